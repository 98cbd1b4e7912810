"""Layers of profile `main`: gsvc_ref and the code of spec.md agree; damage to a layer takes no frame of the base."""

from dataclasses import replace
from io import BytesIO
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings

import gsvc_ref
from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref import spec
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.bitstream.chunks import PREFIX_SIZE
from gsvc_ref.bitstream.coder import MAIN_CATEGORIES
from gsvc_ref.bitstream.header import LEVELS, MAIN, MAX_LAYERS
from gsvc_ref.cli.damage import Gaps
from gsvc_ref.main.codes import NO_FIELD, MainCodes
from gsvc_ref.main.kept_state import MainState
from gsvc_ref.main.layers import Layers
from gsvc_ref.main.motion import field_motion
from gsvc_ref.stream import DecodedFrame, Gap, StreamReader, StreamWriter
from gsvc_ref.testing import OVERVIEW_HEADER, join_chunks, main_streams, overview_frames, split_chunks, write_stream
from gsvc_ref.testing import random_streams as random
from gsvc_ref.testing.choices import SeededChoices
from gsvc_ref.testing.random_main_streams import make_main_frame
from gsvc_tools.listing import list_elements, place_of
from tests.main.material import GROWING, damages, flipped, growing, growing_codes, with_payload

HEADER = SequenceHeader(
    profile=MAIN, level=1, width=32, height=24, parameter_checksum_flag=True, max_lane_exponent=1, layer_count=3
)
SMALL = {"max_frames": 4, "max_count": 20, "max_pixels": 4096}
TYPES = "IPRPRIP"
LAYERS: tuple[dict[int, str], ...] = (
    {1: "I", 2: "I"}, {1: "P", 2: "R"}, {2: "P"}, {1: "P", 2: "I"}, {1: "R"}, {1: "I", 2: "I"}, {1: "P", 2: "P"},
)  # fmt: skip
"""The types of the layers after each frame of `TYPES`."""


def layered(
    types: str = TYPES, layers: tuple[dict[int, str], ...] = LAYERS, header: SequenceHeader = HEADER, count: int = 6
) -> bytes:
    """A stream with layers of these types after frames of these types."""
    choices, state, shown = SeededChoices(3), MainState.initial(header.width, header.height), Layers(header.layer_count)
    codes: list[MainCodes] = []
    of_frames: dict[int, list[tuple[int, MainCodes]]] = {}
    for number, (letter, behind) in enumerate(zip(types, layers, strict=True)):
        made, state = make_main_frame(choices, header, state, types=letter, count=count, kind="any")
        codes.append(made)
        shown = shown.after(made.type, state, behind, made.field, number)
        for layer, layer_type in behind.items():
            before = shown.start_of(layer, header)
            made, after = make_main_frame(choices, header, before, types=layer_type, count=count, kind="any")
            of_frames.setdefault(number, []).append((layer, made))
            shown = shown.with_layer(layer, replace(after, inherited=NO_FIELD))
    return write_stream(header, codes, layers=of_frames)


def both(stream: bytes, layer: int) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    """Counts, parameters and error of the library and of spec.md's code."""
    ours, theirs = gsvc_ref.reconstruct_layers(stream, layer), spec.reconstruct_layers(stream, layer)
    return (
        (ours.counts.tolist(), ours.parameters.tobytes(), ours.error),
        (theirs["counts"].tolist(), theirs["parameters"].tobytes(), theirs["error"]),
    )


def without(data: bytes, *numbers: int) -> bytes:
    """A stream without some of its chunks; chunk 0 is the header."""
    kept = [chunk for number, chunk in enumerate(split_chunks(data)) if number not in numbers]
    return join_chunks(kept, prefix=data[:PREFIX_SIZE])


def chunk_number(data: bytes, frame: int, layer: int) -> int:
    """The number of the chunk of a layer."""
    at = -1
    for number, (kind, payload) in enumerate(split_chunks(data)):
        at += kind in (b"I", b"P", b"R")
        if at == frame and ((kind == b"n" and payload[0] >> 6 == layer) or (kind != b"n" and layer == 0)):
            return number
    raise AssertionError


