"""Signed distances to outlines in pixels, and how much of each pixel lies inside."""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from gsvc_base.arrays import F8
from gsvc_base.portable import hypot
from gsvc_lab.scenes.canvas import Canvas

Box = tuple[float, float, float, float]
"""Left, top, right and bottom, in pixels."""


def window(box: Box, canvas: Canvas) -> tuple[slice, slice]:
    """The rows and columns of a frame that a box with one pixel of margin touches; empty where it is outside."""
    left, top, right, bottom = box
    rows = slice(_within(math.floor(top) - 1, canvas.height), _within(math.ceil(bottom) + 1, canvas.height))
    columns = slice(_within(math.floor(left) - 1, canvas.width), _within(math.ceil(right) + 1, canvas.width))
    return rows, columns


def centres_in(part: tuple[slice, slice], canvas: Canvas) -> tuple[F8, F8]:
    """The x and y of the centres of a window's pixels, (h, w) f8 each."""
    x, y = canvas.centres()
    x, y = np.broadcast_arrays(x[:, part[1]], y[part[0]])
    return x, y


def _within(edge: int, size: int) -> int:
    return min(max(edge, 0), size)


def inside(distance: F8) -> F8:
    """The part of a pixel that lies within an outline, 0 to 1, by the signed distance of its centre in pixels."""
    return np.clip(0.5 - distance, 0, 1)


def segment_distance(x: F8, y: F8, ends: Sequence[tuple[float, float]]) -> F8:
    """Distance of points to a line of straight pieces, as an f8 array.

    `x` and `y`: f8 arrays of shapes that go together. `ends`: the corners of the line; a single one, or two equal ones,
    is a point.
    """
    nearest = np.full(np.broadcast_shapes(x.shape, y.shape), np.inf)
    for (ax, ay), (bx, by) in zip(ends, ends[1:] or ends, strict=False):
        length = (bx - ax) * (bx - ax) + (by - ay) * (by - ay)
        along = np.clip(((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length, 0, 1) if length > 0 else 0.0
        nearest = np.minimum(nearest, hypot(x - ax - along * (bx - ax), y - ay - along * (by - ay)))
    return nearest


def polygon_distance(x: F8, y: F8, corners: F8) -> F8:
    """Distance of points to a closed polygon, negative inside (by the even-odd rule), as an f8 array.

    `x` and `y`: f8 arrays of shapes that go together. `corners`: (N, 2) f8, in order; at least three.
    """
    within = np.zeros(np.broadcast_shapes(x.shape, y.shape), bool)
    points = [(float(cx), float(cy)) for cx, cy in corners]
    closed = [*points, points[0]]
    for (ax, ay), (bx, by) in pairwise(closed):
        if ay != by:  # does a ray to the right cross this side?
            crossing = ax + (y - ay) * ((bx - ax) / (by - ay))
            within ^= ((ay > y) != (by > y)) & (x < crossing)
    distance = segment_distance(x, y, closed)
    return np.where(within, -distance, distance)
