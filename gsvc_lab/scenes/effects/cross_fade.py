"""One picture fades while another appears in its place."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from gsvc_base.arrays import F4
from gsvc_lab.scenes.base import Base
from gsvc_lab.scenes.canvas import Canvas
from gsvc_lab.scenes.effect import TransitionEffect
from gsvc_lab.scenes.parameters import frame_number, parameter, table
from gsvc_lab.scenes.paths import check_order, progress


@dataclass(frozen=True)
class CrossFade(TransitionEffect):
    """Mixes what was before with another base, in equal steps of R'G'B'; the camera goes on."""

    SUMMARY: ClassVar[str] = "A cross-fade: one picture fades while another appears in its place."

    to: Base = parameter(table(Base), "what is seen in the end")
    start: int = parameter(frame_number(), "the last frame without it")
    end: int = parameter(frame_number(beyond=True), "the first frame with nothing else")

    def __post_init__(self) -> None:
        super().__post_init__()
        check_order(self.start, self.end)

    def share(self, canvas: Canvas, time: float) -> float:
        """The share of the other base in the mixture, 0..1."""
        return progress(time, self.start, self.end, canvas.frames)

    def replace(self, picture: Callable[[], F4], see: Callable[[Base], F4], canvas: Canvas, time: float) -> F4:
        """The mixture, or one side, and the other is not drawn."""
        share = np.float32(self.share(canvas, time))
        if share == 0:
            return picture()
        return see(self.to) if share == 1 else picture() * (1 - share) + see(self.to) * share

    def shown(self, bases: tuple[Base, ...], canvas: Canvas, time: float) -> tuple[Base, ...]:
        """Both sides while they are mixed."""
        share = self.share(canvas, time)
        return (*(bases if share < 1 else ()), *((self.to,) if share > 0 else ()))

    def truth(self, canvas: Canvas, time: float) -> dict[str, Any]:
        """``share``: of the other base in the mixture, 0..1."""
        return {"share": self.share(canvas, time)}


EFFECT = CrossFade
