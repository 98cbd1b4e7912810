"""Gaussian Splat Pruning (GSP): when and which splats are removed (paper section 3.4)."""

from dataclasses import dataclass
from typing import Final, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_ref.checks import check_types
from gsvc_ref.errors import UsageError
from gsvc_ref.splats import F4
from gsvc_ref.training.adan import Adan

SETTLING: Final = 0.8
"""Part of the iterations up to the last removal, at most; the survivors settle in the others. Ours."""

LAST: Final = 10_000_000
"""Latest iteration that can be named."""


@dataclass(frozen=True)
class PruningSchedule:
    """How many splats are removed after which iteration; the paper only says how many in all.

    Removals come after the iterations first, first + interval, ... and last. Each removes the same number, rounded
    down; the last also removes the remainder, so that the counts add up. Where the last would come later
    than after SETTLING of the iterations, all removals move forward in proportion.

    Attributes
    ----------
    fraction
        Of the splats at the start, how many are removed in all; in [0, 1).
    first, last, interval
        Iterations, counted from 1.

    Raises
    ------
    UsageError
        A number is out of its range, or last comes before first.
    """

    fraction: float = 0.1
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
        """How many splats to remove after which iteration (R-10.7-1).

        Parameters
        ----------
        splats
            Number of splats at the start.
        iterations
            Number of iterations that training may take.

        Returns
        -------
        dict[int, int]
            Iteration, counted from 1 and at most `iterations`, to the number of splats; without zeros, in order. The
            numbers add up to fraction * splats rounded to the nearest, or to nothing without iterations.
        """
        total = round(self.fraction * splats)
        if iterations < 1:
            return {}
        times = [*range(self.first, self.last, self.interval), self.last]
        share = total // len(times)
        removed: dict[int, int] = {}
        for time in times:
            count = share if time != self.last else total - share * (len(times) - 1)
            scale = min(1.0, SETTLING * iterations / self.last)
            iteration = max(1, int(time * scale))  # (10-25)
            if count:
                removed[iteration] = removed.get(iteration, 0) + count
        return removed


def select_survivors(w: ArrayLike, removed: int) -> NDArray[np.int64]:
    """Indices of the splats that stay when those with the least |w| are removed (R-10.7-2).

    Parameters
    ----------
    w
        (N,) weights of the splats.
    removed
        How many go, 0..N. Of equal |w|, the higher index goes.

    Returns
    -------
    NDArray[np.int64]
        (N - removed,) rising indices.

    Raises
    ------
    UsageError
        A weight is NaN, or there are not that many splats.
    """
    magnitude = np.abs(np.asarray(w))
    if magnitude.ndim != 1 or not 0 <= removed <= len(magnitude):
        raise UsageError(f"cannot remove {removed} splats by weights of shape {magnitude.shape}; give 0..N and (N,)")
    if np.isnan(magnitude).any():
        raise UsageError("a weight is NaN; training has diverged, use lower learning rates")
    largest_first = np.argsort(-magnitude, kind="stable")
    return np.sort(largest_first[: len(magnitude) - removed])


def compact(values: F4, state: Adan, survivors: NDArray[np.int64]) -> tuple[F4, Adan]:
    """What is left after a removal: every survivor keeps its values and all that Adan knows of it (R-10.7-3).

    Parameters
    ----------
    values
        (N, 9) f4, the splats in training.
    state
        That of their N rows.
    survivors
        (n,) indices of those that stay, as `select_survivors` returns them.

    Returns
    -------
    The values (n, 9) f4 and the state of n rows, both in the order of `survivors`.
    """
    return values[survivors], state.take(survivors)


def fold_weights(colors: ArrayLike, w: ArrayLike) -> F4:
    """The products w c': what is rendered, and what the next frame starts from (paper section 3.4).

    Parameters
    ----------
    colors
        (N, 3) f4, c'.
    w
        (N,) f4.

    Returns
    -------
    F4
        (N, 3).
    """
    return np.asarray(colors, np.float32) * np.asarray(w, np.float32)[:, None]
