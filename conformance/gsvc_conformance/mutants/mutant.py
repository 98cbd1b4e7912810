"""A mutant: the code of spec.md with one mistake, as patches of its text.

A mutant only runs on vectors that lead to a function which its patches touch. Its answer decides two things: whether the
vector *kills* it (the answer is judged wrong), and whether a failing implementation *looks like* it (`diagnosis`).
"""

import signal
import sys
import types
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any, Final

import numpy as np

from gsvc_conformance import spec
from gsvc_conformance.expectations import Expectation, Judgement, Rate
from gsvc_conformance.operation import Operation, Values
from gsvc_conformance.vector import Vector

SECONDS: Final = 10.0
"""Maximum processor time of a mutant on one vector, in seconds: what takes longer hangs."""


@dataclass(frozen=True)
class Mutant:
    """One plausible mistake.

    Attributes
    ----------
    name
        A stable name, such as ``pixel-centre-at-integer``.
    area
        The part of spec.md that it is about, such as ``rendering``.
    sentence
        The mistake in words, to stand after "looks like".
    patches
        Texts of spec.md's code, each of which occurs exactly once, and their replacements.
    """

    name: str
    area: str
    sentence: str
    patches: tuple[tuple[str, str], ...]

    def namespace(self) -> dict[str, Any]:
        """The functions of the patched spec.md; raises LookupError if a patch does not fit any more."""
        return _namespace(self)

    def touched(self) -> frozenset[str]:
        """The functions that the patches change, or that use what they change; those of a class as ``Bits.uv``."""
        return _touched(self)


def mutant(area: str, name: str, sentence: str, *patches: tuple[str, str]) -> Mutant:
    """A mutant, with arguments in the order in which one thinks of them."""
    return Mutant(name, area, sentence, patches)


@lru_cache(maxsize=2048)  # more than there are mutants; pairs of them come and go
def _namespace(mutant: Mutant) -> dict[str, Any]:
    return spec.namespace(mutant.patches)


@cache
def _touched(mutant: Mutant) -> frozenset[str]:
    original, mutated = _definitions(spec.namespace()), _definitions(mutant.namespace())
    changed = {name for name in {*original, *mutated} if _text(original.get(name)) != _text(mutated.get(name))}
    constants = {name for name in changed if not isinstance(original.get(name), types.FunctionType)}
    users = {
        name
        for name, value in original.items()
        if isinstance(value, types.FunctionType) and constants.intersection(_names(value.__code__))
    }
    return frozenset(changed | users)


def _definitions(namespace: Mapping[str, Any]) -> dict[str, Any]:
    """Functions, methods and constants by name."""
    found: dict[str, Any] = {}
    for name, value in namespace.items():
        if isinstance(value, type):
            members = {method: member for method, member in vars(value).items() if method != "__slotnames__"}
            found |= {f"{name}.{method}": member for method, member in members.items()}  # copying notes __slotnames__
        elif not name.startswith("__"):
            found[name] = value
    return {name: value for name, value in found.items() if not isinstance(value, types.ModuleType)}


def _text(value: Any) -> Any:
    """A value that differs when a definition does."""
    if isinstance(value, types.FunctionType):
        return _code(value.__code__), repr(value.__defaults__)
    return value.tolist() if isinstance(value, np.ndarray) else repr(value)


def _code(code: types.CodeType) -> Any:
    constants = [_code(c) if isinstance(c, types.CodeType) else repr(c) for c in code.co_consts]
    return code.co_code, code.co_names, constants


def _names(code: types.CodeType) -> Iterator[str]:
    """The global names that a function uses."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _names(constant)


def called(operation: Operation, inputs: Values) -> frozenset[str]:
    """The functions of spec.md that some inputs of an operation reach: only mutants that touch one answer otherwise."""
    names = set()

    def note(frame: types.FrameType, event: str, argument: object) -> None:
        if event == "call":
            names.add(frame.f_code.co_qualname.partition(".<locals>")[0])

    function = spec.namespace().get(operation.name)
    if function is None:  # the code of spec.md has no encoder
        return frozenset()
    sys.setprofile(note)
    try:
        with np.errstate(all="ignore"):
            function(**inputs)
    finally:
        sys.setprofile(None)
    return frozenset(names)


class HangsError(Exception):
    """A mutant took longer than SECONDS."""


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raise `HangsError` after some seconds of processor time; in the main thread of a process only."""

    def ring(*_: object) -> None:
        raise HangsError(f"more than {seconds:g} s")

    before = signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def answer(mutant: Mutant, operation: Operation, inputs: Values) -> Values | None:
    """The outputs of a mutant for the inputs of an operation; None if it crashes or hangs."""
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"), time_limit(SECONDS):
            warnings.simplefilter("ignore")
            given: Values = mutant.namespace()[operation.name](**inputs)
            return given
    except Exception:
        return None


def judge(expected: Mapping[str, Expectation], outputs: Mapping[str, Any]) -> Iterator[Judgement]:
    """The judgement of each output."""
    for name, expectation in expected.items():
        whole = expectation.beside(outputs) if isinstance(expectation, Rate) else expectation
        yield whole.judge(outputs.get(name))


def kills(vector: Vector, mutant: Mutant) -> bool:
    """Whether a vector finds a mutant."""
    outputs = answer(mutant, vector.operation, vector.inputs)
    return outputs is None or not all(verdict.passed for verdict in judge(vector.expected, outputs))


def killed_by(vectors: Iterable[Vector], mutants: Iterable[Mutant]) -> dict[str, list[str]]:
    """The names of the mutants that each vector kills, by its id."""
    mutants = list(mutants)
    table = {}
    for vector in vectors:
        run = called(vector.operation, vector.inputs)
        able = (mutant for mutant in mutants if run & mutant.touched()) if run else ()
        table[vector.id] = [mutant.name for mutant in able if kills(vector, mutant)]
    return table
