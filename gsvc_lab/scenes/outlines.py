"""Outlines of shapes by how they stand in the frame: corners, and signed distances to them in pixels."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from gsvc_base.arrays import F8
from gsvc_base.portable import arctan2, cos, hypot, sin
from gsvc_lab.scenes.distances import Box, polygon_distance

Corners = Sequence[tuple[float, float]]

RECTANGLE: Final[Corners] = ((-1, -1), (1, -1), (1, 1), (-1, 1))
"""Corners in halves of the width and the height from the centre, before they are placed; y points down."""

ROUND_POINTS: Final = 128
"""Number of points of an outline that has no corners."""


@dataclass(frozen=True)
class Pose:
    """The pose of a shape in the frame.

    Its own coordinates are those of the circle or square that it was before it got its size, bulges, turn and place.
    """

    x: float  # Its centre in pixels
    y: float
    a: float  # Half its width and height in pixels; positive
    b: float
    angle: float = 0.0  # rotation in radians, clockwise as seen
    wobble: float = 0.0  # height of the bulges of its outline, as a part of the distance from the centre
    waves: int = 3  # number of bulges around it
    phase: float = 0.0  # phase of the bulges in radians

    def bulge(self, theta: F8) -> F8:
        """The factor by which bulges move points away from the centre, by their direction in own coordinates."""
        return np.asarray(1 + self.wobble * sin(self.waves * theta + self.phase))

    def own(self, x: F8, y: F8) -> tuple[F8, F8]:
        """The own coordinates of places in the frame."""
        u, v = self.turned_back(x, y)
        bulge = self.bulge(arctan2(v, u))
        return u / bulge, v / bulge

    def frame(self, u: F8, v: F8) -> tuple[F8, F8]:
        """The places in the frame, in pixels, of own coordinates: the inverse of `own`."""
        bulge = self.bulge(arctan2(v, u))
        across, down = u * bulge * self.a, v * bulge * self.b
        cosine, sine = cos(self.angle), sin(self.angle)
        return self.x + across * cosine - down * sine, self.y + across * sine + down * cosine

    def placed(self, corners: Corners) -> F8:
        """(N, 2) f8, corners in own coordinates as places in the frame."""
        points = np.asarray(corners, np.float64)
        return np.stack(self.frame(points[:, 0], points[:, 1]), axis=1)

    def turned_back(self, x: F8, y: F8) -> tuple[F8, F8]:
        """Own coordinates but for the bulges."""
        cosine, sine = cos(self.angle), sin(self.angle)
        dx, dy = x - self.x, y - self.y
        return (dx * cosine + dy * sine) / self.a, (dy * cosine - dx * sine) / self.b


def divided(corners: Corners, pieces: int) -> Corners:
    """The same polygon with each side divided into pieces, so that sides can bulge as well."""
    sides = zip(corners, [*corners[1:], corners[0]], strict=True)
    return [
        (ax + (bx - ax) * piece / pieces, ay + (by - ay) * piece / pieces)
        for (ax, ay), (bx, by) in sides
        for piece in range(pieces)
    ]


def regular_polygon(points: int) -> Corners:
    """Corners of a regular polygon with one of them on top."""
    return [_on_circle(index / points, 1) for index in range(points)]


def star(points: int, inner: float) -> Corners:
    """Corners of a star with this number of points, one on top; `inner` is the radius of its inner corners."""
    return [_on_circle(index / (2 * points), inner if index % 2 else 1) for index in range(2 * points)]


def round_bounds(pose: Pose) -> Box:
    """Left, top, right and bottom of all that an ellipse with bulges may touch, in pixels."""
    cosine, sine = cos(pose.angle), sin(pose.angle)
    across = hypot(pose.a * cosine, pose.b * sine) * (1 + pose.wobble)
    down = hypot(pose.a * sine, pose.b * cosine) * (1 + pose.wobble)
    return pose.x - across, pose.y - down, pose.x + across, pose.y + down


def corner_bounds(corners: Corners, pose: Pose) -> Box:
    """Left, top, right and bottom of a placed polygon, in pixels."""
    x, y = pose.placed(corners).T
    return float(x.min()), float(y.min()), float(x.max()), float(y.max())


def round_distance(x: F8, y: F8, pose: Pose) -> F8:
    """Signed distance to an ellipse with bulges, negative inside, in pixels: f / |grad f|, exact for a circle.

    With rho and theta the polar coordinates in units of the ellipse's own axes, f = rho - bulge(theta).
    """
    u, v = pose.turned_back(x, y)
    rho, theta = hypot(u, v), arctan2(v, u)
    bulge = pose.bulge(theta)
    slope = pose.wobble * pose.waves * cos(pose.waves * theta + pose.phase)  # d bulge / d theta
    # Deep inside only the sign matters, and the gradient has no limit at the centre.
    safe = np.maximum(rho, 0.5 * bulge)
    along_u = cos(theta) + slope * sin(theta) / safe
    along_v = sin(theta) - slope * cos(theta) / safe
    return np.asarray((rho - bulge) / hypot(along_u / pose.a, along_v / pose.b))


def corner_distance(x: F8, y: F8, corners: Corners, pose: Pose) -> F8:
    """Signed distance to a placed polygon, negative inside, in pixels."""
    return polygon_distance(x, y, pose.placed(corners))


def _on_circle(turn: float, radius: float) -> tuple[float, float]:
    return radius * sin(2 * math.pi * turn), -radius * cos(2 * math.pi * turn)
