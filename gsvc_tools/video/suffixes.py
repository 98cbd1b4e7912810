"""The ends of the names of video files that gsvc_tools writes."""

from typing import Final

CONTAINERS: Final = {".mp4": "mp4", ".mkv": "matroska", ".mov": "mov", ".webm": "webm"}
"""The name that FFmpeg has for the container of each."""
ANIMATIONS: Final = (".gif", ".webp")