@pytest.fixture(scope="module")
def data() -> bytes:
    return layered()


@settings(max_examples=15)
@given(main_streams(**SMALL))
def test_the_code_of_the_document_reads_the_same(stream: random.Stream) -> None:
    for layer in range(4):
        ours, theirs = both(stream.data, layer)
        assert ours == theirs
        assert ours[2] == ""
    base = gsvc_ref.reconstruct_stream(stream.data)
    assert gsvc_ref.reconstruct_layers(stream.data, 0).parameters.tobytes() == base.parameters.tobytes()


@settings(max_examples=30)
@given(main_streams(**SMALL))
def test_what_is_written_is_read(stream: random.Stream) -> None:
    with StreamReader(stream.data, layer=None) as reader:
        frames = list(reader)
    for frame in frames:
        written = [(layer, codes) for layer, codes in stream.layers[frame.number]]
        assert [(chunk.layer, chunk.codes) for chunk in frame.chunks] == written
        assert frame.splats.take(np.arange(len(frame.state.splats))) == stream.splats[frame.number]
        for chunk in frame.chunks:
            assert sum(chunk.bits.values()) == 8 * chunk.size
            assert set(chunk.bits) <= set(MAIN_CATEGORIES)
            assert chunk.number == frame.number


def test_qualities(data: bytes) -> None:
    """A frame shows the layers that are there, also those without a chunk."""
    base = gsvc_ref.reconstruct_layers(data, 0).counts
    one, two = (gsvc_ref.reconstruct_layers(data, layer).counts for layer in (1, 2))
    assert (one > base).all()
    assert (two > one).all()
    assert both(data, 3)[0] == both(data, 2)[0]


def test_a_layer_that_the_mask_does_not_name_is_carried() -> None:
    stream = layered("IPRPI", ({1: "I"}, {}, {}, {1: "P"}, {}))
    ours, theirs = both(stream, 1)
    assert (ours, ours[2]) == (theirs, "")
    base = gsvc_ref.reconstruct_layers(stream, 0).counts.tolist()
    assert [a - b for a, b in zip(ours[0], base, strict=True)][:3] == [6, 6, 6]
    assert ours[0][4] == base[4]
    before, moved, repeated = frames_of(stream)[:3]
    field = moved.codes.field
    old, new = before.layers.there[1].values, moved.layers.there[1].values
    assert np.array_equal(new[:, 2:], old[:, 2:])
    assert np.array_equal(new[:, :2], old[:, :2] + field_motion(old, *field))
    assert field.side == 0 or (new[:, :2] != old[:, :2]).any()
    assert repeated.layers.there[1] is moved.layers.there[1]


def test_a_chunk_that_is_missing_is_found() -> None:
    ours, theirs = both(without(layered("IPP", ({1: "I"}, {1: "P"}, {1: "P"})), 4), 1)
    assert ours == theirs
    assert ours[2].split()[:2] == ["invalid", "R-15.13-6"]
    assert len(ours[0]) == 2  # the frame of the layer at fault is there without it


def test_a_frame_is_complete_with_its_last_chunk_that_is_wanted(data: bytes) -> None:
    """R-15.13-5: nothing after that chunk is needed, not even that there is something."""
    for layer in (0, 1, 2):
        for frame in frames_of(data, layer=layer):
            last = frame.chunks[-1] if frame.chunks else frame
            frames = iter(gsvc_ref.open(data[: last.offset + last.size], layer=layer))
            assert [next(frames) for _ in range(frame.number + 1)][-1].splats == frame.splats


@pytest.mark.exhaustive
@pytest.mark.parametrize("checksums", [False, True])
def test_some_damages(checksums: bool) -> None:
    header = SequenceHeader(
        profile=MAIN, level=1, width=20, height=9, max_lane_exponent=1, layer_count=3, parameter_checksum_flag=checksums
    )
    stream = layered("IPR", ({1: "I", 2: "I"}, {1: "P", 2: "R"}, {1: "P"}), header, count=2)
    for what, damaged in damages(stream, 41, first=5 + checksums):
        for layer in (1, 2):
            ours, theirs = both(damaged, layer)
            assert ours == theirs, (what, layer)


