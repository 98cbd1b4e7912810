"""The frame that a scene is drawn on."""

from dataclasses import dataclass

import numpy as np

from gsvc_base.arrays import F8


@dataclass(frozen=True)
class Canvas:
    """The clip that effects are part of, as far as they may know it."""

    width: int  # Size of a frame in pixels
    height: int
    frames: int  # number of frames

    @property
    def shorter(self) -> int:
        """The shorter side in pixels, of which lengths are fractions."""
        return min(self.width, self.height)

    def centres(self) -> tuple[F8, F8]:
        """The centres of the pixels; see `centres`."""
        return centres(self.width, self.height)


def centres(width: int, height: int) -> tuple[F8, F8]:
    """The centres of a frame's pixels, x and y in pixels, as (1, width) and (height, 1) f8: (0.5, 0.5) is the first."""
    x = np.arange(width, dtype=np.float64)[None, :]
    y = np.arange(height, dtype=np.float64)[:, None]
    return x + 0.5, y + 0.5
