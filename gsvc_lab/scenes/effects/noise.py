"""Noise of a sensor: independent in every sample, new in every frame."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from gsvc_base.arrays import F4
from gsvc_base.draws import Draws
from gsvc_lab.scenes.canvas import Canvas
from gsvc_lab.scenes.effect import SensorEffect
from gsvc_lab.scenes.parameters import number, parameter


@dataclass(frozen=True)
class Noise(SensorEffect):
    """Read noise and shot noise: Gaussian, its variance grows with the light.

    A sample v gets the standard deviation sqrt(read^2 + shot^2 v); the result is clipped to 0 to 1.
    """

    SUMMARY: ClassVar[str] = "Every sample of every frame gets noise of its own, more of it where there is more light."

    read: float = parameter(number(0, 1), "standard deviation in the dark; 1 = full scale", 0.010)
    shot: float = parameter(number(0, 1), "standard deviation of what the light adds, at full scale", 0.030)

    def develop(self, picture: F4, canvas: Canvas, frame: int, rng: Draws) -> F4:
        """The picture with noise, a new array."""
        drawn = rng.standard_normal(picture.shape, np.float32)
        return np.asarray(np.clip(picture + self.sigma(picture) * drawn, 0, 1), np.float32)

    def sigma(self, picture: F4) -> F4:
        """The standard deviation of what each sample of a picture gets, before clipping, (H, W, 3) f4."""
        return np.asarray(np.sqrt(self.read * self.read + self.shot * self.shot * np.clip(picture, 0, 1)), np.float32)

    def truth(self, canvas: Canvas, time: float) -> dict[str, Any]:
        """``read`` and ``shot``: the standard deviation of a sample v is sqrt(read^2 + shot^2 v) before clipping."""
        return {"read": self.read, "shot": self.shot}


EFFECT = Noise
