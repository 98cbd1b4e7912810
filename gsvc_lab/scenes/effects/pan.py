"""The camera moves sideways, up or down by fractions of a pixel."""

from dataclasses import dataclass, replace
from typing import ClassVar

from gsvc_lab.scenes.camera import Camera
from gsvc_lab.scenes.canvas import Canvas
from gsvc_lab.scenes.effect import CameraEffect
from gsvc_lab.scenes.parameters import choice, frame_number, number, pair, parameter
from gsvc_lab.scenes.paths import PACES, begun, check_order, progress


@dataclass(frozen=True)
class Pan(CameraEffect):
    """Moves the point of the picture that the camera looks at along a straight line."""

    SUMMARY: ClassVar[str] = "The camera pans: everything moves the same way, by fractions of a pixel."

    to: tuple[float, float] = parameter(pair(0, 1), "the point it looks at in the end, as fractions of the picture")
    from_: tuple[float, float] | None = parameter(pair(0, 1), "the one in the beginning; else where it is", None)
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
        x, y = self.from_ or (camera.x, camera.y)
        span = camera.span if self.span is None else self.span
        return replace(camera, x=x + (self.to[0] - x) * share, y=y + (self.to[1] - y) * share, span=span)


EFFECT = Pan
