"""Running error analysis in the error model fp32/1: numbers that know how far a binary32 implementation may be off.

`Computed` is a real number (`expansions`) with a bound of the error, and calculates like an array (13-17). An operation
passes the errors of its operands on and adds its own: eps = 2^-23 of the result for an addition, subtraction or
multiplication, 3.5 eps for a quotient (2.5 for a division; 2.5 and 1 for a reciprocal and a product), 2.5 eps for a
root (that of fp32/1 for a division, taken for the root as well), and 2^-126 for underflow. `total` allows any order in
which no term takes part in more than D additions: gamma_D of the sum of magnitudes. A fused operation leaves roundings
out and stays within. Errors are evaluated in binary64 by IEEE operations in a stated order.

Where all operands are exact binary32 numbers and the exact result is one, no rounding direction changes it and nothing
is added; neither for a quotient by a power of two. So ties and bounds that are met exactly have exact expectations.

In the models with fewer digits factors of products, or inputs and results, have an error more (13-19), exact or not.
"""

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_base.arrays import F8, I8
from gsvc_base.exact.expansions import Expansion, certain, exact, joined, where
from gsvc_base.rendering.error_models import EPS, ETA, FP32, ErrorModel, Roundings, additions

QUOTIENT_ERROR = 3.5 * EPS
ROOT_ERROR = 2.5 * EPS
OF_QUOTIENT: Final = Roundings(3.5, factors=2, stored=1)
OF_SUM: Final = Roundings(0, factors=0, stored=0)
"""Roundings of a quotient as a product, without that of its result, and of a sum beside its additions."""
COMPONENTS: Final = 4
"""Number of components of a number: some 210 bits, of which cancellation may take all but 53."""


@dataclass(frozen=True, eq=False)
class Computed:
    """Real numbers of which an implementation has anything within `error` (f8, of the same shape)."""

    number: Expansion
    error: F8
    model: ErrorModel = FP32

    __array_ufunc__ = None  # so that array * Computed asks Computed

    @property
    def value(self) -> F8:
        """The numbers in binary64: (...) f8."""
        return self.number.near

    def __getitem__(self, place: Any) -> "Computed":
        return replace(self, number=self.number[place], error=self.error[place])

    def __neg__(self) -> "Computed":
        return replace(self, number=-self.number)

    def __add__(self, other: "Computed") -> "Computed":
        error = self.error + other.error
        return _rounded(self.number + other.number, error, EPS, _all_exact(self, other), self.model)

    def __sub__(self, other: "Computed") -> "Computed":
        return self + -other

    def __mul__(self, other: "Computed") -> "Computed":
        of_self, of_other = self._as_factor(), other._as_factor()
        error = abs(self.value) * of_other + abs(other.value) * of_self + of_self * of_other
        return _rounded(self.number * other.number, error, EPS, _all_exact(self, other), self.model)

    def _as_factor(self) -> F8:
        """The error of these numbers as factors of a product."""
        model = self.model
        own = model.factor * (abs(self.value) + self.error) + model.eta if model.factor else 0.0
        return self.error + own

    def __truediv__(self, other: "Computed") -> "Computed":
        least = abs(other.value) - other.error
        quotient = self.number / other.number
        with np.errstate(divide="ignore", invalid="ignore"):
            error = (self.error + abs(quotient.near) * other.error) / np.maximum(least, 0)
        error = np.where(least > 0, error, np.inf)
        if self.model.narrow:  # a product with a reciprocal
            error = error + self.model.digits(OF_QUOTIENT) * (abs(quotient.near) + error)
        exactly = _all_exact(self, other) & (abs(np.frexp(other.value)[0]) == 0.5)  # a power of two
        return _rounded(quotient, error, QUOTIENT_ERROR, exactly, self.model)

    def sqrt(self) -> "Computed":
        """The root of numbers that are at least 0: near 0 the distance of the roots themselves, not a derivative."""
        root = self.number.sqrt()
        highest, lowest = np.sqrt(self.value + self.error), np.sqrt(np.maximum(self.value - self.error, 0))
        error = np.maximum(highest - root.near, root.near - lowest)
        return _rounded(root, np.maximum(error, 0), ROOT_ERROR, np.zeros(error.shape, np.bool_), self.model)

    def total(self, axis: int | None = None, *, times: I8 | None = None, rows: int = 0, columns: int = 0) -> "Computed":
        """The sum along an axis, or of all, where each term of the axis occurs `times`.

        `rows` and `columns` are those of the pixels that the terms belong to, for (13-4).
        """
        terms = self.flat() if axis is None else self._moved(axis)
        return terms.totals(np.zeros(len(terms.error), np.int64), 1, times=times, rows=rows, columns=columns)[0]

    def totals(self, keys: I8, count: int, *, times: I8 | None = None, rows: int = 0, columns: int = 0) -> "Computed":
        """The sums (count, ...) of the terms (n, ...) of each key 0, 1, .. count - 1; see `total`."""
        ones = (1,) * (self.error.ndim - 1)
        repeated = np.ones(len(keys), np.int64) if times is None else times
        often = repeated.reshape(-1, *ones)
        order = np.argsort(keys, kind="stable")
        number = (self.number * exact(often))[order].totals(keys[order], count)
        shape = (count, *self.error.shape[1:])
        error, magnitude, last_place = np.zeros(shape), np.zeros(shape), np.ones(shape)
        np.add.at(error, keys, self.error * often)
        np.add.at(magnitude, keys, (abs(self.value) + self.error) * often)
        np.minimum.at(last_place, keys, _last_place(self.value))
        terms = np.bincount(keys, repeated, count).reshape(-1, *ones)
        # Every partial sum of so few of them is a binary32 number.
        all_exact = (error == 0) & (magnitude < 2.0**24 * last_place) & (last_place >= ETA)
        model, sums = self.model, additions(terms, rows, columns)
        own = model.growth(OF_SUM, sums, terms) * magnitude + terms * model.eta  # (13-17)
        return _stored(Computed(number, np.where(all_exact, error, error + own), model))

    def flat(self) -> "Computed":
        """These numbers in a row."""
        return replace(self, number=self.number.reshape(-1), error=self.error.reshape(-1))

    def _moved(self, axis: int) -> "Computed":
        return replace(self, number=self.number.moved(axis), error=np.moveaxis(self.error, axis, 0))

    def where(self, condition: NDArray[np.bool_], other: "Computed") -> "Computed":
        """These numbers where the condition holds, else the other ones."""
        number = where(condition, self.number, other.number)
        return Computed(number, np.where(condition, self.error, other.error), self.model)


