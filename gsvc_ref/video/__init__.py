"""Video in and out: y4m, pictures, and by plug-ins other files; frames are always full-range R'G'B'."""

from typing import TYPE_CHECKING, Final

from gsvc_ref._lazy import lazily

if TYPE_CHECKING:
    from gsvc_ref.video.color import to_planes, to_rgb
    from gsvc_ref.video.format import ChromaFormat, ColorDescription, Frame, VideoFormat
    from gsvc_ref.video.opening import VideoSource, open_video, open_writer
    from gsvc_ref.video.png import decode_png, encode_png
    from gsvc_ref.video.stream import VideoReader, VideoWriter

__all__ = [
    "ChromaFormat",
    "ColorDescription",
    "Frame",
    "VideoFormat",
    "VideoReader",
    "VideoSource",
    "VideoWriter",
    "decode_png",
    "encode_png",
    "open_video",
    "open_writer",
    "to_planes",
    "to_rgb",
]

_HOMES: Final = {
    "ChromaFormat": "format",
    "ColorDescription": "format",
    "Frame": "format",
    "VideoFormat": "format",
    "VideoReader": "stream",
    "VideoSource": "opening",
    "VideoWriter": "stream",
    "decode_png": "png",
    "encode_png": "png",
    "open_video": "opening",
    "open_writer": "opening",
    "to_planes": "color",
    "to_rgb": "color",
}
"""The module of each name."""

__getattr__, __dir__ = lazily(__name__, _HOMES)
