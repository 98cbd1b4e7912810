"""Sources that are read more than once: a file is opened again, and frames that come once are kept in a file."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fractions import Fraction
from itertools import islice
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Final

import numpy as np

from gsvc_base.arrays import Frame
from gsvc_base.errors import UsageError
from gsvc_ref.encoder.source_and_target import Source, opened_source
from gsvc_ref.plugins import source_by_prefix
from gsvc_ref.video import VideoFormat, VideoReader
from gsvc_ref.video.format import FrameRate
from gsvc_ref.video.stream import PassingReader

MAX_BYTES_KEPT: Final = 1 << 32
"""The most bytes of frames that are kept in a temporary file, 690 frames of 1920x1080 with 8 bits."""


def can_be_read_again(source: Source) -> bool:
    """Whether a source gives its frames each time that it is opened: no pipe, open reader or iterator does."""
    if isinstance(source, str | Path):
        if isinstance(source, str) and source_by_prefix(source) is not None:
            return True
        return str(source) != "-" and (Path(source).is_file() or Path(source).is_dir())
    if isinstance(source, VideoReader):
        return False
    if isinstance(source, tuple) and len(source) == 2 and isinstance(source[1], VideoFormat):
        return can_be_read_again(source[0])
    if hasattr(source, "read"):
        return False
    return hasattr(source, "open_video") or iter(source) is not source


@contextmanager
def readable_again(source: Source, frame_rate: FrameRate | None) -> Iterator[Callable[[], VideoReader]]:
    """What gives a new reader of the source each time; frames that come once are kept in a temporary file.

    Reading ends with a UsageError where frames would take more than MAX_BYTES_KEPT bytes.
    """
    if can_be_read_again(source):
        yield lambda: _Reopened(source, frame_rate)
        return
    with opened_source(source, frame_rate) as reader, TemporaryFile() as file:
        kept = _Kept(reader, file)
        yield lambda: _KeptReader(kept)


class _Reopened(PassingReader):
    """A source that is opened now, and closed with this reader or after its last frame."""

    def __init__(self, source: Source, frame_rate: FrameRate | None) -> None:
        super().__init__()
        self._context = opened_source(source, frame_rate)
        self._reader = self._context.__enter__()
        self.format, self.notes = self._reader.format, self._reader.notes
        self.take_times(self._reader)

    def _read(self) -> Iterator[Frame]:
        for frame in self._reader:
            self.take_times(self._reader)
            yield frame

    def close(self) -> None:
        """Release the source."""
        super().close()
        self._context.__exit__(None, None, None)


class _Kept:
    """The frames of a reader, in a file as soon as they are asked for."""

    def __init__(self, reader: VideoReader, file: IO[bytes]) -> None:
        self.reader = reader
        self._file, self._times = file, list[tuple[Fraction | None, Fraction | None]]()
        self._fault: Exception | None = None
        self._is_whole = False
        video = reader.format
        self._size = video.width * video.height * 3 * video.dtype.itemsize

    def frame(self, number: int) -> tuple[Frame, tuple[Fraction | None, Fraction | None]] | None:
        """A frame with its `frame_time` and `end_time`, or None after the last; from the source if it is new."""
        if number < len(self._times):
            video = self.reader.format
            self._file.seek(number * self._size)
            samples = np.frombuffer(self._file.read(self._size), video.dtype)
            return samples.reshape(video.height, video.width, 3), self._times[number]
        if self._fault is not None:
            raise self._fault
        if self._is_whole:
            return None
        try:
            frame = next(self.reader, None)
        except Exception as error:
            self._fault = error
            raise
        if frame is None:
            self._is_whole = True
            return None
        if (number + 1) * self._size > MAX_BYTES_KEPT:
            raise UsageError(
                f"the source can be read once only, and more than {number} of its frames do not fit into the "
                f"{MAX_BYTES_KEPT >> 30} GiB that a temporary file may take: give a file, or fewer frames"
            )
        self._file.seek(number * self._size)
        self._file.write(np.ascontiguousarray(frame).tobytes())
        self._times.append((self.reader.frame_time, self.reader.end_time))
        return frame, self._times[-1]


class _KeptReader(PassingReader):
    """One pass over frames that are kept."""

    def __init__(self, kept: _Kept) -> None:
        super().__init__()
        self._kept = kept
        self.format, self.notes = kept.reader.format, kept.reader.notes
        self.time_base = kept.reader.time_base

    def _read(self) -> Iterator[Frame]:
        number = 0
        while (found := self._kept.frame(number)) is not None:
            frame, (self.frame_time, self.end_time) = found
            yield frame
            number += 1


class Chosen(VideoReader):
    """Some of the frames of another reader, by their numbers, which grow."""

    def __init__(self, reader: VideoReader, numbers: tuple[int, ...]) -> None:
        super().__init__()
        self.format, self.notes, self._reader, self._numbers = reader.format, reader.notes, reader, numbers

    def _read(self) -> Iterator[Frame]:
        at = 0
        for number in self._numbers:
            yield from islice(self._reader, number - at, number - at + 1)
            at = number + 1

    def close(self) -> None:
        """Release the source."""
        super().close()
        self._reader.close()
