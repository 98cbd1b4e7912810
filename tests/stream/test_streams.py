"""Whole streams: what is written is read, here, in another process and through a pipe; every bit is accounted for."""

import io
import json
import subprocess
import sys
import tracemalloc
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.bitstream import CATEGORIES, SequenceHeader, crc32c
from gsvc_ref.bitstream.chunks import PREFIX_SIZE
from gsvc_ref.paper import FrameCodes, SplatBlock
from gsvc_ref.stream import StreamReader, StreamWriter
from gsvc_ref.testing import (
    OVERVIEW_HEADER,
    RICH_HEADER,
    Lie,
    Stream,
    join_chunks,
    overview_frames,
    rich_frames,
    split_chunks,
    streams,
    write_stream,
)
from gsvc_tools.editing.copying import belongs_to_frame, is_safe_to_copy


class Pipe(io.RawIOBase):
    """Bytes that can be read once, a few at a time; what is written to it is collected in `data`."""

    def __init__(self, data: bytes = b"", most: int = 7) -> None:
        self.data = data
        self.most = most
        self.at = 0

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return False

    def readinto(self, buffer: Any) -> int:
        piece = self.data[self.at : self.at + min(self.most, len(buffer))]
        buffer[: len(piece)] = piece
        self.at += len(piece)
        return len(piece)

    def write(self, data: Any) -> int:
        piece = bytes(data)[: self.most]
        self.data += piece
        return len(piece)


@given(streams())
@settings(max_examples=30)
def test_round_trip(stream: Stream) -> None:
    reader = StreamReader(stream.data)
    assert reader.header == stream.header
    assert reader.frame_count == len(stream.frames)
    decoded = list(reader)
    assert [frame.number for frame in decoded] == list(range(len(stream.frames)))
    assert [frame.codes for frame in decoded] == stream.frames
    assert [frame.splats for frame in decoded] == stream.splats


@given(streams(max_count=20))
@settings(max_examples=30)
def test_every_bit_is_accounted_for(stream: Stream) -> None:
    elements = []
    summary = StreamReader(stream.data).summary()
    assert summary.error is None
    assert summary.bits["unread"] == 0
    assert sum(summary.bits.values()) == 8 * summary.file_bytes == 8 * len(stream.data)
    for frame in StreamReader(stream.data, trace=elements.append):
        assert sum(frame.bits.values()) == 8 * frame.size
        assert set(frame.bits) <= set(CATEGORIES)
    ends = 0
    for element in sorted(elements, key=lambda element: (element.bit, element.bits)):
        assert element.bit == ends, element
        ends += element.bits
    assert ends == 8 * len(stream.data)


@given(streams(max_frames=3, max_count=20), st.integers(1, 40))
@settings(max_examples=25)
def test_pipes(stream: Stream, most: int) -> None:
    assert [frame.splats for frame in StreamReader(Pipe(stream.data, most))] == stream.splats
    assert StreamReader(Pipe(stream.data, most)).summary() == StreamReader(stream.data).summary()
    target = Pipe(most=most)
    writer = StreamWriter(target, stream.header)
    for codes in stream.frames:
        writer.write_frame(codes)
    writer.finish()
    reader = StreamReader(target.data)
    assert reader.header == replace(stream.header, frame_count=0)
    assert [frame.codes for frame in reader] == stream.frames


def test_pipe_is_read_once() -> None:
    reader = StreamReader(Pipe(write_stream(OVERVIEW_HEADER, overview_frames())))
    assert reader.frame_count == 3
    assert len(list(reader)) == 3
    with pytest.raises(UsageError, match="only once"):
        next(iter(reader))


DECODE = """
import json, sys, zlib
from gsvc_ref.bitstream.crc import parameter_checksum
from gsvc_ref.stream import StreamReader
print(json.dumps([[parameter_checksum(f.splats), zlib.adler32(f.splats.tobytes())] for f in StreamReader(sys.argv[1])]))
"""


def test_another_process_reads_the_same_bits(tmp_path: Path) -> None:
    path = tmp_path / "rich.gsvc"
    with path.open("wb") as target:
        writer = StreamWriter(target, RICH_HEADER)
        written = [writer.write_frame(codes).splats for codes in rich_frames()]
        writer.finish()
    output = subprocess.run(
        [sys.executable, "-c", DECODE, str(path)], check=True, capture_output=True, text=True, timeout=120
    ).stdout
    assert json.loads(output) == [[crc32c(s.tobytes()), zlib.adler32(s.tobytes())] for s in written]


