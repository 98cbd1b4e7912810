"""Faults that are none of the catalogue's own, and what a report says of each: is it named, and rightly?

    python -m planted                      # all, from tests/conformance
    python -m planted --area gradients
    python -m planted --jobs 2 --results FILE --write     # what FILE has of earlier runs, too, and the page of it

A fault is the code of spec.md with patches, something done to its inputs or outputs, or code of its own (`peers`). `right`
is what a right name must say, in the first probable cause of the report; `near` is what a place must say from which one
would find the fault, anywhere in the causes or in the vector to begin with. Where nothing is said, where a cause says that it
could be another one, or where it only says where errors are, the report is not wrong: it is of no help.

There are five lists, and the parts that nothing was tuned on are told apart. Of the oldest one a third, whose names have a
CRC-32 divisible by 3, was held back: no sentence of the kit was written with a look at what the kit says of them, until
their first count, after which some were looked at. The newer one, `fresh_*.py`, was written without a look at the diagnosis,
each `right` before any count. The half of it whose names have an odd CRC-32 was held back in turn. At first look 50 of 78
caught mutants of the other half were named rightly and 3 wrongly; after mends for these, at first look, 40 of 59 of the half
held back, and 4 wrongly. Then these were looked at, too, and three `right` that were too narrow (two of them of the half held
back) were widened: both lists are tuned on now. `main_profile.py` has what an outside decoder was given (`reported`), and what
was made up later (`third`, held back). `peers.py` has public implementations (`peers`) and gradients by autograd (`autograd`).
"""

import re
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Final, Literal, get_args

import numpy as np

from gsvc_base.errors import UsageError
from gsvc_conformance import spec
from gsvc_conformance.causes import MEND, Causes
from gsvc_conformance.diagnosis import VAGUE
from gsvc_conformance.implementations import ModuleImplementation
from gsvc_conformance.profiles import ANY
from gsvc_conformance.report.console import WHERE, begin_lines, cause_lines
from gsvc_conformance.runner import Judged, judge_vector
from gsvc_conformance.vector import VECTORS, Vector
from gsvc_conformance.vector_folder import VectorFolder
from gsvc_conformance.verdicts import Report

Verdict = Literal["right", "place", "nothing", "wrong", "not caught"]
Known = Literal["older", "newer", "reported", "third", "fresh", "raising", "unchecked", "peers", "autograd"]
Part = Literal[
    "tuned",
    "held back",
    "new, tuned",
    "new, held back",
    "reported",
    "third, held back",
    "fresh",
    "raising",
    "unchecked",
    "peers",
    "autograd",
]
Function = Callable[..., dict[str, Any]]
Patch = spec.Patch


COUNTS = re.compile(r" \(\w+: \d+ of \d+ examined[^()]*\)$")
"""How often a sentence is said, behind it."""
RIGHT_ONES: Final = re.compile(r"; [^;(]* (is|are) right(?= |$)")
"""What a sentence about a place says of the other outputs."""
GUESSES: Final = "could be|need not be yours|or another one"
"""What a sentence has that may be about another fault: what it says is no place."""
HEDGES: Final = re.compile(
    f"{GUESSES}|{MEND}|^a legal stream refused|^a refusal of another kind|^every answer is an error"
)
"""The same, and sentences that say what happens: they give no cause for sure, as places do (`VAGUE`, `WHERE`)."""
SHAPES: Final = "only vectors "
"""What a cause by shapes begins with: a place in the lists without `near`; in the others it is nonsense unless it is near."""
CONFORMS: Final = "nothing is wrong"
"""What is right to say of an implementation that conforms, if at least half of the vectors can be asked."""
MAX_ELEMENTS: Final = 2**17
"""Elements of the arrays of a vector of profile `main`, at most: larger ones take a patched spec.md too long."""


