"""Bounds of the error of a correct renderer, per pixel (R-9.2-1) and gradient, by an error model (`error_models`).

The model fp32/1 (unit eps = 2^-23, so that any rounding direction is legal): an addition, subtraction or
multiplication has a relative error of at most eps, fused or not; a division or reciprocal 2.5 eps; exp(-x) has
(3 + 2 x) eps (13-3); terms may be added in any order; a result below 2^-126 may become zero. gamma_k =
k eps / (1 - k eps) bounds k roundings in a row. In long sums no term takes part in more than D additions
(`additions`): a sum in blocks, or of rows and then columns.

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

**Fewer digits.** The other models have the same formulas. Roundings of factors or of what is stored join those of
binary32 (13-20), and there are more terms for what underflow loses, (13-22) to (13-26). For fp32/1 all of these are 0.

Bounds are evaluated in binary64 by IEEE operations in a stated order, so that they have the same bits on every machine.
"""

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_base.arrays import F8
from gsvc_base.checks import door
from gsvc_base.constants import LN_255, SUPPORT_RADIUS
from gsvc_base.rendering.definition import Footprint, added, check_residual, exp_minus, footprint
from gsvc_base.rendering.error_models import EPS, FP32, ErrorModel, Roundings, additions
from gsvc_base.splats import PARAMETERS_PER_SPLAT, Splats

OF_U1: Final = Roundings(5, factors=2, stored=5)
OF_Y: Final = Roundings(6, factors=2, stored=6)
OF_SHEAR: Final = Roundings(11, factors=6, stored=11)
OF_SIGMA: Final = Roundings(2, factors=2, stored=2)
OF_TERM: Final = Roundings(2, factors=2, stored=3)
OF_Q: Final = Roundings(5, factors=4, stored=6)
OF_MOMENT: Final = Roundings(4, factors=4, stored=3)
OF_FACTOR: Final = Roundings(12, factors=6, stored=12)
"""Roundings of u1; of the parts of u2; of sigma; of a term of a pixel, without additions; of q, of a term of a moment;
of a factor of (13-12) and its product (13-20)."""

LARGEST_SIGMA: Final = 6.0
"""At least the largest computed sigma of a covered pixel."""


def coverage_margin(splat: F8, model: ErrorModel = FP32) -> int:
    """The number of pixels beyond the bounding box that a decision in a model may still find covered."""
    reach = SUPPORT_RADIUS * (splat[2] + abs(splat[3]) + splat[4])
    lost = 4 * model.eta * (splat[2] + splat[4]) if model.narrow else 0.0
    beyond = (64 * EPS + 4 * model.digits(OF_SHEAR) + lost) * reach + 2 * model.position if lost < 1 else np.inf
    return 1 + int(np.ceil(min(beyond, 2.0**17)))


class WeightErrors:
    """The errors of one splat (8,) f8 over its footprint, each (h, w) f8, named as in the module's text."""

    def __init__(self, splat: F8, pixels: Footprint, model: ErrorModel = FP32) -> None:
        l11, l21, l22 = splat[2], abs(splat[3]), splat[4]
        eta, entry = model.eta, 2 * model.eta if model.narrow else 0.0
        dx, dy, u1, u2, sigma = (abs(part) for part in (pixels.dx, pixels.dy, pixels.u1, pixels.u2, pixels.sigma))
        later = 1 + model.digits(OF_SHEAR)  # what roundings make of absolute errors
        # (13-22)
        absolute = later * eta * (1 + dx) + later * (model.position + entry * u1) / l11
        # Bounds of the errors of u1, u2 and sigma.
        self.delta_1 = model.growth(OF_U1) * u1 + absolute  # (13-5)
        self.delta_2 = (
            (model.growth(OF_Y) * dy + model.growth(OF_SHEAR) * l21 * u1 + l21 * absolute + eta) / l22
            + later * eta * (1 + dy + l21 * u1 + u1)
            + later * (model.position + entry * (1 + u1 + (dy + l21 * u1) / l22)) / l22  # (13-6)
        )  # fmt: skip
        w = u1 * self.delta_1 + u2 * self.delta_2 + (self.delta_1 * self.delta_1 + self.delta_2 * self.delta_2) / 2
        self.d_sigma = w + model.growth(OF_SIGMA) * (sigma + w) + entry  # (13-7)
        if min(l11, l22) < entry:
            self.d_sigma = np.full(sigma.shape, np.inf)
        nearest, farthest = np.maximum(sigma - self.d_sigma, 0), sigma + self.d_sigma
        # exp(-sigma), covered or not, and its error.
        self.g_plain, highest, lowest = exp_minus(np.stack([sigma, nearest, farthest]))
        of_exp = (3 + 2 * nearest) * EPS * highest  # exp(-x) (3 + 2 x) falls: it is largest at the smallest x
        of_stored = (1 + 2 * np.minimum(farthest, LARGEST_SIGMA)) * model.stored * highest  # (13-23)
        self.d_g = np.maximum(highest - self.g_plain, self.g_plain - lowest) + of_exp + of_stored + eta  # (13-8)
        # Where either coverage decision is legal.
        distance = abs(sigma - LN_255)
        self.band = distance <= self.d_sigma + (EPS + model.stored) * LN_255  # (13-9)
        entries = max(l11, l21, l22, 1 / l11, 1 / l22, l21 / l22)
        steps = np.maximum(np.maximum(dx, dy) + model.local, np.maximum(dy / l22, l21 * u1 * max(1, 1 / l22)))
        self.band |= pixels.covered & model.beyond(np.maximum(steps, entries))


