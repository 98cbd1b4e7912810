"""A circle, ball, rectangle, ellipse, polygon or star that moves, turns, grows and deforms in front."""

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Final

import numpy as np

from gsvc_base.arrays import F4, F8
from gsvc_lab.scenes.canvas import Canvas
from gsvc_lab.scenes.distances import centres_in, inside, window
from gsvc_lab.scenes.effect import ObjectEffect
from gsvc_lab.scenes.keyframes import check_keys, frames, is_shown, key_before, places, value_at, values
from gsvc_lab.scenes.outlines import (
    RECTANGLE,
    ROUND_POINTS,
    Corners,
    Pose,
    corner_bounds,
    corner_distance,
    divided,
    regular_polygon,
    round_bounds,
    round_distance,
    star,
)
from gsvc_lab.scenes.parameters import (
    ParameterError,
    choice,
    flag,
    frame_number,
    number,
    pair,
    parameter,
    several,
    whole,
)
from gsvc_lab.scenes.parameters import color as rgb
from gsvc_lab.scenes.paths import check_order
from gsvc_lab.scenes.shapes import ball_colors

_ROUND: Final = ("circle", "ball", "ellipse")
_PIECES: Final = 12  # of a side that bulges


@dataclass(frozen=True)
class Shape(ObjectEffect):
    """A shape in front of all that stands before it in the description, with its edge antialiased by distance."""

    SUMMARY: ClassVar[str] = (
        "A shape moves, turns, grows or deforms in front, appears and vanishes, and hides what is behind it."
    )

    form: str = parameter(
        choice("circle", "ball", "rectangle", "ellipse", "polygon", "star"), "its form; a ball is lit from upper left"
    )
    color: tuple[float, float, float] = parameter(rgb(), "its colour", (0.90, 0.35, 0.15))
    path: tuple[tuple[float, float], ...] = parameter(
        places(), "where its centre is, as fractions of the frame's width and height: one place, or one for each of at",
        ((0.5, 0.5),),
    )  # fmt: skip
    at: tuple[float, ...] = parameter(
        frames(), "the frames at which path, scale and angle hold; without it, evenly over the whole clip", ()
    )
    pace: str = parameter(
        choice("even", "gentle", "bouncing", "jump"),
        "how it gets there: evenly, gently at both ends, thrown, or all at once", "even",
    )  # fmt: skip
    bounce: float = parameter(number(0, 10), "how high it is thrown, in shorter sides of the frame", 0.3)
    repeat: bool = parameter(flag(), "whether it starts again from the first place when it comes to the last", False)
    width: float = parameter(number(1e-4, 10), "its width, as a fraction of the frame's shorter side", 0.3)
    height: float | None = parameter(number(1e-4, 10), "its height likewise; without it, its width", None)
    scale: tuple[float, ...] = parameter(values(0, 100), "how many times larger it is drawn, over time", (1.0,))
    angle: tuple[float, ...] = parameter(values(-1e5, 1e5), "by how many degrees it is turned, over time", (0.0,))
    corners: tuple[tuple[float, float], ...] = parameter(
        several(pair(-1, 1), 0, 1000), "of a polygon, from its centre, in halves of width and height", ()
    )
    points: int = parameter(whole(3, 100), "of a star, or corners of a polygon without corners given", 5)
    inner: float = parameter(number(0.01, 1), "how far out the inner corners of a star are", 0.45)
    wobble: float = parameter(number(0, 0.9), "how far its outline bulges, as a part of the radius", 0.0)
    waves: int = parameter(whole(1, 100), "how many bulges run around it", 3)
    wobble_period: float = parameter(number(0.1, 1e6), "frames until a bulge stands where the next one stood", 24.0)
    edge: float = parameter(
        number(0, 1), "thickness of a line inside its outline, as a fraction of the frame's shorter side", 0.0
    )
    edge_color: tuple[float, float, float] = parameter(rgb(), "the colour of that line", (1.0, 1.0, 1.0))
    start: int = parameter(frame_number(), "the first frame in which it is seen", 0)
    end: int | None = parameter(frame_number(beyond=True), "the first frame in which it is no longer seen", None)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_keys(self.at, path=self.path, scale=self.scale, angle=self.angle)
        check_order(self.start, self.end)
        if self.form in {"circle", "ball"} and self.height not in {None, self.width}:
            raise ParameterError("height", f"of a {self.form} is its width; an ellipse may have another")
        if self.corners and (self.form != "polygon" or len(self.corners) < 3):
            raise ParameterError("corners", f"are {len(self.corners)} of a {self.form}; a polygon may have 3 or more")

    def paint(self, picture: F4, canvas: Canvas, time: float) -> F4:
        """The picture with the shape in front of it; the same array where it is not to be seen."""
        if (pose := self.pose(canvas, time)) is None:
            return picture
        box = round_bounds(pose) if self.form in _ROUND else corner_bounds(self._corners, pose)
        part = window(box, canvas)
        x, y = centres_in(part, canvas)
        distance = self._distance(x, y, pose)
        share = inside(distance)[..., None]  # (h, w, 1) f8
        painted = picture.copy()
        painted[part] = picture[part] * (1 - share) + self._colors(x, y, distance, pose, canvas) * share
        return painted

    def coverage(self, x: F8, y: F8, canvas: Canvas, time: float) -> F8:
        """The part of the pixels with centres (x, y) that the shape hides, 0 to 1."""
        if (pose := self.pose(canvas, time)) is None:
            return np.zeros(np.broadcast_shapes(x.shape, y.shape))
        return inside(self._distance(x, y, pose))

    def motion(self, x: F8, y: F8, canvas: Canvas, time: float) -> tuple[F8, F8] | None:
        """The motion of the shape's points at (x, y) in the last frame, right and down; None if it just appeared."""
        pose, before = self.pose(canvas, time), self.pose(canvas, time - 1)
        if pose is None or before is None:
            return None
        old_x, old_y = before.frame(*pose.own(x, y))
        return np.asarray(x - old_x), np.asarray(y - old_y)

    def truth(self, canvas: Canvas, time: float) -> dict[str, Any]:
        """``center`` (2,) and ``outline`` (M, 2) f8: x and y in pixels; NaN when it is not to be seen.

        The outline is the corners, or 128 points of what is round, or 12 of each side of what wobbles.
        """
        corners = regular_polygon(ROUND_POINTS) if self.form in _ROUND else self._corners
        if (pose := self.pose(canvas, time)) is None:
            return {"center": np.full(2, np.nan), "outline": np.full((len(corners), 2), np.nan)}
        return {"center": np.array([pose.x, pose.y]), "outline": pose.placed(corners)}

    def pose(self, canvas: Canvas, time: float) -> Pose | None:
        """The pose of the shape at a time; None when it is not to be seen."""
        if not is_shown(self.start, self.end, time):
            return None
        count = len(self.at) or max(len(self.path), len(self.scale), len(self.angle))
        key, part = key_before(self.at, count, canvas, time, self.pace, self.repeat)
        lift = 4 * part * (1 - part) * self.bounce * canvas.shorter if self.pace == "bouncing" else 0.0
        half = value_at(self.scale, key, part) * canvas.shorter / 2
        if half == 0:
            return None
        angle, phase = math.radians(value_at(self.angle, key, part)), 2 * math.pi * time / self.wobble_period
        if self.form == "ball":  # the light on it stays where it is, so that no more than its bulges can turn
            angle, phase = 0.0, phase - self.waves * angle
        return Pose(
            x=value_at([x for x, _ in self.path], key, part) * canvas.width,
            y=value_at([y for _, y in self.path], key, part) * canvas.height - lift,
            a=half * self.width,
            b=half * (self.height or self.width),
            angle=angle,
            wobble=self.wobble,
            waves=self.waves,
            phase=phase,
        )

    @property
    def _corners(self) -> Corners:
        """The pose of a shape that is not round."""
        corners: Corners = self.corners or regular_polygon(self.points)
        if self.form == "rectangle":
            corners = RECTANGLE
        if self.form == "star":
            corners = star(self.points, self.inner)
        return divided(corners, _PIECES) if self.wobble > 0 else corners

    def _distance(self, x: F8, y: F8, pose: Pose) -> F8:
        """Signed distance to the outline in pixels."""
        return round_distance(x, y, pose) if self.form in _ROUND else corner_distance(x, y, self._corners, pose)

    def _colors(self, x: F8, y: F8, distance: F8, pose: Pose, canvas: Canvas) -> F8:
        """The colours of the shape, (h, w, 3) or (3,) f8."""
        colors = np.asarray(self.color, np.float64)
        if self.form == "ball":
            colors = ball_colors(*pose.own(x, y), self.color)
        if self.edge == 0:
            return colors
        line = np.clip(0.5 + distance + self.edge * canvas.shorter, 0, 1)[..., None]  # (h, w, 1) f8
        return np.asarray(colors * (1 - line) + np.asarray(self.edge_color) * line)


EFFECT = Shape
