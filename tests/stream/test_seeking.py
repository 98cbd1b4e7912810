"""Random access: every range of frames equals the same part of the whole, with any index or none."""

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gsvc_ref
from gsvc_base.errors import GsvcError, UsageError
from gsvc_conformance.cases.seeking import forged
from gsvc_ref import spec
from gsvc_ref.bitstream.chunks import PREFIX_SIZE
from gsvc_ref.cli import main
from gsvc_ref.paper import FrameCodes
from gsvc_ref.stream import StreamReader
from gsvc_ref.stream.chunk_decoder import ChunkDecoder
from gsvc_ref.stream.seeking import SEARCH_SIZE, find_frame
from gsvc_ref.stream.source import Source
from gsvc_ref.testing import (
    RICH_HEADER,
    Lie,
    Stream,
    join_chunks,
    rich_frames,
    split_chunks,
    streams,
    write_stream,
)
from gsvc_ref.video import open_video

FRAMES = [*rich_frames(), *rich_frames()]  # I-frames 0, 3, 5, 8
SMALL_HEADER = replace(RICH_HEADER, parameter_checksum_flag=False)
SMALL = [FrameCodes.intra_frame(None), FrameCodes.repeated_frame()] * 2 + [FrameCodes.intra_frame(None)]
MAGIC = write_stream(SMALL_HEADER, SMALL)[:PREFIX_SIZE]


class Counted(io.BytesIO):
    """Counts the bytes that are read."""

    count = 0

    def read(self, size: int | None = -1, /) -> bytes:
        data = super().read(size)
        self.count += len(data)
        return data


@given(streams(max_count=10), st.data())
@settings(max_examples=20)
def test_any_range(stream: Stream, data: st.DataObject) -> None:
    start = data.draw(st.integers(0, len(stream.frames) + 1))
    stop = data.draw(st.one_of(st.none(), st.integers(start, len(stream.frames) + 2)))
    frames = list(StreamReader(stream.data).frames(start, stop))
    assert [frame.splats for frame in frames] == stream.splats[start:stop]
    assert [frame.number for frame in frames] == list(range(len(stream.frames)))[start:stop]


@given(streams(max_count=8), st.data())
@settings(max_examples=20)
def test_what_is_sought_is_what_decoding_from_the_start_gives(stream: Stream, data: st.DataObject) -> None:
    first = data.draw(st.integers(0, len(stream.frames) + 1))
    last = data.draw(st.integers(first, len(stream.frames) + 2))
    counts, parameters, _ = gsvc_ref.reconstruct_stream(stream.data)
    ends = np.cumsum([0, *counts])
    there = slice(min(first, len(counts)), min(last + 1, len(counts)))
    for found in (gsvc_ref.seek(stream.data, first, last)._asdict(), spec.seek(stream.data, first, last)):
        assert found["error"] == ""
        assert found["counts"].tolist() == counts[there].tolist()
        assert found["parameters"].tobytes() == parameters[ends[there.start] : ends[there.stop]].tobytes()


def hostile(draw: st.DataObject) -> bytes:
    """A stream of which chunks were removed, repeated or moved, bytes changed, and the end cut off."""
    data = write_stream(SMALL_HEADER, SMALL, index=draw.draw(st.booleans()))
    chunks = split_chunks(data)
    for _ in range(draw.draw(st.integers(0, 2))):
        at, to = (draw.draw(st.integers(0, len(chunks) - 1)) for _ in range(2))
        chunk = chunks.pop(at) if draw.draw(st.booleans()) else chunks[at]
        chunks.insert(to, chunk)
    changed = bytearray(join_chunks(chunks, prefix=data[:PREFIX_SIZE]))
    for _ in range(draw.draw(st.integers(0, 2))):
        changed[draw.draw(st.integers(0, len(changed) - 1))] = draw.draw(st.integers(0, 255))
    return bytes(changed[: draw.draw(st.one_of(st.just(len(changed)), st.integers(0, len(changed))))])


@given(st.data())
@settings(max_examples=100)
def test_hostile_streams_end_alike_in_the_code_of_the_spec(draw: st.DataObject) -> None:
    data = hostile(draw)
    first = draw.draw(st.integers(0, len(SMALL) + 1))
    last = first + draw.draw(st.integers(0, 3))
    mine, plain = gsvc_ref.seek(data, first, last), spec.seek(data, first, last)
    assert (mine.error, mine.counts.tolist()) == (plain["error"], plain["counts"].tolist())
    assert mine.parameters.tobytes() == plain["parameters"].tobytes()


