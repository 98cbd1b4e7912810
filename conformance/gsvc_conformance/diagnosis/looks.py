"""The generic looks, and the choice among several accounts of one failure: the one that most failures share."""

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from gsvc_conformance.diagnosis.altered import ALL, altered_candidates, altered_form
from gsvc_conformance.diagnosis.curves import curve_candidates
from gsvc_conformance.diagnosis.cutoffs import cutoff_candidates
from gsvc_conformance.diagnosis.failures import Failure, Part, parts, wrong_outputs
from gsvc_conformance.diagnosis.layouts import NOTHING_WRITTEN, layout_cause, never_written
from gsvc_conformance.diagnosis.places import place_candidates
from gsvc_conformance.diagnosis.ratios import ratio_candidates
from gsvc_conformance.diagnosis.regions import Candidate, column_candidates, region_candidates
from gsvc_conformance.diagnosis.stale import stale_candidates
from gsvc_conformance.diagnosis.sums import MAX_SOLVED, sum_candidates
from gsvc_conformance.names import columns
from gsvc_conformance.vector import Vector

MIN_SHARE: Final = 0.5
"""Fraction of the vectors that could show an account that must show it."""

MIN_SINGLES: Final = 0.75
"""Fraction of the failures with few splats that single splats must account for: not few of many."""

SMALL: Final = 16
"""In an output with fewer elements a place says little."""

FEWEST: Final = 2
"""Number of wrong outputs from which on one integer is no account of them."""

Key = tuple[str, str]
"""The id of a vector and an output."""


@dataclass
class Look:
    """One failure's accounts of all that is wrong, and mere places; `whole` if no mutant need be asked."""

    strong: list[str] = field(default_factory=list)
    weak: list[str] = field(default_factory=list)
    whole: bool = False


def generic_looks(failures: Sequence[Failure], passed: Sequence[Vector]) -> dict[str, Look]:
    """Describe the failures of one operation without a mutant in mind, by the id of a vector."""
    looks = {failure.vector.id: Look() for failure in failures}
    empty = _empty(failures, passed)
    strong: dict[Key, list[Candidate]] = {}
    weak: dict[Key, list[Candidate]] = {}
    wrong_parts = {}
    forms: dict[str, list[str]] = {}
    for failure in failures:
        name = failure.vector.id
        if name in empty:
            looks[name] = Look([empty[name]], whole=True)
            continue
        found = parts(failure)
        for part in found:
            wrong_parts[name, part.name] = part
            lost, weak[name, part.name] = _placed(part), _places(failure, part)
            accounts = [*_accounts(failure, part), *altered_candidates(failure, part), *lost]
            strong[name, part.name] = [a._replace(telling=0.0) for a in accounts] if _all_lost(part) else accounts
        if exchanged := _exchanged(failure, found):
            looks[name].strong.append(exchanged)
        if not found:
            forms[name] = altered_form(failure)
    able = sum(_solvable(failure) for failure in failures)
    if sum(any(c.single for c in candidates) for candidates in strong.values()) < MIN_SINGLES * able:
        strong = {key: [c for c in candidates if not c.single] for key, candidates in strong.items()}
    lone = {(failure.vector.id, part) for failure in failures for part in _lone_numbers(failure)}
    for table, strongly in ((strong, True), (weak, False)):
        chosen = _chosen(table, wrong_parts, passed)
        chosen = {key: sentence for key, sentence in chosen.items() if not strongly or key not in lone}
        for name, sentence in _by_vector(chosen, wrong_parts):
            (looks[name].strong if strongly else looks[name].weak).append(sentence)
    shared = Counter(sentence for sentences in forms.values() for sentence in sentences)
    for name, sentences in forms.items():
        common = [s for s in sentences if shared[s] >= max(2, ALL * len(forms))]
        looks[name].strong += sorted(common, key=lambda s: -shared[s])[:1]
    for failure in failures:
        look = looks[failure.vector.id]
        look.whole = look.whole or any("the vector before" in sentence for sentence in look.strong)
    return looks


def _lone_numbers(failure: Failure) -> list[str]:
    """Outputs of one integer beside other wrong outputs: such a number says too little for an account of all."""
    vector, outputs, _ = failure
    if len(wrong_outputs(vector, outputs)) < FEWEST:
        return []
    return [part.name for part in parts(failure) if part.right.size == 1 and part.given.dtype.kind in "iu"]


def _solvable(failure: Failure) -> bool:
    """Whether single splats of a failure could be found missing."""
    return 1 < len(failure.vector.inputs.get("parameters", ())) <= MAX_SOLVED


def _by_vector(chosen: dict[Key, str], wrong: dict[Key, Part]) -> Iterator[tuple[str, str]]:
    """Each vector with its sentences; they say which outputs they are of where they are not of all."""
    homes: defaultdict[tuple[str, str], list[str]] = defaultdict(list)
    for (name, output), sentence in chosen.items():
        homes[name, sentence].append(output)
    for (name, sentence), outputs in homes.items():
        several = len(next(part for key, part in wrong.items() if key[0] == name).operation.outputs) > 1
        everywhere = len(outputs) == sum(key[0] == name for key in wrong) > 1
        yield name, f"{sentence} (of {', '.join(outputs)})" if several and not everywhere else sentence


