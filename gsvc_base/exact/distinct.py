"""Distinct rows: an oracle computes each of them once, however often large inputs repeat it."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import I8


def distinct(*columns: NDArray[Any]) -> tuple[I8, I8, I8]:
    """The rows of arrays (N, ...) that differ in a bit, in the order in which they come first.

    Returns where each of the n rows comes first, (n,); which of them each row is, (N,); how often each occurs, (n,).
    """
    count = len(columns[0])
    if not count:
        return (np.zeros(0, np.int64),) * 3
    rows = np.concatenate([np.ascontiguousarray(c).reshape(count, -1).view(np.uint8) for c in columns], axis=1)
    kind = np.dtype(np.uint64) if rows.shape[1] == 8 else np.dtype((np.void, rows.shape[1]))
    whole = np.ascontiguousarray(rows).view(kind).reshape(count)
    _, first, inverse, counts = np.unique(whole, return_index=True, return_inverse=True, return_counts=True)
    order = np.argsort(first)  # that of the bytes is another one on machines of another byte order
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    return first[order], rank[inverse], counts[order]
