"""Timing contenders in turn, A B A B ..., so that whatever else the machine does meets all of them alike.

pytest-benchmark times one function after the other and compares what it has summed up; what is wanted here is a ratio
that holds although a machine's speed drifts. So every round times each contender once, a ratio is taken within each
round, and medians and quartiles are over the rounds.

The call that is timed comes after others of the same contender, for SETTLE seconds: the threads of the one before may
go on waiting for work at full speed, those of OpenMP for some milliseconds, and its data fill the caches. Without this
a frame beside a program with OpenMP took up to twice as long as alone.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Self

import numpy as np

SETTLE: Final = 0.02
"""A contender is called for so many seconds, at least once, before the call that is timed..."""

LONG: Final = 10 * SETTLE
"""...unless its last call took so many."""


@dataclass(frozen=True)
class Spread:
    """The median of some numbers and their quartiles."""

    median: float
    low: float
    high: float

    @classmethod
    def of(cls, numbers: Any) -> Self:
        """The spread of a row of numbers."""
        low, median, high = (float(q) for q in np.quantile(np.asarray(numbers), (0.25, 0.5, 0.75)))
        return cls(median, low, high)

    def text(self, digits: int = 2, factor: float = 1.0) -> str:
        """``3.1 (3.0-3.3)``, in a unit `factor` times as small."""
        numbers = (f"{factor * part:,.{digits}f}" for part in (self.median, self.low, self.high))
        median, low, high = numbers
        return f"{median} ({low}–{high})"


def interleaved(
    calls: Mapping[str, Callable[[], object]], *, seconds: float = 3.0, fewest: int = 5, most: int = 200
) -> dict[str, list[float]]:
    """Seconds of the timed calls of every contender, round by round; one round that is not counted comes first.

    Of several contenders each is called for SETTLE seconds before its call that is timed. One alone needs no such.

    `calls`: the contenders by name. `seconds`: about how long to go on. `fewest` and `most`: least and most rounds.
    """
    times: dict[str, list[float]] = {name: [] for name in calls}
    last = {name: _seconds(call) for name, call in calls.items()}
    end = time.perf_counter() + seconds
    rounds = 0
    while rounds < fewest or (rounds < most and time.perf_counter() < end):
        for name, call in calls.items():
            if len(calls) > 1 and last[name] <= LONG:
                _settle(call)
            last[name] = _seconds(call)
            times[name].append(last[name])
        rounds += 1
    return times


def _seconds(call: Callable[[], object]) -> float:
    """What one call takes."""
    begin = time.perf_counter()
    call()
    return time.perf_counter() - begin


def _settle(call: Callable[[], object]) -> None:
    """Call a contender for SETTLE seconds."""
    end = time.perf_counter() + SETTLE
    call()
    while time.perf_counter() < end:
        call()


def ratio(times: Mapping[str, list[float]], of: str, to: str) -> Spread:
    """The ratio of two contenders' seconds within each round."""
    return Spread.of(np.array(times[of]) / np.array(times[to]))
