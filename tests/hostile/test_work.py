"""Time without a clock: what the renderer and the reader do is counted, and bounded by the level and the bytes.

A splat whose box has c columns and r rows adds c r to the rendering work (5-1). It touches at most (c + 30) / 16
tiles, and never more than c. In each, at most r rows are added, in groups of three and of 16 pixels each: 16 (r + 2)
pixels. So it takes at most min(16 c, c + 30) (r + 2) pixels, which is at most 16 c r + 64. Regions of 64 rows break up
groups: that makes it 17 c r + 128.
"""

import io
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gsvc_base.arrays import I8, U2
from gsvc_base.errors import GsvcError
from gsvc_base.splats import Splats
from gsvc_ref.bitstream import LEVELS, SequenceHeader
from gsvc_ref.bitstream.crc import parameter_checksum
from gsvc_ref.bitstream.rans import decode_kernel
from gsvc_ref.bitstream.work import rendering_work
from gsvc_ref.main import kept_state as main_state
from gsvc_ref.main.codes import MainCodes
from gsvc_ref.paper import FrameCodes
from gsvc_ref.rendering import SequenceRenderer
from gsvc_ref.rendering.fast.binning import Binning, windows_of
from gsvc_ref.rendering.fast.projection import row_range
from gsvc_ref.rendering.fast.tiles import GROUP_ROWS, TILE_WIDTH
from gsvc_ref.stream import StreamReader, chunk_decoder, decode, profiles
from gsvc_ref.testing import OVERVIEW_HEADER, overview_frames, splat_sets, write_stream
from tests.hostile.hostile_streams import (
    CHOLESKY_BITS,
    STAGES,
    chunk,
    encode_uv,
    end,
    half,
    header,
    intra,
    main_frames,
    main_header,
    opening,
    predicted,
    repeated,
)

PIXELS_PER_WORK = 16
PIXELS_PER_SPLAT = 64


