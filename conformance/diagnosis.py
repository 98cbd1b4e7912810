"""What wrong outputs look like: a plausible bug that gives, on the same inputs, what an implementation gave.

A bug *explains* a failure if it fails the same vector and gives nearly all of the elements that are wrong. Small
numbers agree by chance, so bugs are ranked by how well they fit the whole stage: a bug that would fail vectors that
the implementation passes, or fail others in another way, fits badly. Where a failure is only a refusal or a few wrong
elements, bugs that have nothing in common agree: then a bug is named only if it fails just the vectors that failed,
and where more than `MOST` are left they are called what they are, bugs that cannot be told apart.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from conformance.expectations import Bounded, Decision, Exact, Expectation, Interval, Refusal
from conformance.layouts import NOTHING_WRITTEN, layout_cause
from conformance.mutants import Mutant, all_mutants, answer, called
from conformance.stage import Values
from conformance.vectors import Vector

EXAMINED: Final = 12
"""Failures of a stage that are compared with every bug."""

EXPLAINED: Final = 0.9
"""Fraction of the wrong elements that a bug must give."""

NEARNESS: Final = 0.25
"""An element is given by a bug if it is so many times nearer to the bug's answer than to the right one."""

LEAST_FIT: Final = 0.2
"""Bugs that fit the stage worse are not named."""

FEW: Final = 4
"""So few wrong elements tell little."""

MOST: Final = 2
"""So many causes are told."""

MOST_ALIKE: Final = 4
"""So many bugs that cannot be told apart are named."""

LEAST_FIT_OF_FEW: Final = 0.9
"""The same of bugs that explain only failures that tell little."""

PAIRED: Final = 3
"""Failures that no bug explains for which pairs of bugs are tried."""

FIRST_OF_PAIR: Final = 2
"""So many bugs, those that give most, are tried together with each other one."""

LEAST_WRONG: Final = 20
"""Wrong elements that a pair must explain: fewer agree with one of so many by chance."""

COARSE: Final = 2.0**-8
"""Errors of at most so much of the largest element may be those of arithmetic."""

Failure = tuple[Vector, Values]
"""A vector and the wrong outputs."""


def diagnose(failures: Sequence[Failure], passed: Iterable[Vector] = ()) -> dict[str, list[str]]:
    """What the failures of one stage look like.

    Parameters
    ----------
    failures
        All of the stage; `EXAMINED` of them are looked at.
    passed
        Vectors of the stage that were answered rightly.

    Returns
    -------
    dict[str, list[str]]
        By the id of a vector, at most two sentences, the better one first.
    """
    examined, passed = failures[:EXAMINED], list(passed)
    laid_out = _laid_out(examined, passed)
    named = {vector.id: _explanations(vector, outputs) for vector, outputs in examined if vector.id not in laid_out}
    _name_pairs([failure for failure in examined if named.get(failure[0].id) == []], named)
    explained = Counter(mutant for mutants in named.values() for mutant in mutants)
    foreseen = Counter(
        name for vector in [*passed, *(v for v, _ in examined)] for name in vector.manifest.get("kills", ())
    )
    fit = {mutant: count / max(foreseen[mutant.name], count) for mutant, count in explained.items()}
    plain = {mutant for vector, outputs in examined if not _tells_little(vector, outputs)
             for mutant in named.get(vector.id, ())}  # fmt: skip
    likely = {mutant for mutant in fit if fit[mutant] >= (LEAST_FIT if mutant in plain else LEAST_FIT_OF_FEW)}
    ranked = sorted(likely, key=lambda mutant: (-fit[mutant], -explained[mutant], mutant.name))
    causes = dict(laid_out)
    for name, mutants in named.items():
        these = [mutant for mutant in ranked if mutant in mutants]
        sure = [mutant for mutant in these if mutant in plain]
        causes[name] = _best(sure, fit)[:MOST] if sure else _alike(_best(these, fit))
    for vector, outputs in examined:
        causes[vector.id] = causes[vector.id] or _not_numbers(vector, outputs) or _imprecision(vector, outputs)
    return causes


def _laid_out(failures: Iterable[Failure], passed: Iterable[Vector]) -> dict[str, list[str]]:
    """What needs no bug to be tried, by the id of a vector; one picture may be empty for other reasons."""
    told = {vector.id: _layouts(vector, outputs) for vector, outputs in failures}
    empty = [name for name, sentences in told.items() if any(NOTHING_WRITTEN in sentence for sentence in sentences)]
    others = [outputs for vector, outputs in failures if vector.id not in empty]
    writes = bool(others) or any(_varied(expected.value) for vector in passed for expected in vector.expected.values())
    return {name: sentences for name, sentences in told.items() if sentences and not (writes and name in empty)}


