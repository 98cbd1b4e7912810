"""The source of an encode, from which frames come, and its target, the file that the stream goes to."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from io import FileIO
from pathlib import Path
from typing import Any, BinaryIO, cast

import numpy as np
from numpy.typing import NDArray

from gsvc_ref.errors import UsageError
from gsvc_ref.files import NamingWriter, check_parent, opened_output, still_named, try_lock
from gsvc_ref.video import VideoFormat, VideoReader, VideoSource, open_video
from gsvc_ref.video.format import check_frame

Frame = NDArray[np.unsignedinteger[Any]]
Source = str | Path | BinaryIO | VideoSource | VideoReader | tuple[Iterable[Frame], VideoFormat]
Target = str | Path | BinaryIO


class FrameSource(VideoReader):
    """A source of frames that the caller has; what they raise is passed on as it is."""

    def __init__(self, frames: Iterable[Frame], video: VideoFormat) -> None:
        super().__init__()
        self.format, self._source = video, frames

    def _read(self) -> Iterator[Frame]:
        for number, frame in enumerate(self._source):
            try:
                check_frame(np.asarray(frame), self.format)
            except UsageError as error:
                raise UsageError(f"frame {number}: {error}") from None
            yield np.array(frame)  # the caller may fill the same array again

    def __next__(self) -> Frame:
        if self._frames is None:
            self._frames = self._read()
        return next(self._frames)


@contextmanager
def opened_source(source: Source) -> Iterator[VideoReader]:
    """The source as a reader, closed at the end if it was opened here."""
    if isinstance(source, VideoReader):
        yield source
    elif isinstance(source, tuple) and len(source) == 2 and isinstance(source[1], VideoFormat):
        yield FrameSource(*source)
    elif not isinstance(source, str | Path) and not hasattr(source, "read") and not hasattr(source, "open_video"):
        raise UsageError(
            f"a {type(source).__name__} is no source; give a path, a VideoReader, a Scene, or frames with their "
            f"format: (frames, VideoFormat(...))"
        )
    else:
        with open_video(source) as reader:
            yield reader


@contextmanager
def opened_target(target: Target, *, live: bool) -> Iterator[BinaryIO]:
    """The file to write to; a path stands under its own name only when the block has ended well, unless `live`."""
    in_place = live and isinstance(target, str | Path) and str(target) != "-" and not _is_device(Path(target))
    with _live_file(Path(str(target))) if in_place else opened_output(target) as file:
        yield file


def is_file(target: Target) -> bool:
    """Whether a target is a file, or will be, and no pipe or device, which may never take what is written."""
    return (
        isinstance(target, str | Path) and str(target) != "-" and (Path(target).is_file() or not Path(target).exists())
    )


def same_file(source: Source, target: Target) -> bool:
    """Whether both are paths of one file."""
    if not (isinstance(source, str | Path) and isinstance(target, str | Path)):
        return False
    return Path(source).is_file() and Path(target).is_file() and Path(source).samefile(target)


def _is_device(path: Path) -> bool:
    return path.exists() and not path.is_file()


class LiveFile(FileIO):
    """A file that only ever grows, after its first write took the place of what it held.

    Attributes
    ----------
    begun
        Whether anything was written.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path, "ab")
        self.begun = False

    def write(self, data: Any) -> int:
        """Append."""
        if not self.begun:
            self.truncate(0)
            self.begun = True
        return super().write(data)


@contextmanager
def _live_file(path: Path) -> Iterator[BinaryIO]:
    """The file itself; an old one loses its contents at the first write, and one without any is not left behind.

    Raises
    ------
    UsageError
        Another encode is writing to it.
    """
    check_parent(path)
    existed = path.exists()
    with _locked(path) as file:
        try:
            yield cast(BinaryIO, NamingWriter(cast(BinaryIO, file), str(path)))
        finally:
            if not (file.begun or existed):
                path.unlink(missing_ok=True)


def _locked(path: Path) -> LiveFile:
    """The file with a lock that lasts until it is closed, where files can be locked: two encodes would mix."""
    while True:
        file = LiveFile(path)
        locked = try_lock(cast(BinaryIO, file))
        if locked is False:
            file.close()
            raise UsageError(f"another encode writes to {path}: wait for its end, or give another output")
        if locked is None or still_named(cast(BinaryIO, file), path):
            return file
        file.close()  # the one who had locked it has just removed it
