"""Learning-rate schedules: the factor on the learning rates at each iteration, counted from 0."""

import math
from dataclasses import dataclass
from typing import Final, Protocol

from gsvc_base.checks import check_types
from gsvc_base.errors import UsageError
from gsvc_base.portable import cos, whole_power


class Schedule(Protocol):
    """Anything that gives the factor of an iteration."""

    def __call__(self, iteration: int) -> float:
        """The factor on the learning rates of this iteration, counted from 0."""
        ...


@dataclass(frozen=True)
class Constant:
    """The same rates from first to last."""

    def __call__(self, iteration: int) -> float:
        """Always 1."""
        return 1.0


@dataclass(frozen=True)
class StepDecay:
    """Rates multiplied by `factor` after every `interval` iterations; the paper's defaults (section 4.1); R-10.4-1."""

    factor: float = 0.5
    interval: int = 20_000

    def __post_init__(self) -> None:
        check_types(self)
        if not 0 < self.factor <= 1 or self.interval < 1:
            raise UsageError(f"{self}: the factor must be in (0, 1] and the interval at least 1")

    def __call__(self, iteration: int) -> float:
        """Factor ** (iteration // interval)."""
        return whole_power(self.factor, iteration // self.interval)  # (10-12)


@dataclass(frozen=True)
class Cosine:
    """Rates that fall from 1 to `final` along half a cosine within `steps` iterations, and stay there."""

    steps: int
    final: float = 0.02

    def __post_init__(self) -> None:
        check_types(self)
        if self.steps < 1 or not 0 <= self.final <= 1:
            raise UsageError(f"{self}: steps must be at least 1 and final in [0, 1]")

    def __call__(self, iteration: int) -> float:
        """Final + (1 - final) (1 + cos(pi iteration / steps)) / 2."""
        progress = min(iteration / self.steps, 1.0)
        return self.final + (1 - self.final) * (1 + float(cos(math.pi * progress))) / 2


PAPER_SCHEDULE: Final = StepDecay()
"""Halved every 20,000 iterations; the paper's rate at the start is 1e-3."""
