"""Gaussian Splat Pruning (GSP): when and which splats are removed (paper section 3.4)."""

from dataclasses import dataclass
from typing import Final, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_base.arrays import F4
from gsvc_base.checks import check_types, door
from gsvc_base.errors import UsageError

SETTLING: Final = 0.8
"""Maximum fraction of the iterations up to the last removal; the survivors settle in the others. Ours."""

LAST: Final = 10_000_000
"""Latest iteration that a schedule can name."""


@dataclass(frozen=True)
class PruningSchedule:
    """The iterations after which splats are removed; the paper only says how many are removed in all.

    Removals come after the iterations first, first + interval, ... and last. Each removes the same number, rounded
    down; the last also removes the remainder, so that the counts add up. Where the last would come later
    than after SETTLING of the iterations, all removals move forward in proportion.
    """

    fraction: float = 0.1  # of the splats at the start, removed in all, in [0, 1)
    # Iterations, counted from 1.
    first: int = 100
    last: int = 4000
    interval: int = 100

    def __post_init__(self) -> None:
        check_types(self)
        if not 0 <= self.fraction < 1:
            raise UsageError(f"the fraction to prune is {self.fraction}; it must be in [0, 1)")
        if not (1 <= self.first <= self.last <= LAST and self.interval >= 1):
            raise UsageError(f"{self}: it must have 1 <= first <= last <= {LAST} and interval >= 1")

    @classmethod
    def intra(cls) -> Self:
        """I-frames: 10 % of the splats, after every 100th iteration from 100 to 4000, as in the authors' code."""
        return cls()

    @classmethod
    def inter(cls) -> Self:
        """P-frames: 10 % of the splats, as many as GSA added to 90 % of N, after every 100th from 500 to 1000."""
        return cls(first=500, last=1000)

    @classmethod
    def late(cls) -> Self:
        """10 % of the splats in five steps from 64 % to 80 % of the iterations, however few; ours, for short fits."""
        return cls(first=LAST * 4 // 5, last=LAST, interval=LAST // 20)

    def counts(self, splats: int, iterations: int) -> dict[int, int]:
        """Iteration (from 1) -> number of splats to remove after it, as of `pruning_plan`; without zeros, in order.

        The numbers add up to fraction * splats rounded to the nearest, or to nothing without iterations.
        """
        plan = pruning_plan(splats, iterations, self.fraction, self.first, self.last, self.interval)
        return dict(zip(plan.iterations.tolist(), plan.counts.tolist(), strict=True))


class PruningPlan(NamedTuple):
    """The iterations after which splats are removed, and how many."""

    iterations: NDArray[np.int64]
    """(K,), counted from 1, rising."""
    counts: NDArray[np.int64]
    """(K,), at least 1 each."""


# twin of spec.pruning_plan
@door
def pruning_plan(splats: int, iterations: int, fraction: float, first: int, last: int, interval: int) -> PruningPlan:
    """The iterations after which splats are removed, and how many, by (10-25); R-10.7-1.

    Parameters
    ----------
    splats
        Number of splats at the start.
    iterations
        Number of iterations that training may take.
    fraction, first, last, interval
        As in `PruningSchedule`, which checks them.

    Returns
    -------
    PruningPlan
        Empty without iterations.
    """
    total = round(fraction * splats)
    times = [*range(first, last, interval), last] if iterations > 0 else []
    share = total // max(len(times), 1)
    scale = min(1.0, SETTLING * iterations / last)  # below 1 where `last` would come too late
    removed: dict[int, int] = {}
    for time in times:
        count = share if time != last else total - share * (len(times) - 1)
        iteration = max(1, int(time * scale))  # (10-25)
        if count:  # scaled iterations may coincide: their counts add up
            removed[iteration] = removed.get(iteration, 0) + count
    return PruningPlan(np.array(list(removed), np.int64), np.array(list(removed.values()), np.int64))


# twin of spec.prune
@door
def prune(weights: ArrayLike, removed: int) -> NDArray[np.int64]:
    """Indices of the splats that stay when those with the least |w| are removed (R-10.7-2).

    Parameters
    ----------
    weights
        (N,), w of each splat.
    removed
        How many go, 0..N; among splats of equal |w| the higher index goes.

    Returns
    -------
    NDArray[np.int64]
        (N - removed,) rising indices.

    Raises
    ------
    UsageError
        A weight is NaN, or there are not that many splats.
    """
    magnitude = np.abs(np.asarray(weights))
    if magnitude.ndim != 1 or not 0 <= removed <= len(magnitude):
        raise UsageError(f"cannot remove {removed} splats by weights of shape {magnitude.shape}; give 0..N and (N,)")
    if np.isnan(magnitude).any():
        raise UsageError("a weight is NaN; training has diverged, use lower learning rates")
    largest_first = np.argsort(-magnitude, kind="stable")  # stable: among equal |w| the lower index comes first
    return np.sort(largest_first[: len(magnitude) - removed])


class Compacted(NamedTuple):
    """The rows of the splats that stay: their values, and the optimiser's state."""

    values: F4
    m: F4
    v: F4
    n: F4
    previous: F4
    steps: NDArray[np.int64]


# twin of spec.compact
@door
def compact(
    survivors: NDArray[np.int64], values: F4, m: F4, v: F4, n: F4, previous: F4, steps: NDArray[np.int64]
) -> Compacted:
    """The rows of the survivors of a removal: their values and their state of the optimiser (R-10.7-3).

    Parameters
    ----------
    survivors
        (n,) indices of the splats that stay, as `prune` returns them.
    values
        (N, 9) f4, the splats in training.
    m, v, n, previous, steps
        (N, 9) f4 each and (N,) i8, the state of their rows, see `Adan`.

    Returns
    -------
    Compacted
        n rows each, in the order of `survivors`.
    """
    return Compacted(values[survivors], m[survivors], v[survivors], n[survivors], previous[survivors], steps[survivors])
