"""Clips so small that an experiment on them takes a blink."""

from collections.abc import Iterator
from fractions import Fraction
from itertools import islice

import numpy as np

from gsvc_lab.clips import Clip
from gsvc_ref.video import ColorDescription, VideoFormat

RGB = ColorDescription(primaries=1, transfer=13, matrix=0, full_range=True, chroma_location=0)


def tiny_clip(name: str = "tiny", frames: int = 4, cut: int | None = None, width: int = 32, height: int = 24) -> Clip:
    """Moving waves; before the frame `cut`, others, which are finer."""
    y, x = np.mgrid[:height, :width]

    def draw() -> Iterator[np.ndarray]:
        for t in range(frames):
            coarse = cut is None or t >= cut
            wave = np.sin((x + t) / 3) * np.cos(y / 4) if coarse else np.sin((x + 3 * y + t) / 2)
            tint = (200, 120, 60) if coarse else (30, 160, 220)
            yield np.stack([c * (0.5 + 0.4 * wave) for c in tint], axis=-1).astype(np.uint8)

    video = VideoFormat(width, height, Fraction(25), 8, "rgb", RGB, frame_count=frames)
    return Clip(name, f"the clip {name}", video, lambda start: islice(draw(), start, None))


def silent(sentence: str) -> None:
    """Say nothing."""
