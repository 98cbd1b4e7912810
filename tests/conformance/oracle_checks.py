"""What a variant of a stage gets wrong in the cases of that stage."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from conformance.case import LEVELS, of_stage


def judged(stage: str, variant: Callable[..., Mapping[str, Any]], levels: tuple[str, ...] = LEVELS):
    """For every case of a stage, by id: the outputs of a variant that fail."""
    found = {}
    for case in of_stage(stage):
        if case.level in levels:
            inputs, expected = case.run()
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
