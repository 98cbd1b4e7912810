"""A failure as the looks see it: which outputs are wrong, where, and what agrees with what was given."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gsvc_conformance.expectations import NO_ARRAYS, Bounded, Decision, Exact, Expectation, Interval, Refusal
from gsvc_conformance.operation import Operation, Values
from gsvc_conformance.vector import Vector

Array = NDArray[Any]
F8 = NDArray[np.float64]
Mask = NDArray[np.bool_]

EXPLAINED: Final = 0.9
"""Fraction of the wrong elements that an account must give, and of its own that must have been given."""

NEARNESS: Final = 0.25
"""An element is given by a mutant if it is this many times nearer to the mutant's answer than to the right one."""

NEARNESS_OF_FEW: Final = 0.02
"""The same where few elements are wrong, which agree with one of many mutants by chance."""

FEW: Final = 4
"""Number of wrong elements below which a failure tells little."""

SLACK: Final = 4.0
"""Bounds from a number that was computed otherwise, within which it is taken for the same."""

RELATIVE: Final = 2e-6
"""Relative tolerance where there is no bound: a few units in the last place of binary32."""


class Failure(NamedTuple):
    """A vector, the wrong outputs, and what a buffer that is never cleared would have held before, by output."""

    vector: Vector
    outputs: Values
    before: Mapping[str, Array] = {}


@dataclass(frozen=True, eq=False)
class Part:
    """One wrong output that is an array of the right shape and kind, as binary64.

    Attributes
    ----------
    operation, name
        Whose output it is.
    right, mine
        The expected and the given elements.
    wrong
        The mask of wrong elements of `mine`; all of them if only sums over it are wrong.
    allowed
        The difference that is allowed.
    expectation, given
        As they are.
    """

    operation: Operation
    name: str
    right: F8
    mine: F8
    wrong: Mask
    allowed: F8
    expectation: Bounded | Decision | Exact | Interval
    given: Array

    def at(self, items: Array) -> "Part":
        """The part of some items, by their numbers on the first axis."""
        right, mine, allowed = (array[items] for array in (self.right, self.mine, self.allowed))
        return replace(self, right=right, mine=mine, wrong=self.wrong[items], allowed=allowed)

    def near(self, theirs: F8) -> Mask:
        """Where an account gives what was given, as far as arithmetic can tell."""
        with np.errstate(invalid="ignore", over="ignore"):
            both_nan = np.isnan(self.mine) & np.isnan(theirs)
            return np.asarray((abs(self.mine - theirs) <= self.slack(theirs)) | (self.mine == theirs) | both_nan)

    def slack(self, theirs: F8) -> F8:
        """The largest difference that is allowed between what was given and an account of it."""
        if self.given.dtype.kind != "f":
            return np.full(self.mine.shape, 1.0 if isinstance(self.expectation, Interval) else 0.0)
        allowed = np.where(np.isfinite(self.allowed), self.allowed, 0.0)
        return SLACK * allowed + RELATIVE * np.maximum(abs(theirs), abs(self.right))

    def differs(self, theirs: F8) -> Mask:
        """Where an account is something else than the right output."""
        with np.errstate(invalid="ignore", over="ignore"):
            near = abs(theirs - self.right) <= self.slack(theirs) + self.allowed
            return np.asarray(~(near | (theirs == self.right)))

    def agrees(self, theirs: F8) -> bool:
        """Whether an account gives nearly all that is wrong, and nothing else that would be: it is asked both ways."""
        near, theirs_wrong = self.near(theirs), self.differs(theirs)
        if not (theirs_wrong & self.wrong).any():
            return False
        return bool(near[self.wrong].mean() >= EXPLAINED and near[theirs_wrong].mean() >= EXPLAINED)


def parts(failure: Failure) -> list[Part]:
    """The wrong outputs that can be compared element by element."""
    found = []
    for name in wrong_outputs(failure.vector, failure.outputs):
        expectation, given = failure.vector.expected[name], failure.outputs.get(name)
        if isinstance(expectation, NO_ARRAYS) or not isinstance(given, np.ndarray):
            continue
        if given.shape != expectation.value.shape or given.dtype.kind not in "biuf":
            continue
        right = expectation.value.astype(np.float64)
        found.append(
            Part(
                failure.vector.operation,
                name,
                right,
                given.astype(np.float64),
                wrong_elements(expectation, given),
                _allowed(expectation, right),
                expectation,
                given,
            )
        )
    return found


