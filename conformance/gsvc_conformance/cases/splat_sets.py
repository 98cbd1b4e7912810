"""Splats for the cases of rendering."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gsvc_base.draws import Draws
from gsvc_conformance.operations.rendering import edge_margins

F4 = NDArray[np.float32]

COLOR = (0.75, -0.375, 1.125)
"""A colour whose channels differ, one of them negative."""

MIN_GUARDS = 4.0
"""Distance of all pixels from the edge of the support of random splats, in rounding errors."""


def splat(x: float, y: float, l11: float, l21: float, l22: float, color: Sequence[float] = COLOR) -> F4:
    """One splat, (1, 8) f4."""
    return np.array([[x, y, l11, l21, l22, *color]], np.float32)


def splats(*rows: F4) -> F4:
    """Several splats in order, (N, 8) f4."""
    return np.concatenate([np.empty((0, 8), np.float32), *rows])


def population(rng: Draws, count: int, width: int, height: int, radius: float | None = None) -> F4:
    """Splats of natural sizes all over a frame, drawn until each is clear of decisions within rounding: (N, 8) f4.

    Parameters
    ----------
    radius
        Their typical size in pixels; None: about ten on every pixel, as after training.
    """
    size = np.sqrt(width * height / count) if radius is None else radius
    packed = anywhere(rng, count, width, height, float(size))
    while (close := edge_margins(packed, width, height) <= MIN_GUARDS).any():
        packed[close] = anywhere(rng, int(close.sum()), width, height, float(size))
    return packed


def anywhere(rng: Draws, count: int, width: int, height: int, size: float) -> F4:
    """Random splats, wherever their edges are."""
    columns = [
        rng.random((count, 2)) * (width + size, height + size) - size / 2,
        size * rng.lognormal(-0.4, 0.5, (count, 1)),
        size * rng.normal(0, 0.7, (count, 1)),
        size * rng.lognormal(-0.4, 0.5, (count, 1)),
        rng.normal(0.1, 0.25, (count, 3)),
    ]
    return np.concatenate(columns, axis=1).astype(np.float32)