def changed(data: bytes, chunk: int, byte: int, value: int) -> bytes:
    return with_payload(data, chunk, lambda p: p[:byte] + bytes([value]) + p[byte + 1 :])


FAULTS = {
    "layer 0": (0, 0, 0x00, "R-3.2-1"),
    "a layer that the mask does not name": (0, 0, 0xC0, "R-15.13-1"),
    "a chunk of the layer above": (0, 0, 0x80, "R-15.13-6"),
    "no such type": (0, 0, 0x70, "R-3.2-1"),
    "P where the layer is not there": (0, 0, 0x50, "R-15.13-2"),
    "another frame": (1, 0, 0x50, "R-15.13-4"),
    "a wrong checksum": (0, 1, 0, "R-6.4-3"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_faults(name: str, data: bytes) -> None:
    number, byte, value, rule = FAULTS[name]
    chunk = chunk_number(data, number, 1)
    damaged = changed(data, chunk, byte, value)
    ours, theirs = both(damaged, 2)
    assert ours == theirs
    assert ours[2].split()[1] == rule
    with pytest.raises(GsvcError) as caught:
        list(gsvc_ref.open(damaged))
    assert caught.value.rule == rule
    for reader in (gsvc_ref.open(damaged, layer=0), StreamReader(damaged)):  # the base has no fault
        assert len(list(reader)) == len(TYPES)


def test_the_level_counts_all_layers() -> None:
    """R-15.13-3: splats that the level allows to one layer are too many for two."""
    header = SequenceHeader(profile=MAIN, level=1, width=32, height=24, layer_count=2)
    most = header.limits.splats
    choices, start = SeededChoices(5), MainState.initial(32, 24)
    frame, state = make_main_frame(choices, header, start, types="I", max_count=9000, count=9000, kind="last")
    assert most < 2 * 9000
    with pytest.raises(UsageError, match=r"the level allows 7384"):
        write_stream(header, [frame], layers={0: [(1, frame)]})
    high = write_stream(SequenceHeader(**{**header.arguments, "level": 2}), [frame], layers={0: [(1, frame)]})
    low = with_payload(high, 0, lambda p: p[:1] + b"\1" + p[2:-2] + b"\x20\x20")
    ours, theirs = both(low, 1)
    assert ours == theirs
    assert ours[2].split()[:2] == ["limit", "R-5-2"]
    assert both(low, 0)[0][2] == ""
    split = with_payload(high, 0, lambda p: p[:-2] + b"\x20\x40")  # the base alone asks for level 1
    assert both(split, 0) == both(low, 0)
    assert both(split, 1)[0][2] == both(split, 1)[1][2] == ""
    wrong = with_payload(high, 0, lambda p: p[:-2] + b"\x20\x20")
    assert both(wrong, 0)[0][2] == both(wrong, 0)[1][2]
    assert both(wrong, 0)[0][2].split()[:2] == ["limit", "R-5-9"]
    assert len(state.values) == 9000


def test_a_frame_beyond_its_operating_point_is_not_salvaged_as_one_that_comes_too_fast() -> None:
    """R-5-9 in the place of R-5-2, in a paced stream: it is noted once, and the frame is skipped."""
    header = SequenceHeader(profile=MAIN, level=2, width=32, height=24, layer_count=2, paced_flag=True)
    start, count = MainState.initial(32, 24), LEVELS[1].splats + 1
    frame, _ = make_main_frame(SeededChoices(5), header, start, types="I", max_count=count, count=count, kind="last")
    low = with_payload(write_stream(header, [frame]), 0, lambda p: p[:-2] + b"\x20\x40")
    (gap,) = StreamReader(low).salvage()
    assert isinstance(gap, Gap)
    assert [fault.rule for fault in gap.faults] == ["R-5-9"]
    assert gap.fault_count == 1


@pytest.mark.parametrize(("name", "checksums"), [("the base grows", False), ("a layer below grows", True)])
def test_the_level_counts_a_layer_that_repeats(name: str, checksums: bool) -> None:
    """R-5-2 of `layer_type` R: the splats that it keeps count beside those of a base or of layers that have grown."""
    stream = growing(name, 1, checksums)
    highest = max(GROWING[name][-1])
    ours, theirs = both(stream, highest)
    assert ours == theirs
    kind, rule, bit = ours[2].split()
    assert (kind, rule) == ("limit", "R-5-2")
    found = place_of(stream, int(bit)).entry
    assert found is not None
    assert found.full_name == "layer_type, chunk n, frame 1"
    assert both(stream, highest - 1)[0][2] == ""
    ours, theirs = both(growing(name, 2, checksums), highest)
    assert (ours, ours[2]) == (theirs, "")
    frames = list(gsvc_ref.open(stream).salvage())
    assert [len(frame.splats) <= 1 << 14 for frame in frames if isinstance(frame, DecodedFrame)] == [True, True]
    assert [frame.lacking for frame in frames if isinstance(frame, DecodedFrame)] == [(), (highest,)]
    assert [fault.rule for gap in frames if isinstance(gap, Gap) for fault in gap.faults] == ["R-5-2"]


@pytest.mark.parametrize("name", GROWING)
def test_a_layer_that_repeats_is_not_written_beyond_the_level(name: str) -> None:
    header = SequenceHeader(profile=MAIN, level=1, width=32, height=24, layer_count=3)
    base, layers = growing_codes(name, header)
    target = BytesIO()
    writer = StreamWriter(target, header)
    writer.write_frame(base[0], layers=dict(layers[0]))
    size = target.tell()
    with pytest.raises(UsageError, match=r"repeated the frame has 1[68]\d+ splats; level 1 allows 16384 .R-5-2"):
        writer.write_frame(base[1], layers=dict(layers[1]))
    assert target.tell() == size
    carried = {layer: codes for layer, codes in layers[1] if codes.type != "R"}
    if not carried:
        with pytest.raises(UsageError, match=r"frame 1 has 1[68]\d+ splats; level 1 allows 16384 .R-5-2"):
            writer.write_frame(base[1])
    low = StreamWriter(BytesIO(), SequenceHeader(**{**header.arguments, "level": 3}), least_level=True)
    for number, frame in enumerate(base):
        low.write_frame(frame, layers=dict(layers[number]))
    low.finish()
    assert low.header.level == 2
    assert low.header.operating_points[-1].level == 2


def test_least_level_is_one_for_all_layers() -> None:
    header = SequenceHeader(profile=MAIN, level=3, width=32, height=24, layer_count=2)
    start = MainState.initial(32, 24)
    frame, _ = make_main_frame(SeededChoices(5), header, start, types="I", max_count=9000, count=9000, kind="last")
    levels = []
    for layers in ({}, {1: frame}):
        target = BytesIO()
        writer = StreamWriter(target, header, least_level=True)
        writer.write_frame(frame, layers=layers)
        writer.finish()
        levels.append((writer.header.level, *writer.header.operating_points))
        assert StreamReader(target.getvalue()).header == writer.header
    assert levels == [(1, (1, 0), (1, 0)), (2, (1, 0), (2, 0))]


def test_layers_are_refused_where_they_cannot_stand() -> None:
    choices, start = SeededChoices(1), MainState.initial(32, 24)
    first, _ = make_main_frame(choices, HEADER, start, types="I", count=2)
    target = BytesIO()
    writer = StreamWriter(target, HEADER)
    size = target.tell()
    with pytest.raises(UsageError, match="must begin with I"):
        writer.write_frame(first, layers={1: MainCodes.repeated_frame()})
    for layers in ({0: first}, {3: first}, {1: first, 4: first}):
        with pytest.raises(UsageError, match=r"they must be 1 to 2 .R-15\.13-1"):
            writer.write_frame(first, layers=layers)
    assert target.tell() == size
    writer.write_frame(first, layers={2: first})


def test_chunks_in_front_of_the_first_frame_and_of_other_profiles_are_skipped(data: bytes) -> None:
    chunks = split_chunks(data)
    early = join_chunks([chunks[0], (b"n", b"\x09"), *chunks[1:]], prefix=data[:PREFIX_SIZE])
    ours, theirs = both(early, 2)
    assert ours == theirs
    assert ours[1] == both(data, 2)[0][1]
    paper = split_chunks(write_stream(OVERVIEW_HEADER, overview_frames()))
    stream = join_chunks([*paper[:2], (b"n", b"\x09"), *paper[2:]], prefix=data[:PREFIX_SIZE])
    ours, theirs = both(stream, 1)
    assert ours == theirs
    assert len(ours[0]) == 3


# --- Streams ---------------------------------------------------------------------------------------------------------


def frames_of(data: bytes, **options: Any) -> list[DecodedFrame]:
    return list(gsvc_ref.open(data, **options))


def test_the_highest_layer_is_the_default(data: bytes) -> None:
    for layer, wanted in ((None, 2), (2, 2), (1, 1), (0, 0)):
        expected = gsvc_ref.reconstruct_layers(data, wanted).counts.tolist()
        assert [len(frame.splats) for frame in frames_of(data, layer=layer)] == expected
        assert gsvc_ref.open(data, layer=layer).layer == wanted
    with pytest.raises(UsageError, match=r"layer 3 was asked for; the stream has layers 0 \(the base\) to 2"):
        gsvc_ref.open(data, layer=3)
    with pytest.raises(UsageError, match="no layer but the base"):
        gsvc_ref.open(layered("I", ({},), SequenceHeader(profile=MAIN, level=1, width=9, height=9)), layer=1)
    with pytest.raises(UsageError, match="it must be 0"):
        gsvc_ref.open(data, layer=-1)


def test_frames_from_anywhere(data: bytes) -> None:
    frames = frames_of(data)
    with gsvc_ref.open(data) as stream:
        for start in range(len(TYPES) + 1):
            for stop in range(start, len(TYPES) + 1):
                assert list(stream.frames(start, stop)) == frames[start:stop]


@pytest.mark.parametrize("layer", [0, 1, 2])
def test_pictures(data: bytes, layer: int) -> None:
    """Of each frame only what changed is rendered; the pictures are those of all of its splats."""
    frames = list(gsvc_ref.decode(data, layer=layer))
    splats = [frame.splats for frame in frames_of(data, layer=layer)]
    for picture, wanted in zip(frames, splats, strict=True):
        assert np.array_equal(picture, gsvc_ref.render_frame(wanted, 32, 24, 8))
    assert np.array_equal(frames[3:6], list(gsvc_ref.decode(data, start=3, stop=6, layer=layer)))
    assert np.array_equal(gsvc_ref.decode_stream(data), list(gsvc_ref.decode(data, layer=0)))


def test_origins_tell_which_splat_goes_on(data: bytes) -> None:
    """A splat with an origin that was not changed is the one of the frame before."""
    frames = frames_of(data)
    for before, frame in pairwise(frames):
        if frame.repeats(before):
            assert frame.splats == before.splats
            continue
        origins = frame.origins(before)
        if frame.type == "I":
            assert origins is None
            continue
        assert origins is not None
        assert len(origins) == len(frame.splats)
        assert origins.max() < len(before.splats)
        assert len(set(origins[origins >= 0].tolist())) == np.count_nonzero(origins >= 0)
        base = frame.codes.origins if frame.type == "P" else np.arange(len(frame.state.splats))
        assert np.array_equal(origins[: len(base)], base)


class Pipe:
    """A source that can be read once, and tells how much of it was."""

    def __init__(self, data: bytes) -> None:
        self._file, self.taken = BytesIO(data), 0

    def seekable(self) -> bool:
        return False

    def read(self, size: int) -> bytes:
        data = self._file.read(size)
        self.taken += len(data)
        return data


def test_a_pipe_gives_a_frame_as_soon_as_its_layers_are_there(data: bytes) -> None:
    """Nothing is read beyond them."""
    expected = frames_of(data)
    pipe = Pipe(data)
    frames = iter(gsvc_ref.open(pipe))
    for number, frame in enumerate(frames):
        assert frame == expected[number]
        last = frame.chunks[-1]
        assert pipe.taken <= last.offset + last.size
    assert number == len(TYPES) - 1


def test_a_stream_that_grows_gives_what_is_complete(data: bytes) -> None:
    """A file that ends inside a layer has the frame without that layer."""
    end = 0
    for number, frame in enumerate(frames_of(data)):
        for chunk in frame.chunks:
            for cut in (chunk.offset, chunk.offset + chunk.size // 2):
                got = []
                with pytest.raises(GsvcError, match=r"R-6\.2-4"):
                    got.extend(gsvc_ref.open(data[:cut]))
                assert len(got) == number + 1
                assert [c.layer for c in got[-1].chunks] == [c.layer for c in frame.chunks if c.offset < chunk.offset]
            end = chunk.offset + chunk.size
    assert end < len(data)


def test_every_bit_is_accounted_for(data: bytes) -> None:
    for layer in (0, 1, 2):
        summary = gsvc_ref.open(data, layer=layer).info()
        assert summary.error is None
        assert sum(summary.bits.values()) == 8 * len(data)
        of_layers = [one.layer for frame in summary.frames for one in frame.layers]
        assert sorted({*of_layers}) == list(range(1, layer + 1))
        assert (summary.bits["ancillary"] > 0) == (layer < 2)
    chunks = sum(frame.size + sum(one.size for one in frame.layers) for frame in summary.frames)
    assert chunks < len(data)
    assert [frame.splats for frame in summary.frames] == gsvc_ref.reconstruct_layers(data, 0).counts.tolist()


def test_every_element_is_listed(data: bytes) -> None:
    entries: list[Any] = []
    assert list_elements(data, entries.append) == (None, None)
    end = 0
    for entry in entries:
        assert entry.bit == end, entry.full_name
        end += entry.bits
    assert end == 8 * len(data)
    names = [entry.full_name for entry in entries]
    assert names.count("layer, chunk n, frame 0") == 2
    assert "layer_type, chunk n, frame 1" in names
    assert "frame_low, chunk n, frame 1" in names
    assert names.count("quality_level, chunk H") == 3
    assert "layer_mask, frame 1" in names
    assert {entry.frame for entry in entries if entry.chunk == "n"} == set(range(len(TYPES)))
    found = next(entry for entry in entries if entry.name == "layer_type" and entry.frame == 3)
    assert place_of(data, found.bit).entry.full_name == "layer_type, chunk n, frame 3"
    some: list[Any] = []
    list_elements(data, some.append, 1, 2)
    assert [entry.bit for entry in some] == [entry.bit for entry in entries if entry.frame == 1]


# --- Salvage ---------------------------------------------------------------------------------------------------------


def torn(data: bytes, chunk: int) -> bytes:
    """A stream with a byte of a chunk's payload changed, whose checksum then is wrong."""
    before = without(data, *range(chunk, len(split_chunks(data))))
    changed = bytearray(data)
    changed[len(before) + 6] ^= 255
    return bytes(changed)


@pytest.mark.parametrize("damage", [torn, lambda data, chunk: with_payload(data, chunk, flipped(16)), without])
def test_damage_to_a_layer_loses_no_frame_of_the_base(data: bytes, damage: Any) -> None:
    """Whatever is wrong with a layer, the base is there; and each layer that is shown is the right one."""
    whole = frames_of(data)
    for number, frame in enumerate(whole):
        for chunk in frame.chunks:
            damaged = damage(data, chunk_number(data, number, chunk.layer))
            parts = list(gsvc_ref.open(damaged).salvage())
            frames = [part for part in parts if isinstance(part, DecodedFrame)]
            assert [part.codes for part in frames] == [part.codes for part in whole]
            assert [part.state.splats for part in frames] == [part.state.splats for part in whole]
            for part, intact in zip(frames, whole, strict=True):
                assert all(one.splats in [other.splats for other in intact.chunks] for one in part.chunks)
            assert frames[:number] == whole[:number]
            if number < 5:  # behind an I-frame layers begin anew
                assert [part.splats for part in frames[5:]] == [part.splats for part in whole[5:]]
            summary = gsvc_ref.open(damaged).info(salvage=True)
            assert sum(summary.bits.values()) == 8 * len(damaged)


def test_the_layer_that_is_lost_is_named(data: bytes) -> None:
    """Of damage to a chunk of layer 1 nothing but layer 1 is gone, up to its next I."""
    whole = frames_of(data)
    for damage in (torn, without):
        damaged = damage(data, chunk_number(data, 1, 1))
        frames = [part for part in gsvc_ref.open(damaged).salvage() if isinstance(part, DecodedFrame)]
        assert [frame.lacking for frame in frames] == [(), *[(1,)] * 4, (), ()]
        assert [list(frame.layers.there) for frame in frames] == [[1, 2], *[[2]] * 4, [1, 2], [1, 2]]
        for part, intact in zip(frames, whole, strict=True):
            assert part.layers.there[2].splats == intact.layers.there[2].splats
        assert [frame.lacking for frame in gsvc_ref.open(damaged).info(salvage=True).frames] == [
            f.lacking for f in frames
        ]
        gaps = Gaps()
        list(gsvc_ref.decode(damaged, on_gap=gaps, on_incomplete=gaps.incomplete))
        assert len(gaps.found) == 1
        assert gaps.lines()[-1] == "layer 1 is missing from frames 1 to 4"


def test_layers_of_a_lost_frame_are_not_given_to_the_one_before(data: bytes) -> None:
    damaged = torn(data, chunk_number(data, 3, 0))
    frames = [part for part in gsvc_ref.open(damaged).salvage() if isinstance(part, DecodedFrame)]
    whole = frames_of(data)
    assert frames == [*whole[:3], *whole[5:]]


def test_one_gap_for_a_layer_that_is_damaged_and_missed(data: bytes) -> None:
    """P-frames of a layer after damage do not count as further faults."""
    stream = layered("IPPPP", ({1: "I"}, {1: "P"}, {1: "P"}, {1: "P"}, {1: "I"}))
    damaged = torn(stream, chunk_number(stream, 1, 1))
    parts = list(gsvc_ref.open(damaged).salvage())
    gaps = [part for part in parts if isinstance(part, Gap)]
    assert len(gaps) == 1
    assert gaps[0].missing_count == 0
    assert "no frame is missing, but the checksum of a chunk n is wrong" in str(gaps[0])
    frames = [part for part in parts if isinstance(part, DecodedFrame)]
    assert [len(frame.chunks) for frame in frames] == [1, 0, 0, 0, 1]


def test_what_is_lost_is_known_until_the_layer_begins_anew() -> None:
    state = MainState.initial(8, 8)
    layers = Layers(2).after("I", state, (1, 2))
    assert (layers.due, layers.lacking) == ((1, 2), (1, 2))
    layers = layers.with_layer(1, state).with_layer(2, state).after("R", state, (1, 2), number=1)
    assert list(layers.there) == []
    assert layers.missing(2)
    cut = layers.with_layer(1, state).interrupted()
    assert (list(cut.there), cut.due, cut.lacking, cut.missing(MAX_LAYERS)) == ([1], (2,), (2,), None)
    following = cut.after("P", state)
    assert (list(following.there), following.lost, following.lacking) == ([1], {2}, (2,))
    named = cut.after("P", state, (2,))
    assert (named.due, named.missing(MAX_LAYERS)) == ((2,), None)
    assert named.passed(2).lost == {2}
    assert named.with_layer(2, state).lost == set()
    assert cut.after("I", state).lost == set()
