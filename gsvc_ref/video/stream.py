"""What every reader and writer of video has in common, and files that appear under their name only when complete."""

import os
from abc import ABC, abstractmethod
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Self

from gsvc_ref.errors import UsageError
from gsvc_ref.video.format import Frame, VideoFormat, check_frame


class VideoReader(ABC):
    """Frames of a source, one after the other: iterate once.

    Attributes
    ----------
    format
        The format of the source.
    notes
        Sentences about what was assumed or left out; more may come while frames are read.

    Raises
    ------
    GsvcError
        While iterating: data that cannot be read, naming the frame, after all frames before it were delivered.
    """

    format: VideoFormat
    notes: list[str]

    def __init__(self) -> None:
        self.notes = []
        self._frames: Iterator[Frame] | None = None

    @abstractmethod
    def _read(self) -> Iterator[Frame]:
        """Yield each frame as (H, W, 3) u1 or u2."""

    def close(self) -> None:
        """Release the source, which ends the iteration; harmless when called twice."""
        self._frames = iter(())

    def note(self, sentence: str) -> None:
        """Add a sentence to the notes, once."""
        if sentence not in self.notes:
            self.notes.append(sentence)

    def __iter__(self) -> Iterator[Frame]:
        if self._frames is None:
            self._frames = self._read()
        return self

    def __next__(self) -> Frame:
        if self._frames is None:
            self._frames = self._read()
        return next(self._frames)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()


class VideoWriter(ABC):
    """Takes frames; the result stands under its final name only after `close`.

    As a context manager it closes when the block ends well and aborts when it ends by an exception.

    Attributes
    ----------
    format
        What frames must fit, and what is written.
    notes
        Sentences about what the target cannot carry.
    frames_written, frames_skipped
        How many frames were written, and how many left out by `skip`.
    """

    def __init__(self, video: VideoFormat) -> None:
        self.format = video
        self.notes: list[str] = []
        self.frames_written = 0
        self.frames_skipped = 0
        self._open = True

    def write(self, frame: Frame) -> None:
        """Append a frame, (H, W, 3) full-range R'G'B', u1 for 8 bits, else u2.

        Raises
        ------
        UsageError
            The frame does not fit the format, or the writer is closed.
        OSError
            The disk is full, the pipe is closed and the like; what was written so far is removed.
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


class PartialFile:
    """A file under a temporary name beside its target, which it replaces on `commit`.

    Attributes
    ----------
    target
        The final path, with symbolic links followed so that a link stays one.
    path
        The temporary path, an empty file from the start; its name begins with a dot and ends with ``.part``.

    Raises
    ------
    FileNotFoundError
        The folder of the target does not exist.
    """

    def __init__(self, target: Path) -> None:
        self.target = Path(os.path.realpath(target))
        check_parent(self.target)
        self.path = self._create()

    def _create(self) -> Path:
        attempt = 0
        while True:
            path = self.target.with_name(f".{self.target.name}.{os.getpid()}-{attempt}.part")
            try:
                path.open("xb").close()
            except FileExistsError:
                attempt += 1
            else:
                return path

    def commit(self) -> None:
        """Give the file its final name, replacing what stood there."""
        os.replace(self.path, self.target)

    def discard(self) -> None:
        """Remove the file; harmless when it is gone already."""
        self.path.unlink(missing_ok=True)


def check_parent(target: Path) -> None:
    """Refuse a target whose folder does not exist.

    Raises
    ------
    FileNotFoundError
        With a message that says to create it.
    """
    if not target.parent.is_dir():
        raise FileNotFoundError(f"the folder {target.parent} does not exist; create it first to write {target.name}")
