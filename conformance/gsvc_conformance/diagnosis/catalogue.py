"""Mutants that an implementation looks like, asked both ways.

A mutant *explains* a failure if it gives nearly all elements that are wrong, and nearly all elements that it gets wrong
were given. Small numbers agree by chance, so a mutant must fit the whole operation: one that would fail vectors that
the implementation passes fits badly. Where a failure is only a refusal or a few wrong elements, mutants that have
nothing in common agree: then the report says that they end in the same refusal, not that one of them is there.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Final

import numpy as np

from gsvc_conformance.diagnosis.coded import is_cut, same_symbols
from gsvc_conformance.diagnosis.failures import EXPLAINED, FEW, Failure, count, share, wrong_elements, wrong_outputs
from gsvc_conformance.diagnosis.streams import is_desync
from gsvc_conformance.expectations import NO_ARRAYS, Exact, Refusal
from gsvc_conformance.mutants import MUTANTS, Mutant, answer, called
from gsvc_conformance.operation import Values
from gsvc_conformance.vector import Vector

MIN_FIT: Final = 0.5
"""Minimum fit of a mutant that is named."""

MIN_FIT_OF_FEW: Final = 0.9
"""Minimum fit of mutants that explain only failures that tell little."""

LARGE: Final = 2**20
"""An integer of this size, such as a checksum, agrees with nothing by chance."""

MOST: Final = 2
"""Maximum number of mutants that are named."""

MAX_ALIKE: Final = 4
"""Maximum number of mutants named of those that a failure does not tell apart."""

MISSING: Final = 2
"""Minimum number of failures by a missing part that a mutant must explain: a part is missing for many reasons."""

ALIKE: Final = "the same refusal as with mutants"
"""Beginning of the sentence about a refusal that says no more."""

MAYBE: Final = "could be "
"""Beginning of a sentence that is not certain: a single number, a part of the error."""

CAPACITY: Final = "capacity"
"""The flag of vectors that are too large for mutants to be tried on them."""


def named(failures: Sequence[Failure], passed: Iterable[Vector]) -> dict[str, list[str]]:
    """Sentences of the mutants that the failures of one operation look like, by the id of a vector; at most two each.

    Parameters
    ----------
    failures, passed
        As those of `diagnose`.
    """
    passed = list(passed)
    found = {failure.vector.id: _explanations(failure) for failure in failures}
    explained = Counter(mutant for mutants in found.values() for mutant in mutants)
    fit = _fit(explained, failures, passed)
    lost = Counter(
        mutant for failure in failures if _missing_part(failure) for mutant in found[failure.vector.id]
    )  # fmt: skip
    plain = {mutant for failure in failures if not _tells_little(failure) for mutant in found[failure.vector.id]}
    plain -= {mutant for mutant in plain if lost[mutant] == explained[mutant] < MISSING}
    decided = Counter(mutant for failure in failures if not is_desync(failure) for mutant in found[failure.vector.id])
    likely = {
        mutant for mutant in fit
        if (fit[mutant] >= MIN_FIT if mutant in plain else
            min(fit[mutant], explained[mutant] / len(failures)) >= MIN_FIT_OF_FEW)
    }  # fmt: skip
    ranked = sorted(likely, key=lambda mutant: (-fit[mutant], -explained[mutant], mutant.name))
    said: dict[str, list[str]] = {}
    for failure in failures:
        these = [mutant for mutant in ranked if mutant in found[failure.vector.id]]
        least = MISSING if is_desync(failure) else 0  # any mutant gives one that reads something before it wrongly
        sure = [mutant for mutant in these if mutant in plain and decided[mutant] >= least]
        if sure:
            said[failure.vector.id] = _best(sure, fit)[:MOST]
        elif not _missing_part(failure):
            few = sum(explained[mutant] for mutant in these[:1]) < FEW
            said[failure.vector.id] = [
                f"{MAYBE}{sentence}" if few and not sentence.startswith(ALIKE) else sentence
                for sentence in alike(_best(these, fit), failure)
            ]
    return said


def _fit(explained: Counter[Mutant], failures: Iterable[Failure], passed: Iterable[Vector]) -> dict[Mutant, float]:
    """The fraction that each mutant explains of the vectors that it would fail."""
    vectors = [*passed, *(failure.vector for failure in failures)]
    foreseen = Counter(name for vector in vectors for name in vector.manifest.get("kills", ()))
    return {mutant: number / max(number, foreseen[mutant.name]) for mutant, number in explained.items()}


def _tells_little(failure: Failure) -> bool:
    """Whether all that is wrong is a refusal, with what came before it, or a few elements."""
    vector, outputs, _ = failure
    wrong = wrong_outputs(vector, outputs)
    refused = any(isinstance(vector.expected[name], Refusal) and outputs.get(name) for name in wrong)
    found = 0
    for name in wrong:
        expectation, mine = vector.expected[name], outputs.get(name)
        if not isinstance(expectation, NO_ARRAYS) and isinstance(mine, np.ndarray):
            whole = mine.shape == expectation.value.shape
            found += count(expectation, mine) if whole else 0 if refused else mine.size
            if (
                whole
                and isinstance(expectation, Exact)
                and mine.dtype.kind in "iu"
                and abs(mine).max(initial=0) >= LARGE
            ):
                return False
    return found < FEW


def _missing_part(failure: Failure) -> bool:
    """Whether all that is wrong is 0."""
    vector, outputs, _ = failure
    for name in wrong_outputs(vector, outputs):
        expectation, mine = vector.expected[name], outputs.get(name)
        if isinstance(expectation, NO_ARRAYS) or not isinstance(mine, np.ndarray):
            return False
        if mine.shape != expectation.value.shape or mine[wrong_elements(expectation, mine)].any():
            return False
    return True


def _best(ranked: Sequence[Mutant], fit: Mapping[Mutant, float]) -> list[str]:
    """The sentences of the mutants that fit about as well as the first."""
    return list(dict.fromkeys(mutant.sentence for mutant in ranked if fit[mutant] >= 0.9 * fit[ranked[0]]))


def alike(sentences: list[str], failure: Failure | None = None) -> list[str]:
    """The sentence about mutants that a failure, or an error without outputs, does not tell apart."""
    if not sentences:
        return []
    refused = failure is not None and any(
        isinstance(failure.vector.expected[name], Refusal) and failure.outputs.get(name)
        for name in wrong_outputs(failure.vector, failure.outputs)
    )
    if not refused and len(sentences) == 1:
        return sentences
    others = f"; and {len(sentences) - MAX_ALIKE} others" if len(sentences) > MAX_ALIKE else ""
    which = "; ".join(sentences[:MAX_ALIKE]) + others
    if refused:
        return [f"{ALIKE}, which need not be yours: {which}"]
    return [f"one of {len(sentences)} mutants not told apart here, or another one: {which}"]


def _explanations(failure: Failure) -> list[Mutant]:
    """The mutants that explain one failure; where none refuses at the same bit, those that name the same rule."""
    vector, outputs, _ = failure
    if is_cut(failure):
        return [mutant for mutant in mutants_for(vector) if same_symbols(failure, mutant)]
    texts = {name: " ".join(value.split()[:2]) for name, value in outputs.items() if isinstance(value, str)}
    for given in (outputs, {**outputs, **texts}):
        found = [mutant for mutant in mutants_for(vector) if _share(vector, given, mutant) >= EXPLAINED]
        if found or not texts:
            return found
    return []


def mutants_for(vector: Vector) -> list[Mutant]:
    """The mutants that a vector can show: those it is known to find, else all that it reaches; none if it is large."""
    if CAPACITY in vector.manifest.get("flags", ()):
        return []
    kills = vector.manifest.get("kills")
    if kills is not None:
        return [mutant for mutant in MUTANTS if mutant.name in kills]
    run = called(vector.operation, vector.inputs)
    return [mutant for mutant in MUTANTS if run & mutant.touched()] if run else []


def mutants_in(sentence: str) -> list[Mutant]:
    """The mutants that a sentence names."""
    return [mutant for mutant in MUTANTS if mutant.sentence in sentence]


def both(a: Mutant, b: Mutant) -> Mutant:
    """Two mutants as one."""
    return Mutant(f"{a.name}+{b.name}", a.area, f"{a.sentence}, and {b.sentence}", a.patches + b.patches)


def gives(mutant: Mutant, failure: Failure) -> bool:
    """Whether a mutant explains a failure."""
    return _share(failure.vector, failure.outputs, mutant) >= EXPLAINED


def crashes(mutant: Mutant, vector: Vector) -> bool:
    """Whether a mutant ends with an error."""
    return answer_of(mutant, vector) is None


def _share(vector: Vector, outputs: Values, mutant: Mutant) -> float:
    """The share of wrong elements that a mutant and the implementation have in common, both ways."""
    theirs = answer_of(mutant, vector)
    return 0.0 if theirs is None else share(vector, outputs, theirs)


@lru_cache(maxsize=4096)
def answer_of(mutant: Mutant, vector: Vector) -> Values | None:
    """The outputs of a mutant; None if it crashes or hangs."""
    return answer(mutant, vector.operation, vector.inputs)
