"""Diagnosis of wrong outputs: it says what it knows, and nothing else.

The generic looks come first, since they need to know no mutant: an output that nothing was written to, what the vector
before left, the right numbers in other places, terms of a sum that were lost, a part from some place on, a factor. Then
the catalogue of mutants is asked, both ways. Where neither says anything, the report says where the errors are.
"""

import math
import re
from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np

from gsvc_conformance.diagnosis import catalogue
from gsvc_conformance.diagnosis.attribution import OPEN, Attribution, attributed
from gsvc_conformance.diagnosis.catalogue import MAYBE, mutants_for, mutants_in
from gsvc_conformance.diagnosis.failures import Failure, Part, parts, wrong_outputs
from gsvc_conformance.diagnosis.looks import Look, generic_looks
from gsvc_conformance.diagnosis.places import common_condition, output_sentences
from gsvc_conformance.diagnosis.prefixes import FIRST_WRONG, RIGHT_SO_FAR, prefix_sentences
from gsvc_conformance.diagnosis.ratios import spread
from gsvc_conformance.diagnosis.streams import REFUSED_LEGAL, is_desync, kind_sentence, refusal_sentence
from gsvc_conformance.diagnosis.verdicts import mutants_by_verdicts
from gsvc_conformance.expectations import Bounded, Exact, Refusal
from gsvc_conformance.operation import input_size, is_unusual
from gsvc_conformance.vector import Vector

__all__ = [
    "EXAMINED", "MAYBE", "VAGUE", "Failure", "diagnose", "examined", "hedged", "is_place", "is_sure",
    "mutants_for",
]  # fmt: skip

EXAMINED: Final = 12
"""Failures of an operation that are looked at, from the smallest inputs to the largest."""

VAGUE: Final = (
    "errors in ", "errors only ", "only vectors ", "every vector ", FIRST_WRONG, RIGHT_SO_FAR, REFUSED_LEGAL,
    catalogue.ALIKE, MAYBE,
)  # fmt: skip
"""Beginnings of sentences that say where errors are, not what they are."""

PLACE: Final = re.compile(r" are (0|NaN|wrong|all [-+.e\d]+)( |$)|pixels left out (that lie )?beyond ")
"""Parts of other sentences that say where errors are: so many vectors must agree before they tell a cause."""

NO_LOOKS: Final = "encoder"
"""The class in which no look and no mutant can be found: many streams are right, and what is wrong with one is said."""

MAX_SENTENCES: Final = 3
"""Maximum number of sentences about one failure."""

COARSE: Final = 2.0**-6
"""Maximum relative error that may be one of arithmetic."""

FEWEST: Final = 2
"""Minimum number of errors that are said to be all answers."""

ALIKE: Final = 8.0
"""Relative errors of arithmetic are alike: nine tenths are at most this many times the median."""

ONE_SIDED: Final = 0.8
"""Maximum fraction of numbers that rounding makes too large; cut numbers are always too small."""

LAST_PLACES: Final = 2.0**-20
"""Differences up to this, relative to the largest number, are in the last bits."""

MANY: Final = 16
"""An output of integers with fewer elements has no few places."""

FEW: Final = 0.25
"""Maximum fraction of the elements that counts as few."""

FORMATS: Final = {8: "bfloat16", 11: "binary16"}
"""Formats by their significant bits."""


