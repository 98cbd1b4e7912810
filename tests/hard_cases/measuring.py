"""Errors of outputs against the truth, as multiples of the bound of that very element."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, wraps
from typing import Any, Final, ParamSpec, TypeVar

import numpy as np
from mpmath import mpf, workdps
from numpy.typing import ArrayLike, NDArray

from gsvc_conformance.expectations import Bounded, Decision, Exact, Expectation, Interval
from gsvc_conformance.mutants import MUTANTS
from gsvc_conformance.operation import Values, operations
from gsvc_conformance.spec import namespace

DIGITS: Final = 60
"""Decimal digits of the truth."""

P = ParamSpec("P")
R = TypeVar("R")

FAR: Final = 2.0**-29
"""Maximum fraction of a bound that the kit's own oracle may use.

Its values are the true ones, rounded once to binary64: off by 2^-53 of themselves at most, where bounds allow for eps =
2^-23 at least. That is 2^-30 of the bound; 2^-29 leaves a factor 2 for what the bound rounds itself. Nothing is left of
it where terms cancel and the bound is that of the magnitudes.
"""

Variant = Callable[..., Mapping[str, Any]]
"""An implementation of an operation: from its inputs, by name, to its outputs."""

F8 = NDArray[np.float64]
Objects = NDArray[np.object_]


def precise(function: Callable[P, R]) -> Callable[P, R]:
    """A function of `tests.hard_cases.oracle`: it calculates with DIGITS digits."""

    @wraps(function)
    def with_digits(*args: P.args, **kwargs: P.kwargs) -> R:
        with workdps(DIGITS):
            return function(*args, **kwargs)

    return with_digits


@dataclass(frozen=True, eq=False)
class Truth:
    """The truth about an output.

    Attributes
    ----------
    value
        In the output's shape, of mpf; or integers, for outputs that are decided or rounded.
    bound
        (same shape) f8, for outputs that the kit fixes to the bit and that lie within a bound all the same; else None:
        the bound of the vector.
    """

    value: Objects
    bound: ArrayLike | None = None

    @cached_property
    def parts(self) -> tuple[F8, F8]:
        """The value as a sum of two binary64 numbers."""
        high = np.array([float(v) for v in self.value.flat]).reshape(self.value.shape)
        with workdps(DIGITS):
            low = [
                float(v - mpf(h)) if np.isfinite(h) else 0.0 for v, h in zip(self.value.flat, high.flat, strict=True)
            ]
        return high, np.array(low).reshape(high.shape)


@dataclass(frozen=True)
class Worst:
    """The element of all outputs whose error is largest as a multiple of its bound.

    Attributes
    ----------
    error
        Its error: infinite for a NaN, or where only one of output and truth is infinite.
    bound
        Its bound: 0 for integers and bits, which have to be the legal ones.
    """

    error: float
    bound: float

    @property
    def ratio(self) -> float:
        """The error as a multiple of the bound."""
        if self.error == 0:
            return 0.0
        return self.error / self.bound if self.bound > 0 else np.inf

    @property
    def rank(self) -> tuple[float, float, float]:
        """The rank of its badness; without an error anywhere, the largest bound is the one to show."""
        return self.ratio, self.error, self.bound


@dataclass(frozen=True)
class Measurement:
    """The measurement of a case.

    Attributes
    ----------
    ours
        By implementation: gsvc_ref, the code of spec.md, and others.
    naive
        Of the naive formula.
    kit
        Of the kit's own oracle; None where it is the bits themselves that are fixed.
    """

    ours: Mapping[str, Worst]
    naive: Worst
    kit: Worst | None = None

    @property
    def worst(self) -> Worst:
        """The worst of ours."""
        return max(self.ours.values(), key=lambda worst: worst.rank)


def implementations(operation: str) -> dict[str, Variant]:
    """The project's implementations of an operation."""
    return {"gsvc_ref": operations()[operation].reference, "spec.md": namespace()[operation]}


def mutated(operation: str, name: str) -> Variant:
    """An operation by one of the kit's mutants."""
    (mutant,) = (mutant for mutant in MUTANTS if mutant.name == name)
    return lambda **inputs: mutant.namespace()[operation](**inputs)