def error_footprints(
    parameters: NDArray[np.float32], width: int, height: int, model: ErrorModel = FP32
) -> Iterator[tuple[int, F8, Footprint, WeightErrors]]:
    """The index, parameters (8,) f8, footprint and errors of all splats (N, 8) that can cover a pixel, or nearly so."""
    for n, splat in enumerate(parameters.astype(np.float64)):
        pixels = footprint(splat, width, height, margin=coverage_margin(splat, model))
        if pixels is not None:
            yield n, splat, pixels, WeightErrors(splat, pixels, model)


class SumBound:
    """The parts of the bound of a picture's sum, added up splat by splat: each (H, W, 3) or (H, W, 1) f8."""

    def __init__(self, width: int, height: int, model: ErrorModel = FP32) -> None:
        self._model = model
        self._smooth, self._absolute, self._band = np.zeros((3, height, width, 3))
        self._terms = np.zeros((height, width, 1))

    def add(self, splat: F8, pixels: Footprint, errors: WeightErrors, times: int = 1) -> None:
        """Add a splat that occurs `times` times."""
        at = (pixels.rows, pixels.columns)
        c = abs(splat[5:]) * times
        highest = errors.g_plain + errors.d_g
        either = pixels.covered | errors.band
        self._smooth[at] += (pixels.covered * errors.d_g)[..., None] * c
        self._absolute[at] += (pixels.covered * highest)[..., None] * c
        self._band[at] += (errors.band * highest)[..., None] * c  # (13-10)
        self._terms[at] += either[..., None] * float(times)
        if (lost := self._model.beyond(abs(splat[5:]))).any():
            self._smooth[at] += np.where(either[..., None] & lost, np.inf, 0.0)

    def bound(self) -> F8:
        """(13-11) and (13-24): (H, W, 3) f8."""
        model, n = self._model, self._terms
        magnitude = self._absolute + self._band
        roundings = model.growth(OF_TERM, n, n) * magnitude
        results = n * min(model.terms - 1, 1) + 1 if model.stored else 0.0
        losses = (1 + model.digits(OF_TERM)) * (2 * n + results) * model.eta
        bound = self._smooth + roundings + self._band + losses
        return np.where(model.beyond(magnitude), np.inf, bound)


@door
def render_exact_with_bound(
    splats: Splats | ArrayLike, width: int, height: int, model: ErrorModel = FP32
) -> tuple[F8, F8]:
    """The exact sum and how far a renderer may be from it in each element (the derivation is above).

    Parameters
    ----------
    splats
        The splats, or their parameters (N, 8) f4.
    width, height
        Size of the frame in pixels.
    model
        The error model.

    Returns
    -------
    C
        (H, W, 3) f8, not clamped: `render_sum` with precision ``exact``.
    bound
        (H, W, 3) f8: a correct renderer's sum is finite and within `bound` of C.
    """
    C = np.zeros((height, width, 3))  # (H, W, 3) f8
    bound = SumBound(width, height, model)
    for _, splat, pixels, errors in error_footprints(Splats.of(splats).to_array(), width, height, model):
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


