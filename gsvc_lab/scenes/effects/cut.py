"""From one frame to the next, another picture."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

from gsvc_base.arrays import F4
from gsvc_lab.scenes.base import Base
from gsvc_lab.scenes.canvas import Canvas
from gsvc_lab.scenes.effect import TransitionEffect
from gsvc_lab.scenes.parameters import frame_number, parameter, table
from gsvc_lab.scenes.paths import begun


@dataclass(frozen=True)
class Cut(TransitionEffect):
    """Puts another base in the place of what was before; the camera goes on."""

    SUMMARY: ClassVar[str] = "A scene cut: from one frame to the next another picture."

    to: Base = parameter(table(Base), "what is seen afterwards")
    at: int = parameter(frame_number(), "the first frame that shows it")

    def replace(self, picture: Callable[[], F4], see: Callable[[Base], F4], canvas: Canvas, time: float) -> F4:
        """The picture of one side; the other is not drawn."""
        return see(self.to) if begun(time, self.at) else picture()

    def shown(self, bases: tuple[Base, ...], canvas: Canvas, time: float) -> tuple[Base, ...]:
        """One side or the other."""
        return (self.to,) if begun(time, self.at) else bases

    def truth(self, canvas: Canvas, time: float) -> dict[str, Any]:
        """``after``: whether this frame shows what comes after the cut."""
        return {"after": begun(time, self.at)}


EFFECT = Cut