def measure(
    inputs: Values,
    expected: Mapping[str, Expectation],
    truths: Mapping[str, Truth],
    ours: Mapping[str, Variant],
    naive: Variant,
) -> Measurement:
    """Run implementations on the inputs of a vector and compare them with the truth."""
    judged_by_kit = {name: truth for name, truth in truths.items() if truth.bound is None}
    of_kit = {name: expectation.value for name, expectation in expected.items()}
    return Measurement(
        {name: _worst(expected, truths, _run(variant, inputs)) for name, variant in ours.items()},
        _worst(expected, truths, _run(naive, inputs)),
        _worst(expected, judged_by_kit, of_kit) if judged_by_kit else None,
    )


def _run(variant: Variant, inputs: Values) -> Mapping[str, Any]:
    own = {name: value.copy() if isinstance(value, np.ndarray) else value for name, value in inputs.items()}
    with np.errstate(all="ignore"):
        return variant(**own)


def _worst(expected: Mapping[str, Expectation], truths: Mapping[str, Truth], actual: Mapping[str, Any]) -> Worst:
    worst = Worst(0.0, 0.0)
    for name, truth in truths.items():
        for found in _errors(expected[name], truth, np.asarray(actual[name])):
            worst = max(worst, found, key=lambda one: one.rank)
    return worst


def _errors(expectation: Expectation, truth: Truth, actual: NDArray[Any]) -> list[Worst]:
    """The worst element of an output, by its bound and, where bits are fixed, by those."""
    if isinstance(expectation, Bounded):
        return [compared(truth, actual, expectation.bound)]
    found = [outside(expectation, actual)]
    if truth.bound is not None:
        found.append(compared(truth, actual, truth.bound))
    elif actual is expectation.value:  # the kit's: it has to be the true one of the legal integers
        found.append(compared(truth, actual, 0.0))
    return found


def outside(expectation: Expectation, actual: NDArray[Any]) -> Worst:
    """The distance of integers, or of numbers that are fixed to the bit, from the legal ones; the bound is 0."""
    assert isinstance(expectation, Exact | Decision | Interval)
    with np.errstate(all="ignore"):
        same_type = actual.astype(expectation.value.dtype)
    if expectation.judge(same_type).passed:
        return Worst(0.0, 0.0)
    if actual.shape != expectation.value.shape:
        return Worst(np.inf, 0.0)
    if isinstance(expectation, Interval):
        low, high = expectation.lowest, expectation.highest
    else:
        other = expectation.alternative if isinstance(expectation, Decision) else None
        low = high = expectation.value
        if other is not None:
            low, high = np.minimum(low, other), np.maximum(high, other)
    wide = actual.astype(np.float64)
    with np.errstate(invalid="ignore"):
        error = np.maximum(low.astype(np.float64) - wide, wide - high.astype(np.float64))
    error = np.where(np.isnan(wide), np.inf, error)
    # Wrong as well, if by nothing that can be subtracted: a zero of the other sign, one infinity for another.
    return Worst(float(np.max(np.where(error > 0, error, 2.0**-149))), 0.0)


def compared(truth: Truth, actual: NDArray[Any], bound: ArrayLike) -> Worst:
    """The worst element of an output against the truth; the difference is good to 30 digits of the truth."""
    high, low = truth.parts
    if high.shape != actual.shape:
        raise ValueError(f"the truth has shape {high.shape}, the output {actual.shape}")
    wide = actual.astype(np.float64)
    with np.errstate(invalid="ignore"):
        error = abs((wide - high) - low)
    error = np.where(np.isfinite(wide) & np.isfinite(high), error, np.where(wide == high, 0.0, np.inf))
    bounds = np.broadcast_to(np.asarray(bound, np.float64), actual.shape)
    found = (Worst(*pair) for pair in zip(error.ravel().tolist(), bounds.ravel().tolist(), strict=True))
    return max(found, key=lambda worst: worst.rank, default=Worst(0.0, 0.0))


def exactly(values: ArrayLike) -> Objects:
    """Numbers of binary32, binary64 or integers as mpf, exactly, in the same shape."""
    array = np.asarray(values)
    wide = [mpf(int(v)) if array.dtype.kind in "iub" else mpf(float(v)) for v in array.flat]
    result = np.empty(len(wide), object)
    result[:] = wide
    return result.reshape(array.shape)