def examined(failures: Sequence[Failure]) -> list[Failure]:
    """The failures that are looked at, of all sizes, the smallest first; the simplest is one of them."""
    ordered = sorted(failures, key=_size)
    if len(ordered) <= EXAMINED:
        return ordered
    simplest = min(ordered, key=lambda failure: (is_unusual(failure.vector.inputs), _size(failure)))
    others = [failure for failure in ordered if failure is not simplest]
    spread = [others[place * (len(others) - 1) // (EXAMINED - 2)] for place in range(EXAMINED - 1)]
    return sorted([simplest, *spread], key=_size)


def _size(failure: Failure) -> int:
    return input_size(failure.vector.inputs)


def is_place(sentence: str) -> bool:
    """Whether a sentence says where errors are, not what they are."""
    return sentence.startswith(VAGUE) or PLACE.search(sentence) is not None


def is_sure(sentence: str) -> bool:
    """Whether a sentence names a cause without a hedge."""
    return not is_place(sentence) and not sentence.startswith(MAYBE)


def hedged(sentence: str, passed: Iterable[Vector]) -> str:
    """The sentence, with a hedge if its mutants would fail any vector that was answered rightly."""
    names = {mutant.name for mutant in mutants_in(sentence)} if is_sure(sentence) else set()
    against = any(names.intersection(vector.manifest.get("kills", ())) for vector in passed)
    return f"{MAYBE}{sentence}" if against else sentence


def diagnose(
    failures: Sequence[Failure | tuple[object, ...]], passed: Iterable[Vector] = (), errors: Sequence[Vector] = ()
) -> dict[str, list[str]]:
    """Describe what the failures of one operation look like.

    Parameters
    ----------
    failures
        All of the operation; those that `examined` chooses are looked at.
    passed
        Vectors of the operation that were answered rightly.
    errors
        Vectors of the operation that ended with an error.

    Returns
    -------
    dict[str, list[str]]
        At most `MAX_SENTENCES` sentences by the id of a vector, the better ones first.
    """
    wrong = [Failure(*failure) for failure in failures]
    wrong = [failure for failure in wrong if failure.vector.operation.group != NO_LOOKS]
    chosen, passed = examined(wrong), list(passed)
    looks = generic_looks(chosen, passed)
    unnamed = [failure for failure in chosen if not looks[failure.vector.id].whole]
    named = catalogue.named(unnamed, passed)
    if kind := kind_sentence(wrong, passed):
        return {failure.vector.id: [kind] for failure in chosen}
    open_ones = [f for f in chosen if not looks[f.vector.id].strong and not named.get(f.vector.id)]
    if several := attributed(unnamed) if open_ones and len(open_ones) >= OPEN * len(chosen) else None:
        _attribute(several, looks, named)
        open_ones = [failure for failure in open_ones if failure.vector.id not in several.ids]
    alike = mutants_by_verdicts(wrong, errors, passed) if errors or len(open_ones) > len(chosen) / 2 else []
    prefixes, outputs = prefix_sentences(chosen), output_sentences(chosen)
    common = "" if several else common_condition([*(failure.vector for failure in wrong), *errors], passed)
    if len(errors) > len(wrong) and _reads_streams(errors[0]):  # any mutant that desyncs ends so, too
        alike = [f"{MAYBE}{sentence.removeprefix(MAYBE)}" for sentence in alike]
    said = {
        name: _sentences(failure, looks[name], named.get(name) or alike, prefixes[name], [outputs[name], common])
        for failure in chosen
        if (name := failure.vector.id)
    }
    never = [] if passed or failures or len(errors) < FEWEST else [_simplest(errors)]
    return said | {vector.id: alike or ([common] if common else never) for vector in errors}


def _attribute(found: Attribution, looks: dict[str, Look], named: dict[str, list[str]]) -> None:
    """Name what an attribution has found where nothing else is named; several mutants wherever they give all."""
    for name in found.ids:
        if (found.several and found.shares[name] == 1) or not (looks[name].strong or named.get(name)):
            weak = [] if found.sure else looks[name].weak[:1]
            looks[name].strong, named[name] = [], [found.sentence, *weak]


def _reads_streams(vector: Vector) -> bool:
    return any(port.type == "stream" for port in vector.operation.inputs)


def _simplest(errors: Sequence[Vector]) -> str:
    """The sentence about an implementation that answers nothing but errors."""
    first = min(errors, key=lambda vector: input_size(vector.inputs))
    return f"every answer is an error, that to the smallest vector too, which is {first.id}"


def _sentences(failure: Failure, look: Look, mutants: list[str], prefix: list[str], others: list[str]) -> list[str]:
    """The sentences of one failure: what it is, or at least where; `others` say which outputs and vectors are wrong."""
    found = [*look.strong[:2], *mutants]
    if not found:
        given = parts(failure)
        compared = given if len(given) == len(wrong_outputs(failure.vector, failure.outputs)) else []
        found = _not_numbers(compared) or _last_bits(compared) or [*look.weak[:1]]
        found = found or _one_step(compared) or _imprecision(failure)
    alike = is_desync(failure) and all(sentence.startswith(catalogue.ALIKE) for sentence in found)
    if not found or found == look.weak[:1] or alike:
        refusal = refusal_sentence(failure)
        refused = alike or (refusal and prefix and not is_desync(failure))
        places = (refusal, *prefix[-1:], *found) if refused else (*prefix,) if prefix else (*found, refusal)
        found = [sentence for sentence in (*places, *others[bool(prefix) :]) if sentence]
    return list(dict.fromkeys(found))[:MAX_SENTENCES]


def _not_numbers(found: Sequence[Part]) -> list[str]:
    """A sentence for outputs whose wrong elements are all NaN, or infinite."""
    if not found:
        return []
    if any(part.given.dtype.kind != "f" or np.isfinite(part.mine[part.wrong]).any() for part in found):
        return []
    if all(np.isnan(part.mine[part.wrong]).all() for part in found):
        return [
            "NaN from 0 times infinity or infinity minus infinity (mask the factors, not the product), or from 0 / 0"
        ]
    return ["an overflow, or 0 times infinity or infinity minus infinity (mask the factors, not the product)"]


def _last_bits(found: Sequence[Part]) -> list[str]:
    """A sentence for exact numbers that are wrong in the last bits alone."""
    if not found or not all(part.given.dtype.kind == "f" and isinstance(part.expectation, Exact) for part in found):
        return []
    sizes = [abs(part.right) + np.max(abs(part.right[np.isfinite(part.right)]), initial=0.0) for part in found]
    near = [abs(part.mine - part.right) <= LAST_PLACES * size for part, size in zip(found, sizes, strict=True)]
    if not all(bool(mask[part.wrong].all()) for part, mask in zip(found, near, strict=True)):
        return []
    return ["errors in the last bits alone: operations in another order, fused, or not each rounded to binary32"]


def _one_step(found: Sequence[Part]) -> list[str]:
    """A sentence for integers that are one off, in few places."""
    whole = found and all(part.given.dtype.kind in "iu" and part.right.size >= MANY for part in found)
    if not whole or not all(part.wrong.mean() <= FEW and _one_off(part) for part in found):
        return []
    return ["errors in few places, of one step: operations in another order or precision before the rounding"]


def _one_off(part: Part) -> bool:
    return bool((abs(part.mine - part.right)[part.wrong] == 1).all())


def _imprecision(failure: Failure) -> list[str]:
    """A sentence for outputs whose relative errors are small, and alike everywhere."""
    found = parts(failure)
    if any(isinstance(failure.vector.expected[name], Refusal) for name in wrong_outputs(*failure[:2])) or not found:
        return []
    bits = [_bits(part) for part in found]
    if not all(bits):
        return []
    least = min(bits)
    kind = f", as in {FORMATS[least]}" if least in FORMATS else ""
    return [f"errors of arithmetic with few bits: about {least} bits are right everywhere{kind} (half precision, "
            "a fast exp or division)"]  # fmt: skip


def _bits(part: Part) -> int:
    """The number of right bits of an output, if it is alike everywhere; else 0."""
    errors = spread(part)
    if not isinstance(part.expectation, Bounded) or errors is None or errors.size < 16:
        return 0
    some = errors[errors > 0]
    if some.size < errors.size / 2 or part.wrong.mean() < 0.25:
        return 0
    away = np.sign(part.mine - part.right)[abs(part.right) > 0] * np.sign(part.right)[abs(part.right) > 0]
    middle = float(np.median(some))
    if middle > COARSE or float(np.quantile(some, 0.9)) > ALIKE * middle or float(away.mean()) > ONE_SIDED:
        return 0
    return round(-math.log2(2 * middle))
