"""States of splats of profile `main`, by the names of what they have, and such as fits have them."""

from typing import Any, Final

import numpy as np

from gsvc_base import spec
from gsvc_base.draws import Draws
from gsvc_base.portable import power
from gsvc_conformance.cases.building import Array

Q: Final = 24
"""The quantizer of most cases."""
D: Final = spec.step_of(Q)
"""Its step of n in 1/16: 64."""
CLASSES: Final = spec.CLASS_MOST + 1


def ints(rows: Any) -> Array:
    """Integers i8."""
    return np.array(rows, np.int64)


def state(*rows: dict[str, int]) -> Array:
    """States (N, 8), each row by the names of what is not 0."""
    names = ("X", "Y", "A", "B", "S", "n0", "n1", "n2")
    return ints([[row.get(name, 0) for name in names] for row in rows]).reshape(-1, 8)


def color_of_class(j: int, step: int = D) -> int:
    """n0 of a splat whose class is j."""
    return 0 if j == 0 else step << j


def column(array: Any, *names: str) -> list[Any]:
    """Columns of states by name, each as a list."""
    places = {name: place for place, name in enumerate(("X", "Y", "A", "B", "S", "n0", "n1", "n2"))}
    return [array[:, places[name]].tolist() for name in names]


def painted(rng: Draws, count: int, *, width: int = 352, height: int = 288, step: int = D) -> Array:
    """States as fits have them: small splats and large ones, dark and bright ones, a few beyond the border."""
    where = rng.uniform(-0.05, 1.05, (count, 2)) * [256 * width, 256 * height]
    logs = rng.normal(1500, 900, (count, 2))
    shears = rng.normal(0, 500, (count, 1))
    n = rng.normal(0, 1, (count, 3)) * step * power(2.0, rng.uniform(-1, 7, (count, 1)))
    rows = np.concatenate([where, logs, shears, n], axis=1).astype(np.int64)
    found: Array = spec.clipped(*rows[:, :5].T, rows[:, 5:])
    return found
