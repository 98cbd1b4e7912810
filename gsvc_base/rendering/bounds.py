"""Bounds of the error of a correct binary32 renderer, per pixel (R-9.2-1) and gradient, by the error model fp32/1.

The model (unit eps = 2^-23, so that any rounding direction is legal): an addition, subtraction or multiplication has a
relative error of at most eps, fused or not; a division or reciprocal 2.5 eps; exp(-x) has (3 + 2 x) eps (13-3); terms
may be added in any order; a result below 2^-126 may become zero. gamma_k = k eps / (1 - k eps) bounds k roundings in a
row. In long sums no term takes part in more than D additions (`additions`): a sum in blocks, or of rows and then
columns.

**sigma.** With a = |dy| / l22 and b = |l21 u1| / l22, hence |u2| <= a + b:

- dx and dy have one rounding, x + 1/2 none; u1 = dx / l11 as dx times a reciprocal has 1 + 2.5 + 1 at most:
  delta_1 = gamma_5 |u1|;
- u2 = (dy - l21 u1) / l22 in any arrangement: dy has 1, l21 u1 has 5 + 1, the difference 1, and the quotient 3.5:
  delta_2 = gamma_6 a + gamma_11 b;
- underflow adds eta = 2^-126 per operation, carried through what follows: eta (1 + |dx|) to delta_1, and
  that times |l21| / l22, eta / l22 and eta (1 + |dy| + |l21 u1| + |u1|) to delta_2;
- the squares and their sum have two roundings, halving none:
  w = |u1| delta_1 + |u2| delta_2 + (delta_1^2 + delta_2^2) / 2 and d(sigma) = w + gamma_2 (sigma + w).

**g = exp(-sigma).** The computed value lies between exp(-sigma - d(sigma)) and min(exp(-sigma + d(sigma)), 1), times
1 ± (3 + 2 x) eps with x that sigma: exp(-x) (3 + 2 x) falls for x >= 0, so that error is largest at the lower end. d(g)
is the larger distance, that error and 2^-126.

**The sum** of n terms: smooth = sum |c| d(g) + gamma_(n+2) sum |c| (g + d(g)) + 2 n eta.

**Coverage.** Where |sigma - ln 255| <= d(sigma) + eps ln 255 (the constant itself is rounded), either decision is
legal: band = sum over those splats of |c| (g + d(g)).

**Gradients.** A moment is S_m = sum of q m, with q = g (e . c), |q| <= g A where A = sum |e_k c_k|, and m one of u1,
u2, u1^2, u1 u2, u2^2, whose errors d(m) follow from delta_1 and delta_2 by the product rule. With Q = g A,
d(Q) = (d(g) + gamma_5 (g + d(g))) A + 8 eta and M = |m| + d(m), over the P pixels that are covered or in the band:

    d(S_m) = sum (d(Q) M + Q d(m) + 2 eta) + gamma_(D+4) sum (Q + d(Q)) M + sum over the band of (Q + d(Q)) M.

The same with A = |e_k| and m = 1 gives dL/dc'. Each gradient is then one moment or the difference of two over entries
of L: their errors, gamma_12 of their absolute sums and what underflows, divided likewise. The factor gamma_(D+4) takes
all roundings for equal and of one sign: aggregates (relative L2 and bias) are judged too.

Bounds are evaluated in binary64 by IEEE operations in a stated order, so that they have the same bits on every machine.
"""

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_base.arrays import F8
from gsvc_base.checks import door
from gsvc_base.constants import LN_255, SMALLEST_NORMAL, SUPPORT_RADIUS
from gsvc_base.rendering.definition import Footprint, added, check_residual, exp_minus, footprint
from gsvc_base.splats import PARAMETERS_PER_SPLAT, Splats

EPS: Final = 2.0**-23
"""Unit roundoff of the error model fp32/1 (13-1)."""

ETA: Final = SMALLEST_NORMAL
"""Maximum loss by an underflow (13-2)."""


def gamma(k: ArrayLike) -> F8:
    """The relative error of k roundings in a row, k eps / (1 - k eps) (13-4); infinite where k eps reaches 1."""
    error = np.asarray(k, np.float64) * EPS
    return np.where(error < 1, error / np.maximum(1 - error, ETA), np.inf)


def additions(terms: ArrayLike, rows: int = 0, columns: int = 0) -> F8:
    """The maximum number of additions D(n, r, c) that one of n terms of a sum takes part in, spec.md (13-4).

    Two stages of about sqrt(n) terms, such as threads and blocks, and 64 for what is added in pairs; a sum of r rows
    and c columns of pixels may also go by rows and then columns.
    """
    n = np.asarray(terms, np.float64)
    additions_of_stages = np.maximum(2 * np.ceil(np.sqrt(n)), rows + columns)
    return np.asarray(np.maximum(np.minimum(n - 1, additions_of_stages + 64), 0))


