"""Mutants by the vectors that they fail: for what ends with an error, or has outputs that tell too little.

A vector that ends with an error has no outputs to compare, and a single small number agrees with many mutants. The
lists of right and of wrong vectors say more: a mutant is named if it fails the same vectors of the operation in the
same way, with an error where there was one, and otherwise with the outputs that were given.
"""

from collections import defaultdict
from collections.abc import Sequence
from typing import Final, TypeVar

from gsvc_conformance.diagnosis.catalogue import CAPACITY, MAX_ALIKE, alike, crashes, gives
from gsvc_conformance.diagnosis.failures import Failure
from gsvc_conformance.mutants import MUTANTS, Mutant
from gsvc_conformance.vector import Vector

T = TypeVar("T")

ALIKE: Final = 0.9
"""Fraction of the vectors that fail here or with the mutant that must fail both times."""

FEWEST: Final = 2
"""Minimum number of wrong vectors."""

TRIED: Final = 6
"""Maximum number of vectors with outputs, and of those with errors, that are looked at."""


def mutants_by_verdicts(failures: Sequence[Failure], errors: Sequence[Vector], passed: Sequence[Vector]) -> list[str]:
    """The sentences of the mutants that are wrong where this is wrong, and as it is.

    Parameters
    ----------
    failures
        Wrong outputs of an operation, all of them.
    errors
        Vectors that ended with an error.
    passed
        Vectors that were answered rightly.

    Returns
    -------
    list[str]
        One sentence, or one that names several mutants that the vectors don't tell apart, or none.
    """
    failures = [failure for failure in failures if _tried(failure.vector)]
    errors = [vector for vector in errors if _tried(vector)]
    wrong = {vector.id for vector in (*(failure.vector for failure in failures), *errors)}
    if len(wrong) < FEWEST:
        return []
    foreseen: defaultdict[str, set[str]] = defaultdict(set)
    for vector in (*(failure.vector for failure in failures), *errors, *filter(_tried, passed)):
        for name in vector.manifest["kills"]:
            foreseen[name].add(vector.id)
    overlap = {
        mutant: len(wrong & foreseen[mutant.name]) / len(wrong | foreseen[mutant.name])
        for mutant in MUTANTS if mutant.name in foreseen
    }  # fmt: skip
    likely = [mutant for mutant, share in overlap.items() if share >= ALIKE and _ends_alike(mutant, failures, errors)]
    best = max((overlap[mutant] for mutant in likely), default=0.0)
    found = [mutant for mutant in likely if overlap[mutant] == best]
    sentences = list(dict.fromkeys(mutant.sentence for mutant in found))
    if len(sentences) > MAX_ALIKE:
        return []
    return alike(sentences, failures[0] if failures else None)


def _tried(vector: Vector) -> bool:
    """Whether it is known which mutants a vector finds."""
    return vector.manifest.get("kills") is not None and CAPACITY not in vector.manifest.get("flags", ())


def _ends_alike(mutant: Mutant, failures: Sequence[Failure], errors: Sequence[Vector]) -> bool:
    """Whether a mutant gives the outputs that were given, and ends with an error where the implementation did."""
    same = [gives(mutant, failure) for failure in _some(failures)]
    same += [crashes(mutant, vector) for vector in _some(errors)]
    return sum(same) >= ALIKE * len(same)


def _some(items: Sequence[T]) -> Sequence[T]:
    """A few, spread evenly."""
    if len(items) <= TRIED:
        return items
    return [items[place * (len(items) - 1) // (TRIED - 1)] for place in range(TRIED)]
