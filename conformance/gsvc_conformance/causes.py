"""The search for causes in a whole run: what it needs is collected vector by vector."""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gsvc_base.cli.text import plural
from gsvc_conformance.diagnosis.failures import Failure
from gsvc_conformance.operation import DTYPES, operations
from gsvc_conformance.profiles import ANY
from gsvc_conformance.results import FAULTS, Result
from gsvc_conformance.runner import Judged
from gsvc_conformance.spec import complexity, leads_to
from gsvc_conformance.vector import Vector

NOTHING: Final = np.zeros(0)
READING: Final = {"paper": "read_stream", "main": "read_main_stream"}
"""The operations that list what a stream says, by profile, and so tell more of a fault than the splats that it has."""
PARTS: Final = ("bitstream", "reconstruction")
"""The classes of the operations that readers of streams are made of."""
MEND: Final = ": mend that first"
"""The end of sentences about wrong operations inside another one."""


class Search(NamedTuple):
    """How the search for the causes of an operation went.

    Attributes
    ----------
    operation
        Its name.
    failures, examined
        The number of its failures, and of those that were looked at.
    unexplained, tried
        The number of examined failures without a cause, and of the mutants that were tried on them.
    """

    operation: str
    failures: int
    examined: int
    unexplained: int
    tried: int

    def notes(self) -> list[str]:
        """What is to be said of it."""
        notes = []
        if self.unexplained and self.tried:
            notes.append(
                f"{self.operation}: no mutant gives exactly what {self.unexplained} of "
                f"{plural(self.examined, 'failure')} gave ({self.tried} tried)"
            )
        if self.examined < self.failures:
            notes.append(
                f"causes were looked for in {self.examined} of {self.failures} failures of {self.operation}, of all "
                "sizes"
            )
        return notes


def added(searches: Iterable[Search]) -> list[Search]:
    """The searches of several processes, one an operation."""
    total: dict[str, Search] = {}
    for one in searches:
        before = total.get(one.operation, Search(one.operation, 0, 0, 0, 0))
        total[one.operation] = Search(
            one.operation, before.failures + one.failures, before.examined + one.examined,
            before.unexplained + one.unexplained, max(before.tried, one.tried),
        )  # fmt: skip
    return list(total.values())