def _varied(value: Any) -> bool:
    """Whether an output is an array with different elements."""
    return isinstance(value, np.ndarray) and value.size > 0 and bool((value != value.flat[0]).any())


def _layouts(vector: Vector, outputs: Values) -> list[str]:
    """What all wrong outputs look like, if they are empty, in another order, or parts: at most two sentences."""
    arrays = [(vector.expected[name].value, outputs.get(name)) for name in _wrong_outputs(vector, outputs)]
    told = [
        layout_cause(value, mine) if isinstance(value, np.ndarray) and isinstance(mine, np.ndarray) else ""
        for value, mine in arrays
    ]
    return list(dict.fromkeys(told))[:2] if all(told) else []


def _not_numbers(vector: Vector, outputs: Values) -> list[str]:
    """A sentence for outputs whose wrong elements are all NaN, or infinite."""
    for name in _wrong_outputs(vector, outputs):
        expectation, mine = vector.expected[name], outputs.get(name)
        if isinstance(expectation, Refusal) or not isinstance(mine, np.ndarray) or not _count(expectation, mine):
            return []
        if mine.dtype.kind != "f" or np.isfinite(mine[_wrong(expectation, mine)]).any():
            return []
    return ["0 times infinity or infinity minus infinity (mask the factors, not the product), or an overflow"]


def _imprecision(vector: Vector, outputs: Values) -> list[str]:
    """A sentence for wrong outputs that are nearly right, measured by their largest element."""
    for name in _wrong_outputs(vector, outputs):
        expectation, mine = vector.expected[name], outputs.get(name)
        if not isinstance(expectation, Bounded) or not isinstance(mine, np.ndarray) or not _count(expectation, mine):
            return []
        with np.errstate(invalid="ignore"):
            error = abs(mine.astype(np.float64) - expectation.value).max()
        if not error <= COARSE * abs(expectation.value).max():
            return []
    return ["errors of arithmetic with few bits (half precision, a fast exp or division), not of a wrong formula"]


def _tells_little(vector: Vector, outputs: Values) -> bool:
    """Whether all that is wrong is a refusal, with what came before it, or a few elements."""
    wrong = _wrong_outputs(vector, outputs)
    refused = any(isinstance(vector.expected[name], Refusal) and outputs.get(name) for name in wrong)
    found = 0
    for name in wrong:
        expectation, mine = vector.expected[name], outputs.get(name)
        if not isinstance(expectation, Refusal) and isinstance(mine, np.ndarray):
            whole = mine.shape == expectation.value.shape
            found += _count(expectation, mine) if whole else 0 if refused else mine.size
    return found < FEW


def _best(ranked: Sequence[Mutant], fit: dict[Mutant, float]) -> list[str]:
    """The sentences of the bugs that fit about as well as the first."""
    return list(dict.fromkeys(mutant.sentence for mutant in ranked if fit[mutant] >= 0.9 * fit[ranked[0]]))


def _alike(sentences: list[str]) -> list[str]:
    """What is said of bugs that a failure does not tell apart."""
    if len(sentences) <= MOST:
        return sentences
    others = "; and others" if len(sentences) > MOST_ALIKE else ""
    return [f"one of {len(sentences)} bugs not told apart here: {'; '.join(sentences[:MOST_ALIKE])}{others}"]


def _explanations(vector: Vector, outputs: Values) -> list[Mutant]:
    """The bugs that explain one failure; where none refuses at the same bit, those that name the same rule."""
    texts = {name: " ".join(value.split()[:2]) for name, value in outputs.items() if isinstance(value, str)}
    for told in (outputs, {**outputs, **texts}):
        found = [mutant for mutant in bugs_for(vector) if _share(vector, told, mutant) >= EXPLAINED]
        if found or not texts:
            return found
    return []


def bugs_for(vector: Vector) -> list[Mutant]:
    """The bugs that a vector can show: those that it is known to find, or all that it leads to."""
    kills = vector.manifest.get("kills")
    if kills is not None:
        return [mutant for mutant in all_mutants() if mutant.name in kills]
    run = called(vector.stage, vector.inputs)
    return [mutant for mutant in all_mutants() if run & mutant.touched()]


