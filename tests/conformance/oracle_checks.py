"""What a variant of a stage gets wrong in the cases of that stage."""

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np

from conformance.case import LEVELS, Case, of_stage
from conformance.cases import CAPACITY
from conformance.expectations import Expectation
from conformance.stage import Values


@cache
def runs(stage: str) -> list[tuple[Case, Values, Mapping[str, Expectation]]]:
    """Each small case of a stage, its inputs and its expectations; large ones have no other arithmetic than these."""
    return [(case, *case.run()) for case in of_stage(stage) if case.level in LEVELS and CAPACITY not in case.flags]


def judged(stage: str, variant: Callable[..., Mapping[str, Any]], levels: tuple[str, ...] = LEVELS):
    """For every case of a stage, by id: the outputs of a variant that fail."""
    found = {}
    for case, inputs, expected in runs(stage):
        if case.level in levels:
            with np.errstate(all="ignore"):
                outputs = variant(**inputs)
            found[case.id] = [name for name in outputs if not expected[name].judge(outputs[name]).passed]
    return found


def assert_legal(stage: str, variant: Callable[..., Mapping[str, Any]]) -> None:
    """A variant passes all cases."""
    assert not {name: wrong for name, wrong in judged(stage, variant).items() if wrong}


def assert_found(stage: str, variant: Callable[..., Mapping[str, Any]]) -> None:
    """A variant fails a core case."""
    assert any(judged(stage, variant, ("core",)).values())


def in_sequence(terms: np.ndarray) -> np.float32:
    """The binary32 sum of all terms, one after the other."""
    return np.add.accumulate(np.ravel(terms), dtype=np.float32)[-1] if np.size(terms) else np.float32(0)


def in_blocks(terms: np.ndarray) -> np.float32:
    """The binary32 sum of blocks of about as many terms as there are blocks, one after the other in both."""
    size = max(int(np.ceil(np.sqrt(np.size(terms)))), 1)
    blocks = np.pad(np.ravel(terms), (0, -np.size(terms) % size)).reshape(-1, size)
    return in_sequence(np.add.accumulate(blocks, axis=1, dtype=np.float32)[:, -1])
