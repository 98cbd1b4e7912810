"""The camera rolls about the line of sight."""

import math
from dataclasses import dataclass, replace
from typing import ClassVar

from gsvc_lab.scenes.camera import Camera
from gsvc_lab.scenes.canvas import Canvas
from gsvc_lab.scenes.effect import CameraEffect
from gsvc_lab.scenes.parameters import choice, frame_number, number, parameter
from gsvc_lab.scenes.paths import PACES, begun, check_order, progress


@dataclass(frozen=True)
class Rotation(CameraEffect):
    """Turns the camera clockwise, so that the picture turns the other way."""

    SUMMARY: ClassVar[str] = "The camera rolls: everything turns about the middle of the frame."

    to: float = parameter(number(-3600, 3600), "degrees clockwise in the end")
    from_: float | None = parameter(number(-3600, 3600), "degrees in the beginning; else as before", None)
    span: float | None = parameter(number(0.01, 4), "how much of the picture it sees; else as before", None)
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
        first = camera.roll if self.from_ is None else math.radians(self.from_)
        span = camera.span if self.span is None else self.span
        return replace(camera, roll=first + (math.radians(self.to) - first) * share, span=span)


EFFECT = Rotation
