"""The change of a score by a way of fitting: the mean over pairs that differ in nothing else, and its error."""

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Change:
    """A mean difference."""

    mean: float  # mean over the pairs
    # Its standard error, the pairs taken as independent; None of one pair, which tells nothing about chance
    error: float | None
    pairs: int  # number of pairs

    @classmethod
    def of(cls, before: Sequence[float], after: Sequence[float]) -> "Change":
        """The change from one to the other of each pair."""
        differences = [b - a for a, b in zip(before, after, strict=True)]
        count = len(differences)
        error = statistics.stdev(differences) / math.sqrt(count) if count > 1 else None
        return cls(statistics.fmean(differences), error, count)

    @property
    def raises(self) -> bool:
        """Whether it is above 0 by more than twice its standard error."""
        return self.error is not None and self.mean > max(0.0, 2 * self.error)

    @property
    def lowers(self) -> bool:
        """Whether it is below 0 by more than twice its standard error."""
        return self.error is not None and self.mean < min(0.0, -2 * self.error)

    def text(self, digits: int, unit: str = "") -> str:
        """Such as ``+0.12 ± 0.03 dB``."""
        error = "" if self.error is None else f" ± {self.error:.{digits}f}"
        return f"{self.mean:+.{digits}f}{error}{unit}"
