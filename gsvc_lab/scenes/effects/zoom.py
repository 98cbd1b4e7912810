"""The camera moves in or out."""

from dataclasses import dataclass, replace
from typing import ClassVar

from gsvc_base.portable import power
from gsvc_lab.scenes.camera import Camera
from gsvc_lab.scenes.canvas import Canvas
from gsvc_lab.scenes.effect import CameraEffect
from gsvc_lab.scenes.parameters import choice, frame_number, number, pair, parameter
from gsvc_lab.scenes.paths import PACES, begun, check_order, progress


@dataclass(frozen=True)
class Zoom(CameraEffect):
    """Changes how much of the picture is seen, by the same factor in equal times."""

    SUMMARY: ClassVar[str] = "The camera zooms: everything moves to or from one point, faster the farther it is."

    to: float = parameter(number(0.01, 4), "how much of the picture is seen in the end; 1 is the most that fits")
    from_: float | None = parameter(number(0.01, 4), "how much in the beginning; else as before", None)
    at: tuple[float, float] | None = parameter(pair(0, 1), "the point of the picture it looks at; else as before", None)
    start: int = parameter(frame_number(), "the last frame before it moves", 0)
    end: int | None = parameter(frame_number(beyond=True), "the frame with which it arrives; else the last", None)
    pace: str = parameter(choice(*PACES), "even, or gentle at both ends", "even")

    def __post_init__(self) -> None:
        super().__post_init__()
        check_order(self.start, self.end)

    def move(self, camera: Camera, canvas: Canvas, time: float) -> Camera:
        """The camera at a time; before the start that of the effects before."""
        if not begun(time, self.start):
            return camera
        share = progress(time, self.start, self.end, canvas.frames, self.pace)
        span = camera.span if self.from_ is None else self.from_
        x, y = self.at or (camera.x, camera.y)
        return replace(camera, x=x, y=y, span=span * power(self.to / span, share))


EFFECT = Zoom
