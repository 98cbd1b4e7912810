"""The stages that choose: which splats go and come, which frames are key frames, after which iteration training stops.

All are exact. Their inputs are few numbers, and decisions are those of rational numbers or of stated operations.
"""

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any, cast

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from conformance.expectations import Exact, Expectation
from conformance.stage import Values, stage
from gsvc_ref.training.adan import Adan
from gsvc_ref.training.augmentation import NEW_WEIGHT, random_splats
from gsvc_ref.training.convergence import Convergence
from gsvc_ref.training.keyframes import select_key_frames as gsvc_key_frames
from gsvc_ref.training.pruning import PruningSchedule, select_survivors
from gsvc_ref.training.pruning import compact as gsvc_compact

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]
I8 = NDArray[np.int64]
Expected = Mapping[str, Expectation]


class GivenUniforms:
    """Stands in for a random generator: its uniform numbers are those given, in order."""

    def __init__(self, numbers: NDArray[np.floating]) -> None:
        self._numbers = np.ravel(numbers)
        self._taken = 0

    def random(self, size: int | tuple[int, ...], dtype: Any = None) -> NDArray[np.floating]:
        """As `Generator.random`; the type is that of the given numbers."""
        first, self._taken = self._taken, self._taken + int(np.prod(size))
        return self._numbers[first : self._taken].reshape(size)


def generator_of(*numbers: NDArray[np.floating]) -> Generator:
    """What draws the given numbers, for functions that take a generator."""
    return cast(Generator, GivenUniforms(np.concatenate([np.ravel(part) for part in numbers])))


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


@stage(
    "training",
    inputs="splats: int; iterations: int; fraction: float; first: int; last: int; interval: int",
    outputs="iterations: i8 (K,); counts: i8 (K,)",
    equations=("10-25",),
    rules=("R-10.7-1",),
    oracle=pruning_plan_oracle,
)
def pruning_plan(splats: int, iterations: int, fraction: float, first: int, last: int, interval: int) -> Values:
    """How many splats are removed after which iteration."""
    plan = PruningSchedule(fraction, first, last, interval).counts(splats, iterations)
    return {"iterations": np.array(list(plan), np.int64), "counts": np.array(list(plan.values()), np.int64)}


def prune_oracle(weights: F4, removed: int) -> Expected:
    """The order of removal is that of (|w|, -index)."""
    order = sorted(range(len(weights)), key=lambda n: (abs(float(weights[n])), -n))
    return {"survivors": Exact(np.array(sorted(order[removed:]), np.int64))}


@stage(
    "training",
    inputs="weights: f4 (N,); removed: int",
    outputs="survivors: i8 (n,)",
    rules=("R-10.7-2",),
    oracle=prune_oracle,
)
def prune(weights: F4, removed: int) -> Values:
    """The splats that stay when those of least weight are removed."""
    return {"survivors": select_survivors(weights, removed)}


def compact_oracle(survivors: I8, **rows: Any) -> Expected:
    """Row after row, in the order of the survivors."""
    return {name: Exact(np.array([array[row] for row in survivors], array.dtype).reshape(-1, *array.shape[1:]))
            for name, array in rows.items()}  # fmt: skip


@stage(
    "training",
    inputs="survivors: i8 (n,); values: f4 (N, 9); m: f4 (N, 9); v: f4 (N, 9); n: f4 (N, 9); previous: f4 (N, 9); "
    "steps: i8 (N,)",
    outputs="values: f4 (n, 9); m: f4 (n, 9); v: f4 (n, 9); n: f4 (n, 9); previous: f4 (n, 9); steps: i8 (n,)",
    rules=("R-10.7-3",),
    oracle=compact_oracle,
)
def compact(survivors: I8, values: F4, m: F4, v: F4, n: F4, previous: F4, steps: I8) -> Values:
    """What is left of the splats in training, and of the optimiser's state, after a removal."""
    state = Adan(*values.shape)
    state.m, state.v, state.n, state.previous, state.steps = m, v, n, previous, steps
    left, state = gsvc_compact(values, state, survivors)
    return {
        "values": left,
        "m": state.m,
        "v": state.v,
        "n": state.n,
        "previous": state.previous,
        "steps": state.steps,
    }


def augment_oracle(values: F4, uniforms: F4, width: int, height: int) -> Expected:
    """One product or sum each: exact in binary64, rounded once."""
    scale = np.array([width, height, 1, 1, 1, 1, 1, 1], np.float64)
    added = np.array([0, 0, 0.5, 0, 0.5, 0, 0, 0])
    new = (uniforms * scale + added).astype(np.float32)
    weights = np.full((len(uniforms), 1), 0.01, np.float32)
    return {"values": Exact(np.concatenate([values, np.concatenate([new, weights], axis=1)]))}


@stage(
    "training",
    inputs="values: f4 (N, 9); uniforms: f4 (n, 8); width: int; height: int",
    outputs="values: f4 (M, 9)",
    equations=("10-26", "10-27"),
    rules=("R-10.8-1",),
    oracle=augment_oracle,
)
def augment(values: F4, uniforms: F4, width: int, height: int) -> Values:
    """New splats of small weight after the old ones, from uniform numbers."""
    count = len(uniforms)
    drawn = generator_of(uniforms[:, :2], uniforms[:, 2:5], uniforms[:, 5:])
    new = random_splats(count, width, height, drawn).to_array()
    weights = np.full((count, 1), NEW_WEIGHT, np.float32)
    return {"values": np.concatenate([values, np.concatenate([new, weights], axis=1)])}


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


@stage(
    "training",
    inputs="losses_i: f8 (T,); losses_p: f8 (T-1,); window: int; threshold: float; guard_ratio: float; robust: int",
    outputs="key_frames: i8 (K,)",
    equations=("10-28", "10-29", "10-30"),
    rules=("R-10.9-1",),
    oracle=key_frames_oracle,
)
def select_key_frames(
    losses_i: F8, losses_p: F8, window: int, threshold: float, guard_ratio: float, robust: int
) -> Values:
    """The key frames of a sequence, from the losses of every frame."""
    numbers = gsvc_key_frames(
        losses_i.tolist(),
        losses_p.tolist(),
        window=window,
        threshold=threshold,
        guard_ratio=guard_ratio,
        rule="robust" if robust else "paper",
    )
    return {"key_frames": np.array(numbers, np.int64)}


def converged_oracle(losses: F8, patience: int, tolerance: float) -> Expected:
    """The first iteration that ends so many calm changes in a row."""
    calm = abs(np.diff(losses)) <= tolerance  # change j is that of iteration j + 2
    ends = [j + 2 for j in range(patience - 1, len(calm)) if calm[j - patience + 1 : j + 1].all()]
    return {"iteration": Exact(np.array(ends[0] if ends else 0, np.int64))}


@stage(
    "training",
    inputs="losses: f8 (K,); patience: int; tolerance: float",
    outputs="iteration: i8 ()",
    equations=("10-31",),
    rules=("R-10.10-1",),
    oracle=converged_oracle,
)
def converged(losses: F8, patience: int, tolerance: float) -> Values:
    """The iteration after which training stops, from 1; 0 if it does not."""
    test = Convergence(patience, tolerance).start()
    stops = (number for number, loss in enumerate(losses.tolist(), 1) if test.update(loss))
    return {"iteration": np.array(next(stops, 0), np.int64)}
