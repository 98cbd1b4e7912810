"""The shutter is open for a part of the time between frames, in which what moves is smeared."""

from dataclasses import dataclass
from typing import Any, ClassVar

from gsvc_lab.scenes.canvas import Canvas
from gsvc_lab.scenes.effect import ShutterEffect
from gsvc_lab.scenes.parameters import number, parameter, whole


@dataclass(frozen=True)
class MotionBlur(ShutterEffect):
    """Makes each frame the mean of moments spread evenly around its time."""

    SUMMARY: ClassVar[str] = "Motion blur: the shutter stays open, and what moves is smeared along its way."

    shutter: float = parameter(number(0, 1), "how long it is open, as a part of the time between two frames", 0.5)
    moments_: int = parameter(whole(1, 64), "how many moments a frame is the mean of", 8)

    def moments(self, frame: int) -> tuple[float, ...]:
        """The middles of equal parts of the time in which the shutter is open; their mean is the frame's own time."""
        count = self.moments_
        return tuple(frame + self.shutter * ((part + 0.5) / count - 0.5) for part in range(count))

    def truth(self, canvas: Canvas, time: float) -> dict[str, Any]:
        """``shutter``: how long it is open, in frames; what else is known is of the middle of that time."""
        return {"shutter": self.shutter}


EFFECT = MotionBlur
