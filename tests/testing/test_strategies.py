"""The public strategies keep their promises and reach every corner of the syntax."""

import subprocess
import sys
from collections import Counter

import numpy as np
import pytest
from hypothesis import Phase, find, given, settings
from hypothesis import strategies as st

from gsvc_base.splats import Splats
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.paper import State, reconstruct
from gsvc_ref.stream import StreamReader
from gsvc_ref.testing import Plane, Stream, frames, headers, planes, random_stream, splat_sets, streams, videos


@given(splat_sets(30, 20, min_count=2, max_count=9))
def test_splat_sets(splats: Splats) -> None:
    assert 2 <= len(splats) <= 9
    assert (splats.cholesky[:, [0, 2]] > 0).all()


def test_hard_splat_sets_have_degenerate_and_huge_ones() -> None:
    only = settings(phases=[Phase.generate])
    hard = splat_sets(hard=True)
    find(hard, lambda splats: bool((np.abs(splats.cholesky[:, [0, 2]]) < 2.0**-126).any()), settings=only)
    find(hard, lambda splats: bool((np.abs(splats.positions) > 1e30).any()), settings=only)


@pytest.mark.exhaustive
@given(splat_sets(min_count=70, max_count=400))
def test_large_splat_sets_keep_their_limits(splats: Splats) -> None:
    assert 70 <= len(splats) <= 400


@given(planes())
def test_planes(plane: Plane) -> None:
    assert len(plane.symbols) >= 1
    assert plane.symbols.dtype == np.uint16
    assert plane.symbols.max() < plane.alphabet


@given(videos())
def test_videos(video: tuple[list[np.ndarray], int]) -> None:
    sequence, bit_depth = video
    assert len({frame.shape for frame in sequence}) == 1
    for frame in sequence:
        assert frame.ndim == 3
        assert frame.shape[2] == 3
        assert frame.dtype == (np.uint8 if bit_depth == 8 else np.uint16)
        assert frame.max() < 2**bit_depth


@given(headers(), st.data())
@settings(max_examples=30)
def test_frames_fit_their_state(header: SequenceHeader, data: st.DataObject) -> None:
    state = State.initial(header.width, header.height)
    for types in ("I", "P", "R", "IPR"):
        codes = data.draw(frames(header, state, types=types, max_count=6))
        assert codes.type in types
        state = reconstruct(codes, state)
        assert len(state.splats) == codes.survivor_count + codes.intra_count or codes.type == "R"


@pytest.mark.exhaustive
def test_streams_reach_every_corner_of_the_syntax() -> None:
    """In 300 examples: every frame type, plane mode, flag and chunk."""
    seen: Counter[str] = Counter()

    @settings(max_examples=300, database=None, derandomize=True)
    @given(streams(max_frames=4, max_count=90))
    def look(stream: Stream) -> None:
        def note(element: object) -> None:
            name = element.name.split(".")[-1]  # type: ignore[attr-defined]
            seen[name] += 1
            if name == "plane_mode" or name.endswith("_present"):
                seen[f"{name} = {element.value}"] += 1  # type: ignore[attr-defined]

        reader = StreamReader(stream.data, trace=note)
        for frame in reader:
            seen[f"type {frame.type}"] += 1
            seen["several lanes"] += reader.header.lane_count > 1
            seen["frame count"] += reader.header.frame_count > 0

    look()
    flags = ("positions", "cholesky", "quantizer", "colors", "codebooks")
    wanted = [f"{flag}_present = {value}" for flag in flags for value in (0, 1)]
    wanted += [f"plane_mode = {mode}" for mode in (0, 1, 2)] + [f"type {letter}" for letter in "IPR"]
    wanted += ["several lanes", "frame count", "entry_count", "parameter_checksum", "payload", "unknown", "word"]
    assert [what for what in wanted if not seen[what]] == []


def test_random_streams_depend_on_their_seed_only() -> None:
    assert random_stream(3).data == random_stream(3).data
    assert random_stream(3).data != random_stream(4).data


def test_random_streams_need_no_hypothesis() -> None:
    code = """
import sys
sys.modules["hypothesis"] = None  # an import of it fails
import gsvc_ref.testing
print(len(gsvc_ref.testing.random_stream(0).data) > 0)
try:
    gsvc_ref.testing.streams
except ImportError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "True\nstreams needs Hypothesis: pip install 'gsvc_ref[testing]'\n"
