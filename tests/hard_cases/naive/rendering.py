"""Sums of splats and frames by formulas that look right, in binary32; each is in some renderer."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gsvc_conformance.operation import Values
from tests.hard_cases.measuring import Variant

F4 = NDArray[np.float32]

LN_255 = np.float32(np.log(255))
HALF = np.float32(0.5)

Sigma = Callable[[F4, F4, F4], F4]
"""From a splat (8,), the columns (W,) and the rows (H, 1) of pixels to sigma (H, W)."""


def forward_substitution(splat: F4, i: F4, j: F4) -> F4:
    """(9-1), as it should be."""
    x, y, l11, l21, l22 = splat[:5]
    return _half_square((i + HALF - x) / l11, j + HALF - y, l21, l22)


def _half_square(u1: F4, d_y: F4, l21: F4, l22: F4) -> F4:
    u2 = (d_y - l21 * u1) / l22
    return np.asarray((u1 * u1 + u2 * u2) / 2)


def covariance(splat: F4) -> tuple[F4, F4, F4, F4]:
    """The entries a, b, c of L L^T, and its determinant as the difference a c - b b."""
    l11, l21, l22 = splat[2:5]
    a, b, c = l11 * l11, l11 * l21, l21 * l21 + l22 * l22
    return a, b, c, a * c - b * b


def inverse_covariance(splat: F4, i: F4, j: F4) -> F4:
    """d . (L L^T)^-1 d / 2."""
    a, b, c, determinant = covariance(splat)
    dx, dy = i + HALF - splat[0], j + HALF - splat[1]
    return np.asarray((c * dx * dx - 2 * b * dx * dy + a * dy * dy) / determinant / 2)


def normalized(splat: F4, i: F4, j: F4) -> F4:
    """(9-1) with pixels and positions brought to -1..1 before their difference is taken."""
    x, y, l11, l21, l22 = splat[:5]
    w, h = np.float32(2) / np.float32(len(i)), np.float32(2) / np.float32(len(j))
    d_x = ((i + HALF) * w - 1 - (x * w - 1)) / w
    d_y = ((j + HALF) * h - 1 - (y * h - 1)) / h
    return _half_square(d_x / l11, d_y, l21, l22)


def renderer(
    sigma_of: Sigma,
    *,
    drawn: Callable[[F4], Any] = lambda splat: min(splat[2], splat[4]) >= 2.0**-126,
    masked_by_product: bool = False,
    kind: type[np.floating[Any]] = np.float32,
) -> Variant:
    """A renderer in binary32 that does one thing in another way.

    Parameters
    ----------
    sigma_of
        The formula for sigma.
    drawn
        Whether a splat is drawn.
    masked_by_product
        Whether pixels that are not covered are multiplied by 0.
    kind
        The type of the sum.
    """

    def render_sum(parameters: F4, width: int, height: int) -> Values:
        C = np.zeros((height, width, 3), kind)
        i, j = np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32)[:, None]
        for splat in parameters:
            if not drawn(splat):
                continue
            sigma = np.broadcast_to(sigma_of(splat, i, j), (height, width))
            covered = sigma <= LN_255
            g = np.exp(-sigma) * covered if masked_by_product else np.where(covered, np.exp(-sigma), np.float32(0))
            C += (g[..., None] * splat[5:]).astype(kind)
        return {"sum": C.astype(np.float32)}

    return render_sum


dividing_by_anything = renderer(inverse_covariance, drawn=lambda splat: True, masked_by_product=True)
in_normalized_coordinates = renderer(normalized)
in_binary16 = renderer(forward_substitution, kind=np.float16)
