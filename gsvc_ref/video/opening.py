"""Opening what is read as a video, and what one is written to; each format's module is loaded when it is needed."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO, Protocol

from gsvc_base.errors import GsvcError, UsageError
from gsvc_base.files import STREAM_SUFFIX
from gsvc_ref.plugins import Target, file_reader, source_by_prefix, source_by_suffix, targets
from gsvc_ref.video import y4m
from gsvc_ref.video.alpha import Background, background_of
from gsvc_ref.video.format import VideoFormat
from gsvc_ref.video.stream import NO_EXTRAS, Extras, VideoReader, VideoWriter
from gsvc_ref.video.y4m_header import Y4M_SIGNATURE


class VideoSource(Protocol):
    """An object that can be opened as a video though it is no file, such as a scene of gsvc_lab."""

    def open_video(self) -> VideoReader:
        """A new reader of its frames."""


def open_video(
    source: str | Path | BinaryIO | VideoSource, *, background: str | Sequence[int] | None = None
) -> VideoReader:
    """Open a source of frames; what it holds decides how it is read, and its name only where a plugin knows it.

    A source is ``-`` for y4m on standard input; a folder of PNG or JPEG files; a file; with gsvc_lab, ``scene:NAME``
    for a built-in scene, a ``.toml`` file that describes one, or a Scene; or a binary file at its start (one that
    cannot seek must hold y4m), which stays open. Files that are neither y4m nor pictures are read by gsvc_tools.

    `background` is what transparent pictures are shown on: a color by its name in CSS, as ``#rrggbb``, or three numbers
    0..255. Without one a frame that is not opaque is refused.

    A UsageError refuses a GSVC stream, a scene that cannot be, a background that is no color, and what needs gsvc_tools
    or PyAV where that is missing; a GsvcError says that the source cannot be read as video.
    """
    if source == "-":
        return y4m.Y4mReader(sys.stdin.buffer, "standard input")
    if isinstance(source, str) and (named := source_by_prefix(source)) is not None:
        drawn: VideoReader = named.open(source)
        return drawn
    if isinstance(source, str | Path):
        return _open_path(Path(source), background_of(background))
    if hasattr(source, "open_video"):
        return source.open_video()
    return _open_file(source, background_of(background))


def _open_path(path: Path, background: Background | None) -> VideoReader:
    name = str(path)
    if not path.exists():
        raise FileNotFoundError(f"there is no file {path}; check the name of the input")
    if path.is_dir():
        from gsvc_ref.video.images import open_folder

        return open_folder(path, background)
    if path.suffix.lower() == STREAM_SUFFIX:
        raise UsageError(f"{path} is a GSVC stream, not a source video: decode it first (gsvc decode {path} OUT.y4m)")
    if not path.is_file():  # a pipe or device: reading its first bytes would take them away
        return y4m.Y4mReader(path, name)
    with path.open("rb") as file:
        magic = file.read(len(Y4M_SIGNATURE))
    if not magic:
        raise GsvcError("malformed", f"{path} is empty; give a video file")
    suffix = path.suffix.lower()
    if (named := source_by_suffix(name)) is not None:
        drawn: VideoReader = named.open(name)
        return drawn
    if magic == Y4M_SIGNATURE or suffix == ".y4m":
        return y4m.Y4mReader(path, name)
    from gsvc_ref.video import images, png

    if magic.startswith(png.PNG_SIGNATURE) or suffix in images.SUFFIXES:
        return images.ImageReader([path], name, background)
    return _open_other(path, name, background)


def _open_file(file: BinaryIO, background: Background | None) -> VideoReader:
    name = str(getattr(file, "name", "the input"))
    if not file.seekable():
        return y4m.Y4mReader(file, name)
    start = file.tell()
    magic = file.read(len(Y4M_SIGNATURE))
    file.seek(start)
    if not magic:
        raise GsvcError("malformed", f"{name} is empty; give a video file")
    if magic == Y4M_SIGNATURE:
        return y4m.Y4mReader(file, name)
    from gsvc_ref.video import images, png

    if magic.startswith((png.PNG_SIGNATURE, images.JPEG_SIGNATURE)):
        return images.ImageReader([file.read()], name, background)
    return _open_other(file, name, background)


def _open_other(file: Path | BinaryIO, name: str, background: Background | None) -> VideoReader:
    open_file = file_reader()
    if open_file is None:
        raise UsageError(
            f"{name} is neither y4m nor a picture, and other formats need gsvc_tools, which comes with gsvc_ref: "
            "pip install ."
        )
    reader: VideoReader = open_file(file, name, background)
    return reader


def takes_sound(target: str | Path | BinaryIO) -> bool:
    """Whether a target has a place for sound."""
    if not isinstance(target, str | Path) or Path(target).is_dir():
        return False
    found = _target_by_suffix(Path(target).suffix)
    return found is not None and found.takes_sound


def _target_by_suffix(suffix: str) -> Target | None:
    return next((target for target in targets() if suffix.lower() in target.suffixes), None)


def open_writer(target: str | Path | BinaryIO, format: VideoFormat, *, extras: Extras = NO_EXTRAS) -> VideoWriter:
    """Open a target for frames; it is complete, and gets its name, only when it is closed.

    A target is ``-`` for y4m on standard output; a binary file, which takes y4m; or a path: ``.y4m``; ``.png`` for a
    single frame; with gsvc_tools ``.mp4``, ``.mkv``, ``.mov`` or ``.webm`` for a lossy copy to look at (needs PyAV),
    and ``.gif`` or ``.webp`` for an animation; an existing folder, or a name without a suffix, for numbered PNG files.
    A pipe or device takes y4m. y4m is written in the format that frames must fit, so replace ``chroma_format`` or
    ``color`` to choose. A UsageError refuses an unknown suffix, a folder with pictures, and a format or sound that
    cannot be written.
    """
    if extras.audio_from is not None and not takes_sound(target):
        raise UsageError(f"{target} has no place for sound; write .mp4, .mkv, .mov or .webm")
    if target == "-":
        return y4m.Y4mWriter(sys.stdout.buffer, format)
    if not isinstance(target, str | Path):
        return y4m.Y4mWriter(target, format)
    path = Path(target)
    suffix = path.suffix.lower()
    if not path.is_dir() and (suffix == ".y4m" or (path.exists() and not path.is_file())):
        return y4m.Y4mWriter(path, format)
    from gsvc_ref.video import images

    if path.is_dir() or (suffix == "" and not path.exists()):
        return images.ImageFolderWriter(path, format)
    if suffix == ".png":
        return images.ImageFileWriter(path, format)
    if (found := _target_by_suffix(suffix)) is not None:
        writer: VideoWriter = found.open(path, format, extras)
        return writer
    known = ", ".join([".y4m", ".png", *(suffix for target in targets() for suffix in target.suffixes)])
    raise UsageError(f"cannot tell what to write as {path}; give a name that ends in {known}, a folder, or - for y4m")
