"""The light changes slowly: a ramp from value to value, or a wave."""

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from gsvc_base.arrays import F4
from gsvc_base.portable import sin
from gsvc_lab.scenes.canvas import Canvas
from gsvc_lab.scenes.effect import LightEffect
from gsvc_lab.scenes.keyframes import check_keys, frames, key_before, value_at, values
from gsvc_lab.scenes.parameters import choice, number, parameter


@dataclass(frozen=True)
class Brightness(LightEffect):
    """A sample v becomes gain v + offset, clipped to 0 to 1; both change over time."""

    SUMMARY: ClassVar[str] = "Everything grows slowly brighter or darker, in a ramp or a wave."

    gain: tuple[float, ...] = parameter(values(0, 100), "what samples are multiplied by, over time", (1.0,))
    offset: tuple[float, ...] = parameter(values(-1, 1), "what is then added, over time; 1 = full scale", (0.0,))
    at: tuple[float, ...] = parameter(
        frames(), "the frames at which gain and offset hold; without it, evenly over the whole clip", ()
    )
    pace: str = parameter(choice("even", "gentle"), "how they change: evenly or gently", "even")
    swing: float = parameter(number(0, 1), "how far a sine wave moves the gain up and down, as a part of it", 0.0)
    period: float = parameter(number(0.1, 1e6), "frames of that wave", 24.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_keys(self.at, gain=self.gain, offset=self.offset)

    def light(self, picture: F4, canvas: Canvas, time: float) -> F4:
        """The picture in the light of a time; the same array where it is unchanged."""
        gain, offset = self.gain_and_offset(canvas, time)
        if (gain, offset) == (1.0, 0.0):
            return picture
        return np.asarray(np.clip(picture * gain + offset, 0, 1), np.float32)

    def truth(self, canvas: Canvas, time: float) -> dict[str, Any]:
        """``gain`` and ``offset``: a sample v becomes gain v + offset before it is clipped."""
        gain, offset = self.gain_and_offset(canvas, time)
        return {"gain": gain, "offset": offset}

    def gain_and_offset(self, canvas: Canvas, time: float) -> tuple[float, float]:
        """The values that hold at a time."""
        count = len(self.at) or max(len(self.gain), len(self.offset))
        key, part = key_before(self.at, count, canvas, time, self.pace)
        wave = 1 + self.swing * sin(2 * math.pi * time / self.period)
        return value_at(self.gain, key, part) * wave, value_at(self.offset, key, part)


EFFECT = Brightness
