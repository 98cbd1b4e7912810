"""YUV4MPEG2 (.y4m): a header line, then a line and the raw planes of each frame; from and to files and pipes."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO, Final

import numpy as np

from gsvc_base.arrays import Frame, Plane
from gsvc_base.errors import GsvcError, UsageError, naming
from gsvc_base.files import PartialFile
from gsvc_ref.video.color import conversion, to_planes, to_rgb
from gsvc_ref.video.format import VideoFormat
from gsvc_ref.video.stream import VideoReader, VideoWriter
from gsvc_ref.video.y4m_header import Y4M_SIGNATURE, format_header, malformed, parse_header, planar_format

MAX_HEADER_LINE: Final = 4096
"""Longest stream header or frame header in bytes, far beyond what any program writes."""
READ_SIZE: Final = 1 << 22
"""Bytes asked for at once, so that a short file with a huge size in its header costs no memory."""


class Y4mReader(VideoReader):
    """A reader of y4m from a file or pipe, which never seeks; a binary file stays open.

    A frame that is cut off or does not begin with FRAME is a GsvcError ``malformed`` when iterating.
    """

    def __init__(self, source: Path | BinaryIO, name: str) -> None:
        super().__init__()
        self._name = name
        self._owned = isinstance(source, Path)
        self._stream = source.open("rb") if isinstance(source, Path) else source
        try:
            self._parse(source.stat().st_size if isinstance(source, Path) and source.is_file() else None)
        except BaseException:
            self.close()
            raise

    def _parse(self, size: int | None) -> None:
        """Read the stream header; `size` is that of a whole file, from which follows the number of frames."""
        name = self._name
        line = self._stream.readline(MAX_HEADER_LINE + 1)
        if not line:
            raise malformed(name, "it is empty")
        if not line.startswith(Y4M_SIGNATURE):
            _refuse_stream(line, name)
            raise malformed(name, f"it does not begin with {Y4M_SIGNATURE.decode()}")
        if not line.endswith(b"\n"):
            raise malformed(name, f"its header is cut off, or longer than {MAX_HEADER_LINE} bytes")
        header = parse_header(line[:-1], name)
        self.notes = header.notes
        shapes = header.format.plane_shapes[: 1 if header.mono else 3]
        self._mono = header.mono
        self._frame_bytes = sum(rows * columns for rows, columns in shapes) * header.format.dtype.itemsize
        frame_size = len(b"FRAME\n") + self._frame_bytes
        frames, rest = divmod(size - len(line), frame_size) if size is not None else (0, 1)
        self.format = replace(header.format, frame_count=None if rest else frames)

    def _read(self) -> Iterator[Frame]:
        number = 0
        while (line := self._stream.readline(MAX_HEADER_LINE + 1)) != b"":
            if not (line.startswith((b"FRAME\n", b"FRAME ")) and line.endswith(b"\n")):
                raise malformed(self._name, f"frame {number} {_no_frame(line)}")
            yield self._convert(self._samples(number))
            number += 1

    def _samples(self, number: int) -> bytearray:
        samples = bytearray()
        while missing := self._frame_bytes - len(samples):
            part = self._stream.read(min(missing, READ_SIZE))
            if not part:
                raise GsvcError(
                    "malformed",
                    f"{self._name} is cut off in frame {number}: {missing} of its {self._frame_bytes} bytes are "
                    f"missing",
                )
            samples += part
        return samples

    def _convert(self, samples: bytearray) -> Frame:
        video = self.format
        values = np.frombuffer(samples, video.dtype.newbyteorder("<")).astype(video.dtype, copy=False)
        planes: list[Plane] = []
        start = 0
        for rows, columns in video.plane_shapes[: 1 if self._mono else 3]:
            planes.append(values[start : start + rows * columns].reshape(rows, columns))
            start += rows * columns
        if self._mono:
            grey = 1 << (video.bit_depth - 1)
            planes += [np.full(shape, grey, video.dtype) for shape in video.plane_shapes[1:]]
        return to_rgb(planes, video)

    def close(self) -> None:
        """Close the file if it was given by its path."""
        super().close()
        if self._owned:
            self._stream.close()


def _refuse_stream(line: bytes, name: str) -> None:
    """Refuse a GSVC stream, which a pipe may hold as well as y4m, and say what to do."""
    from gsvc_ref.bitstream.chunks import MAGIC  # here, because it imports the compiler

    if MAGIC.startswith(line):
        raise UsageError(
            f"{name} holds a GSVC stream, and a pipe is read as y4m: save it to a file, or decode it on the way "
            f"(gsvc decode - -)"
        )


def _no_frame(line: bytes) -> str:
    """The fault of a line in the place of the header of a frame."""
    found = line[:16].decode("ascii", "backslashreplace")
    if not line.startswith((b"FRAME\n", b"FRAME ")):
        return f"must begin with FRAME, found {found!r}"
    if len(line) > MAX_HEADER_LINE:
        return f"has a header of more than {MAX_HEADER_LINE} bytes, the most that is read"
    return "is cut off in its header"


def _name_of(file: BinaryIO) -> str:
    """The name in messages of a file that the caller opened."""
    name = getattr(file, "name", "the output")
    return "standard output" if name == "<stdout>" else str(name)


class Y4mWriter(VideoWriter):
    """A writer of y4m; read back by `Y4mReader` it has the same format (see `planar_format` for ``rgb``).

    A path has a temporary name until `close`; a binary file stays open. An unspecified matrix becomes the assumed one.
    """

    def __init__(self, target: Path | BinaryIO, video: VideoFormat) -> None:
        super().__init__(video)
        self._planar = planar_format(video)
        conversion(self._planar)
        if video.chroma_format == "rgb":
            self.notes.append("y4m holds no R'G'B': written as 4:4:4 in limited range, exact to a few steps")
        self._partial: PartialFile | None = None
        self._owned = isinstance(target, Path)
        self._name = str(target) if isinstance(target, Path) else _name_of(target)
        if not isinstance(target, Path):
            self._stream = target
        elif target.is_file() or not target.exists():
            self._partial = PartialFile(target)
            try:
                self._stream = self._partial.path.open("wb")
            except BaseException:  # an interrupt too leaves no file behind
                self._partial.discard()
                raise
        else:  # a pipe or device must not be replaced by a file
            self._stream = target.open("wb")
        self._write_all(format_header(self._planar))

    def _write_all(self, data: bytes | memoryview) -> None:
        rest = memoryview(data)
        try:
            while rest:  # an unbuffered file may take less than it is given
                with naming(self._name):
                    rest = rest[self._stream.write(rest) :]
        except BaseException:
            self.abort()
            raise

    def _write(self, frame: Frame) -> None:
        planes = to_planes(frame, self._planar)
        little = self._planar.dtype.newbyteorder("<")
        self._write_all(b"FRAME\n")
        for plane in planes:  # without a copy of any of them
            self._write_all(plane.astype(little, copy=False).reshape(-1).view(np.uint8).data)

    def _finish(self) -> None:
        with naming(self._name):
            self._stream.flush()
            if self._owned:
                self._stream.close()
        if self._partial:
            self._partial.commit()

    def _discard(self) -> None:
        if self._owned:
            with suppress(OSError):  # closing flushes, which fails again on a full disk
                self._stream.close()
        if self._partial:
            self._partial.discard()
