"""Errors of pictures, spreads of runs that take turns, and which settings are Pareto-best."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

STEPS: Final = 255.0
"""Errors are in steps of 8 bits, not rounded to them."""

QUANTILE: Final = 0.99999
"""Fraction of the samples that is at most as far off as `Errors.quantile`."""

VISIT_S: Final = 0.03
"""Seconds, roughly, for which work is repeated within its turn."""

MIN_ROUNDS: Final = 3
"""Rounds that are made even if time is up, so that there is a spread."""

T = TypeVar("T")


@dataclass(frozen=True)
class Errors:
    """The distance of a picture from another over all samples, in steps of 8 bits."""

    # The largest absolute error, its quantile at QUANTILE, and the root of the mean square
    largest: float
    quantile: float
    rms: float
    psnr: float  # PSNR in dB for full scale; infinite for equal pictures

    @classmethod
    def between(cls, picture: NDArray[Any], reference: NDArray[Any]) -> Self:
        """The errors of a picture (H, W, 3), 1.0 = full scale, against a reference of the same shape."""
        error = np.abs(np.subtract(picture, reference, dtype=np.float64)) * STEPS
        rms = math.sqrt(float(np.mean(np.square(error))))
        psnr = 20 * math.log10(STEPS / rms) if rms > 0 else math.inf
        return cls(float(error.max()), float(np.quantile(error, QUANTILE)), rms, psnr)


@dataclass(frozen=True)
class Spread:
    """A number measured several times: the median, and the quartiles, between which half of the runs lie."""

    median: float
    low: float
    high: float
    runs: int

    @classmethod
    def of(cls, values: Sequence[float]) -> Self:
        """The spread of at least one value; infinite ones are allowed."""
        ordered = sorted(values)
        at = [ordered[round(q * (len(ordered) - 1))] for q in (0.25, 0.75)]
        middle = (ordered[(len(ordered) - 1) // 2], ordered[len(ordered) // 2])
        median = middle[0] if middle[0] == middle[1] else (middle[0] + middle[1]) / 2
        return cls(median, at[0], at[1], len(ordered))


def pareto(points: Sequence[tuple[float, float]]) -> list[bool]:
    """Whether each (error, cost) is Pareto-best: no other is at most as large in both and smaller in one."""
    return [not any(e <= error and c <= cost and (e < error or c < cost) for e, c in points) for error, cost in points]


def timed(work: Callable[[], T]) -> tuple[T, float]:
    """The return value of the work, and its seconds."""
    begin = time.perf_counter()
    result = work()
    return result, time.perf_counter() - begin


def visit(work: Callable[[], Any]) -> float:
    """The seconds of one turn: the median of as many runs as fit into VISIT_S after one, or that one if it is longer.

    The first run finds caches that belong to somebody else, so that it counts only where it takes long anyway.
    """
    first = timed(work)[1]
    if first >= VISIT_S:
        return first
    count = min(25, max(3, int(VISIT_S / max(first, 1e-6))))
    return Spread.of([timed(work)[1] for _ in range(count)]).median


def take_turns(
    turns: Sequence[Callable[[int], float]],  # each takes the number of the round and returns seconds
    rounds: int,  # the most rounds
    # The time of `time.perf_counter` after which no round is begun that would not end before it, but MIN_ROUNDS are
    # made at any rate
    until: float,
    on_turn: Callable[[int], None] = lambda turn: None,  # called after each turn with its number
) -> list[list[float]]:
    """Give every turn once a round, so that a drift of the machine hits all alike: forwards, then backwards.

    Returns the seconds of every turn, round by round.
    """
    seconds: list[list[float]] = [[] for _ in turns]
    for number in range(rounds):
        begin = time.perf_counter()
        order = range(len(turns)) if number % 2 == 0 else range(len(turns) - 1, -1, -1)
        for turn in order:
            seconds[turn].append(turns[turn](number))
            on_turn(turn)
        end = time.perf_counter()
        if number + 1 >= MIN_ROUNDS and end + (end - begin) > until:
            break
    return seconds
