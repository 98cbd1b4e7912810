"""Running error analysis in the error model fp32/1: numbers that know how far a binary32 implementation may be off.

`Computed` is a value in binary64 with a bound of the error, and calculates like an array. An operation passes the
errors of its operands on and adds its own: eps = 2^-23 of the result for an addition, subtraction or multiplication,
3.5 eps for a quotient (2.5 for a division; 2.5 and 1 for a reciprocal and a product), 2.5 eps for a root (that of
fp32/1 for a division, taken for the root as well), and 2^-126 for underflow. `total` allows any order: gamma_(n-1) of
the sum of magnitudes. A fused operation leaves roundings out and stays within.

Where all operands are exact binary32 numbers and the exact result is one, no rounding direction changes it and nothing
is added; neither for a quotient by a power of two. So ties and bounds that are met exactly have exact expectations.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from conformance.expectations import Bounded
from gsvc_ref.rendering.bounds import EPS, ETA, gamma

F8 = NDArray[np.float64]

QUOTIENT = 3.5 * EPS
ROOT = 2.5 * EPS


@dataclass(frozen=True, eq=False)
class Computed:
    """Numbers of which an implementation has anything within `error` of `value`; both f8 of one shape."""

    value: F8
    error: F8

    __array_ufunc__ = None  # so that array * Computed asks Computed

    def __getitem__(self, place: Any) -> "Computed":
        return Computed(self.value[place], self.error[place])

    def __neg__(self) -> "Computed":
        return Computed(-self.value, self.error)

    def __add__(self, other: "Computed") -> "Computed":
        value = self.value + other.value
        exact = _all_exact(self, other) & _sum_is_exact(self.value, other.value, value)
        return _rounded(value, self.error + other.error, EPS, exact)

    def __sub__(self, other: "Computed") -> "Computed":
        return self + -other

    def __mul__(self, other: "Computed") -> "Computed":
        value = self.value * other.value
        error = abs(self.value) * other.error + abs(other.value) * self.error + self.error * other.error
        return _rounded(value, error, EPS, _all_exact(self, other))  # 48 bits fit binary64

    def __truediv__(self, other: "Computed") -> "Computed":
        least = abs(other.value) - other.error
        with np.errstate(divide="ignore", invalid="ignore"):
            value = self.value / other.value
            error = np.where(least > 0, (self.error + abs(value) * other.error) / np.maximum(least, 0), np.inf)
        power_of_two = abs(np.frexp(other.value)[0]) == 0.5
        return _rounded(value, error, QUOTIENT, _all_exact(self, other) & power_of_two)

    def sqrt(self) -> "Computed":
        """The root of numbers that are at least 0: near 0 the distance of the roots themselves, not a derivative."""
        value = np.sqrt(self.value)
        highest, lowest = np.sqrt(self.value + self.error), np.sqrt(np.maximum(self.value - self.error, 0))
        return _rounded(value, np.maximum(highest - value, value - lowest), ROOT, np.zeros(value.shape, np.bool_))

    def total(self, axis: int | None = None) -> "Computed":
        """The sum along an axis, or of all, in any order."""
        count = self.value.size if axis is None else self.value.shape[axis]
        value, error = self.value.sum(axis), np.asarray(self.error.sum(axis))
        magnitude = abs(self.value).sum(axis) + error
        step = np.min(_last_place(self.value), axis=axis, initial=1.0)
        # Every partial sum of so few steps is a binary32 number.
        exact = (error == 0) & (magnitude < 2.0**24 * step) & (step >= ETA)
        return Computed(value, np.where(exact, error, error + gamma(max(count - 1, 0)) * magnitude + count * ETA))

    def where(self, condition: NDArray[np.bool_], other: "Computed") -> "Computed":
        """These numbers where the condition holds, else the other ones."""
        return Computed(np.where(condition, self.value, other.value), np.where(condition, self.error, other.error))


def given(values: ArrayLike) -> Computed:
    """Inputs: exact, but subnormal ones may be taken for zero."""
    wide = np.asarray(values, np.float64)
    return Computed(wide, np.where(abs(wide) < ETA, abs(wide), 0.0))


def rounded_once(values: ArrayLike) -> Computed:
    """Numbers that are known in binary64 and rounded to binary32 once."""
    wide = np.asarray(values, np.float64)
    return _rounded(wide, np.zeros(wide.shape), EPS, np.ones(wide.shape, np.bool_))


def stack(*parts: Computed) -> Computed:
    """Parts of one shape along a new first axis."""
    shape = np.broadcast_shapes(*(part.value.shape for part in parts))
    return Computed(
        np.stack([np.broadcast_to(part.value, shape) for part in parts]),
        np.stack([np.broadcast_to(part.error, shape) for part in parts]),
    )


def expected(number: Computed, dtype: str = "<f4") -> Bounded:
    """What an implementation may return, as numbers of `dtype`."""
    return Bounded(np.asarray(number.value), np.asarray(number.error), dtype)


def _rounded(value: F8, error: F8, unit: float, exact: NDArray[np.bool_]) -> Computed:
    with np.errstate(over="ignore"):
        representable = (value.astype(np.float32) == value) & ((abs(value) >= ETA) | (value == 0))
    own = unit * (abs(value) + error) + ETA
    return Computed(value, np.where(exact & representable, error, error + own))


def _all_exact(a: Computed, b: Computed) -> NDArray[np.bool_]:
    return np.asarray((a.error == 0) & (b.error == 0))


def _sum_is_exact(a: F8, b: F8, total: F8) -> NDArray[np.bool_]:
    """Whether a + b needed no rounding in binary64 (Knuth's two-sum)."""
    of_b = total - a
    return np.asarray((a - (total - of_b)) + (b - of_b) == 0)


def _last_place(values: F8) -> F8:
    """The value of the last bit that is set in each number; infinite for 0."""
    fraction, exponent = np.frexp(values)
    whole = (fraction * 2.0**53).astype(np.int64)
    return np.asarray(np.where(whole == 0, np.inf, np.ldexp((whole & -whole).astype(np.float64), exponent - 53)))
