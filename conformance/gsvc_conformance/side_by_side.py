"""A few rows of a wrong table of splats: what was given as a multiple of what is expected, parameter by parameter."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_conformance.expectations import Bounded, Exact
from gsvc_conformance.names import SPLAT, item
from gsvc_conformance.operation import Values
from gsvc_conformance.results import Table
from gsvc_conformance.vector import Vector

MAX_ROWS: Final = 6
"""Maximum number of rows that are shown."""

RIGHT: Final = "ok"
"""Stands for an element that is right."""


def comparison(vector: Vector, outputs: Values) -> Table | None:
    """The worst rows of the first wrong output that is a table of splats; None if there is none."""
    for name, expectation in vector.expected.items():
        given = outputs.get(name)
        if not isinstance(expectation, Bounded | Exact) or not isinstance(given, np.ndarray):
            continue
        right = expectation.value
        if right.ndim != 2 or right.shape[1] not in (len(SPLAT) - 1, len(SPLAT)) or given.shape != right.shape:
            continue
        if given.dtype.kind == "f" and not expectation.judge(given).passed and name != "blocks":
            return _table(vector, name, expectation, given)
    return None


def _table(vector: Vector, name: str, expectation: Bounded | Exact, given: NDArray[Any]) -> Table:
    right, mine = expectation.value.astype(np.float64), given.astype(np.float64)
    with np.errstate(all="ignore"):
        bound = np.asarray(expectation.bound, np.float64) if isinstance(expectation, Bounded) else np.zeros(right.shape)
        good = (abs(mine - right) <= bound) | (mine == right)
    bad = np.flatnonzero((~good).any(axis=1))
    chosen = bad[:MAX_ROWS] if len(bad) else np.arange(min(len(right), MAX_ROWS))
    rows = tuple(
        (
            f"{item(vector.operation, name)} {n}",
            *(_cell(right[n, p], mine[n, p], bool(good[n, p])) for p in range(right.shape[1])),
        )
        for n in chosen
    )
    first = f"{len(chosen)} of {len(bad)} wrong rows" if len(bad) > len(chosen) else "the wrong rows"
    title = f"{name}, given / expected ({first}; {RIGHT}: within its bound)"
    return Table(title, SPLAT[: right.shape[1]], rows)


def _cell(right: float, mine: float, good: bool) -> str:
    """A ratio, or the numbers where there is none."""
    if good:
        return RIGHT
    if not np.isfinite(mine) or not np.isfinite(right):
        return f"{mine:g} for {right:g}"
    return f"{mine / right + 0.0:.4g}" if right else f"{mine:.3g} for 0"