def given(values: ArrayLike, components: int = COMPONENTS, model: ErrorModel = FP32) -> Computed:
    """Inputs: exact, but subnormal ones may be taken for zero; in some models they are stored."""
    wide = np.asarray(values, np.float64)
    return _stored(Computed(exact(wide, components), np.where(abs(wide) < ETA, abs(wide), 0.0), model))


def rounded_once(values: ArrayLike | Expansion) -> Computed:
    """Numbers that are known in binary64 or better and rounded to binary32 once."""
    number = values if isinstance(values, Expansion) else exact(values, COMPONENTS)
    return _rounded(number, np.zeros(number.shape), EPS, np.ones(number.shape, np.bool_))


def stack(*parts: Computed) -> Computed:
    """Parts of one shape along a new first axis."""
    shape = np.broadcast_shapes(*(part.error.shape for part in parts))
    wide = [part.number.broadcast(shape)[None] for part in parts]
    return Computed(joined(*wide), np.stack([np.broadcast_to(part.error, shape) for part in parts]))


def with_bound(number: Computed) -> tuple[F8, F8]:
    """The true numbers, rounded once to binary64, and how far an implementation's may be from them."""
    return certain(number.number), np.asarray(number.error)


def _rounded(
    number: Expansion, error: F8, unit: float, exact_operands: NDArray[np.bool_], model: ErrorModel = FP32
) -> Computed:
    value = number.near
    with np.errstate(over="ignore"):
        representable = number.is_exact & (value.astype(np.float32) == value) & ((abs(value) >= ETA) | (value == 0))
    own = unit * (abs(value) + error) + ETA  # (13-17)
    return _stored(Computed(number, np.where(exact_operands & representable, error, error + own), model))


def _stored(number: Computed) -> Computed:
    """Numbers as they are stored (13-19); what is then too large may be anything."""
    model = number.model
    if not model.stored:
        return number
    most = abs(number.value) + number.error
    return replace(number, error=np.where(model.beyond(most), np.inf, number.error + model.stored * most + model.eta))


def _all_exact(a: Computed, b: Computed) -> NDArray[np.bool_]:
    return np.asarray((a.error == 0) & (b.error == 0))


def _last_place(values: F8) -> F8:
    """The value of the last bit that is set in each number; infinite for 0."""
    fraction, exponent = np.frexp(values)
    whole = (fraction * 2.0**53).astype(np.int64)
    return np.asarray(np.where(whole == 0, np.inf, np.ldexp((whole & -whole).astype(np.float64), exponent - 53)))