def test_what_write_frame_returns_is_what_is_read() -> None:
    target = io.BytesIO()
    writer = StreamWriter(target, RICH_HEADER)
    written = [writer.write_frame(codes) for codes in rich_frames()]
    bits = writer.finish()
    for mine, read in zip(written, StreamReader(target.getvalue()), strict=True):
        assert (mine.number, mine.type, mine.bits, mine.offset, mine.size) == (
            read.number,
            read.type,
            read.bits,
            read.offset,
            read.size,
        )
        assert mine.splats == read.splats
        assert mine.codes == read.codes
    assert writer.state.splats == written[-1].splats
    assert sum(bits.values()) == 8 * len(target.getvalue()) == 8 * writer.offset


def test_overview_stream_byte_by_byte() -> None:
    """The bytes that an implementer can check by hand: I at (6, 4.5), P moved by (1, -0.75), R."""
    data = write_stream(OVERVIEW_HEADER, overview_frames(), index=False)
    assert data.hex(" ") == (
        "89 47 53 56 43 0d 0a 1a 82 00 "
        "48 24 00 01 00 10 00 0c 00 19 00 00 00 01 00 00 00 00 00 00 00 03 00 00 00 "
        "08 01 01 01 01 01 00 06 01 01 00 0e 01 0c bc 8d 86 "
        "49 30 00 01 f8 2d 00 00 00 2d 00 00 00 "
        "00 00 80 3e 00 00 00 00 08 00 00 80 3e 00 00 80 c0 10 00 00 80 3e 00 00 00 00 08 "
        "01 01 00 00 3a 00 38 00 34 00 d3 0c c5 96 "
        "50 0c 01 00 20 80 0c 00 00 00 2c 00 00 00 77 c2 c2 99 "
        "52 01 02 a4 e4 55 6a "
        "45 08 03 00 00 00 00 00 00 00 25 3e de 55"
    )
    expected = [[6, 4.5, 2, 0, 2, 0.75, 0.5, 0.25], [7, 3.75, 2, 0, 2, 0.75, 0.5, 0.25]]
    decoded = [frame.splats.to_array()[0].tolist() for frame in StreamReader(data)]
    assert decoded == [expected[0], expected[1], expected[1]]


def test_sources_of_all_kinds(tmp_path: Path) -> None:
    data = write_stream(OVERVIEW_HEADER, overview_frames())
    path = tmp_path / "a.gsvc"
    path.write_bytes(b"before" + data)
    with path.open("rb") as file:
        file.seek(6)
        reader = StreamReader(file)
        assert [len(list(reader)), len(list(reader)), reader.frame_count] == [3, 3, 3]
        assert [frame.number for frame in reader.frames(1, 2)] == [1]
        reader.close()
        assert not file.closed
    path.write_bytes(data)
    for source in (str(path), path, data, bytearray(data), memoryview(data)):
        with StreamReader(source) as reader:
            assert len(list(reader)) == 3


@pytest.mark.parametrize("source", [7, None, io.StringIO("text, and no bytes at all")])
def test_useless_sources(source: Any) -> None:
    with pytest.raises(UsageError):
        StreamReader(source)


