"""The search for causes in a whole run: what it needs is collected vector by vector."""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_conformance.diagnosis.failures import Failure
from gsvc_conformance.operation import DTYPES
from gsvc_conformance.results import Result
from gsvc_conformance.runner import Judged
from gsvc_conformance.vector import Vector
from gsvc_ref.cli.text import plural

NOTHING: Final = np.zeros(0)


class Causes:
    """Collects what the search for causes needs, operation by operation, and finds them."""

    def __init__(self) -> None:
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
                port.name: self._buffers.get((name, port.name), NOTHING) for port in judged.vector.operation.outputs
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
                beyond = self._buffers.get(key, NOTHING)[flat.size :]
                self._buffers[key] = np.concatenate([flat, beyond]) if beyond.size else flat

    def find(self, results: Iterable[Result]) -> tuple[list[Result], list[str]]:
        """The results with their causes, and what is to be said of the search."""
        from gsvc_conformance.diagnosis import EXAMINED, diagnose, examined, mutants_for

        causes: dict[str, list[str]] = {}
        notes = []
        for operation in dict.fromkeys([*self._failures, *self._errors]):
            failures = self._failures[operation]
            causes |= diagnose(failures, self._passed[operation], self._errors[operation])
            seen = [failure.vector for failure in examined(failures)]
            if open_ones := [vector for vector in seen if not causes.get(vector.id)]:
                tried = len({mutant.name for vector in open_ones for mutant in mutants_for(vector)})
                notes.append(
                    f"{operation}: no mutant gives exactly what {len(open_ones)} of {plural(len(seen), 'failure')} "
                    f"gave ({tried} tried)"
                )
            if len(failures) > EXAMINED:
                notes.append(
                    f"causes were looked for in {EXAMINED} of {len(failures)} failures of {operation}, of all sizes"
                )
        return [replace(result, causes=tuple(causes.get(result.id, ()))) for result in results], notes


def _right_types(judged: Judged) -> bool:
    """Whether arrays have the types that they must have; if not, the report says so and looks for no other cause."""
    given = judged.outputs or {}
    mine = {port: given.get(port.name) for port in judged.vector.operation.outputs if port.type in DTYPES}
    return all(array.dtype == port.type for port, array in mine.items() if isinstance(array, np.ndarray))