def _allowed(expectation: Expectation, right: F8) -> F8:
    if isinstance(expectation, Bounded):
        return np.asarray(expectation.bound, np.float64)
    if isinstance(expectation, Interval):
        return np.maximum(expectation.highest - right, right - expectation.lowest)
    return np.zeros(right.shape)


def wrong_outputs(vector: Vector, outputs: Values) -> list[str]:
    """The names of the outputs that are judged wrong."""
    return [name for name, expectation in vector.expected.items() if not expectation.judge(outputs.get(name)).passed]


def wrong_elements(expectation: Bounded | Decision | Exact | Interval, mine: Array) -> Mask:
    """The wrong elements; all where only their sum is wrong."""
    if isinstance(expectation, Bounded):
        with np.errstate(invalid="ignore"):
            near = abs(mine.astype(np.float64) - expectation.value) <= expectation.bound
        wrong = ~(near | (mine == expectation.value))
    elif isinstance(expectation, Interval):
        wrong = (mine < expectation.lowest) | (mine > expectation.highest)
    else:
        wrong = mine != expectation.value
        if isinstance(expectation, Decision) and expectation.alternative is not None:
            wrong = wrong & (mine != expectation.alternative)
    wrong = np.asarray(wrong)
    return wrong if wrong.any() else np.ones(mine.shape, np.bool_)


def count(expectation: Expectation, mine: Any) -> int:
    """The number of wrong elements of an output; 0 for what is no array of the right shape."""
    if isinstance(expectation, NO_ARRAYS) or not isinstance(mine, np.ndarray) or mine.shape != expectation.value.shape:
        return 0
    return int(wrong_elements(expectation, mine).sum())


def share(vector: Vector, outputs: Values, theirs: Values) -> float:
    """The fraction of a mutant's outputs that were given, asked both ways, in the output with the least of it.

    The one way it is the fraction of the wrong elements that the mutant gives, the other way the fraction of what the
    mutant gets wrong that was given: a mutant that spoils much explains nothing of which only a part is spoiled.
    """
    mine_wrong, theirs_wrong = wrong_outputs(vector, outputs), wrong_outputs(vector, theirs)
    if not mine_wrong:
        return 0.0
    ways = [_given(vector.expected[name], outputs.get(name), theirs.get(name)) for name in mine_wrong]
    ways += [_given(vector.expected[name], theirs.get(name), outputs.get(name)) for name in theirs_wrong]
    return min(ways)


def _given(expectation: Expectation, mine: Any, theirs: Any) -> float:
    """The fraction of a wrong output's wrong elements that another output has, too."""
    if isinstance(expectation, Refusal):
        if not isinstance(mine, str) or not isinstance(theirs, str):
            return 0.0
        common = min(mine.split(), theirs.split(), key=len)  # the kind, and the rule and the bit if both have them
        return float(
            common == mine.split()[: len(common)] == theirs.split()[: len(common)] and bool(mine) == bool(theirs)
        )
    if isinstance(expectation, NO_ARRAYS) or not isinstance(mine, np.ndarray) or not isinstance(theirs, np.ndarray):
        return 0.0
    if mine.shape != theirs.shape or mine.dtype != theirs.dtype:
        return 0.0
    if mine.shape != expectation.value.shape or mine.dtype.kind != expectation.value.dtype.kind:
        return float(np.array_equal(mine, theirs))
    wrong = wrong_elements(expectation, mine)
    same = (mine == theirs) | ((mine != mine) & (theirs != theirs))
    if not isinstance(expectation, Decision) and not (isinstance(expectation, Exact) and mine.dtype.kind != "f"):
        with np.errstate(invalid="ignore", over="ignore"):
            a, b, c = (array.astype(np.float64) for array in (mine, theirs, expectation.value))
            nearness = NEARNESS if np.count_nonzero(wrong) >= FEW else NEARNESS_OF_FEW
            same |= abs(a - b) <= nearness * np.minimum(abs(a - c), np.maximum(abs(a), abs(b)))
    return float(np.mean(same[wrong]))