@dataclass(frozen=True)
class Planted:
    """A fault.

    Attributes
    ----------
    name, area
        A name and the folder of reports that it belongs to.
    operations
        The operations that it is judged by; it is in no other.
    right
        A pattern that a right name or place has.
    functions
        Makes the functions of these operations, afresh.
    known
        The list that it is in.
    near
        A pattern that what leads to it has; empty if every place does.
    profile, tier
        The vectors that it is judged by: those that a claim of a profile needs, or of a tier; empty for all.
    """

    name: str
    area: str
    operations: tuple[str, ...]
    right: str
    functions: Callable[[], Mapping[str, Function]]
    known: Known = "older"
    near: str = ""
    profile: str = ""
    tier: str = ""

    @property
    def held_back(self) -> bool:
        """Whether it is in the part of its list that was not looked at."""
        return self.part.endswith("held back")

    @property
    def part(self) -> Part:
        """The part of the lists that it is in."""
        number = zlib.crc32(self.name.encode())
        if self.known == "older":
            return "tuned" if number % 3 else "held back"
        if self.known == "newer":
            return "new, held back" if number % 2 else "new, tuned"
        return "third, held back" if self.known == "third" else self.known


@dataclass(frozen=True)
class Said:
    """What the report says of a fault: its causes, and what to begin with."""

    mutant: Planted
    verdict: Verdict
    lines: tuple[str, ...]
    begin: str = ""


def patched(area: str, name: str, operations: str, right: str, *patches: Patch) -> Planted:
    """A mutant as changes of spec.md's code."""
    names = tuple(operations.split())
    return Planted(
        name, area, names, right, lambda: {operation: spec.namespace(patches)[operation] for operation in names}
    )


def after(
    area: str,
    name: str,
    operations: str,
    right: str,
    change: Callable[[dict[str, Any], dict[str, Any]], dict[str, Any]],
) -> Planted:
    """A mutant that changes the right outputs, as `change(outputs, inputs)` does."""

    def wrapped(operation: str) -> Function:
        function = spec.namespace()[operation]
        return lambda **inputs: {**(out := function(**inputs)), **change({k: _own(v) for k, v in out.items()}, inputs)}

    names = tuple(operations.split())
    return Planted(name, area, names, right, lambda: {operation: wrapped(operation) for operation in names})


def before(area: str, name: str, operations: str, right: str, change: Callable[..., dict[str, Any]]) -> Planted:
    """A mutant that changes the inputs, as `change(inputs)` does."""

    def wrapped(operation: str) -> Function:
        function = spec.namespace()[operation]
        return lambda **inputs: function(**{**inputs, **change({k: _own(v) for k, v in inputs.items()})})

    names = tuple(operations.split())
    return Planted(name, area, names, right, lambda: {operation: wrapped(operation) for operation in names})


def _own(value: Any) -> Any:
    return value.copy() if isinstance(value, np.ndarray) else value


@cache
def vectors_of(operation: str, profile: str = "", tier: str = "") -> tuple[Vector, ...]:
    """The vectors of an operation, of a profile and a tier if these are given."""
    folder = VectorFolder(VECTORS)
    names = [name for name in folder.names if name.split("/")[1] == operation and name.startswith(tier)]
    vectors = folder.read(names)
    return tuple(
        vector for vector in vectors if not profile or (vector.profile in (profile, ANY) and _is_small(vector))
    )


def _is_small(vector: Vector) -> bool:
    values = (*vector.inputs.values(), *(expected.value for expected in vector.expected.values()))
    return sum(np.size(value) for value in values) <= MAX_ELEMENTS


def judged(mutant: Planted) -> Iterator[Judged]:
    """The fault, judged by the vectors of its operations in their order."""
    implementation = ModuleImplementation(mutant.name, mutant.functions())
    for operation in mutant.operations:
        for vector in vectors_of(operation, mutant.profile, mutant.tier):
            with np.errstate(all="ignore"):
                entry = judge_vector(implementation, vector)
            yield entry