def pixels_added(splats: Splats, width: int, height: int) -> tuple[int, int]:
    """The (splat, pixel) pairs that the inner loops of the renderer handle, and the intersections of all tiles."""
    binning = Binning(width, height, threads=1)
    binning.load_splats(splats)
    pixels = 0
    for splat, tiles in zip(binning.bins.projected, binning.bins.tile_ranges, strict=True):
        for t in range(*tiles):
            top, below = row_range(splat, t, height)
            pixels += -(-(below - top) // GROUP_ROWS) * GROUP_ROWS * TILE_WIDTH
    return pixels, binning.intersection_count


def check(splats: Splats, width: int, height: int) -> None:
    work = rendering_work(splats, width, height)
    pixels, intersections = pixels_added(splats, width, height)
    assert pixels <= PIXELS_PER_WORK * work + PIXELS_PER_SPLAT * len(splats)
    assert intersections <= work / TILE_WIDTH + 2 * len(splats)


def equal(x: float, y: float, l11: float, l21: float, l22: float) -> Splats:
    return Splats.from_array([[x, y, l11, l21, l22, 1, 1, 1]])


@pytest.mark.parametrize("x", [0.5, 15.5, 16.0, 16.5, 100.0])
@pytest.mark.parametrize("l11", [1e-30, 0.1, 0.16, 0.3, 1, 5, 1e4])
@pytest.mark.parametrize(("l21", "l22"), [(0, 0.1), (0, 1), (0, 1e4), (1e4, 0.001), (-30, 0.5), (3, 1e-30)])
def test_hard_splats(x: float, l11: float, l21: float, l22: float) -> None:
    """One column of all rows, one row of all columns, needles at 45 degrees, everything, next to nothing."""
    for y in (0.5, 1.0, 64.0):
        check(equal(x, y, l11, l21, l22), 200, 130)


@pytest.mark.parametrize("share", [1 - 2.0**-17, 1 - 2.0**-18, 1 - 2.0**-19, 1 - 2.0**-20, 1.0])
@pytest.mark.parametrize("distance", [2.0**17, 2.0**22, 2.0**31, 1e30])
def test_far_and_large(distance: float, share: float) -> None:
    """Splats whose support ends just before the frame, if it is not rounded."""
    radius = 3.3290429691304455
    for far in (-distance, distance):
        check(equal(far, 50, distance * share / radius, 0, 1e6), 200, 130)
        check(equal(50, far, 1e6, 0, distance * share / radius), 200, 130)
        check(equal(50, far, 1e6, distance * share / radius, 1), 200, 130)


def test_the_bound_is_not_idle() -> None:
    """A column of one pixel takes 16 times its work; one pixel takes 48 times its work."""
    work = rendering_work(equal(8.5, 500, 0.1, 0, 1e4), 16, 1000)
    pixels, _ = pixels_added(equal(8.5, 500, 0.1, 0, 1e4), 16, 1000)
    assert pixels >= 0.99 * PIXELS_PER_WORK * work
    assert pixels_added(equal(8.5, 8.5, 0.1, 0, 0.1), 16, 16)[0] == 48


@given(splat_sets(70, 50, hard=True, max_count=20))
@settings(max_examples=60)
def test_any_splats(splats: Splats) -> None:
    check(splats, 70, 50)


@given(st.lists(st.integers(0, 40), min_size=1, max_size=60), st.integers(1, 60))
def test_windows_are_few(counts: list[int], most: int) -> None:
    """A window costs a pass over the splats: two neighbours have more than `most` intersections, so they are few."""
    offsets = np.concatenate([[0], np.cumsum(counts)])
    windows = windows_of(offsets, most)
    assert [first for first, _ in windows] == [0, *(end for _, end in windows[:-1])]
    assert windows[-1][1] == len(counts)
    assert len(windows) <= 2 * offsets[-1] / most + 1
    for first, end_ in windows:
        assert offsets[end_] - offsets[first] <= most or end_ == first + 1


class Counting(io.BytesIO):
    """A file that counts what is read of it."""

    def __init__(self, data: bytes) -> None:
        super().__init__(data)
        self.reads = self.bytes = 0

    def read(self, size: int | None = -1) -> bytes:
        data = super().read(size)
        self.reads += 1
        self.bytes += len(data)
        return data


CHUNKS = 3000
CHUNK_TYPES = {"ancillary": chunk("z"), "index": chunk("x", b"\0"), "frames": b""}


def many_chunks(kind: str) -> bytes:
    """A stream of many chunks of the fewest bytes after an I-frame, and another I-frame after them."""
    if kind == "frames":
        parts, count = [repeated(number) for number in range(1, CHUNKS + 1)], CHUNKS
    else:
        parts, count = [CHUNK_TYPES[kind]] * CHUNKS, 0
    return b"".join([opening(header(1, 16, 16)), intra(0, 0), *parts, intra(count + 1, 0), end(count + 2)])


@pytest.mark.parametrize("kind", CHUNK_TYPES)
def test_reading_is_linear(kind: str) -> None:
    """Every byte is read once to decode, and once more at most to find a frame; a chunk takes a few reads."""
    data = many_chunks(kind)
    file = Counting(data)
    frames = sum(1 for _ in StreamReader(file))
    assert file.bytes == len(data)
    assert file.reads <= 7 * CHUNKS + 50
    file.reads = file.bytes = 0
    file.seek(0)
    assert [frame.number for frame in StreamReader(file).frames(frames - 1)] == [frames - 1]
    assert file.bytes <= 2 * len(data)
    assert file.reads <= 14 * CHUNKS + 100


def test_an_index_is_read_once() -> None:
    """Of a million entries, block after block: every piece of work is a fixed part of them."""
    steps = 1 << 20
    last = chunk("x", encode_uv(steps), b"\1\1" * steps)
    data = b"".join([opening(header(3, 16, 16)), intra(0, 0), chunk("z", bytes(steps)), last, end(1, len(last))])
    file = Counting(data)
    assert len(list(StreamReader(file))) == 1
    assert file.bytes == len(data)
    assert file.reads <= 40


def test_splats_off_the_screen_are_no_pixels() -> None:
    """60 bytes stand for as many splats as a level allows; they are decoded, and not one is listed for a tile."""
    for level in (1, 2):
        count = LEVELS[level].splats
        options: dict[str, Any] = {"long": False, "stages": 1, "codewords": 1}
        aside = intra(0, count, at=(half(1), half(1)), **options)
        moved = predicted(1, count, **options)
        assert len(moved) < 60
        frames = list(StreamReader(b"".join([opening(header(level, 16, 16)), aside, moved, end(2)])))
        assert [len(frame.splats) for frame in frames] == [count, count]
        assert rendering_work(frames[1].splats, 16, 16) == 0
        assert pixels_added(frames[1].splats, 16, 16) == (0, 0)


def repeating(head: SequenceHeader, frames: int) -> bytes:
    """A base and three layers that stay as they are: by R-frames, chunks `n` of 8 bytes, and P-frames of no splat."""
    still, repeat = main_frames(head, 5, 0)[0], MainCodes.repeated_frame()
    nothing = MainCodes(type="P")
    of_each = {number: [(layer, repeat) for layer in (1, 2, 3)] for number in range(1, frames + 1)}
    bases = [MainCodes(type="I"), *[(repeat, nothing)[number % 2] for number in range(frames)]]
    return write_stream(head, bases, index=False, layers={0: [(layer, still) for layer in (1, 2, 3)], **of_each})


def calls_of(monkeypatch: pytest.MonkeyPatch, owner: object, name: str) -> list[Any]:
    """The first arguments of all calls of a function from now on."""
    real, calls = getattr(owner, name), []

    def counted(first: Any, *others: Any, **named: Any) -> Any:
        calls.append(first)
        return real(first, *others, **named)

    monkeypatch.setattr(owner, name, counted)
    return calls


@pytest.mark.parametrize("checksums", [False, True])
def test_layers_that_repeat_cost_nothing(monkeypatch: pytest.MonkeyPatch, checksums: bool) -> None:
    """A chunk of 8 bytes may stand for as many splats as a level allows: nothing that it repeats is looked at again."""
    data = repeating(replace(main_header(1, 16, 16), parameter_checksum_flag=checksums), 20)
    work = calls_of(monkeypatch, main_state, "work_of")
    checksum = calls_of(monkeypatch, main_state, "parameter_checksum")
    joined = calls_of(monkeypatch, Splats, "joined")
    rendered = calls_of(monkeypatch, SequenceRenderer, "next_frame")
    counts = [len(frame.chunks) for frame in StreamReader(data, layer=None)]
    assert counts == [3] * 21
    assert sum(len(splats) for splats in work) == 15
    assert sum(len(splats) for splats in checksum) == 15 * checksums
    assert not joined
    pictures = list(decode(data, threads=1))
    assert len(pictures) == 21
    assert len(rendered) == len(joined) == 1


def test_layers_that_are_carried_and_rest_cost_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Behind R-frames, and P-frames without a field, a layer without a chunk is the same state, known already."""
    head = main_header(1, 16, 16)
    still, nothing = main_frames(head, 5, 0)[0], MainCodes(type="P")
    bases = [MainCodes(type="I"), *[(MainCodes.repeated_frame(), nothing)[number % 2] for number in range(20)]]
    data = write_stream(head, bases, index=False, layers={0: [(layer, still) for layer in (1, 2, 3)]})
    work = calls_of(monkeypatch, main_state, "work_of")
    frames = list(StreamReader(data, layer=None))
    assert [len(frame.splats) for frame in frames] == [15] * 21
    assert len({id(state) for frame in frames for state in frame.parts}) == 3
    assert sum(len(splats) for splats in work) == 15


def test_a_layer_that_changes_costs_the_others_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    head = main_header(1, 16, 16)
    five, one = main_frames(head, 5, 0)[0], main_frames(head, 1, 1)
    of_each = {number: [(2, one[1])] for number in range(1, 21)}
    frames = [five, *[MainCodes.repeated_frame()] * 20]
    data = write_stream(head, frames, index=False, layers={0: [(1, five), (2, one[0]), (3, five)], **of_each})
    work = calls_of(monkeypatch, main_state, "work_of")
    assert [len(frame.splats) for frame in StreamReader(data, layer=None)] == [16] * 21
    assert [len(splats) for splats in work] == [5, 5, 1, 5, *[1] * 20]


def test_a_repeated_frame_of_profile_paper_is_not_checked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    head = replace(header(1, 16, 16), parameter_checksum_flag=True)
    checksum = parameter_checksum(Splats.empty()).to_bytes(4, "little")
    parts = [chunk("I", encode_uv(0), checksum, encode_uv(0))]
    parts += [chunk("R", encode_uv(number), checksum) for number in range(1, 21)]
    calls = calls_of(monkeypatch, chunk_decoder, "parameter_checksum")
    work = calls_of(monkeypatch, profiles, "rendering_work")
    assert len(list(StreamReader(b"".join([opening(head), *parts, end(21)])))) == 21
    assert len(calls) == len(work) == 1
    wrong = chunk("R", encode_uv(21), b"\1" * 4)
    with pytest.raises(GsvcError, match=r"R-6\.4-3"):
        list(StreamReader(b"".join([opening(head), *parts, wrong, end(22)])))


def test_a_repeated_frame_is_written_without_its_work(monkeypatch: pytest.MonkeyPatch) -> None:
    still, work = FrameCodes.repeated_frame(), calls_of(monkeypatch, profiles, "rendering_work")
    write_stream(replace(OVERVIEW_HEADER, paced_flag=True), [overview_frames()[0], *[still] * 20])
    assert len(work) == 1


def coded(symbol: int, width: int) -> bytes:
    """A coded plane of one symbol of `width` bits, with a table of 2^16 slots; the lane needs no word."""
    first = min(symbol, (1 << width) - 2)
    bits = "10" + f"{1:05b}" + f"{0:04b}" + f"{first:0{width}b}" + f"{first + 1:0{width}b}" + "010" * 2
    table = int(bits.ljust(-(-len(bits) // 8) * 8, "0"), 2).to_bytes(-(-len(bits) // 8), "big")
    state = (2 << 16) + ((symbol - first) << 15)
    return table + encode_uv(0) + state.to_bytes(4, "little")


def test_tables_of_a_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    """A dozen bytes make a table of 2^16 slots: a P-frame has at most 31 of them, one after the other."""
    slots: list[int] = []

    def counted(frequencies: I8, first: int, precision: int, states: I8, words: U2, symbols: U2) -> int:
        slots.append(1 << precision)
        return decode_kernel(frequencies, first, precision, states, words, symbols)

    monkeypatch.setattr("gsvc_ref.bitstream.planes.decode_kernel", counted)
    positions = [coded(0, 8)] * 4
    numbers = np.array([1, 0.01], "<f4").tobytes()
    codebooks = bytes([STAGES]) + ((2).to_bytes(2, "little") + bytes(12)) * STAGES
    full = b"".join([b"\xf8", *positions, *[numbers + coded(0, CHOLESKY_BITS)] * 3, codebooks, *[coded(0, 1)] * STAGES])
    frame = chunk("P", encode_uv(1), encode_uv(1), coded(1, 1), full, full)
    head = replace(header(1, 16, 16), entropy_precision=16, lane_count=1)
    data = b"".join([opening(head), intra(0, 1, long=False), frame, end(2)])
    assert [len(decoded.splats) for decoded in StreamReader(data)] == [1, 2]
    assert slots == [1 << 16] * 31
    assert max(len(coded(0, width)) for width in (1, 8, CHOLESKY_BITS)) == 11