class Causes:
    """Collects what the search for causes needs, operation by operation, and finds them.

    Attributes
    ----------
    searches
        How the search went, operation by operation.
    examined
        The ids of the failures that were looked at.
    faults
        A sentence about each operation whose search ended with an exception.
    """

    def __init__(self) -> None:
        self.searches: list[Search] = []
        self.examined: set[str] = set()
        self.faults: list[str] = []
        self._failures: defaultdict[str, list[Failure]] = defaultdict(list)
        self._passed: defaultdict[str, list[Vector]] = defaultdict(list)
        self._errors: defaultdict[str, list[Vector]] = defaultdict(list)
        self._buffers: dict[tuple[str, str], NDArray[Any]] = {}

    def add(self, judged: Judged) -> None:
        """Take note of a vector."""
        name = judged.vector.operation.name
        if judged.result.outcome == "pass":
            self._passed[name].append(judged.vector)
        elif judged.result.outcome == "fail" and judged.outputs is not None and _right_types(judged):
            before = {
                port.name: self._buffers.get((name, port.name), NOTHING).copy()
                for port in judged.vector.operation.outputs
            }
            self._failures[name].append(Failure(judged.vector, judged.outputs, before))
        elif judged.result.outcome in ("error", "crash"):
            self._errors[name].append(judged.vector)
        self._write_buffers(judged)

    def _write_buffers(self, judged: Judged) -> None:
        """Keep what buffers would hold now that no vector clears: each output over the one before."""
        for name, value in (judged.outputs or {}).items():
            if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
                key, flat = (judged.vector.operation.name, name), value.ravel()
                buffer = self._buffers.get(key, NOTHING)
                if buffer.dtype == flat.dtype and buffer.size >= flat.size:
                    buffer[: flat.size] = flat
                else:
                    beyond = buffer[flat.size :]
                    self._buffers[key] = np.concatenate([flat, beyond]) if beyond.size else flat.copy()

    def find(self, results: Iterable[Result]) -> tuple[list[Result], list[str]]:
        """The results with their causes, and what is to be said of the search."""
        results = list(results)
        self.searches, self.examined, self.faults = [], set(), []
        wrong: defaultdict[str, set[str]] = defaultdict(set)
        for result in results:
            if result.outcome in FAULTS and not self._is_mute(result.operation):
                wrong[result.operation].add(result.profile)
        causes: dict[str, list[str]] = {}
        for operation in dict.fromkeys([*self._failures, *self._errors]):
            try:
                causes |= self._searched(operation, wrong)
            except Exception as error:
                self.faults.append(f"{operation}: the search for causes failed: {type(error).__name__}: {error}")
        notes = [note for search in self.searches for note in search.notes()]
        found = [replace(result, causes=tuple(causes.get(result.id, ()))) for result in results]
        return found, [*notes, *self.faults]

    def _is_mute(self, operation: str) -> bool:
        """Whether an operation that lists what a stream says ended with errors alone, which say less than others."""
        return operation in READING.values() and operation not in self._failures

    def _searched(self, operation: str, wrong: Mapping[str, set[str]]) -> dict[str, list[str]]:
        """The causes of an operation's failures by id, where those in `wrong` have failures of some profiles, too."""
        from gsvc_conformance.diagnosis import diagnose, examined, hedged, is_sure, mutants_for

        failures = self._failures[operation]
        seen = [failure.vector for failure in examined(failures)]
        self.examined |= {vector.id for vector in seen}
        first = {
            vector.id: mend_first(operation, vector.profile, wrong) for vector in (*seen, *self._errors[operation])
        }
        if reads_streams(operation) and all(map(_is_of_reader, first.values())):
            return {name: [sentence] for name, sentence in first.items()}
        causes = diagnose(failures, self._passed[operation], self._errors[operation])
        for name, sentence in first.items():
            if sentence and not any(map(is_sure, causes.get(name, ()))):
                causes[name] = [sentence]
        if reads_streams(operation):
            passed = [vector for vectors in self._passed.values() for vector in vectors]
            causes = {name: [hedged(cause, passed) for cause in some] for name, some in causes.items()}
        unexplained = [vector for vector in seen if not causes.get(vector.id)]
        tried = {mutant.name for vector in unexplained for mutant in mutants_for(vector)}
        self.searches.append(Search(operation, len(failures), len(seen), len(unexplained), len(tried)))
        return causes


def _is_of_reader(sentence: str) -> bool:
    """Whether a sentence names an operation that is wrong in whatever is read, not in what is drawn of it."""
    return any(name in sentence.split() for name, about in operations().items() if about.group in PARTS)


@cache
def parts_of(operation: str, profile: str) -> frozenset[str]:
    """The operations that an operation is made of, where it reads a stream of some profile.

    These are the code's functions that it leads to, and of one that reads streams those that share their code with it.
    """
    own = leads_to(operation)
    found = own & operations().keys() - {operation}
    if not reads_streams(operation):
        return found
    shared = {
        name for name, part in operations().items()
        if part.group in PARTS and not name.startswith("encode_") and not reads_streams(name)
        and leads_to(name) - {name} and leads_to(name) - {name} <= own
    }  # fmt: skip
    reading = READING.get(profile, operation)
    return frozenset({*found, *shared, reading} - {operation})


def reads_streams(operation: str) -> bool:
    """Whether an operation has a stream as an input."""
    return operation in operations() and any(port.type == "stream" for port in operations()[operation].inputs)


def mend_first(operation: str, profile: str, wrong: Mapping[str, set[str]]) -> str:
    """A sentence about those operations inside another one that are wrong in a profile; empty if there are none."""
    inside = [
        name for name in parts_of(operation, profile)
        if wrong.get(name, set()) & {profile, ANY} or (profile == ANY and wrong.get(name))
    ]  # fmt: skip
    leaves = sorted((name for name in inside if not parts_of(name, profile).intersection(inside)), key=complexity)
    if not leaves:
        return ""
    return f"{' and '.join(leaves)} {'are' if leaves[1:] else 'is'} wrong{MEND}"


def looks_like(cause: str) -> str:
    """A cause as it is said of one failure."""
    return cause if cause.endswith(MEND) else f"looks like {cause}"


def _right_types(judged: Judged) -> bool:
    """Whether arrays have the types that they must have; if not, the report says so and looks for no other cause."""
    given = judged.outputs or {}
    mine = {port: given.get(port.name) for port in judged.vector.operation.outputs if port.type in DTYPES}
    return all(array.dtype == port.type for port, array in mine.items() if isinstance(array, np.ndarray))