def coverage_margin(splat: F8) -> int:
    """The number of pixels beyond the bounding box that a binary32 decision may still find covered."""
    reach = SUPPORT_RADIUS * (splat[2] + abs(splat[3]) + splat[4])
    return 1 + int(np.ceil(min(64 * EPS * reach, 2.0**17)))


class WeightErrors:
    """The errors of one splat (8,) f8 over its footprint, each (h, w) f8, named as in the module's text."""

    def __init__(self, splat: F8, pixels: Footprint) -> None:
        l21, l22 = splat[3:5]
        u1, u2, sigma = abs(pixels.u1), abs(pixels.u2), pixels.sigma
        underflow = ETA * (1 + abs(pixels.dx))
        # Bounds of the errors of u1, u2 and sigma.
        self.delta_1 = gamma(5) * u1 + underflow  # (13-5)
        self.delta_2 = (
            (gamma(6) * abs(pixels.dy) + gamma(11) * abs(l21) * u1 + abs(l21) * underflow + ETA) / l22
            + ETA * (1 + abs(pixels.dy) + abs(l21) * u1 + u1)  # (13-6)
        )  # fmt: skip
        w = u1 * self.delta_1 + u2 * self.delta_2 + (self.delta_1 * self.delta_1 + self.delta_2 * self.delta_2) / 2
        self.d_sigma = w + gamma(2) * (sigma + w)  # (13-7)
        nearest = np.maximum(sigma - self.d_sigma, 0)
        # exp(-sigma), covered or not, and its error.
        self.g_plain, highest, lowest = exp_minus(np.stack([sigma, nearest, sigma + self.d_sigma]))
        of_exp = (3 + 2 * nearest) * EPS * highest  # exp(-x) (3 + 2 x) falls: it is largest at the smallest x
        self.d_g = np.maximum(highest - self.g_plain, self.g_plain - lowest) + of_exp + ETA  # (13-8)
        # Where either coverage decision is legal.
        self.band = abs(sigma - LN_255) <= self.d_sigma + EPS * LN_255  # (13-9)


def error_footprints(
    parameters: NDArray[np.float32], width: int, height: int
) -> Iterator[tuple[int, F8, Footprint, WeightErrors]]:
    """The index, parameters (8,) f8, footprint and errors of all splats (N, 8) that can cover a pixel, or nearly so."""
    for n, splat in enumerate(parameters.astype(np.float64)):
        pixels = footprint(splat, width, height, margin=coverage_margin(splat))
        if pixels is not None:
            yield n, splat, pixels, WeightErrors(splat, pixels)


class SumBound:
    """The parts of the bound of a picture's sum, added up splat by splat: each (H, W, 3) or (H, W, 1) f8."""

    def __init__(self, width: int, height: int) -> None:
        self._smooth, self._absolute, self._band = np.zeros((3, height, width, 3))
        self._terms = np.zeros((height, width, 1))

    def add(self, splat: F8, pixels: Footprint, errors: WeightErrors, times: int = 1) -> None:
        """Add a splat that occurs `times` times."""
        at = (pixels.rows, pixels.columns)
        c = abs(splat[5:]) * times
        highest = errors.g_plain + errors.d_g
        self._smooth[at] += (pixels.covered * errors.d_g)[..., None] * c
        self._absolute[at] += (pixels.covered * highest)[..., None] * c
        self._band[at] += (errors.band * highest)[..., None] * c  # (13-10)
        self._terms[at] += (pixels.covered | errors.band)[..., None] * float(times)

    def bound(self) -> F8:
        """(13-11): (H, W, 3) f8."""
        roundings = gamma(self._terms + 2) * (self._absolute + self._band)
        return self._smooth + roundings + self._band + 2 * self._terms * ETA


@door
def render_exact_with_bound(splats: Splats | ArrayLike, width: int, height: int) -> tuple[F8, F8]:
    """The exact sum and how far a binary32 renderer may be from it in each element (the derivation is above).

    Parameters
    ----------
    splats
        The splats, or their parameters (N, 8) f4.
    width, height
        Size of the frame in pixels.

    Returns
    -------
    C
        (H, W, 3) f8, not clamped: `render_sum` with precision ``exact``.
    bound
        (H, W, 3) f8: a correct renderer's sum is finite and within `bound` of C.
    """
    C = np.zeros((height, width, 3))  # (H, W, 3) f8
    bound = SumBound(width, height)
    for _, splat, pixels, errors in error_footprints(Splats.of(splats).to_array(), width, height):
        C[pixels.rows, pixels.columns] += pixels.g[..., None] * splat[5:]
        bound.add(splat, pixels, errors)
    return C, bound.bound()


