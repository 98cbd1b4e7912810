"""The encoder: what it does with each frame of a video, its settings and presets, and what it reports."""

from gsvc_ref.encoder.effects import Effects
from gsvc_ref.encoder.encode import encode
from gsvc_ref.encoder.report import EncodeReport, FrameReport, IncompleteEncodeError, Progress
from gsvc_ref.encoder.settings import Settings

__all__ = [
    "Effects",
    "EncodeReport",
    "FrameReport",
    "IncompleteEncodeError",
    "Progress",
    "Settings",
    "encode",
]
