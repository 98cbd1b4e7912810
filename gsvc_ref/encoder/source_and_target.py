"""The source of an encode, from which frames come, and its target, the file that the stream goes to."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from io import FileIO
from itertools import chain
from pathlib import Path
from typing import Any, BinaryIO, Final, Generic, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import Frame
from gsvc_base.checks import check_unmasked, described_type
from gsvc_base.errors import UsageError
from gsvc_base.files import NamingWriter, check_parent, opened_output, still_named, try_lock
from gsvc_ref.video import VideoFormat, VideoReader, VideoSource, open_video
from gsvc_ref.video.format import FrameRate, array_format, check_frame
from gsvc_ref.video.stream import PassingReader

Source = str | Path | BinaryIO | VideoSource | VideoReader | tuple[Iterable[Frame], VideoFormat] | Iterable[Frame]
Target = str | Path | BinaryIO
FrameT = TypeVar("FrameT")

DEFAULT_FRAME_RATE: Final = 25
"""Frames per second of arrays for which none is given."""


class FrameSource(PassingReader):
    """A source of frames that the caller has; what they raise is passed on as it is."""

    def __init__(self, frames: Iterable[Frame], video: VideoFormat) -> None:
        super().__init__()
        self.format, self._source = video, frames

    def _read(self) -> Iterator[Frame]:
        for number, frame in enumerate(self._source):
            check_unmasked(f"frame {number}", frame)
            try:
                check_frame(np.asarray(frame), self.format)
            except UsageError as error:
                raise UsageError(f"frame {number}: {error}") from None
            yield np.array(frame)  # the caller may fill the same array again


class SoundFrames(Generic[FrameT]):
    """The frames of a source up to its first fault, so that those read before it are still encoded."""

    def __init__(self, frames: Iterable[FrameT]) -> None:
        self._frames = frames
        self.fault: Exception | None = None  # what ended the frames early

    def __iter__(self) -> Iterator[FrameT]:
        frames = iter(self._frames)
        while True:
            try:
                frame = next(frames)
            except StopIteration:
                return
            except Exception as error:
                self.fault = error
                return
            yield frame

    def check(self) -> None:
        """Raise the fault of the source, if it has one."""
        if self.fault is not None:
            raise self.fault


@contextmanager
def opened_source(source: Source, frame_rate: FrameRate | None = None) -> Iterator[VideoReader]:
    """The source as a reader, closed at the end if it was opened here; a frame rate is for arrays alone."""
    if _is_arrays(source):
        yield _array_source(source, DEFAULT_FRAME_RATE if frame_rate is None else frame_rate)
        return
    if frame_rate is not None:
        raise UsageError(f"frame_rate is {frame_rate}, but the source states its own; it is for arrays alone")
    if isinstance(source, VideoReader):
        yield source
    elif isinstance(source, tuple) and len(source) == 2 and isinstance(source[1], VideoFormat):
        yield FrameSource(*source)
    elif isinstance(source, str | Path) or hasattr(source, "read") or hasattr(source, "open_video"):
        with open_video(cast("str | Path | BinaryIO | VideoSource", source)) as reader:
            yield reader
    else:
        raise UsageError(
            f"a {type(source).__name__} is not a source; give a path, an array (T, H, W, 3) of uint8 or uint16, an "
            f"iterable of frames (H, W, 3), a VideoReader, a Scene, or (frames, VideoFormat(...))"
        )


def _is_arrays(source: Any) -> bool:
    """Whether a source is an array, or an iterable of what should be arrays: nothing else that may be one."""
    with_format = isinstance(source, tuple) and len(source) == 2 and isinstance(source[1], VideoFormat)
    other = isinstance(source, str | bytes | bytearray | Path | VideoReader | Mapping) or with_format
    return hasattr(source, "__iter__") and not (other or hasattr(source, "read") or hasattr(source, "open_video"))


def _array_source(source: Any, frame_rate: FrameRate) -> FrameSource:
    """Frames without a format as a source; the first frame tells it, and each must be like the first."""
    if isinstance(source, np.ndarray) and source.ndim != 4:
        raise UsageError(f"the array has shape {source.shape}; a video is (T, H, W, 3){_remedy(source, 4)}")
    frames = iter(source)
    try:
        first = next(frames)
    except StopIteration:
        raise UsageError("there are no frames; give at least one") from None
    try:
        picture = np.asarray(first)
    except (TypeError, ValueError):
        picture = np.asarray(None)
    if picture.dtype.kind not in "biuf":
        raise UsageError(f"frame 0 is a {described_type(first)}; a frame is an array (H, W, 3) of uint8 or uint16")
    if picture.ndim != 3 or picture.shape[2] != 3:
        raise UsageError(f"frame 0 has shape {picture.shape}; a frame is (H, W, 3){_remedy(picture, 3)}")
    if picture.dtype not in (np.uint8, np.uint16):
        raise UsageError(f"frame 0 is {picture.dtype}; frames are uint8, or uint16 for 16 bits{_remedy(picture, 3)}")
    height, width = picture.shape[:2]
    count = len(source) if hasattr(source, "__len__") else None
    video = array_format(width, height, frame_rate, 8 * picture.dtype.itemsize)
    return FrameSource(chain([first], frames), replace(video, frame_count=count))


def _remedy(array: NDArray[Any], dimensions: int) -> str:
    """How an array that is nearly one of frames becomes one; a part of a sentence."""
    if array.ndim == dimensions and array.dtype.kind == "f":
        return ": if 1 is full scale, give np.rint(np.clip(frame, 0, 1) * 255).astype(np.uint8)"
    if dimensions == 4 and array.ndim == 3 and array.shape[2] == 3:
        return ": this is one frame, so give array[None]"
    if array.ndim == dimensions - 1:
        return ": of grey frames, give np.repeat(array[..., None], 3, axis=-1)"
    if array.ndim == dimensions and array.shape[-1] == 4:
        return ": leave alpha out, array[..., :3]"
    if array.ndim == dimensions and array.shape[-3] == 3:
        return ": channels come last, np.moveaxis(array, -3, -1)"
    return ""


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
    """A file that only ever grows, after its first write took the place of what it held."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, "ab")
        self.begun = False  # whether anything was written

    def write(self, data: Any) -> int:
        """Append."""
        if not self.begun:
            self.truncate(0)
            self.begun = True
        return super().write(data)


@contextmanager
def _live_file(path: Path) -> Iterator[BinaryIO]:
    """The file itself: its old bytes go at the first write, and a new file that stays empty is removed."""
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