def said(mutant: Planted) -> Said:
    """What the report says of a fault, and whether it is right."""
    causes, results = Causes(), []
    try:
        entries = list(judged(mutant))
    except UsageError as error:  # it cannot be imported: the message is all that the report says
        lines = (str(error),)
        return Said(mutant, "right" if re.search(mutant.right, lines[0]) else "wrong", lines)
    for entry in entries:
        causes.add(entry)
        results.append(entry.result)
    report = Report({}, "", "", [], causes.find(results)[0])
    if not report.faults:
        asked = sum(result.outcome == "pass" for result in results)
        lines = (f"{CONFORMS}; {asked} of {len(results)} vectors can be asked",) if mutant.right == CONFORMS else ()
        return Said(mutant, "not caught" if not lines else "right" if 2 * asked >= len(results) else "nothing", lines)
    lines, begin = tuple(cause_lines(report)), begin_lines(report)[-1]
    return Said(mutant, verdict(mutant, lines, begin), lines, begin)


def said_of(place: int) -> Said:
    """The same of one by its place in `all_planted`, for a process of its own."""
    one = said(all_planted()[place])
    return replace(one, mutant=replace(one.mutant, functions=dict))


def verdict(mutant: Planted, lines: tuple[str, ...], begin: str = "") -> Verdict:
    """Whether the first cause is the right one, or else one that is stated as if it were, or what leads to the fault."""
    if lines and re.search(mutant.right, COUNTS.sub("", lines[0])):
        return "right"
    places = (*VAGUE, WHERE) if not mutant.near else (*(start for start in VAGUE if start != SHAPES), WHERE)
    told = [RIGHT_ONES.sub("", line) for line in lines]
    sure = [line for line in told if not line.startswith(places) and not HEDGES.search(line)]
    if sure and (sure[0] == told[0] or not any(re.search(words, sure[0]) for words in (mutant.right, mutant.near))):
        return "wrong"
    if not mutant.near:
        return "place" if lines else "nothing"
    certain = [line for line in told if not re.search(GUESSES, line)]
    leads = re.search(mutant.near, "\n".join([*certain, begin])) or re.search(mutant.right, "\n".join(told))
    return "place" if leads else "nothing"


@cache
def all_planted() -> tuple[Planted, ...]:
    """All of them, area by area."""
    from planted import bitstream, color, gradients, main_profile, peers, quantization, rendering, training
    from planted import fresh_bitstream, fresh_rendering, fresh_training  # isort: skip

    older = (
        mutant
        for module in (rendering, gradients, training, quantization, color, bitstream)
        for mutant in module.PLANTED
    )
    newer = (mutant for module in (fresh_rendering, fresh_training, fresh_bitstream) for mutant in module.PLANTED)
    return (*older, *(replace(mutant, known="newer") for mutant in newer), *main_profile.PLANTED, *peers.PLANTED)


COLUMNS: Final = ("faults", "caught", "right", "place", "nothing", "wrong")


def rows(found: Iterable[Said]) -> list[tuple[str, list[int]]]:
    """The counts of each area of each part, of each part, and of all, under `COLUMNS`."""
    found = list(found)
    table = []
    for part in get_args(Part):
        of_part = [one for one in found if one.mutant.part == part]
        areas = list(dict.fromkeys(one.mutant.area for one in of_part))
        if len(areas) > 1:
            by_area = {area: [one for one in of_part if one.mutant.area == area] for area in areas}
            table += [(f"{part}, {area}", _counts(own)) for area, own in by_area.items()]
        if of_part:
            table.append((f"{part}, all", _counts(of_part)))
    return [*table, ("all", _counts(found))]


def table(found: Iterable[Said]) -> list[str]:
    """The same as lines of text."""
    head = f"{'':36}{''.join(f'{name:>9}' for name in COLUMNS)}"
    return [head, *(f"{title:36}{''.join(f'{count:9}' for count in counts)}" for title, counts in rows(found))]


def _counts(found: list[Said]) -> list[int]:
    count = {verdict: sum(one.verdict == verdict for one in found) for verdict in get_args(Verdict)}
    named = [count[verdict] for verdict in ("right", "place", "nothing", "wrong")]
    return [len(found), len(found) - count["not caught"], *named]
