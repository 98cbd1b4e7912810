"""Symbols of a decoder that left a stream of profile `main`: the tables of the right ones, and what mutants decode."""

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any, Final

import numpy as np

from gsvc_conformance import spec
from gsvc_conformance.diagnosis.failures import Array, Failure
from gsvc_conformance.expectations import Exact
from gsvc_conformance.mutants import Mutant, time_limit
from gsvc_conformance.vector import Vector

SYMBOLS: Final = "symbols"

FEWEST: Final = 6
"""Minimum number of symbols from the first wrong one on that must be the same."""

MOST_APART: Final = 0.1
"""Maximum difference of the numbers of symbols, as a fraction: decoders leave a stream at one place or another."""

SECONDS: Final = 2.0
"""Mutants that take longer are given up."""

DECODED: Final = "            found[i] = self.next(self.place % len(self.states), tables[row])\n"
NOTED: Final = (DECODED, f"            noted.append((tables, row))\n{DECODED}")
"""A patch that notes the tables of the part of a pass, and which of them each symbol is decoded by."""

RIGHT_TABLE: Final = "from a wrong state: its table is right (words, lanes, groups, first states)"
OTHER_TABLE: Final = "by the table of another"
WRONG_TABLE: Final = "by a table that is wrong"
"""What the first wrong symbol says of its table."""


def table_evidence(vector: Vector, number: int, c: int, f: int) -> str:
    """What was wrong where a symbol, of some number in the stream, was decoded as one of start c and frequency f."""
    tables, row = _tables(vector)[number]
    if _has(tables[row], c, f):
        return RIGHT_TABLE
    return OTHER_TABLE if any(_has(table, c, f) for table in tables) else WRONG_TABLE


def _has(table: Array, c: int, f: int) -> bool:
    return bool(((table[:-1] == c) & (np.diff(table) == f)).any())


@lru_cache(maxsize=16)
def _tables(vector: Vector) -> list[tuple[Sequence[Array], int]]:
    """The tables at hand for each symbol of a stream, and the number of its own."""
    names = spec.namespace((NOTED,))
    noted: list[tuple[Sequence[Array], int]] = []
    names["noted"] = noted
    names[vector.operation.name](**vector.inputs)
    return noted


def is_cut(failure: Failure) -> bool:
    """Whether symbols were given, and more or fewer than there are."""
    given, expected = failure.outputs.get(SYMBOLS), failure.vector.expected.get(SYMBOLS)
    if not isinstance(expected, Exact) or not isinstance(given, np.ndarray):
        return False
    return given.shape[1:] == expected.value.shape[1:] and len(given) != len(expected.value)


class _LeftError(Exception):
    """A mutant decodes another symbol than the implementation did."""


class _Beside(list[Any]):
    """The symbols of a run, beside those that were given; what differs ends the decoding."""

    def __init__(self, given: Iterator[Any]) -> None:
        super().__init__()
        self.given = given

    def append(self, symbol: Any) -> None:
        if symbol != next(self.given, symbol):
            raise _LeftError
        super().append(symbol)


def same_symbols(failure: Failure, mutant: Mutant) -> bool:
    """Whether a mutant decodes what was given until one of both ends, some of it wrong."""
    right, mine = np.asarray(failure.vector.expected[SYMBOLS].value), failure.outputs[SYMBOLS]
    decoded = _decoded_beside(failure, mutant)
    common = min(len(right), len(mine), decoded)
    if common < (1 - MOST_APART) * max(len(mine), decoded):
        return False
    wrong = np.flatnonzero((right[:common] != mine[:common]).any(axis=1))
    return len(wrong) > 0 and common - int(wrong[0]) >= FEWEST


def _decoded_beside(failure: Failure, mutant: Mutant) -> int:
    """How many symbols a mutant decodes until it is done or finds a fault; 0 if one differs from what was given."""
    names, runs = spec.namespace(mutant.patches), []
    read_parts, given = names["read_parts"], map(tuple, failure.outputs[SYMBOLS].tolist())

    def noting(run: Any, parts: Any) -> Any:
        run.decoded = _Beside(given)
        runs.append(run)
        return read_parts(run, parts)

    names["read_parts"] = noting
    try:
        with np.errstate(all="ignore"), time_limit(SECONDS):
            names[failure.vector.operation.name](**failure.vector.inputs)
    except _LeftError:
        return 0
    except Exception:  # a fault, or what the mutant makes of the bits
        pass
    return sum(len(run.decoded) for run in runs)