def _name_pairs(failures: Sequence[Failure], named: dict[str, list[Mutant]]) -> None:
    """Name two bugs together for failures that no one of them explains."""
    pairs: list[Mutant] = []
    for vector, outputs in failures:
        found = [pair for pair in pairs if _share(vector, outputs, pair) >= EXPLAINED]
        if not found and len(pairs) < PAIRED:
            found = _pairs(vector, outputs)[:1]
            pairs += found
        named[vector.id] = found


def _pairs(vector: Vector, outputs: Values) -> list[Mutant]:
    """The pairs of bugs that explain a failure, the best first."""
    wrong = sum(_count(vector.expected[name], outputs.get(name)) for name in _wrong_outputs(vector, outputs))
    if wrong < LEAST_WRONG:
        return []
    bugs = sorted(bugs_for(vector), key=lambda bug: -_share(vector, outputs, bug))
    tried = [_both(a, b) for place, a in enumerate(bugs[:FIRST_OF_PAIR]) for b in bugs[place + 1 :]]
    shares = {pair: _share(vector, outputs, pair) for pair in tried}
    return sorted((pair for pair in tried if shares[pair] >= EXPLAINED), key=lambda pair: -shares[pair])


def _both(a: Mutant, b: Mutant) -> Mutant:
    return Mutant(f"{a.name}+{b.name}", a.area, f"{a.sentence}, and {b.sentence}", a.patches + b.patches)


def _share(vector: Vector, outputs: Values, mutant: Mutant) -> float:
    """The fraction of the wrong elements that a bug gives, of the output of which it gives least."""
    theirs = answer(mutant, vector.stage, vector.inputs)
    wrong = _wrong_outputs(vector, outputs)
    if theirs is None or not wrong:
        return 0.0
    return min(_given(vector.expected[name], outputs.get(name), theirs.get(name)) for name in wrong)


def _wrong_outputs(vector: Vector, outputs: Values) -> list[str]:
    return [name for name, expectation in vector.expected.items() if not expectation.judge(outputs.get(name)).passed]


def _given(expectation: Expectation, mine: Any, theirs: Any) -> float:
    """The fraction of a wrong output's wrong elements that a bug's output gives."""
    if isinstance(expectation, Refusal):
        if not isinstance(mine, str) or not isinstance(theirs, str):
            return 0.0
        told = mine.split()  # the kind, and the rule and the bit if they are told
        return float(told == theirs.split()[: len(told)] and bool(told) == bool(theirs))
    if not isinstance(mine, np.ndarray) or not isinstance(theirs, np.ndarray):
        return 0.0
    if mine.shape != theirs.shape or mine.dtype != theirs.dtype:
        return 0.0
    if mine.shape != expectation.value.shape or mine.dtype.kind != expectation.value.dtype.kind:
        return float(np.array_equal(mine, theirs))
    wrong = _wrong(expectation, mine)
    same = (mine == theirs) | ((mine != mine) & (theirs != theirs))
    if not isinstance(expectation, Decision) and not (isinstance(expectation, Exact) and mine.dtype.kind != "f"):
        with np.errstate(invalid="ignore", over="ignore"):
            a, b, c = (array.astype(np.float64) for array in (mine, theirs, expectation.value))
            same |= abs(a - b) <= NEARNESS * np.minimum(abs(a - c), np.maximum(abs(a), abs(b)))
    return float(np.mean(same[wrong]))


def _count(expectation: Expectation, mine: Any) -> int:
    """How many elements of an output are wrong; 0 for what is no array of the right shape."""
    if isinstance(expectation, Refusal) or not isinstance(mine, np.ndarray) or mine.shape != expectation.value.shape:
        return 0
    return int(_wrong(expectation, mine).sum())


def _wrong(expectation: Bounded | Decision | Exact | Interval, mine: NDArray[Any]) -> NDArray[np.bool_]:
    """The wrong elements; all where only their sum is wrong."""
    if isinstance(expectation, Bounded):
        with np.errstate(invalid="ignore"):
            near = abs(mine.astype(np.float64) - expectation.value) <= expectation.bound
        wrong = ~(near | (mine == expectation.value))
    elif isinstance(expectation, Interval):
        wrong = (mine < expectation.lowest) | (mine > expectation.highest)
    else:
        wrong = mine != expectation.value
    return wrong if wrong.any() else np.ones(mine.shape, np.bool_)
