"""Errors of a variant of an operation in the cases of that operation."""

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np

from gsvc_conformance.case import TIERS, Case, of_operation
from gsvc_conformance.cases import CAPACITY
from gsvc_conformance.expectations import Expectation
from gsvc_conformance.operation import Values


@cache
def runs(operation: str) -> list[tuple[Case, Values, Mapping[str, Expectation]]]:
    """Each small case of an operation, its inputs and expectations; large ones have no other arithmetic than these."""
    return [
        (case, *case.run()) for case in of_operation(operation) if case.tier in TIERS and CAPACITY not in case.flags
    ]


def judged(operation: str, variant: Callable[..., Mapping[str, Any]], tiers: tuple[str, ...] = TIERS):
    """For every case of an operation, by id: the outputs of a variant that fail."""
    found = {}
    for case, inputs, expected in runs(operation):
        if case.tier in tiers:
            with np.errstate(all="ignore"):
                outputs = variant(**inputs)
            found[case.id] = [name for name in outputs if not expected[name].judge(outputs[name]).passed]
    return found


def assert_legal(operation: str, variant: Callable[..., Mapping[str, Any]]) -> None:
    """A variant passes all cases."""
    assert not {name: wrong for name, wrong in judged(operation, variant).items() if wrong}


def assert_found(operation: str, variant: Callable[..., Mapping[str, Any]]) -> None:
    """A variant fails a core case."""
    assert any(judged(operation, variant, ("core",)).values())


def in_sequence(terms: np.ndarray) -> np.float32:
    """The binary32 sum of all terms, one after the other."""
    return np.add.accumulate(np.ravel(terms), dtype=np.float32)[-1] if np.size(terms) else np.float32(0)


def in_blocks(terms: np.ndarray) -> np.float32:
    """The binary32 sum of blocks of about as many terms as there are blocks, one after the other in both."""
    size = max(int(np.ceil(np.sqrt(np.size(terms)))), 1)
    blocks = np.pad(np.ravel(terms), (0, -np.size(terms) % size)).reshape(-1, size)
    return in_sequence(np.add.accumulate(blocks, axis=1, dtype=np.float32)[:, -1])
