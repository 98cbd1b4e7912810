"""Opening the video files that gsvc_tools reads and writes; each format's module is loaded when it is needed."""

from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, Final

from gsvc_ref.plugins import Target
from gsvc_tools.video.suffixes import ANIMATIONS, CONTAINERS

if TYPE_CHECKING:
    from gsvc_ref.video.alpha import Background
    from gsvc_ref.video.format import VideoFormat
    from gsvc_ref.video.stream import Extras, VideoReader, VideoWriter


def open_file(file: Path | BinaryIO, name: str, background: "Background | None" = None) -> "VideoReader":
    """A reader of a file in a format that FFmpeg knows, or of an animated WebP, which Pillow reads."""
    from gsvc_tools.video.webp import AnimatedWebpReader, picture_delays

    if (delays := picture_delays(file)) is not None:
        return AnimatedWebpReader(file, name, delays, background)
    from gsvc_tools.video.libav import LibavReader

    return LibavReader(file, name, background)


def _open_copy(path: Path, video: "VideoFormat", extras: "Extras") -> "VideoWriter":
    from gsvc_tools.video.libav_writer import LibavWriter

    return LibavWriter(path, video, extras)


def _open_animation(path: Path, video: "VideoFormat", extras: "Extras") -> "VideoWriter":
    from gsvc_tools.video.animation import AnimationWriter

    return AnimationWriter(path, video, extras)


TARGETS: Final = (
    Target(tuple(CONTAINERS), takes_sound=True, open=_open_copy),
    Target(ANIMATIONS, takes_sound=False, open=_open_animation),
)
