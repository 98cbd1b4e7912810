"""Scale and offset of LSQ+ channels: what may be coded, where training starts, and an exact zero for differences."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_base.arrays import F4, F8
from gsvc_base.errors import UsageError
from gsvc_ref.paper.lsq import largest_code, lsq_quantize

SCALE_FLOOR: Final = np.float32(2.0**-24)
"""Smallest scale that training may reach: a finer step is lost in the binary32 rounding of a value near 1 px."""

CLIPPED_FRACTIONS: Final = (0.0, 0.001, 0.01, 0.05)
"""Fractions of the total weight that the starts of `from_mse` clip at either end."""

REFINEMENTS: Final = 4
"""Rounds of assignment and least squares in `from_mse`; the error does not rise from one to the next."""


@dataclass(frozen=True, eq=False)
class LsqParameters:
    """Scale and offset of C channels, with which a decoder dequantizes them."""

    scale: F4  # (C,) the step s of each channel, in the unit of the values, at least 2^-24
    offset: F4  # (C,) the value beta of code 0 of each channel

    def __post_init__(self) -> None:
        scale, offset = (np.array(part, np.float32, ndmin=1) for part in (self.scale, self.offset))
        if scale.ndim != 1 or scale.shape != offset.shape:
            raise UsageError(f"scale has shape {scale.shape} and offset {offset.shape}; both must be (channels,)")
        if not (np.isfinite(scale).all() and np.isfinite(offset).all()):
            raise UsageError(f"scale {scale} and offset {offset} must be finite")
        if (scale < SCALE_FLOOR).any():
            raise UsageError(f"scale {scale} must be at least {SCALE_FLOOR}; apply bounded_scale after each step")
        object.__setattr__(self, "scale", scale)
        object.__setattr__(self, "offset", offset)


def bounded_scale(scale: ArrayLike) -> F4:
    """max(scale, 2^-24): applied after each training step, so that no scale crosses zero; same shape, f4."""
    return np.maximum(np.asarray(scale, np.float32), SCALE_FLOOR)


def zero_codes(parameters: LsqParameters, bits: int) -> NDArray[np.uint16]:
    """The code nearest to zero in each channel, (C,) u2."""
    zeros = np.zeros((1, len(parameters.scale)), np.float32)
    return lsq_quantize(zeros, parameters.scale, parameters.offset, bits).ravel()


def with_exact_zero(parameters: LsqParameters, bits: int) -> LsqParameters:
    """The parameters with each offset moved, by at most about half a step, so that one code stands for exactly zero.

    The offset becomes -fl(k * s) with k of `zero_codes`, so that fl(fl(k * s) + beta) = 0: a splat that does not
    change between frames then has a difference of exactly zero. Where zero lies outside a channel's range, k is the
    nearer end and the range moves with it.
    """
    k = zero_codes(parameters, bits).astype(np.float32)
    return LsqParameters(parameters.scale, np.float32(0) - k * parameters.scale)


def from_range(x: ArrayLike, bits: int) -> LsqParameters:
    """Scale and offset whose codes span each channel of x (N, C), N >= 1, from its smallest to its largest value.

    beta = min, s = max((max - min) / p, 2^-24).
    """
    p, values = largest_code(bits), _checked_values(x)
    low, high = values.min(axis=0), values.max(axis=0)
    return _narrow((high - low) / p, low)


def from_mse(x: ArrayLike, bits: int, weights: ArrayLike | None = None) -> LsqParameters:
    """Scale and offset with a small mean squared quantisation error in each channel of x (N, C), N >= 1.

    From 16 clipping ranges (4 fractions of the weight at either end), the codes and the least-squares scale and
    offset for these codes are found in turn; the best result wins. The first range is that of `from_range`, so the
    error is never larger than there. The weights (N,) or (N, C), at least 0, say how much each squared error counts.
    """
    p, values = largest_code(bits), _checked_values(x)
    weight = _checked_weights(weights, values.shape)
    columns = [_search(values[:, c], weight[:, c], p) for c in range(values.shape[1])]
    scale, offset = np.array(columns).T
    return _narrow(scale, offset)


def _search(x: F8, weight: F8, p: int) -> tuple[float, float]:
    """Best (s, beta) of one channel; x and weight are (N,)."""
    order = np.argsort(x, kind="stable")
    center = x[order[len(x) // 2]]  # sums of squares about a middle value cancel least
    x, weight = x[order] - center, weight[order]
    sums = np.zeros((3, len(x) + 1))  # running sums of w, w x, w x^2
    np.cumsum([weight, weight * x, weight * x * x], axis=1, out=sums[:, 1:])

    clipped = np.array(CLIPPED_FRACTIONS) * sums[0, -1]
    lowest = np.searchsorted(sums[0, 1:], clipped)
    highest = np.searchsorted(sums[0, 1:], sums[0, -1] - clipped)
    # The whole range comes first, so that the best is never worse.
    lowest[0], highest[0] = 0, len(x) - 1
    low, high = (ends.ravel() for ends in np.meshgrid(x[lowest], x[highest], indexing="ij"))  # (16,)
    scale, offset = np.maximum((high - low) / p, SCALE_FLOOR), low
    best = (np.inf, scale[0], offset[0])
    # All 16 starts side by side. Sorted values: each code takes a range, and its sums are two differences.
    for _ in range(REFINEMENTS + 1):
        parts = _sums_by_code(x, sums, scale, offset, p)
        error = _squared_error(parts, scale, offset, p)
        winner = int(np.argmin(error))
        if error[winner] < best[0]:
            best = (error[winner], scale[winner], offset[winner])
        scale, offset = _least_squares(parts, scale, offset, p)
    return float(best[1]), float(best[2] + center)


def _sums_by_code(x: F8, sums: F8, scale: F8, offset: F8, p: int) -> F8:
    """Sums of w, w x, w x^2 over the values that take each code: (3, starts, p + 1)."""
    thresholds = offset[:, None] + (np.arange(p) + 0.5) * scale[:, None]  # (starts, p)
    ends = np.searchsorted(x, thresholds)
    bounds = np.pad(ends, ((0, 0), (1, 1)), constant_values=((0, 0), (0, len(x))))  # (starts, p + 2)
    return np.diff(sums[:, bounds], axis=2)


def _squared_error(parts: F8, scale: F8, offset: F8, p: int) -> F8:
    count, first, second = parts
    value = offset[:, None] + np.arange(p + 1) * scale[:, None]
    return np.asarray((second - 2 * value * first + value * value * count).sum(axis=1))


def _least_squares(parts: F8, scale: F8, offset: F8, p: int) -> tuple[F8, F8]:
    """The line x = s q + beta nearest to the values of each code; unchanged where all values share one code."""
    count, first, _ = parts
    q = np.arange(p + 1)
    # Sums rather than matrix products: these differ in their last bits from one kind of CPU to another.
    total, sum_q, sum_x = count.sum(axis=1), (count * q).sum(axis=1), first.sum(axis=1)
    determinant = total * (count * (q * q)).sum(axis=1) - sum_q * sum_q
    solvable = determinant > 1e-9 * total * total  # all values share one code: no line
    fitted = (total * (first * q).sum(axis=1) - sum_q * sum_x) / np.where(solvable, determinant, 1.0)
    new_scale = np.maximum(np.where(solvable, fitted, scale), SCALE_FLOOR)
    new_offset = (sum_x - new_scale * sum_q) / np.where(solvable, total, 1.0)
    return new_scale, np.where(solvable, new_offset, offset)


def _narrow(scale: F8, offset: F8) -> LsqParameters:
    with np.errstate(over="ignore"):  # a range beyond binary32 becomes infinite, which LsqParameters refuses
        return LsqParameters(bounded_scale(scale), offset.astype(np.float32))


def _checked_values(x: ArrayLike) -> F8:
    values = np.asarray(x, np.float64)
    if values.ndim != 2 or len(values) == 0:
        raise UsageError(f"the values have shape {values.shape}; they must be (N, channels) with N >= 1")
    if not np.isfinite(values).all():
        raise UsageError("a value to quantize is NaN or infinite; every value must be finite")
    return values


def _checked_weights(weights: ArrayLike | None, shape: tuple[int, ...]) -> F8:
    if weights is None:
        return np.ones(shape)
    array = np.asarray(weights, np.float64)
    array = array[:, None] if array.ndim == 1 else array
    if array.shape not in (shape, (shape[0], 1)):
        raise UsageError(f"weights have shape {array.shape}, the values {shape}; give one per splat or one per value")
    if not (np.isfinite(array).all() and (array >= 0).all()):
        raise UsageError("a weight is negative or not finite; weights must be at least 0")
    return np.broadcast_to(array, shape)
