"""The base classes of all readers and writers of video."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Final, Protocol, Self

from gsvc_base.arrays import Frame
from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.video.format import VideoFormat, check_frame


class Damage(str):
    """A note of a reader that frames of its source are lost or damaged, which commands write to standard error."""


class VideoReader(ABC):
    """A reader of the frames of a source, one after the other: iterate once.

    Data that cannot be read raises a GsvcError, which names the frame, after all frames before it were delivered.
    """

    format: VideoFormat
    notes: list[str]

    def __init__(self) -> None:
        self.notes = []  # sentences about what was assumed or left out; more may come while frames are read
        # When the frame given last is shown, in seconds from the first frame; None where frames are evenly spaced.
        self.frame_time: Fraction | None = None
        self.end_time: Fraction | None = None  # when it ends, if that is known
        self.time_base: Fraction | None = None  # a unit of which `frame_time` is a multiple, in seconds, if it is known
        self.is_turned = False  # frames are rotated or mirrored from how they are coded, as the source asks
        self._frames: Iterator[Frame] | None = None
        self._peeked: Frame | Exception | None = None
        self._delivered = 0

    @abstractmethod
    def _read(self) -> Iterator[Frame]:
        """Yield each frame as (H, W, 3) u1 or u2."""

    def close(self) -> None:
        """Release the source, which ends the iteration; harmless when called twice."""
        self._frames, self._peeked = iter(()), None

    def take_times(self, other: "VideoReader") -> None:
        """Take the times of the frame that another reader gave last, which is the one to give next."""
        self.frame_time, self.end_time, self.time_base = other.frame_time, other.end_time, other.time_base

    def note(self, sentence: str) -> None:
        """Add a sentence to the notes, once."""
        if sentence not in self.notes:
            self.notes.append(sentence)

    def __iter__(self) -> Iterator[Frame]:
        if self._frames is None:
            self._frames = self._read()
        return self

    def peek(self) -> Frame | None:
        """The frame that comes next, and still comes after this; None if none does, or a fault in its place."""
        if self._peeked is None:
            try:
                self._peeked = next(self, None)
            except Exception as error:
                self._peeked = error
        return None if isinstance(self._peeked, Exception) else self._peeked

    def __next__(self) -> Frame:
        peeked, self._peeked = self._peeked, None
        if isinstance(peeked, Exception):
            raise peeked
        return self._advance() if peeked is None else peeked

    def _advance(self) -> Frame:
        """Read the next frame."""
        if self._frames is None:
            self._frames = self._read()
        try:
            frame = next(self._frames)
        except OSError as error:  # opening went well, so this is one more way of being damaged
            message = f"frame {self._delivered} cannot be read ({error}); give an intact copy"
            raise GsvcError("malformed", message) from error
        self._delivered += 1
        return frame

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()


class PassingReader(VideoReader):
    """A reader of frames that the caller or another reader gives; what these raise is passed on as it is."""

    def _advance(self) -> Frame:
        if self._frames is None:
            self._frames = self._read()
        return next(self._frames)


class Times(Protocol):
    """When frames are shown, as `gsvc_ref.bitstream.times.FrameTimes` says it."""

    ticks_per_second: int | None

    def time_of(self, frame: int) -> Fraction:
        """The second at which a frame is shown, from that of frame 0."""


@dataclass(frozen=True)
class Extras:
    """What goes with the frames of a video that is written."""

    times: Times | None = None  # when frames are shown; None if they are evenly spaced
    first_frame: int = 0  # the number, in `times`, of the first frame that is written
    audio_from: Path | None = None  # a file whose sound is copied, from the time of that frame on


NO_EXTRAS: Final = Extras()
"""Evenly spaced frames without sound."""


class VideoWriter(ABC):
    """A writer of frames; the result gets its final name only when it is closed.

    As a context manager it closes when the block ends well and aborts when it ends by an exception.
    """

    carries_times = False
    """Whether the target says when frames are shown."""

    def __init__(self, video: VideoFormat, extras: Extras = NO_EXTRAS) -> None:
        self.format = video
        self.times = extras.times
        self.written_depth = video.bit_depth  # bits per sample; fewer where the target cannot hold them
        self._first_frame = extras.first_frame
        self.notes: list[str] = []  # sentences about what the target cannot carry
        self.frames_written = 0
        self.frames_skipped = 0  # left out by `skip`
        self._open = True

    @property
    def start_time(self) -> Fraction:
        """When the first frame that is written is shown, in seconds from that of frame 0."""
        first = self._first_frame
        return first / self.format.frame_rate if self.times is None else self.times.time_of(first)

    def span(self) -> tuple[Fraction, Fraction]:
        """When the next frame is shown, and when it ends, in seconds from that of the first frame that is written.

        With `times` a frame that is missing leaves its time to the one before.
        """
        if self.times is None:
            return self.frames_written / self.format.frame_rate, (self.frames_written + 1) / self.format.frame_rate
        number = self._first_frame + self.frames_written + self.frames_skipped
        return self.times.time_of(number) - self.start_time, self.times.time_of(number + 1) - self.start_time

    def write(self, frame: Frame) -> None:
        """Append a frame, (H, W, 3) full-range R'G'B', u1 for 8 bits, else u2.

        On an OSError, such as a full disk or a closed pipe, what was written so far is removed.
        """
        if not self._open:
            raise UsageError("this writer is closed; open another one to write more frames")
        check_frame(frame, self.format)
        try:
            self._write(frame)
        except BaseException:
            self.abort()
            raise
        self.frames_written += 1

    def skip(self, count: int) -> None:
        """Leave out frames that are missing: numbered files keep their numbers, other targets become shorter."""
        self.frames_skipped += count

    def close(self) -> None:
        """Complete the result and put it in place; harmless when called twice or after `abort`."""
        if self._open:
            try:
                self._finish()
            except BaseException:
                self.abort()
                raise
            self._open = False

    def abort(self) -> None:
        """Remove everything that was written; harmless when called twice or after `close`."""
        if self._open:
            self._open = False
            self._discard()

    @abstractmethod
    def _write(self, frame: Frame) -> None: ...

    @abstractmethod
    def _finish(self) -> None: ...

    @abstractmethod
    def _discard(self) -> None: ...

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if kind is None:
            self.close()
        else:
            self.abort()
