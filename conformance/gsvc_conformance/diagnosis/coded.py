"""Symbols of a decoder that left a stream of profile `main`, beside those that mutants decode until they leave it."""

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


def is_cut(failure: Failure) -> bool:
    """Whether symbols were given, and more or fewer than there are."""
    given, expected = failure.outputs.get(SYMBOLS), failure.vector.expected.get(SYMBOLS)
    if not isinstance(expected, Exact) or not isinstance(given, np.ndarray):
        return False
    return given.shape[1:] == expected.value.shape[1:] and len(given) != len(expected.value)


def same_symbols(failure: Failure, mutant: Mutant) -> bool:
    """Whether a mutant decodes what was given, from the first wrong symbol on until one of both ends."""
    right, mine = np.asarray(failure.vector.expected[SYMBOLS].value), failure.outputs[SYMBOLS]
    theirs = _decoded(mutant, failure.vector)
    common = min(len(right), len(mine), len(theirs))
    if common < (1 - MOST_APART) * max(len(mine), len(theirs)):
        return False
    wrong = np.flatnonzero((right[:common] != mine[:common]).any(axis=1))
    if not len(wrong) or common - wrong[0] < FEWEST:
        return False
    return bool(np.array_equal(mine[wrong[0] : common], theirs[wrong[0] : common]))


@lru_cache(maxsize=1024)
def _decoded(mutant: Mutant, vector: Vector) -> Array:
    """The symbols that a mutant decodes, until it is done or finds a fault."""
    names, runs = spec.namespace(mutant.patches), []
    read_parts = names["read_parts"]

    def noting(run: Any, parts: Any) -> Any:
        runs.append(run)
        return read_parts(run, parts)

    names["read_parts"] = noting
    try:
        with np.errstate(all="ignore"), time_limit(SECONDS):
            names[vector.operation.name](**vector.inputs)
    except Exception:  # a fault, or what the mutant makes of the bits
        pass
    return np.array([symbol for run in runs for symbol in run.decoded], np.int64).reshape(-1, 4)
