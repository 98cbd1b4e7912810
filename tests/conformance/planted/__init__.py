"""Mutants that are none of the catalogue's own, and what a report says of each: is it named, and rightly?

    python -m planted                      # all, from tests/conformance
    python -m planted --area gradients

A mutant is the code of spec.md with a patch, or with something done to its inputs or outputs. `right` is what a right name
or place must say, in the first probable cause of the report. Of a mutant of which nothing is said, or only where errors are
(a sentence that begins as `VAGUE` has it) and that not as `right` wants it, the report is neither right nor wrong.
The mutants are two lists. Of the older one a third, whose names have a CRC-32 divisible by 3, was held back: no sentence of
the kit was written with a look at what the kit says of them, until their first count, after which some were looked at.
The newer one, `fresh_*.py`, was written without a look at the diagnosis, each `right` before any count. The half of
it whose names have an odd CRC-32 was held back in turn. At first look 50 of 78 caught mutants of the other half were named
rightly and 3 wrongly; after mends for these, at first look, 40 of 59 of the half held back, and 4 wrongly. Then these
were looked at, too, and three `right` that were too narrow (two of them of the half held back) were widened: both lists
are tuned on now, and only a third one could tell what a new mutant meets.
"""

import re
import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Literal, get_args

import numpy as np

from gsvc_conformance import spec
from gsvc_conformance.causes import Causes
from gsvc_conformance.diagnosis import VAGUE
from gsvc_conformance.implementations import ModuleImplementation
from gsvc_conformance.report.console import WHERE, cause_lines
from gsvc_conformance.results import Report
from gsvc_conformance.runner import Judged, judge_vector
from gsvc_conformance.vector import VECTORS, Vector
from gsvc_conformance.vector_folder import VectorFolder

Verdict = Literal["right", "place", "nothing", "wrong", "not caught"]
Part = Literal["tuned", "held back", "new, tuned", "new, held back"]
Function = Callable[..., dict[str, Any]]


COUNTS = re.compile(r" \(\w+: \d+ of \d+ examined[^()]*\)$")
"""How often a sentence is said, behind it."""


@dataclass(frozen=True)
class Planted:
    """A mutant.

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
    new
        Whether it is of the newer list.
    """

    name: str
    area: str
    operations: tuple[str, ...]
    right: str
    functions: Callable[[], dict[str, Function]]
    new: bool = False

    @property
    def held_back(self) -> bool:
        """Whether it is in the part of its list that was not looked at."""
        return zlib.crc32(self.name.encode()) % 2 == 1 if self.new else zlib.crc32(self.name.encode()) % 3 == 0

    @property
    def part(self) -> Part:
        """The part of the lists that it is in."""
        if self.new:
            return "new, held back" if self.held_back else "new, tuned"
        return "held back" if self.held_back else "tuned"


@dataclass(frozen=True)
class Said:
    """What the report says of a mutant."""

    mutant: Planted
    verdict: Verdict
    lines: tuple[str, ...]


def patched(area: str, name: str, operations: str, right: str, *patches: tuple[str, str]) -> Planted:
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
def vectors_of(operation: str) -> tuple[Vector, ...]:
    """The vectors of an operation."""
    folder = VectorFolder(VECTORS)
    return tuple(folder.read([name for name in folder.names if name.split("/")[1] == operation]))


def judged(mutant: Planted) -> list[Judged]:
    """The mutant, judged by the vectors of its operations in their order."""
    implementation = ModuleImplementation(mutant.name, mutant.functions())
    with np.errstate(all="ignore"):
        return [
            judge_vector(implementation, vector) for operation in mutant.operations for vector in vectors_of(operation)
        ]


def said(mutant: Planted) -> Said:
    """What the report says of a mutant, and whether it is right."""
    causes, results = Causes(), []
    for entry in judged(mutant):
        causes.add(entry)
        results.append(entry.result)
    report = Report({}, "", "", [], causes.find(results)[0])
    lines = tuple(cause_lines(report))
    if not report.faults:
        return Said(mutant, "not caught", ())
    if not lines:
        return Said(mutant, "nothing", ())
    if re.search(mutant.right, COUNTS.sub("", lines[0])):
        return Said(mutant, "right", lines)
    return Said(mutant, "place" if lines[0].startswith((*VAGUE, WHERE)) else "wrong", lines)


@cache
def all_planted() -> tuple[Planted, ...]:
    """All of them, area by area."""
    from planted import bitstream, color, gradients, quantization, rendering, training
    from planted import fresh_bitstream, fresh_rendering, fresh_training  # isort: skip

    older = (
        mutant
        for module in (rendering, gradients, training, quantization, color, bitstream)
        for mutant in module.PLANTED
    )
    newer = (mutant for module in (fresh_rendering, fresh_training, fresh_bitstream) for mutant in module.PLANTED)
    return (*older, *(replace(mutant, new=True) for mutant in newer))


def table(found: Iterable[Said]) -> list[str]:
    """Counts by area, of each part of the lists."""
    found = list(found)
    lines = [f"{'':28}{'mutants':>8}{'caught':>8}{'right':>8}{'place':>7}{'nothing':>9}{'wrong':>7}"]
    for part in get_args(Part):
        of_part = [one for one in found if one.mutant.part == part]
        for area in dict.fromkeys(one.mutant.area for one in of_part):
            lines.append(_row(f"{part}, {area}", [one for one in of_part if one.mutant.area == area]))
        lines.append(_row(f"{part}, all", of_part))
    return [*lines, _row("all", found)]


def _row(title: str, found: list[Said]) -> str:
    count = {verdict: sum(one.verdict == verdict for one in found) for verdict in get_args(Verdict)}
    caught = len(found) - count["not caught"]
    return (
        f"{title:28}{len(found):8}{caught:8}{count['right']:8}{count['place']:7}{count['nothing']:9}{count['wrong']:7}"
    )