def test_to_seek_to_the_first_frame_is_to_decode() -> None:
    data = bytearray(write_stream(SMALL_HEADER, SMALL))
    for at in range(len(data)):
        data[at] ^= 4
        whole, sought = gsvc_ref.reconstruct_stream(bytes(data)), gsvc_ref.seek(bytes(data), 0, 2**32 - 1)
        assert (sought.error, sought.counts.tolist()) == (whole.error, whole.counts.tolist())
        data[at] ^= 4


def place(data: bytes, number: int) -> int:
    """The number of the frame, or of the frames before the end chunk, that decoding begins at."""
    return find_frame(ChunkDecoder(Source(data)), number).next_number


@pytest.mark.parametrize("index", [True, False])
@pytest.mark.parametrize(
    ("number", "found"), [(0, 0), (1, 0), (2, 0), (3, 3), (4, 3), (5, 5), (7, 5), (8, 8), (9, 8), (10, 10), (99, 10)]
)
def test_the_last_i_frame_is_found(number: int, found: int, *, index: bool) -> None:
    assert place(write_stream(RICH_HEADER, FRAMES, index=index), number) == found


@pytest.mark.parametrize(
    "size", [0, 1, 127, 128, SEARCH_SIZE - 3, SEARCH_SIZE - 2, SEARCH_SIZE - 1, SEARCH_SIZE, 2 * SEARCH_SIZE + 5]
)
def test_heads_anywhere_in_a_window_are_read(size: int) -> None:
    """A chunk of any size before each frame: heads lie at, across and beyond the ends of what is read at once."""
    chunks = split_chunks(write_stream(SMALL_HEADER, SMALL, index=False))
    padded = [part for chunk in chunks[1:] for part in ((b"q", bytes(size)), chunk)]
    data = join_chunks([chunks[0], *padded], prefix=MAGIC)
    for number, found in enumerate([0, 0, 2, 2, 4, 5]):
        assert place(data, number) == found


def test_a_forged_index_is_not_believed(tmp_path: Path) -> None:
    """The index names a whole I-frame inside of another payload, which a scanner that decodes all never sees."""
    data = forged()
    truth = list(StreamReader(data))
    for start in range(4):
        assert [frame.splats for frame in StreamReader(data).frames(start)] == [frame.splats for frame in truth[start:]]
        assert [frame.splats for frame in StreamReader(data).salvage(start)] == [
            frame.splats for frame in truth[start:]
        ]
    shown = list(gsvc_ref.decode(data))
    assert np.array_equal(next(gsvc_ref.decode(data, start=1, stop=2)), shown[1])
    (tmp_path / "forged.gsvc").write_bytes(data)
    assert main(["decode", str(tmp_path / "forged.gsvc"), str(tmp_path / "out"), "--frames", "1:2", "--quiet"]) == 0
    with open_video(tmp_path / "out") as reader:
        assert np.array_equal(next(iter(reader)), shown[1])


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


def test_an_index_that_is_broken_does_no_harm() -> None:
    for lie in (Lie("entry_count", 9), Lie("index_length", 3), Lie("index_length", 2**32 - 1), Lie("chunk_crc", 0, 11)):
        assert place(write_stream(RICH_HEADER, FRAMES, lies=[lie]), 9) == 8


def test_seeking_reads_little() -> None:
    """Of payloads longer than a window only what is decoded is read, and a window of each."""
    chunks = split_chunks(write_stream(SMALL_HEADER, SMALL, index=False))
    padded = [part for chunk in chunks[1:] for part in ((b"q", bytes(9 * SEARCH_SIZE)), chunk)]
    data = join_chunks([chunks[0], *padded], prefix=MAGIC)
    sought = Counted(data)
    assert [frame.number for frame in StreamReader(sought).frames(4, 5)] == [4]
    assert 5 * SEARCH_SIZE < sought.count < 8 * SEARCH_SIZE


def test_start_in_a_damaged_stream() -> None:
    """Damage of payloads before the I-frame does no harm; damage after it is reported, when it is reached."""
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
