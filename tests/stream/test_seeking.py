"""Random access: every range of frames equals the same part of the whole, with any index or none."""

import io
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gsvc_ref.errors import GsvcError, UsageError
from gsvc_ref.stream import StreamReader
from gsvc_ref.stream.chunk_decoder import ChunkDecoder
from gsvc_ref.stream.seeking import find_by_hopping, find_by_index
from gsvc_ref.stream.source import Source
from gsvc_ref.testing import RICH_HEADER, Lie, Stream, rich_frames, streams, write_stream

FRAMES = [*rich_frames(), *rich_frames()]  # I-frames 0, 3, 5, 8


class Counted(io.BytesIO):
    """Counts the bytes that are read."""

    count = 0

    def read(self, size: int | None = -1, /) -> bytes:
        data = super().read(size)
        self.count += len(data)
        return data


@given(streams(max_count=10), st.data())
@settings(max_examples=40)
def test_any_range(stream: Stream, data: st.DataObject) -> None:
    start = data.draw(st.integers(0, len(stream.frames) + 1))
    stop = data.draw(st.one_of(st.none(), st.integers(start, len(stream.frames) + 2)))
    frames = list(StreamReader(stream.data).frames(start, stop))
    assert [frame.splats for frame in frames] == stream.splats[start:stop]
    assert [frame.number for frame in frames] == list(range(len(stream.frames)))[start:stop]


def place(data: bytes, number: int) -> Iterator[int | None]:
    """The number of the I-frame that index and hopping find."""
    for find in (find_by_index, find_by_hopping):
        found = find(ChunkDecoder(Source(data)), number)
        yield found.next_number if found else None


@pytest.mark.parametrize(("number", "i_frame"), [(1, 0), (2, 0), (3, 3), (4, 3), (5, 5), (7, 5), (8, 8), (9, 8)])
def test_index_and_hopping_find_the_nearest_i_frame(number: int, i_frame: int) -> None:
    assert list(place(write_stream(RICH_HEADER, FRAMES), number)) == [i_frame, i_frame]
    assert list(place(write_stream(RICH_HEADER, FRAMES, index=False), number)) == [None, i_frame]


def lying_index(column: int, amount: int) -> bytes:
    def lie(truth: np.ndarray) -> np.ndarray:
        steps = truth.astype(np.int64)
        steps[1, column] += amount
        return steps

    return write_stream(RICH_HEADER, FRAMES, lies=[Lie("frame_number_step", lie)])


@pytest.mark.parametrize(("column", "amount"), [(0, -1), (0, 1), (1, -1), (1, 1), (1, 11)])
def test_an_index_that_lies_is_not_believed(column: int, amount: int) -> None:
    data = lying_index(column, amount)
    truth = [frame.splats for frame in StreamReader(data)]
    for start in range(len(FRAMES)):
        assert [frame.splats for frame in StreamReader(data).frames(start)] == truth[start:]


def test_an_index_that_is_broken_is_not_used_to_seek() -> None:
    for lie in (Lie("entry_count", 9), Lie("index_length", 3), Lie("index_length", 2**32 - 1), Lie("chunk_crc", 0, 11)):
        data = write_stream(RICH_HEADER, FRAMES, lies=[lie])
        assert list(place(data, 9)) == [None, 8]


def test_an_index_may_name_fewer_i_frames() -> None:
    shorter = [Lie("entry_count", 2), Lie("frame_number_step", lambda steps: steps[:2])]
    data = write_stream(RICH_HEADER, FRAMES, lies=shorter)
    assert list(place(data, 9)) == [3, 8]
    assert [frame.number for frame in StreamReader(data).frames(9)] == [9]


def test_seeking_reads_little() -> None:
    data = write_stream(RICH_HEADER, FRAMES, index=False)
    whole, indexed, hopped = Counted(data), Counted(write_stream(RICH_HEADER, FRAMES)), Counted(data)
    intra_chunk = list(StreamReader(whole))[8].size
    list(StreamReader(indexed).frames(8, 9))
    list(StreamReader(hopped).frames(8, 9))
    assert indexed.count < 200 + 2 * intra_chunk  # the I-frame is read to see whether the index is true, then decoded
    assert hopped.count < 200 + intra_chunk
    assert whole.count == len(data)


def test_start_in_a_damaged_stream() -> None:
    """Damage before the I-frame does no harm; damage after it is reported, when it is reached."""
    good = write_stream(RICH_HEADER, FRAMES, index=False)
    frames = list(StreamReader(good))
    for number in (1, 4, 9):
        data = bytearray(good)
        data[frames[number].offset + 9] ^= 1
        after = StreamReader(bytes(data)).frames(5)
        assert [next(after).splats for _ in range(4)] == [frame.splats for frame in frames[5:9]]
        if number < 5:
            assert [frame.splats for frame in after] == [frames[9].splats]
        else:
            with pytest.raises(GsvcError, match=r"R-6\.2-2"):
                next(after)


def test_start_behind_a_cut() -> None:
    good = write_stream(RICH_HEADER, FRAMES)
    cut = good[: list(StreamReader(good))[6].offset + 20]
    with pytest.raises(GsvcError, match=r"R-6\.2-4"):
        list(StreamReader(cut).frames(8))


def test_several_iterations_of_one_reader_at_once() -> None:
    reader = StreamReader(write_stream(RICH_HEADER, FRAMES))
    first, second = reader.frames(), reader.frames(3)
    numbers = [(a.number, b.number) for a, b in zip(first, second, strict=False)]
    assert numbers == [(n, n + 3) for n in range(7)]


def test_ranges_that_make_no_sense() -> None:
    reader = StreamReader(write_stream(RICH_HEADER, FRAMES))
    for start, stop in ((-1, None), (3, 2)):
        with pytest.raises(UsageError, match="start"):
            reader.frames(start, stop)
    assert list(reader.frames(4, 4)) == []
