"""Splats whose arithmetic is hard, for the cases of sums, of their deterministic twins and of gradients."""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.constants import LN_255
from gsvc_base.portable import cos, hypot, sin
from gsvc_conformance.cases.splat_sets import splat, splats
from gsvc_conformance.operations.rendering import edge_margins

F4 = NDArray[np.float32]
Shape = tuple[float, float, float, float, float]
"""x, y, l11, l21, l22 in pixels."""

WIDTH: Final = 7
HEIGHT: Final = 5
"""Height of all frames: vectors stay small."""

SUBNORMAL: Final = 1e-39


def turned(degrees: float, length: float, thickness: float) -> tuple[float, float, float]:
    """The factors l11, l21, l22 of a splat with these deviations, the first at an angle to the rows."""
    c, s = cos(math.radians(degrees)), sin(math.radians(degrees))
    l11 = hypot(length * c, thickness * s)
    return l11, (length * length - thickness * thickness) * s * c / l11, length * thickness / l11


def needle(degrees: float) -> Shape:
    """Deviations of 3000 and 0.3 pixels, through the frame."""
    return 3.3, 2.6, *turned(degrees, 3000, 0.3)


SHAPES: Final[dict[str, tuple[Shape, Shape, Shape]]] = {
    "needles_that_lie": (needle(0.001), needle(20), needle(45)),
    "needles_that_stand": (needle(70), needle(89.999), needle(120)),
    "specks": (
        (3.5 + 2.0**-20, 2.5, 2.0**-20, 0.0, 2.0**-20),
        (1.5 - 2.0**-13, 3.5 + 2.0**-12, 2.0**-13, 2.0**-13, 2.0**-13),
        (5.5 + 2.0**-8, 1.5 - 2.0**-9, 2.0**-7, -(2.0**-9), 2.0**-8),
    ),
    "thousands_of_frames": (
        (4e3, -3e3, 9e3, 2e3, 5e3),
        (-7e5, 5e5, 9e5, -6e5, 2e5),
        (9e6, 7e6, 9e6, 7e6, 9e5),
    ),
    "leaning_bands": (
        (3.5, 2.5, 9e3, -4e3, 1.5),
        (2.9, 2.1, 9e5, 3e5, 1.2),
        (3.1, 2.4, 7e6, 7e6, 2.0),
    ),
    "shear_of_1e6_to_1e30": (
        (3.5 + 2.0**-20, 2.5, 1.0, 1e6, 1.0),
        (3.4, 2.2, 1e18, -5e17, 0.8),
        (3.7, 2.3, 1e30, 1e30, 1.1),
    ),
    "smallest_l11_or_l22": (
        (3.5, 2.5, 2.0**-126, 2.0**-126, 2.0),
        (3.5, 2.5, 3.0, -1.5, 2.0**-126),
        (3.5, 2.5, 2.0**-62, 2.0, 2.0**-62),
    ),
    "a_million_pixels_away": (
        (-1e6, 2.5, 1e6 / 3.32, 0.0, 2.0),
        (1e6, 1e6, 1e6 / 2.5, 1e6 / 2, 1e6 / 1.5),
        (3.5, -1e6, 2.0, 0.0, 1e6 / 3.329),
    ),
    "a_line_from_a_million_pixels_away": (
        (-7e5, 7e5, 2.5e5, -2.5e5, 1.0),
        (1e6, 2.5, 3.2e5, 0.0, 0.75),
        (-1e6, -5e5, 4e5, 2e5, 40.0),
    ),
}
"""Three splats each; `COLORS` shows each in a channel of its own."""

NOT_QUITE: Final[tuple[Shape, ...]] = (
    (-1e6, 2.5, 1e6 / 3.33, 0.0, 2.0),
    (3.5, -1e6, 2.0, 0.0, 1e6 / 3.33),
    (1e6, 1e6, 1e6 / 2.5, 0.0, 1e6 / 2.3),
    (-7e5, 7e5, 2.5e5, -2.5e5 - 6.0, 1.0),
)
"""Splats a million pixels away that end, by little, before they reach the frame."""

COLORS: Final = ((1.0, 0.0, 0.0), (0.0, -0.75, 0.0), (0.0, 0.0, 0.5))


def in_channels(shapes: Sequence[Shape]) -> F4:
    """Three splats, each in a channel of its own: (3, 8) f4."""
    return splats(*(splat(*shape, color) for shape, color in zip(shapes, COLORS, strict=True)))


TARGETS: Final = ((1, 2), (5, 3), (3, 0))
"""Column and row of the pixel at the edge of each of the three splats of `at_the_edge`."""

_EDGES: Final = ((0.0, (1.25, 0.0, 1.5)), (2.3, (1.5, 1.75, 0.8)), (-1.2, (60.0, 40.0, 0.3)))
"""In which direction the pixel lies from the centre, in units of L, and the factors."""


def at_the_edge(side: int) -> F4:
    """Three splats, round, leaning and thin, each with a pixel at sigma = ln 255: (3, 8) f4.

    Parameters
    ----------
    side
        0: x is the binary32 number for which the pixel's sigma is nearest to ln 255; -1 or 1: the first one beyond for
        which any binary32 arithmetic must find the pixel covered, or not covered.
    """
    rows = []
    for (i, j), (angle, (l11, l21, l22)), color in zip(TARGETS, _EDGES, COLORS, strict=True):
        u = np.sqrt(2 * LN_255) * np.array([cos(angle), sin(angle)])
        x, y = np.array([i + 0.5 - l11 * u[0], j + 0.5 - (l21 * u[0] + l22 * u[1])], np.float32)
        places = x + np.arange(-4000, 4001, dtype=np.float32) * np.spacing(abs(x))
        packed = np.tile(splat(0, float(y), l11, l21, l22, color), (len(places), 1))
        packed[:, 0] = places
        beyond = _sigma(packed.astype(np.float64), i + 0.5, j + 0.5) - LN_255
        nearest = (packed[[n]] for n in np.argsort(abs(beyond), kind="stable") if side in (0, np.sign(beyond[n])))
        rows.append(next(one for one in nearest if side == 0 or edge_margins(one, WIDTH, HEIGHT) > 1))
    return splats(*rows)


def _sigma(packed: NDArray[np.float64], px: float, py: float) -> NDArray[np.float64]:
    """(9-1) of many splats (N, 8) f8 at one place: (N,) f8."""
    x, y, l11, l21, l22 = packed[:, :5].T
    u1 = (px - x) / l11
    u2 = ((py - y) - l21 * u1) / l22
    return np.asarray((u1 * u1 + u2 * u2) / 2)


def odd_numbers() -> F4:
    """24 splats on a pixel's centre, each with one parameter that is -0, subnormal, or negative and subnormal: f4."""
    packed = np.tile(splat(0.5, 0.5, 1.5, 0.5, 1.25, (0.25, -0.5, 0.125)), (24, 1))
    packed[np.arange(24), np.arange(24) % 8] = np.repeat([-0.0, SUBNORMAL, -SUBNORMAL], 8)
    return packed
