"""Remains of the vector before: buffers that are not cleared, or not overwritten."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from gsvc_conformance.diagnosis.failures import EXPLAINED, F8, Failure, Part
from gsvc_conformance.diagnosis.regions import Candidate

DISTINCT: Final = 6
"""Minimum number of different numbers that do not agree by chance."""

SHARE: Final = 0.4
"""Fraction of the failures that must show it: pictures of two vectors may be alike."""


def stale_candidates(failure: Failure, part: Part) -> Iterator[Candidate]:
    """Whether wrong elements are what an uncleared buffer held there, or have it added."""
    old = failure.before.get(part.name)
    if old is None or old.size == 0:
        return
    reach = min(old.size, part.right.size)
    old, right, mine = (np.asarray(a, np.float64).ravel()[:reach] for a in (old, part.right, part.mine))
    wrong = part.wrong.ravel()[:reach]
    if reach < EXPLAINED * part.right.size and np.flatnonzero(part.wrong.ravel()).max() >= reach:
        return
    if not wrong.any() or len(np.unique(old[wrong])) < DISTINCT or (old[wrong] != 0).mean() < EXPLAINED / 2:
        return
    slack = part.slack(part.right).ravel()[:reach]
    same = abs(mine - old) <= slack
    if same[wrong].mean() >= EXPLAINED:
        whole = _always if same.mean() >= EXPLAINED else None
        yield Candidate("what the vector before left in the same buffer: elements that are not written", whole, SHARE)
    added = old + right
    if part.given.dtype.kind == "u":
        added = np.minimum(added, float(np.iinfo(part.given.dtype).max))
    changed = abs(added - right) > slack
    near = abs(mine - added) <= 2 * slack + 1e-6 * abs(old)
    if changed.any() and near[changed].mean() >= EXPLAINED and near[wrong].mean() >= EXPLAINED:
        yield Candidate("results added to what the vector before left: a buffer that is not cleared", _always, SHARE)


def _always(value: F8) -> bool:
    """Every vector would show it whose output is not empty."""
    return True
