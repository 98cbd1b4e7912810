"""Greedy attribution: the mutant that removes most of the error, then the one that removes most of what is left.

Code of others has two or three departures at once, and sums in another order, so that no mutant gives its numbers
exactly. The *share* of some mutants is the part of the squared error that is gone if the implementation is compared
with them, not with the right output: the median over vectors. Where numbers are codes, the wrong ones are counted.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from gsvc_conformance.diagnosis.catalogue import MAYBE, answer_of, both, mutants_for
from gsvc_conformance.diagnosis.failures import F8, Failure, Part, count, parts, wrong_outputs
from gsvc_conformance.expectations import Interval
from gsvc_conformance.mutants import MUTANTS, Mutant
from gsvc_conformance.operation import Values

SURE: Final = 0.9
"""Minimum share of several mutants that are named without a hedge: each removes most of what the others leave."""

SURE_ALONE: Final = 0.99
"""Minimum share of one mutant that is named without a hedge: beside it there is nothing but noise."""

LIKELY: Final = 0.5
"""Minimum share of mutants that are named at all."""

WHOLE: Final = 0.9995
"""Share of mutants that leave nothing to be told of."""

FIRST: Final = 0.1
"""Minimum share of a mutant that others are tried beside."""

MOST_FIRST: Final = 3
"""Number of mutants, or pairs, beside which all others are tried."""

HALVED: Final = 0.5
"""One more mutant is named if it leaves at most this fraction of the error that was left."""

OPEN: Final = 0.15
"""Fraction of the failures that nothing else accounts for before this is tried."""

STILL: Final = 0.25
"""Fraction of the vectors, for each mutant that is named, in which an error must be left before one more is tried."""

MOST_TOGETHER: Final = 3
"""Maximum number of mutants that are named together."""

MOST_VECTORS: Final = 8
"""Number of vectors, the smallest ones, on which several mutants are tried together."""

MOST_WORK: Final = 40_000
"""Items of inputs times elements of outputs; on vectors with more, several mutants would take seconds."""

MIN_WRONG: Final = 20
"""Minimum number of wrong elements: fewer agree with one of many mutants by chance."""

FOUND: Final = 0.5
"""Share in one vector of mutants that are told of it."""

BLACK: Final = 1e-3
"""Share of the error that zeros leave of an output in which there is as good as nothing."""

NOISE: Final = 1e-12
"""A fraction of the squared error that arithmetic in binary32 leaves."""

MOST_COLUMNS: Final = 16
"""Maximum length of a last axis of columns, or channels, each of which is right or wrong for itself."""

MOST_LEFT: Final = 2.0
"""What is left counts for no more than this: also where a mutant crashes, or gives no number."""


CATALOGUE: Final = frozenset(MUTANTS)


@dataclass(frozen=True)
class Attribution:
    """The mutants that remove most of the error of an operation.

    Attributes
    ----------
    sentence
        In words, with the shares where something is left.
    shares
        The share in each vector by id.
    sure
        Whether the report states it as the cause; otherwise it says "could be".
    several
        Whether it is more than one mutant.
    """

    sentence: str
    shares: dict[str, float]
    sure: bool
    several: bool

    @property
    def ids(self) -> set[str]:
        """The vectors in which it explains anything."""
        return {name for name, share in self.shares.items() if share >= FOUND}


class _Measured:
    """A failure all of whose wrong outputs can be compared element by element, and what mutants leave of its error."""

    def __init__(self, failure: Failure) -> None:
        self.vector, self.parts = failure.vector, parts(failure)
        self.whole = len(self.parts) == len(wrong_outputs(failure.vector, failure.outputs)) > 0
        self.wrong = sum(count(failure.vector.expected[part.name], part.given) for part in self.parts)
        arrays = [value for value in failure.vector.inputs.values() if isinstance(value, np.ndarray) and value.ndim]
        items = max(map(len, arrays), default=1)
        self.cost = items * sum(part.right.size for part in self.parts)
        self.mutants = mutants_for(failure.vector)
        self._left: dict[Mutant, float] = {}

    def left(self, mutant: Mutant) -> float:
        """The fraction of the error that is left beside a mutant: 0 if it gives all, 1 if it explains nothing."""
        if mutant in CATALOGUE and mutant not in self.mutants:  # it gives what is right
            return 1.0
        if mutant not in self._left:
            self._left[mutant] = self._beside(answer_of(mutant, self.vector))
        return self._left[mutant]

    def black(self) -> float:
        """The fraction of the error that is left beside an output of zeros."""
        return float(np.mean([_left_of_part(part, {part.name: np.zeros(part.right.shape)}) for part in self.parts]))

    def _beside(self, theirs: Values | None) -> float:
        if theirs is None:
            return MOST_LEFT
        expected, mine = self.vector.expected, {part.name for part in self.parts}
        if not all(expected[name].judge(theirs.get(name)).passed for name in expected if name not in mine):
            return MOST_LEFT
        return float(np.mean([_left_of_part(part, theirs) for part in self.parts]))


def attributed(failures: Sequence[Failure]) -> Attribution | None:
    """The mutants that remove most of the error of the failures of one operation; None if none removes enough."""
    measured = [one for one in map(_Measured, failures) if one.whole]
    if sum(one.wrong for one in measured) < MIN_WRONG:
        return None
    if np.median([one.black() for one in measured]) <= BLACK:  # any mutant that draws nothing explains that
        return None
    mutants = list(dict.fromkeys(mutant for one in measured for mutant in one.mutants))
    kept = [[mutant] for mutant in _best(mutants, measured) if _explains(mutant, measured)]
    if not kept:
        return None
    ordered = sorted(measured, key=lambda one: one.cost)
    best, small = kept[0], [one for one in ordered if one.cost <= MOST_WORK][:MOST_VECTORS] or ordered[:1]
    while len(best) < MOST_TOGETHER:
        still = [one for one in small if one.left(together(best)) > 0]
        if len(still) < STILL * len(best) * len(small):
            break
        more = [[*some, mutant] for some in kept for mutant in mutants if mutant not in some and _fit(*some, mutant)]
        ranked = {together(some): some for some in more}
        kept = [ranked[mutant] for mutant in _best(ranked, still)]
        if not kept or _left(together(kept[0]), still) > HALVED * _left(together(best), still):
            break
        best = kept[0]
    return _told(sorted(best, key=lambda mutant: _left(mutant, measured)), measured)


def together(mutants: Sequence[Mutant]) -> Mutant:
    """Several mutants as one."""
    first, *others = sorted(mutants, key=lambda mutant: mutant.name)
    for other in others:
        first = both(first, other)
    return first


def _fit(*mutants: Mutant) -> bool:
    """Whether the patches of several mutants can all be made."""
    try:
        together(mutants).namespace()
    except LookupError:
        return False
    return True


def _best(mutants: Iterable[Mutant], measured: Sequence[_Measured]) -> list[Mutant]:
    """The few mutants that leave least, the best first: in the middle, and then on average."""
    left = {mutant: [one.left(mutant) for one in measured] for mutant in mutants}
    return sorted(left, key=lambda m: (float(np.median(left[m])), float(np.mean(left[m])), m.name))[:MOST_FIRST]


def _explains(mutant: Mutant, measured: Sequence[_Measured]) -> bool:
    """Whether a mutant removes a part of the error in most vectors, or most of it in some."""
    some = sum(one.left(mutant) <= 1 - FOUND for one in measured)
    return _left(mutant, measured) <= 1 - FIRST or some >= OPEN * len(measured)


def _left(mutant: Mutant, measured: Sequence[_Measured]) -> float:
    return float(np.median([one.left(mutant) for one in measured]))


def _told(mutants: Sequence[Mutant], measured: Sequence[_Measured]) -> Attribution | None:
    shares = {one.vector.id: 1 - one.left(together(mutants)) for one in measured}
    share = float(np.median(list(shares.values())))
    if share < LIKELY:
        return None
    words = [mutants[0].sentence]
    if share < WHOLE:
        words[0] += f" ({_percent(1 - _left(mutants[0], measured))} of the squared error)"
    for number, mutant in enumerate(mutants[1:], 2):
        part = 1 - _left(together(mutants[:number]), measured)
        words.append(f"{mutant.sentence}{f' (together {_percent(part)})' if share < WHOLE else ''}")
    sure = share >= (SURE if len(mutants) > 1 else SURE_ALONE)
    return Attribution(f"{'' if sure else MAYBE}{', and '.join(words)}", shares, sure, len(mutants) > 1)


def _percent(share: float) -> str:
    """A share that is not whole, in words."""
    return f"{max(0, round(100 * share))} %" if share < 0.995 else f"{min(99.9, 100 * share):.1f} %"


def _left_of_part(part: Part, theirs: Values) -> float:
    other = theirs.get(part.name)
    if not isinstance(other, np.ndarray) or other.shape != part.right.shape:
        return MOST_LEFT
    other = other.astype(np.float64)
    if part.near(other).all() and _is_closer(part, other):
        return 0.0
    if _spoils(part, other):
        return MOST_LEFT
    finite = np.isfinite(part.mine) & np.isfinite(part.right)
    with np.errstate(all="ignore"):
        before, after = (_error(part, (part.mine - array)[finite]) for array in (part.right, other))
    if not before > 0:
        return 1.0
    left = min(after / before, MOST_LEFT) if np.isfinite(after) else MOST_LEFT
    return left if left > NOISE else 0.0


def _is_closer(part: Part, theirs: F8) -> bool:
    """Whether most wrong numbers are closer to those of a mutant than to the right ones."""
    closer = abs(part.mine - theirs) < abs(part.mine - part.right)
    return bool(2 * np.count_nonzero(closer & part.wrong) >= np.count_nonzero(part.wrong))


def _spoils(part: Part, theirs: F8) -> bool:
    """Whether a mutant is wrong in a column that was given rightly."""
    if part.right.ndim < 2 or part.right.shape[-1] > MOST_COLUMNS:
        return False
    rows = tuple(range(part.right.ndim - 1))
    return bool((part.differs(theirs).any(axis=rows) & ~part.wrong.any(axis=rows)).any())


def _error(part: Part, difference: F8) -> float:
    """The sum of squares; of codes the number that differ."""
    measured = part.given.dtype.kind == "f" or isinstance(part.expectation, Interval)
    return float(np.sum(difference * difference) if measured else np.count_nonzero(difference))
