"""Decisions of training on the host, in numbers that no accelerator has (sections 10.7, 10.9 and 10.10).

The plan and the key frames are exact: integers of any length, and binary64 where the specification says so.
"""

from collections import Counter
from collections.abc import Sequence
from fractions import Fraction

import numpy as np
import torch

from gsvc_conformance.adapters.pytorch.device import Array, Arrays


def pruning_plan(splats: int, iterations: int, fraction: float, first: int, last: int, interval: int) -> Arrays:
    """Operation: (10-25)."""
    total = round(fraction * splats)
    times = [*range(first, last, interval), last]
    share = total // len(times)
    removals = [share] * (len(times) - 1) + [total - share * (len(times) - 1)]
    scale = min(1.0, 0.8 * iterations / last)
    plan: Counter[int] = Counter()
    for time, removed in zip(times, removals, strict=True):
        plan[max(1, int(time * scale))] += removed
    rows = sorted((when, count) for when, count in plan.items() if count > 0 and iterations > 0)
    when, counts = np.array(rows, np.int64).reshape(-1, 2).T
    return {"iterations": when, "counts": counts}


def converged(losses: Array, patience: int, tolerance: float) -> Arrays:
    """Operation: (10-31) as a window over all iterations: the first `patience` quiet steps in a row."""
    quiet = torch.tensor(losses).diff().abs() <= tolerance  # of iterations 2, 3, …, counted from 1
    if len(quiet) < patience:
        return {"iteration": 0}
    found = quiet.unfold(0, patience, 1).all(1).nonzero()
    return {"iteration": int(found[0]) + patience + 1 if len(found) else 0}


def select_key_frames(
    losses_i: Array, losses_p: Array, window: int, threshold: float, guard_ratio: float, robust: int
) -> Arrays:
    """Operation: (10-28) to (10-30) in rational numbers; neither a ratio nor a root is formed."""
    alone = [Fraction(value) for value in losses_i.tolist()]
    predicted = [Fraction(0), *(Fraction(value) for value in losses_p.tolist())]
    D = [p - i for p, i in zip(predicted, alone, strict=True)]
    squared_threshold = Fraction(threshold) ** 2
    keys = {0}
    for t in range(1, len(D)):
        W = range(max(1, t - window), min(len(D) - 1, t + window) + 1)
        if not robust and len(W) - 1 > squared_threshold:
            is_key = _stands_out(D[t], [D[j] for j in W], squared_threshold)
        else:
            left = [D[j] for j in W if j != t and j not in keys]
            is_key = predicted[t] > Fraction(guard_ratio) * alone[t] and (
                not left or _stands_out(D[t], left, squared_threshold)
            )
        if is_key:
            keys.add(t)
    return {"key_frames": np.array(sorted(keys), np.int64)}


def _stands_out(value: Fraction, values: Sequence[Fraction], squared_threshold: Fraction) -> bool:
    """(10-29)."""
    n, S, Q = len(values), sum(values), sum(other * other for other in values)
    above = n * value - S
    return above > 0 and above * above > squared_threshold * (n * Q - S * S)
