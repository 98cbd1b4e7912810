"""The decoder inside spec.md against gsvc_ref: a second implementation sees what a round trip cannot.

Writer and reader of gsvc_ref share one description of the syntax, so a misreading of the spec would go unnoticed
between them. This decoder shares nothing with them.
"""

from dataclasses import asdict
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gsvc_base.errors import GsvcError
from gsvc_base.splats import Splats
from gsvc_conformance import reference
from gsvc_conformance.cases.faulty import faults
from gsvc_conformance.spec import namespace
from gsvc_ref.bitstream import LEVELS
from gsvc_ref.rendering import render_exact_with_bound
from gsvc_ref.rendering.deterministic import sum_plain
from gsvc_ref.stream import StreamReader
from gsvc_ref.testing import (
    OVERVIEW_HEADER,
    RICH_HEADER,
    Plane,
    Stream,
    join_chunks,
    overview_frames,
    planes,
    rich_frames,
    splat_sets,
    split_chunks,
    streams,
    write_stream,
)

Values = dict[str, Any]
PREFIX = 10
"""Bytes of magic and version."""


def spec(operation: str, **inputs: Any) -> Values:
    outputs: Values = namespace()[operation](**inputs)
    return outputs


def assert_same(actual: Values, expected: Values) -> None:
    assert actual.keys() == expected.keys()
    for name, value in expected.items():
        if isinstance(value, str):
            assert actual[name] == value
            continue
        mine, theirs = actual[name], np.asarray(value)
        assert isinstance(mine, np.ndarray)
        assert (mine.dtype, mine.shape) == (theirs.dtype, theirs.shape), name
        assert mine.tobytes() == theirs.tobytes(), name


def outcome(data: bytes) -> Values:
    """gsvc_ref's reading of a stream: the splats of all complete frames, and the error in full."""
    frames, error = [], ""
    try:
        frames.extend(frame.splats.to_array() for frame in StreamReader(data))
    except GsvcError as fault:
        error = f"{fault.kind} {fault.rule} {fault.bit}"
    counts = np.array([len(parameters) for parameters in frames], np.int64)
    return {"counts": counts, "parameters": np.concatenate([np.zeros((0, 8), np.float32), *frames]), "error": error}


@given(streams(max_frames=4, max_count=60))
@settings(max_examples=30)
def test_streams(stream: Stream) -> None:
    decoded = spec("reconstruct_stream", stream=stream.data)
    assert decoded["error"] == ""
    expected = [splats.to_array() for splats in stream.splats]
    assert decoded["counts"].tolist() == [len(parameters) for parameters in expected]
    assert decoded["parameters"].tobytes() == np.concatenate(expected).tobytes()
    assert_same(spec("read_stream", stream=stream.data), reference.read_stream(stream=stream.data))


@given(streams(max_frames=3, max_count=20, max_pixels=1500))
@settings(max_examples=25)
def test_deterministic_frames(stream: Stream) -> None:
    decoded = spec("decode_stream_deterministic", stream=stream.data)
    assert_same(decoded, reference.decode_stream_deterministic(stream=stream.data))


@pytest.mark.parametrize("fault", faults(), ids=lambda fault: fault.slug)
def test_rule_violations(fault: Any) -> None:
    data = fault.make()
    decoded = spec("reconstruct_stream", stream=data)
    assert decoded["error"].split()[:2] == [fault.kind, fault.rule]
    assert_same(decoded, outcome(data))


@st.composite
def damaged(draw: st.DrawFn) -> bytes:
    """A stream with bytes changed, inserted or removed in one payload, and checksums that are right again."""
    count = draw(st.integers(4, 20))
    stream = draw(
        st.sampled_from(
            [
                write_stream(OVERVIEW_HEADER, overview_frames()),
                write_stream(RICH_HEADER, rich_frames(count)),
                write_stream(OVERVIEW_HEADER, overview_frames(), index=False),
            ]
        )
        | streams(max_frames=3, max_count=12, max_pixels=1000).map(lambda drawn: drawn.data)
    )
    chunks = split_chunks(stream)
    number = draw(st.integers(0, len(chunks) - 1))
    payload = bytearray(chunks[number][1])
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, max(0, len(payload) - 1)))
        kept = draw(st.sampled_from((0, 1)))
        payload[at : at + 1 - kept] = draw(st.binary(max_size=1))
    chunks[number] = chunks[number][0], bytes(payload)
    return join_chunks(chunks, prefix=stream[:PREFIX])


@given(damaged())
@settings(max_examples=60)
def test_damaged_streams_break_the_same_rule_at_the_same_bit(data: bytes) -> None:
    assert_same(spec("reconstruct_stream", stream=data), outcome(data))


@given(streams(max_frames=3, max_count=9, max_pixels=500), st.data())
@settings(max_examples=30)
def test_cut_streams(stream: Stream, data: st.DataObject) -> None:
    cut = stream.data[: data.draw(st.integers(0, len(stream.data)))]
    assert_same(spec("reconstruct_stream", stream=cut), outcome(cut))


@given(splat_sets(40, 30, hard=True, max_count=30))
@settings(max_examples=50)
def test_rendering(splats: Splats) -> None:
    given = {"parameters": splats.to_array(), "width": 40, "height": 30}
    assert spec("render_sum_deterministic", **given)["sum"].tobytes() == sum_plain(splats, 40, 30).tobytes()
    assert_same(spec("rendering_work", **given), reference.rendering_work(**given))
    C, bound = render_exact_with_bound(splats, 40, 30)
    drawn = spec("render_sum", **given)["sum"]
    moderate = abs(C) < 1e38
    assert (abs(drawn - C) <= bound)[moderate].all()


@given(planes(max_count=300))
@settings(max_examples=50)
def test_planes(plane: Plane) -> None:
    """What an encoder of section 7 writes with any table, the decoder reads."""
    counts = np.bincount(plane.symbols, minlength=plane.alphabet) + 1
    frequencies = counts * 2**14 // counts.sum()
    frequencies[0] += 2**14 - frequencies.sum()
    for lanes in (1, 3, 64):
        coder = {"frequencies": frequencies, "entropy_precision": 14, "lane_count": lanes}
        coded = spec("encode_plane", symbols=plane.symbols, **coder)
        assert_same(coded, reference.encode_plane(symbols=plane.symbols, **coder))
        words, states = coded["words"].tolist(), coded["lane_states"].tolist()
        decode = namespace()["decode_symbols"]
        symbols, taken = decode(len(plane.symbols), frequencies.tolist(), 14, states, words, 0)
        assert (symbols.tolist(), taken, set(states)) == (plane.symbols.tolist(), len(words), {2**16})


def test_halves() -> None:
    bits = np.arange(1 << 16, dtype=np.uint16)
    bits = bits[~np.isnan(bits.view(np.float16))]
    values = spec("from_half", bits=bits)["values"]
    assert values.tobytes() == bits.view(np.float16).astype(np.float32).tobytes()
    finite = np.unique(values[np.isfinite(values)].astype(np.float64))
    between = ((finite[1:] + finite[:-1]) / 2).astype(np.float32)  # ties, exact in binary32
    near = [np.nextafter(between, np.float32(side)) for side in (-np.inf, np.inf)]
    given = np.concatenate([values[np.isfinite(values)], between, *near])
    assert spec("to_half", values=given)["bits"].tobytes() == given.astype(np.float16).view(np.uint16).tobytes()


def test_levels() -> None:
    assert namespace()["LEVELS"] == {number: asdict(level) for number, level in LEVELS.items()}