def _accounts(failure: Failure, part: Part) -> Iterator[Candidate]:
    """Accounts of all that is wrong in one output, the simplest first; of the first kind that has any."""
    names = columns(part.operation, part.name, part.right.shape[-1] if part.right.ndim else None)
    if found := list(stale_candidates(failure, part)):
        yield from found
        return
    value = part.expectation.value
    if (sentence := layout_cause(value, part.given, names)) and NOTHING_WRITTEN not in sentence:
        where = [names[place] for place in np.flatnonzero(part.wrong)] if part.name == "header" else []
        yield Candidate(f"{sentence}: {', '.join(where)}" if where else sentence)
        return
    yield from ratio_candidates(part, failure.vector.inputs)
    yield from curve_candidates(part)
    yield from cutoff_candidates(failure, part)
    yield from sum_candidates(failure, part)


def _all_lost(part: Part) -> bool:
    """Whether every element is the same: what lost all may have lost it for any reason."""
    return part.mine.size > 1 and not (part.mine != part.mine.flat[0]).any()


def _exchanged(failure: Failure, found: Sequence[Part]) -> str:
    """Two outputs that stand in each other's place; '' if there are none."""
    for place, a in enumerate(found):
        for b in found[place + 1 :]:
            if a.right.shape == b.right.shape and a.agrees(b.right) and b.agrees(a.right):
                return f"outputs {a.name} and {b.name} exchanged"
    return ""


def _placed(part: Part) -> list[Candidate]:
    """The places of a part that was lost."""
    if part.right.size < SMALL:
        return []
    lost = not part.mine[part.wrong].any() or np.isnan(part.mine[part.wrong]).all()
    return list(region_candidates(part)) if lost else []


def _places(failure: Failure, part: Part) -> list[Candidate]:
    """The sentences that only say where to look."""
    return [*place_candidates(failure, part), *column_candidates(part), *region_candidates(part)]


def _empty(failures: Sequence[Failure], passed: Sequence[Vector]) -> dict[str, str]:
    """Outputs that nothing was written to, by id; none where others are written, since a picture may be empty."""
    found = {}
    for vector, outputs, _ in failures:
        wrong = wrong_outputs(vector, outputs)
        arrays = [(vector.expected[name].value, outputs.get(name)) for name in wrong]
        sentences = [never_written(a, b) for a, b in arrays
                if isinstance(a, np.ndarray) and isinstance(b, np.ndarray) and a.shape == b.shape]  # fmt: skip
        if sentences and len(sentences) == len(wrong) and all(sentences):
            found[vector.id] = sentences[0]
    others = len(found) < len(failures)
    writes = others or any(_varied(e.value) for vector in passed for e in vector.expected.values())
    return {} if writes else found


def _varied(value: object) -> bool:
    """Whether an output is an array with different elements."""
    return isinstance(value, np.ndarray) and value.size > 0 and bool((value != value.flat[0]).any())


def _chosen(table: dict[Key, list[Candidate]], wrong: dict[Key, Part], passed: Sequence[Vector]) -> dict[Key, str]:
    """For each output the account that most outputs share and fewest vectors speak against."""
    support: Counter[str] = Counter()
    telling: defaultdict[str, float] = defaultdict(float)
    foresees, least = {}, dict[str, float]()
    homes: defaultdict[str, set[str]] = defaultdict(set)
    for (_, output), candidates in table.items():
        for candidate in {c.sentence: c for c in candidates}.values():
            support[candidate.sentence] += 1
            telling[candidate.sentence] += candidate.telling
            foresees[candidate.sentence] = candidate.foresees
            least[candidate.sentence] = max(candidate.least, least.get(candidate.sentence, 0.0))
            homes[candidate.sentence].add(output)

    def against(sentence: str) -> int:
        shown = foresees[sentence]
        if shown is None:
            return 0
        values = [v.expected[output].value for v in passed for output in homes[sentence]]
        others = [
            part.right
            for key, part in wrong.items()
            if key[1] in homes[sentence] and sentence not in {c.sentence for c in table.get(key, ())}
        ]
        return sum(shown(np.asarray(value, np.float64)) for value in [*filter(_varied, values), *others])

    outputs = Counter(output for _, output in wrong)
    fair = {
        s for s, number in support.items()
        if telling[s] >= 1 and number >= least[s] * sum(outputs[output] for output in homes[s])
        and number >= MIN_SHARE * (number + against(s))
    }  # fmt: skip
    chosen = {}
    for key, candidates in table.items():
        sentences = [candidate.sentence for candidate in candidates if candidate.sentence in fair]
        if sentences:
            chosen[key] = max(sentences, key=lambda s: (telling[s], support[s], -sentences.index(s)))
    return chosen
