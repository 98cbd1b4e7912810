"""Key frames, convergence, pruning and new splats: decisions in so many digits that nothing is rounded."""

from collections.abc import Mapping

import numpy as np
from mpmath import mpf, workdps
from numpy.typing import NDArray

from tests.hard_cases.measuring import Objects, Truth, exactly, precise
from tests.hard_cases.oracle.rounding import fl

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]

ALL_DIGITS = 1400
"""The square of a sum of binary64 numbers, which are multiples of 2^-1074 below 2^1024, has less than 4300 bits."""


def stands_out(value: mpf, values: list[mpf], k: mpf) -> bool:
    """Whether a value exceeds the mean of values by more than k of their standard deviations; times n, squared."""
    n, S = len(values), sum(values)
    deviations = sum((n * other - S) ** 2 for other in values)  # n^3 times the variance
    return n * value > S and n * (n * value - S) ** 2 > k * k * deviations


@precise
def select_key_frames(
    losses_i: F8, losses_p: F8, window: int, threshold: float, guard_ratio: float, robust: int
) -> Mapping[str, Truth]:
    """(10-28) to (10-30)."""
    with workdps(ALL_DIGITS):
        i, p = exactly(losses_i), [mpf(0), *exactly(losses_p)]
        D = [after - alone for after, alone in zip(p, i, strict=True)]
        k, keys = mpf(threshold), [0]
        for t in range(1, len(i)):
            W = list(range(max(1, t - window), min(len(i) - 1, t + window) + 1))
            if not robust and len(W) - 1 > k * k:
                is_key = stands_out(D[t], [D[j] for j in W], k)
            else:
                others = [D[j] for j in W if j != t and j not in keys]
                is_key = p[t] > mpf(guard_ratio) * i[t] and (not others or stands_out(D[t], others, k))
            if is_key:
                keys.append(t)
    return {"key_frames": Truth(exactly(np.array(keys)))}


@precise
def converged(losses: F8, patience: int, tolerance: float) -> Mapping[str, Truth]:
    """(10-31)."""
    calm, found = 0, 0
    values = exactly(losses)
    for j in range(1, len(values)):
        calm = calm + 1 if abs(values[j] - values[j - 1]) <= mpf(tolerance) else 0
        if calm == patience:
            found = j + 1
            break
    return {"iteration": Truth(exactly(np.array(found)))}


@precise
def prune(weights: F4, removed: int) -> Mapping[str, Truth]:
    """R-10.7-2."""
    magnitudes = abs(exactly(weights))
    order = sorted(range(len(weights)), key=lambda n: (magnitudes[n], -n))
    return {"survivors": Truth(exactly(np.array(sorted(order[removed:]))))}


@precise
def augment(values: F4, uniforms: F4, width: int, height: int) -> Mapping[str, Truth]:
    """(10-26) and (10-27), where each product and sum is rounded once."""
    a = exactly(uniforms)
    new: Objects = exactly(np.zeros((len(a), 9)))
    new[:, :2] = a[:, :2] * exactly(np.array([width, height]))
    new[:, 2:5] = a[:, 2:5] + exactly(np.array([0.5, 0, 0.5]))
    new[:, 5:8] = a[:, 5:]
    new[:, 8] = mpf(1) / 100
    return {"values": Truth(np.concatenate([exactly(values), np.vectorize(fl, otypes=[object])(new)]), 0.0)}
