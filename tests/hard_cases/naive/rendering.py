"""Sums of splats by formulas that look right, in binary32; each is in some renderer."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from conformance.stage import Values
from tests.hard_cases.measuring import Variant

F4 = NDArray[np.float32]

LN_255 = np.float32(np.log(255))

Sigma = Callable[[F4, F4, F4], F4]
"""From a splat (8,), the columns (W,) and the rows (H, 1) of pixels to sigma (H, W)."""


def forward_substitution(splat: F4, i: F4, j: F4) -> F4:
    """(9-1), as it should be."""
    x, y, l11, l21, l22 = splat[:5]
    u1 = (i + np.float32(0.5) - x) / l11
    u2 = ((j + np.float32(0.5) - y) - l21 * u1) / l22
    return (u1 * u1 + u2 * u2) / 2


def inverse_covariance(splat: F4, i: F4, j: F4) -> F4:
    """d . (L L^T)^-1 d / 2, with a determinant that is the difference a c - b b."""
    x, y, l11, l21, l22 = splat[:5]
    a, b, c = l11 * l11, l11 * l21, l21 * l21 + l22 * l22
    determinant = a * c - b * b
    dx, dy = i + np.float32(0.5) - x, j + np.float32(0.5) - y
    return (c * dx * dx - 2 * b * dx * dy + a * dy * dy) / determinant / 2


def center_moved_first(splat: F4, i: F4, j: F4) -> F4:
    """u2 = ((j + 1/2) - (y + l21 u1)) / l22: the shear is added to the position before the difference."""
    x, y, l11, l21, l22 = splat[:5]
    u1 = (i + np.float32(0.5) - x) / l11
    u2 = ((j + np.float32(0.5)) - (y + l21 * u1)) / l22
    return (u1 * u1 + u2 * u2) / 2


def renderer(sigma_of: Sigma, *, limit: np.float32 = LN_255, degenerate: float = 2.0**-126) -> Variant:
    """A renderer in binary32 with a formula for sigma, another threshold, or another test for degenerate splats."""

    def render_sum(parameters: F4, width: int, height: int) -> Values:
        C = np.zeros((height, width, 3), np.float32)
        i, j = np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32)[:, None]
        for splat in parameters:
            if splat[2] >= degenerate and splat[4] >= degenerate:
                sigma = np.broadcast_to(sigma_of(splat, i, j), (height, width))
                C += np.where(sigma <= limit, np.exp(-sigma), np.float32(0))[..., None] * splat[5:]
        return {"sum": C}

    return render_sum


by_inverse_covariance = renderer(inverse_covariance)
