"""The picture of a set of splats as it is defined, in binary64: the oracle that faster renderers are held against."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import factorial
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_base.arrays import F8
from gsvc_base.constants import LN_255, SMALLEST_NORMAL, SUPPORT_RADIUS
from gsvc_base.errors import UsageError
from gsvc_base.splats import PARAMETERS_PER_SPLAT, Splats

LN2_HIGH: Final = float.fromhex("0x1.62e42fefa3800p-1")
LN2_LOW: Final = float.fromhex("0x1.ef35793c76730p-45")
"""ln 2 in two parts; the first has 42 bits, so that its product with a whole number below 2^11 is exact."""

TAYLOR_TERMS: Final = 14
MAX_EXPONENT: Final = 1000.0


@dataclass(frozen=True)
class Footprint:
    """One splat over the box of pixels around it: everything that the sum and its gradients are made of."""

    rows: slice  # of the frame
    columns: slice
    dx: F8  # (1, w), d = pixel centre - mu
    dy: F8  # (h, 1)
    u1: F8  # (h, w), u = L^-1 d
    u2: F8  # (h, w)
    sigma: F8  # (h, w), (u1^2 + u2^2) / 2
    covered: NDArray[np.bool_]  # (h, w), sigma <= LN_255
    g: F8  # (h, w), exp(-sigma) where the splat covers the pixel, else 0

    def gradient(self, splat: F8, e: F8) -> F8:
        """The gradient (8,) f8 of sum(e * C) over these pixels, with e = dL/dC (h, w, 3) and coverage held fixed.

        With q = g (e . c') (10-6) and v = L^-T u, that is v2 = u2 / l22 and v1 = (u1 - l21 v2) / l11 (10-3):

            d sigma / d mu  = -v                 dL/dmu  = sum q v               (10-7)
            d sigma / d l11 = -v1 u1             dL/dl11 = sum q v1 u1           (10-8)
            d sigma / d l21 = -v2 u1             dL/dl21 = sum q v2 u1
            d sigma / d l22 = -v2 u2  (10-5)     dL/dl22 = sum q v2 u2
                                                 dL/dc'  = sum g e               (10-9)

        since u = L^-1 d gives du = -L^-1 (dmu + dL u), hence d sigma = u . du = -v . (dmu + dL u) (10-4).
        """
        l11, l21, l22 = splat[2:5]
        q = self.g * (e[..., 0] * splat[5] + e[..., 1] * splat[6] + e[..., 2] * splat[7])  # (10-6)
        v2 = self.u2 / l22
        v1 = (self.u1 - l21 * v2) / l11  # (10-3)
        of_mu = [q * v1, q * v2]  # (10-7)
        of_l = [q * v1 * self.u1, q * v2 * self.u1, q * v2 * self.u2]  # (10-8)
        of_color = [self.g * e[..., k] for k in range(3)]  # (10-9)
        return np.array([added(terms) for terms in (*of_mu, *of_l, *of_color)])


def added(values: F8) -> float:
    """The sum of all values one after the other, an order that NumPy's own sums do not promise."""
    return float(np.add.accumulate(values.ravel())[-1]) if values.size else 0.0


def exp_minus(x: F8) -> F8:
    """exp(-x) for x >= 0 in binary64, to 2 units in the last place, by IEEE operations of arrays alone.

    With x = n ln 2 + r it is 2^-n times a Taylor series of -r. Numbers below 2^-1074 become 0.
    """
    x = np.minimum(x, MAX_EXPONENT)
    n = np.rint(x * (1 / LN2_HIGH))
    r = (x - n * LN2_HIGH) - n * LN2_LOW
    p = np.full(x.shape, 1 / factorial(TAYLOR_TERMS))
    for k in range(TAYLOR_TERMS - 1, -1, -1):
        p = 1 / factorial(k) - r * p
    return np.asarray(np.ldexp(p, (-n).astype(np.int64)))


def footprint(splat: F8, width: int, height: int, *, margin: int = 0) -> Footprint | None:
    """Evaluate one splat (8,) f8 over its bounding box and `margin` pixels around it; None where that is empty.

    u1 = dx / l11, u2 = (dy - l21 u1) / l22 and sigma = (u1^2 + u2^2) / 2, spec.md (9-1): the paper's
    d^T (L L^T)^-1 d / 2 (section 3.2), never negative and without a determinant.
    """
    mu_x, mu_y, l11, l21, l22 = splat[:5]
    if not (l11 >= SMALLEST_NORMAL and l22 >= SMALLEST_NORMAL and np.isfinite(splat[:5]).all()):
        return None  # degenerate (R-9.1-2), or infinite, which leaves no sigma that is small enough
    columns = _box(mu_x, SUPPORT_RADIUS * l11, width, margin)
    rows = _box(mu_y, SUPPORT_RADIUS * np.sqrt(l21 * l21 + l22 * l22), height, margin)
    dx = np.arange(columns.start, columns.stop)[None, :] + 0.5 - mu_x  # (1, w) f8
    dy = np.arange(rows.start, rows.stop)[:, None] + 0.5 - mu_y  # (h, 1) f8
    if dx.size == 0 or dy.size == 0:
        return None
    u1 = np.broadcast_to(dx / l11, (dy.size, dx.size))
    u2 = (dy - l21 * u1) / l22
    sigma = (u1 * u1 + u2 * u2) / 2  # (9-1)
    covered = sigma <= LN_255  # R-9.1-3
    g = np.where(covered, exp_minus(sigma), 0.0)
    return Footprint(rows, columns, dx, dy, u1, u2, sigma, covered, g)


def _box(center: float, half_extent: float, size: int, margin: int) -> slice:
    """The pixels of an axis whose centre is within half_extent of `center`, and `margin` more on either side."""
    first = np.clip(np.ceil(center - half_extent - 0.5) - margin, 0, size)
    end = np.clip(np.floor(center + half_extent - 0.5) + 1 + margin, first, size)
    return slice(int(first), int(end))


def footprints(splats: Splats, width: int, height: int) -> Iterator[tuple[int, F8, Footprint]]:
    """The index, the parameters (8,) f8 and the footprint of every splat that can cover a pixel, in index order."""
    for n, splat in enumerate(splats.to_array().astype(np.float64)):
        pixels = footprint(splat, width, height)
        if pixels is not None:
            yield n, splat, pixels


def exact_sum(splats: Splats, width: int, height: int) -> F8:
    """C = sum of c' exp(-sigma) over the splats that cover the pixel, in index order, (H, W, 3) f8: (9-2), R-9.1-4."""
    C = np.zeros((height, width, 3))  # (H, W, 3) f8
    for _, splat, pixels in footprints(splats, width, height):
        C[pixels.rows, pixels.columns] += pixels.g[..., None] * splat[5:]  # (9-2)
    return C


def exact_gradients(splats: Splats, residual: ArrayLike) -> F8:
    """The gradient (N, 8) f8 of sum(residual * C) for every parameter (R-10.3-1), for a residual dL/dC (H, W, 3).

    See `Footprint.gradient`.
    """
    e = check_residual(residual)
    height, width = e.shape[:2]
    gradients = np.zeros((len(splats), PARAMETERS_PER_SPLAT))  # (N, 8) f8
    for n, splat, pixels in footprints(splats, width, height):
        gradients[n] = pixels.gradient(splat, e[pixels.rows, pixels.columns])
    return gradients


def check_residual(residual: ArrayLike) -> F8:
    """The residual as (H, W, 3) f8; what is not finite is refused."""
    e = np.asarray(residual, np.float64)
    check_residual_shape(e.shape)
    if not np.isfinite(e).all():
        raise UsageError("the residual has a value that is NaN or infinite; every value must be finite")
    return e


def check_residual_shape(shape: tuple[int, ...]) -> None:
    """Raise UsageError unless the shape is (H, W, 3) with at least one pixel."""
    if len(shape) != 3 or shape[2] != 3 or 0 in shape:
        raise UsageError(f"the residual has shape {shape}; it must be (H, W, 3) with at least one pixel")


def exact_covered_pixels(splats: Splats, width: int, height: int) -> NDArray[np.int64]:
    """The number of pixels of the frame that each splat covers, (N,) i8."""
    counts = np.zeros(len(splats), np.int64)  # (N,) i8
    for n, _, pixels in footprints(splats, width, height):
        counts[n] = np.count_nonzero(pixels.covered)
    return counts
