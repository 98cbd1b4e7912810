"""The codec: encoder and decoder drivers, settings and presets, rate control."""

from gsvc_ref.codec.decoder import Stream, decode, scaled_size
from gsvc_ref.codec.effects import Effects
from gsvc_ref.codec.encoder import encode
from gsvc_ref.codec.formats import video_format
from gsvc_ref.codec.report import EncodeReport, FrameReport, IncompleteEncodeError, Progress
from gsvc_ref.codec.settings import Settings

__all__ = [
    "Effects",
    "EncodeReport",
    "FrameReport",
    "IncompleteEncodeError",
    "Progress",
    "Settings",
    "Stream",
    "decode",
    "encode",
    "scaled_size",
    "video_format",
]