def frame_limits(C: F8, bound: F8, bit_depth: int) -> tuple[F8, F8]:
    """The lowest and the highest frame, integers (H, W, 3) f8, that a sum within `bound` of C may give (13-18).

    The clamp is exact, the product with the peak has a relative error of at most eps and may lose ETA to underflow
    (which no rounding to an integer sees), and rounding to an integer keeps the order. No product is rounded above the
    peak.
    """
    peak = 2**bit_depth - 1
    lowest = np.rint(np.clip(C - bound, 0, 1) * peak * (1 - EPS))
    highest = np.rint(np.clip(C + bound, 0, 1) * peak * (1 + EPS))  # (13-18)
    return lowest, highest


def exact_gradients_with_bound(splats: Splats, residual: ArrayLike) -> tuple[F8, F8]:
    """The exact gradients of sum(residual * C) and how far binary32 ones may be from them (the derivation is above).

    Parameters
    ----------
    splats
        The splats.
    residual
        (H, W, 3), dL/dC.

    Returns
    -------
    gradients
        (N, 8) f8, `render_gradients` with precision ``exact``.
    bound
        (N, 8) f8.

    Raises
    ------
    UsageError
        The residual has another shape or a value that is not finite.
    """
    e_all = check_residual(residual)
    height, width = e_all.shape[:2]
    gradients = np.zeros((len(splats), PARAMETERS_PER_SPLAT))  # (N, 8) f8
    bound = np.zeros_like(gradients)
    for n, splat, pixels, errors in error_footprints(splats.to_array(), width, height):
        e = e_all[pixels.rows, pixels.columns]  # (h, w, 3) f8
        gradients[n] = pixels.gradient(splat, e)
        bound[n] = gradient_bound(splat, pixels, errors, e)
    return gradients, bound


def gradient_bound(splat: F8, pixels: Footprint, errors: WeightErrors, e: F8) -> F8:
    """The bounds (8,) f8 of one splat's gradients, with e = dL/dC (h, w, 3) f8."""
    l11, l21, l22 = splat[2:5]
    u1, u2, d1, d2 = abs(pixels.u1), abs(pixels.u2), errors.delta_1, errors.delta_2
    either = pixels.covered | errors.band
    rows, columns = (np.count_nonzero(either.any(axis=axis)) for axis in (1, 0))
    order = gamma(additions(np.count_nonzero(either), int(rows), int(columns)) + 4)
    d_q_of_a = errors.d_g + gamma(5) * (errors.g_plain + errors.d_g)  # (13-14)

    def moment(A: F8, m: F8 | float, d_m: F8 | float) -> tuple[float, float]:
        """The absolute sum and the error of one moment."""
        M = m + d_m
        d_Q = d_q_of_a * A + 8 * ETA
        highest = (errors.g_plain * A + d_Q) * M
        error = d_Q * M + errors.g_plain * A * d_m + order * highest + 2 * ETA
        return added(highest[either]), added(error[either]) + added(highest[errors.band])  # (13-15)

    A = abs(e[..., 0] * splat[5]) + abs(e[..., 1] * splat[6]) + abs(e[..., 2] * splat[7])  # (h, w) f8
    of_u1 = moment(A, u1, d1)
    of_u2 = moment(A, u2, d2)
    of_11 = moment(A, u1 * u1, (2 * u1 + d1) * d1)
    of_12 = moment(A, u1 * u2, u1 * d2 + u2 * d1 + d1 * d2)
    of_22 = moment(A, u2 * u2, (2 * u2 + d2) * d2)  # (13-13)
    slope = abs(l21) / (l11 * l22)
    bound = [  # the factors of (13-12)
        _total((of_u1, 1 / l11), (of_u2, slope)),
        _total((of_u2, 1 / l22)),
        _total((of_11, 1 / l11), (of_12, slope)),
        _total((of_12, 1 / l22)),
        _total((of_22, 1 / l22)),
        *(_total((moment(abs(e[..., k]), 1.0, 0.0), 1.0)) for k in range(3)),
    ]
    return np.array(bound)


def _total(*parts: tuple[tuple[float, float], float]) -> float:
    """The error of a sum of moments times factors, each (absolute sum, error) and factor."""
    errors = [
        (error + gamma(12) * (absolute + error)) * factor + ETA * (1 + absolute + error)  # (13-16)
        for (absolute, error), factor in parts
    ]
    return added(np.array(errors))
