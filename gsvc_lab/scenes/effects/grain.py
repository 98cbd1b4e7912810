"""Grain of a film: clumps larger than a pixel, strongest in the middle tones, new in every frame."""

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Final

import numpy as np

from gsvc_base.arrays import F4, F8
from gsvc_base.constants import LUMA_WEIGHTS
from gsvc_base.draws import Draws
from gsvc_lab.scenes.canvas import Canvas
from gsvc_lab.scenes.effect import SensorEffect
from gsvc_lab.scenes.parameters import number, parameter
from gsvc_lab.scenes.sampling import correlated, gaussian

_KR, _KB = LUMA_WEIGHTS[1]  # of Rec. ITU-R BT.709
_LUMA: Final = np.array([_KR, 1 - _KR - _KB, _KB], np.float32)
_LEAST: Final = 0.25  # of the strength remains in black and white


@dataclass(frozen=True)
class Grain(SensorEffect):
    """Film grain: Gaussian noise, smoothed to clumps, whose strength follows the luma Y of the picture.

    Its standard deviation is strength (1/4 + 3/4 * 4 Y (1 - Y)), and its correlation at a distance d exp(-d^2 / 4
    size^2); the result is clipped to 0 to 1.
    """

    SUMMARY: ClassVar[str] = "Every frame gets clumps of grain of its own, strongest in the middle tones."

    strength: float = parameter(number(0, 1), "standard deviation in the middle tones; 1 = full scale", 0.06)
    size: float = parameter(number(1e-4, 0.1), "size of a clump, as a fraction of the frame's shorter side", 0.004)
    color: float = parameter(number(0, 1), "what part of its variance differs between red, green and blue", 0.2)

    def develop(self, picture: F4, canvas: Canvas, frame: int, rng: Draws) -> F4:
        """The picture with grain, a new array."""
        layers = rng.standard_normal((*picture.shape[:2], 4))  # one for all colours, one for each
        kernel = self.kernel(canvas)
        for axis in (0, 1):
            layers = correlated(layers, kernel, axis, "wrap")
        grain = np.sqrt(1 - self.color) * layers[..., :1] + np.sqrt(self.color) * layers[..., 1:]
        return np.asarray(np.clip(picture + self.sigma(picture) * grain, 0, 1), np.float32)

    def kernel(self, canvas: Canvas) -> F8:
        """(K,) f8 Gaussian whose squares add up to 1, so that smoothing along an axis keeps the variance."""
        deviation = self.size * canvas.shorter
        taps = gaussian(deviation, max(math.ceil(4 * deviation), 1))
        return np.asarray(taps / math.sqrt(math.fsum(taps * taps)))

    def sigma(self, picture: F4) -> F4:
        """The standard deviation of what each pixel of a picture gets, before clipping, (H, W, 1) f4."""
        red, green, blue = (picture[..., channel] * _LUMA[channel] for channel in range(3))
        luma = np.clip(red + green + blue, 0, 1)[..., None]
        return np.asarray(self.strength * (_LEAST + (1 - _LEAST) * 4 * luma * (1 - luma)), np.float32)

    def truth(self, canvas: Canvas, time: float) -> dict[str, Any]:
        """``strength``: the standard deviation where luma is 1/2; ``size``: that of the smoothing in pixels."""
        return {"strength": self.strength, "size": self.size * canvas.shorter}


EFFECT = Grain
