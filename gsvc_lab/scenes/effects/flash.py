"""Some frames are suddenly brighter, as by a photographer's flash."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from gsvc_base.arrays import F4
from gsvc_lab.scenes.canvas import Canvas
from gsvc_lab.scenes.effect import LightEffect
from gsvc_lab.scenes.parameters import MAX_FRAMES, flag, frame_number, number, parameter, several, whole
from gsvc_lab.scenes.paths import frame_at


@dataclass(frozen=True)
class Flash(LightEffect):
    """For some frames a sample v becomes gain v + offset, clipped to 0 to 1; no other frame changes."""

    SUMMARY: ClassVar[str] = "For some frames everything is suddenly brighter, and then as before."

    at: tuple[int, ...] = parameter(several(frame_number(), 1, 1000), "the first frame of each flash")
    frames: int = parameter(whole(1, MAX_FRAMES), "how many frames a flash lasts", 2)
    gain: float = parameter(number(0, 100), "what samples are multiplied by", 1.6)
    offset: float = parameter(number(-1, 1), "what is then added; 1 = full scale", 0.15)
    fading: bool = parameter(flag(), "whether it weakens evenly over its frames instead of ending at once", False)

    def light(self, picture: F4, canvas: Canvas, time: float) -> F4:
        """The picture in the flash's light; the same array where there is none."""
        gain, offset = self.gain_and_offset(time)
        if (gain, offset) == (1.0, 0.0):
            return picture
        return np.asarray(np.clip(picture * gain + offset, 0, 1), np.float32)

    def truth(self, canvas: Canvas, time: float) -> dict[str, Any]:
        """``gain`` and ``offset``: a sample v becomes gain v + offset before it is clipped."""
        gain, offset = self.gain_and_offset(time)
        return {"gain": gain, "offset": offset}

    def gain_and_offset(self, time: float) -> tuple[float, float]:
        """The values that hold at a time: (1, 0) where there is no flash; the strongest where several meet."""
        since = [frame_at(time) - first for first in self.at]
        strength = max(
            (1 - number / self.frames if self.fading else 1.0 for number in since if 0 <= number < self.frames),
            default=0.0,
        )
        return 1 + strength * (self.gain - 1), strength * self.offset


EFFECT = Flash
