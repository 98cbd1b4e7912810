"""Finding whole chunks: the same as the definition finds, with windows of any size, at a cost that hostile bytes
cannot raise."""

import io

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from salvage_checks import salvage

from gsvc_base.errors import GsvcError
from gsvc_ref.bitstream import crc32c
from gsvc_ref.bitstream.bit_reader import Reader
from gsvc_ref.bitstream.chunks import chunk
from gsvc_ref.bitstream.coder import encode_uv
from gsvc_ref.stream import StreamReader
from gsvc_ref.stream.source import READ_AT_ONCE, Source
from gsvc_ref.stream.whole_chunks import WholeChunks
from gsvc_ref.testing import RICH_HEADER, rich_frames, write_stream

LONGEST = 300


def whole(kind: bytes, payload: bytes) -> bytes:
    body = kind + encode_uv(len(payload)) + payload
    return body + crc32c(body).to_bytes(4, "little")


def size_by_definition(data: bytes, offset: int) -> int | None:
    """The size of the chunk at an offset, if chunk() of spec.md section 6.2 accepts it."""
    s = Reader(data[offset:], end_rule="R-6.2-4")
    try:
        chunk(s, lambda kind: 1024 if kind == ord("H") else LONGEST)
    except GsvcError:
        return None
    return s.position // 8


class SmallWindows(WholeChunks):
    """Windows that slide after a few bytes."""

    def __init__(self, data: bytes, step: int, longest: int = LONGEST) -> None:
        super().__init__(Source(data), longest)
        self._step = step


PARTS = st.one_of(
    st.binary(max_size=12),
    st.binary(max_size=4).map(lambda payload: whole(b"I", payload)),
    st.integers(0, 400).map(lambda size: whole(b"P", bytes(size))),
    st.integers(0, 1100).map(lambda size: whole(b"H", bytes(size))),
    st.sampled_from(
        [b"a\0", b"I\xac\x02", b"I\xad\x02", b"x\x80\0", b"E\x80\x80\x80\x80\0", bytes(500), whole(b"7", b"")]
    ),
    st.tuples(st.integers(0, 3), st.sampled_from([whole(b"z", b"12345"), whole(b"R", bytes(200))])).map(
        lambda cut: cut[1][cut[0] :]
    ),
)


@given(st.lists(PARTS, max_size=8).map(b"".join), st.sampled_from([1, 7, 64, 1000]))
@settings(max_examples=30)
def test_any_bytes(data: bytes, step: int) -> None:
    sizes = [size_by_definition(data, offset) for offset in range(len(data))]
    asked = SmallWindows(data, step)
    assert [asked.size_at(offset) for offset in range(len(data))] == sizes
    searched, preferring = SmallWindows(data, step), SmallWindows(data, step)
    for offset in range(len(data)):
        following = [at for at in range(offset + 1, len(data)) if sizes[at] is not None]
        next_whole = min(following, default=len(data))
        assert searched.after_damaged(offset, None) == next_whole
        claimed = min(offset + 20, len(data))
        good_claim = claimed == len(data) or sizes[claimed] is not None
        assert preferring.after_damaged(offset, claimed) == (claimed if good_claim else next_whole)


SMALL = whole(b"a", b"")
HOSTILE = {
    "longest claims everywhere": b"I\x80\x80\x40",
    "letters": b"aAaAaA\x7f\x7f",
    "whole chunks between claims": SMALL + b"I\xfb\xff\x3f",
    "whole chunks between claims that end at nothing": SMALL + b"I\xf7\xff\x3f",
    "garbage between whole chunks": SMALL + b"\0",
    "headers of other streams": whole(b"H", b"") + b"\0",
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_bytes_cost_no_more_than_others(name: str) -> None:
    """Windows of the real size: one after the other if nothing is whole, else few chunks, which take their time."""
    good = write_stream(RICH_HEADER, rich_frames())
    second = list(StreamReader(good))[1].offset
    pattern = HOSTILE[name]
    junk = pattern * ((1 << 15 if SMALL in pattern or b"H" in pattern else 3 << 20) // len(pattern))
    result = salvage(good[:second] + junk + good[second:])  # counts the bytes checksummed
    assert result.frames[0].number == 0
    assert result.gaps != []


@pytest.mark.parametrize("name", HOSTILE)
def test_small_windows_overlap_no_more_than_stated(name: str) -> None:
    longest = 2000
    data = HOSTILE[name] * 2000
    chunks = SmallWindows(data, longest // 2, longest)
    offset = 0
    while offset < len(data):
        size = chunks.size_at(offset)
        offset = offset + size if size is not None else chunks.after_damaged(offset, offset + longest)
    assert offset == len(data)
    assert chunks.checksummed <= WholeChunks.MAX_CHECKSUMMED * len(data)


class Shrinking(io.BytesIO):
    """A file that becomes shorter after it was opened."""

    def read(self, size: int | None = -1, /) -> bytes:
        data = super().read(size)
        return data[: max(0, 200 - self.tell() + len(data))]


def test_a_file_that_becomes_shorter_ends_there() -> None:
    data = whole(b"a", bytes(50)) * 10
    chunks = WholeChunks(Source(Shrinking(data)), LONGEST)
    assert chunks.size_at(0) == 56
    assert chunks.size_at(168) is None
    assert chunks.after_damaged(168, 224) == chunks.end == 200


def test_windows_of_the_lowest_level() -> None:
    chunks = WholeChunks(Source(bytes(10 * READ_AT_ONCE)), READ_AT_ONCE)
    assert chunks.after_damaged(0, None) == 10 * READ_AT_ONCE
    assert chunks.checksummed <= 4 * 10 * READ_AT_ONCE
