"""The operations that choose: which splats go and come, which frames are key frames, when training stops.

All are exact. Their inputs are few numbers, and decisions are those of rational numbers or of stated operations.
"""

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gsvc_conformance.expectations import Exact, Expectation
from gsvc_conformance.operation import paired

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]
I8 = NDArray[np.int64]
Expected = Mapping[str, Expectation]


def pruning_plan_oracle(
    splats: int, iterations: int, fraction: float, first: int, last: int, interval: int
) -> Expected:
    """One loop over the iterations of full length, in binary64 as (10-25) has it."""
    total = round(fraction * splats)
    times = [time for time in range(1, last + 1) if time == last or (time >= first and (time - first) % interval == 0)]
    plan: dict[int, int] = {}
    for place, time in enumerate(times, 1):
        removed = total // len(times) + (total % len(times) if place == len(times) else 0)
        iteration = max(1, math.floor(time * min(1.0, 0.8 * iterations / last)))
        plan[iteration] = plan.get(iteration, 0) + removed
    rows = [row for row in plan.items() if row[1] and iterations]
    return {
        "iterations": Exact(np.array([iteration for iteration, _ in rows], np.int64)),
        "counts": Exact(np.array([count for _, count in rows], np.int64)),
    }


paired(
    "pruning_plan",
    "training",
    "How many splats are removed after which iteration.",
    inputs="splats: int; iterations: int; fraction: float; first: int; last: int; interval: int",
    outputs="iterations: i8 (K,); counts: i8 (K,)",
    equations=("10-25",),
    rules=("R-10.7-1",),
    oracle=pruning_plan_oracle,
)


def prune_oracle(weights: F4, removed: int) -> Expected:
    """The order of removal is that of (|w|, -index)."""
    order = sorted(range(len(weights)), key=lambda n: (abs(float(weights[n])), -n))
    return {"survivors": Exact(np.array(sorted(order[removed:]), np.int64))}


paired(
    "prune",
    "training",
    "The splats that stay when those of least weight are removed.",
    inputs="weights: f4 (N,); removed: int",
    outputs="survivors: i8 (n,)",
    rules=("R-10.7-2",),
    oracle=prune_oracle,
)


def compact_oracle(survivors: I8, **rows: Any) -> Expected:
    """Row after row, in the order of the survivors."""
    return {name: Exact(np.array([array[row] for row in survivors], array.dtype).reshape(-1, *array.shape[1:]))
            for name, array in rows.items()}  # fmt: skip


paired(
    "compact",
    "training",
    "What is left of the splats in training, and of the optimiser's state, after a removal.",
    inputs="survivors: i8 (n,); values: f4 (N, 9); m: f4 (N, 9); v: f4 (N, 9); n: f4 (N, 9); previous: f4 (N, 9); "
    "steps: i8 (N,)",
    outputs="values: f4 (n, 9); m: f4 (n, 9); v: f4 (n, 9); n: f4 (n, 9); previous: f4 (n, 9); steps: i8 (n,)",
    rules=("R-10.7-3",),
    oracle=compact_oracle,
)


def augment_oracle(values: F4, uniforms: F4, width: int, height: int) -> Expected:
    """One product or sum each: exact in binary64, rounded once."""
    scale = np.array([width, height, 1, 1, 1, 1, 1, 1], np.float64)
    added = np.array([0, 0, 0.5, 0, 0.5, 0, 0, 0])
    new = (uniforms * scale + added).astype(np.float32)
    weights = np.full((len(uniforms), 1), 0.01, np.float32)
    return {"values": Exact(np.concatenate([values, np.concatenate([new, weights], axis=1)]))}


paired(
    "augment",
    "training",
    "New splats of small weight after the old ones, from uniform numbers.",
    inputs="values: f4 (N, 9); uniforms: f4 (n, 8); width: int; height: int",
    outputs="values: f4 (M, 9)",
    equations=("10-26", "10-27"),
    rules=("R-10.8-1",),
    oracle=augment_oracle,
)


def key_frames_oracle(
    losses_i: F8, losses_p: F8, window: int, threshold: float, guard_ratio: float, robust: int
) -> Expected:
    """Means and variances of rational numbers, with all frames at hand."""
    i = [Fraction(value) for value in losses_i.tolist()]
    p = [Fraction(0), *(Fraction(value) for value in losses_p.tolist())]
    keys = {0}
    for t in range(1, len(i)):
        near = [j for j in range(t - window, t + window + 1) if 1 <= j < len(i)]
        if robust or len(near) <= Fraction(threshold) ** 2 + 1:
            near = [j for j in near if j != t and j not in keys]
            candidate = p[t] > Fraction(guard_ratio) * i[t]
        else:
            candidate = True
        if candidate and (not near or _stands_out(p[t] - i[t], [p[j] - i[j] for j in near], Fraction(threshold))):
            keys.add(t)
    return {"key_frames": Exact(np.array(sorted(keys), np.int64))}


def _stands_out(value: Fraction, values: Sequence[Fraction], threshold: Fraction) -> bool:
    mean = sum(values, Fraction(0)) / len(values)
    variance = sum(((other - mean) ** 2 for other in values), Fraction(0)) / len(values)
    return value > mean and (value - mean) ** 2 > threshold**2 * variance


paired(
    "select_key_frames",
    "training",
    "The key frames of a sequence, from the losses of every frame.",
    inputs="losses_i: f8 (T,); losses_p: f8 (T-1,); window: int; threshold: float; guard_ratio: float; robust: int",
    outputs="key_frames: i8 (K,)",
    equations=("10-28", "10-29", "10-30"),
    rules=("R-10.9-1",),
    oracle=key_frames_oracle,
)


def converged_oracle(losses: F8, patience: int, tolerance: float) -> Expected:
    """The first iteration that ends `patience` small changes in a row."""
    small = abs(np.diff(losses)) <= tolerance  # change j is that of iteration j + 2
    ends = [j + 2 for j in range(patience - 1, len(small)) if small[j - patience + 1 : j + 1].all()]
    return {"iteration": Exact(np.array(ends[0] if ends else 0, np.int64))}


paired(
    "converged",
    "training",
    "The iteration after which training stops, from 1; 0 if it does not.",
    inputs="losses: f8 (K,); patience: int; tolerance: float",
    outputs="iteration: i8 ()",
    equations=("10-31",),
    rules=("R-10.10-1",),
    oracle=converged_oracle,
)