def exact_gradients_with_bound(splats: Splats, residual: ArrayLike, model: ErrorModel = FP32) -> tuple[F8, F8]:
    """The exact gradients of sum(residual * C) and how far others may be from them (the derivation is above).

    Parameters
    ----------
    splats
        The splats.
    residual
        (H, W, 3), dL/dC.
    model
        The error model.

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
    for n, splat, pixels, errors in error_footprints(splats.to_array(), width, height, model):
        e = e_all[pixels.rows, pixels.columns]  # (h, w, 3) f8
        gradients[n] = pixels.gradient(splat, e)
        bound[n] = gradient_bound(splat, pixels, errors, e, model)
    return gradients, bound


def gradient_bound(splat: F8, pixels: Footprint, errors: WeightErrors, e: F8, model: ErrorModel = FP32) -> F8:
    """The bounds (8,) f8 of one splat's gradients, with e = dL/dC (h, w, 3) f8."""
    l11, l21, l22 = splat[2], abs(splat[3]), splat[4]
    eta, entry = model.eta, 2 * model.eta if model.narrow else 0.0
    u1, u2, d1, d2 = abs(pixels.u1), abs(pixels.u2), errors.delta_1, errors.delta_2
    either = pixels.covered | errors.band
    count = np.count_nonzero(either)
    rows, columns = (np.count_nonzero(either.any(axis=axis)) for axis in (1, 0))
    order = model.growth(OF_MOMENT, additions(count, int(rows), int(columns)), count)
    d_q_of_a = errors.d_g + model.growth(OF_Q) * (errors.g_plain + errors.d_g)  # (13-14)
    later = 1 + model.digits(OF_FACTOR)
    inputs = entry * (_summed(abs(e)) + added(abs(splat[5:])))  # what is lost of e and c'

    def moment(A: F8, m: F8 | float, d_m: F8 | float) -> tuple[float, float]:
        """The absolute sum and the error of one moment."""
        M = m + d_m
        d_Q = d_q_of_a * A + later * (8 * eta + inputs)
        highest = (errors.g_plain * A + d_Q) * M
        lost = later * (2 * eta + entry * (1 + errors.g_plain * A + d_Q))
        error = d_Q * M + errors.g_plain * A * d_m + order * highest + lost
        return added(highest[either]), added(error[either]) + added(highest[errors.band])  # (13-15), (13-25)

    def total(*parts: tuple[tuple[float, float], float, float]) -> float:
        """The error of a sum of moments times factors: (absolute sum, error), factor, absolute error of the factor."""
        return added(np.array([_product(of_moment, factor, lost, model) for of_moment, factor, lost in parts]))

    A = abs(e[..., 0] * splat[5]) + abs(e[..., 1] * splat[6]) + abs(e[..., 2] * splat[7])  # (h, w) f8
    of_u1 = moment(A, u1, d1)
    of_u2 = moment(A, u2, d2)
    of_11 = moment(A, u1 * u1, (2 * u1 + d1) * d1)
    of_12 = moment(A, u1 * u2, u1 * d2 + u2 * d1 + d1 * d2)
    of_22 = moment(A, u2 * u2, (2 * u2 + d2) * d2)  # (13-13)
    i11, i22, shear = 1 / l11, 1 / l22, l21 / (l11 * l22)
    lost_11, lost_22 = entry * (i11 * i11 + 1), entry * (i22 * i22 + 1)
    lost_shear = entry * (shear * (i11 + i22) + i11 * i22 + i11 + l21 * (i11 + i22) + 1)
    bound = [  # the factors of (13-12)
        total((of_u1, i11, lost_11), (of_u2, shear, lost_shear)),
        total((of_u2, i22, lost_22)),
        total((of_11, i11, lost_11), (of_12, shear, lost_shear)),
        total((of_12, i22, lost_22)),
        total((of_22, i22, lost_22)),
        *(total((moment(abs(e[..., k]), 1.0, 0.0), 1.0, 0.0)) for k in range(3)),
    ]
    steps = (abs(e[either]).max(initial=0), abs(splat[5:]).max(), i11, i22, shear, l21 / l22)
    if min(l11, l22) < entry or np.any(model.beyond(steps)):
        return np.full(8, np.inf)
    return np.array(bound)


def _product(moment: tuple[float, float], factor: float, lost: float, model: ErrorModel) -> float:
    """The error of a moment (absolute sum, error) times a factor, which may lose something itself (13-16), (13-26)."""
    absolute, error = moment
    most, eta = absolute + error, model.eta
    later = 1 + model.digits(OF_FACTOR)
    of_product = (error + model.growth(OF_FACTOR) * most) * factor + later * eta * (1 + absolute + error)
    of_stored = later * (most * lost + 2 * eta * factor) if model.narrow else 0.0
    return np.inf if model.beyond(max(most, most * factor)) else float(of_product + of_stored)


def _summed(values: F8) -> F8:
    """The sum of three channels."""
    return np.asarray(values[..., 0] + values[..., 1] + values[..., 2])