def test_missing_file_and_directory_stay_os_errors(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        StreamReader(tmp_path / "none.gsvc")
    with pytest.raises(IsADirectoryError):
        StreamReader(tmp_path)


@pytest.mark.parametrize("frame_count", [0, 3, 99])
def test_frame_count_is_corrected_in_a_file(frame_count: int) -> None:
    target = io.BytesIO(b"before")
    target.seek(6)
    writer = StreamWriter(target, replace(OVERVIEW_HEADER, frame_count=frame_count))
    for codes in overview_frames():
        writer.write_frame(codes)
    writer.finish()
    assert target.getvalue()[:6] == b"before"
    assert target.tell() == len(target.getvalue())
    assert StreamReader(target.getvalue()[6:]).header.frame_count == writer.header.frame_count == 3
    assert len(list(StreamReader(target.getvalue()[6:]))) == 3


def test_finish_after_an_interrupted_write() -> None:
    """Ctrl-C in the middle of a chunk: `finish` cuts the part away, and the stream holds the frames so far."""

    class Interrupted(io.BytesIO):
        armed = False

        def write(self, data: Any) -> int:
            if self.armed:
                self.armed = False
                super().write(bytes(data)[:11])
                raise KeyboardInterrupt
            return super().write(data)

    target = Interrupted()
    writer = StreamWriter(target, RICH_HEADER)
    frames = rich_frames()
    first = writer.write_frame(frames[0])
    target.armed = True
    with pytest.raises(KeyboardInterrupt):
        writer.write_frame(frames[1])
    writer.finish()
    assert [frame.splats for frame in StreamReader(target.getvalue())] == [first.splats]


def test_writer_refuses_what_no_reader_accepts() -> None:
    writer = StreamWriter(io.BytesIO(), OVERVIEW_HEADER)
    intra, predicted, repeated = overview_frames()
    with pytest.raises(UsageError, match=r"R-6\.1-5"):
        writer.finish()
    for codes in (predicted, repeated):
        with pytest.raises(UsageError):
            writer.write_frame(codes)
    assert intra.intra is not None
    with pytest.raises(UsageError, match=r"R-6\.5-4"):
        writer.write_frame(FrameCodes.intra_frame(replace(intra.intra, codebooks=None)))
    before = writer.offset
    writer.write_frame(intra)
    with pytest.raises(UsageError, match="survivors"):
        writer.write_frame(FrameCodes.predicted_frame(np.ones(2, np.bool_), SplatBlock()))
    infinite = SplatBlock(positions=np.array([[0x7C00, 0]], np.uint16))
    with pytest.raises(GsvcError, match=r"R-8-1"):
        writer.write_frame(FrameCodes.predicted_frame(np.ones(1, np.bool_), infinite))
    for name in ("x", "A", "ab", "", "é", "1"):
        with pytest.raises(UsageError, match="ancillary"):
            writer.write_ancillary(name, b"")
    for name in "pqrs":
        with pytest.raises(UsageError, match=r"begin it with a UUID of 16 bytes.*R-6\.2-8"):
            writer.write_ancillary(name, bytes(15))
    writer.write_ancillary("q", bytes(16))
    writer.write_frame(repeated)
    assert writer.finish() == writer.finish()
    with pytest.raises(UsageError, match="finished"):
        writer.write_frame(repeated)
    assert before < writer.offset


def test_writer_refuses_too_much_rendering_work() -> None:
    header = SequenceHeader(level=1, width=400, height=300, color_stages=3, cholesky_bits=5)
    block = rich_frames(300)[0].intra
    assert block is not None
    assert block.quantizer is not None
    huge = replace(block, quantizer=replace(block.quantizer, offset=np.full(3, 1e9, np.float32)))
    writer = StreamWriter(io.BytesIO(), header)
    with pytest.raises(UsageError, match=r"R-5-4"):
        writer.write_frame(FrameCodes.intra_frame(huge))
    writer.write_frame(FrameCodes.intra_frame(block))


def test_unknown_ancillary_chunks_are_skipped() -> None:
    plain = write_stream(RICH_HEADER, rich_frames(), index=False)
    chunks = split_chunks(plain)
    decorated = [chunks[0], (b"q", b"hello"), chunks[1], (b"a", b""), *chunks[2:-1], (b"z", bytes(300)), chunks[-1]]
    data = join_chunks(decorated, prefix=plain[:PREFIX_SIZE])
    assert [frame.splats for frame in StreamReader(data)] == [frame.splats for frame in StreamReader(plain)]
    summary = StreamReader(data).summary()
    assert summary.bits["ancillary"] == 8 * 305
    assert sum(summary.bits.values()) == 8 * len(data)


def test_later_minor_version_may_append_to_the_header() -> None:
    lies = [Lie("version_minor", 7), Lie("lane_count", bytes([1]) + b"more")]
    data = write_stream(OVERVIEW_HEADER, overview_frames(), lies=lies)
    assert StreamReader(data).header == replace(OVERVIEW_HEADER, frame_count=3)
    assert len(list(StreamReader(data))) == 3
    with pytest.raises(GsvcError, match=r"R-6\.2-3"):
        StreamReader(write_stream(OVERVIEW_HEADER, overview_frames(), lies=lies[1:]))


def test_memory_does_not_grow_with_the_number_of_frames() -> None:
    """Neither of the writer, which keeps an index entry for each I-frame, nor of the reader."""
    intra, _, repeated = overview_frames()

    def peak(frames: int) -> int:
        pipe = Pipe(most=1 << 20)
        tracemalloc.start()
        try:
            writer = StreamWriter(pipe, OVERVIEW_HEADER)
            writer.write_frame(intra)
            for _ in range(frames):
                writer.write_frame(repeated)
            writer.finish()
            assert sum(1 for _ in StreamReader(pipe)) == frames + 1
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    peak(1)
    assert peak(400) < peak(40) + 20 * 400  # the bytes of the pipe itself, 7 a frame, and of a copy


def test_a_file_opened_to_append_holds_a_whole_stream(tmp_path):
    path = tmp_path / "a.gsvc"
    with path.open("ab") as file:
        writer = StreamWriter(file, OVERVIEW_HEADER)
        for codes in overview_frames():
            writer.write_frame(codes)
        writer.finish()
    with StreamReader(path) as reader:
        assert reader.header.frame_count == 0  # nothing after the end of the file can be corrected
        assert len(list(reader)) == len(overview_frames())


def test_bits_of_an_ancillary_type_tell_what_becomes_of_its_chunk() -> None:
    letters = "abdnpqrstxz"
    assert "".join(letter for letter in letters if is_safe_to_copy(ord(letter))) == "aqs"
    assert "".join(letter for letter in letters if belongs_to_frame(ord(letter))) == "bnrsz"
