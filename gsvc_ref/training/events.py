"""The splats that come and go during a fit: growth adds them where the residual is, GSP removes the faintest."""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from gsvc_base.splats import Splats
from gsvc_ref.rendering import Objective
from gsvc_ref.training.augmentation import KEPT_WEIGHT, residual_splats
from gsvc_ref.training.population import Population
from gsvc_ref.training.pruning import prune
from gsvc_ref.training.settings import AnyFit, FitSettings

NEW_SIZE: Final = 0.165
"""Deviation of a splat that is added where the residual is, in units of the mean distance between splats; measured."""


class Event(NamedTuple):
    """The numbers of splats that one iteration adds before its step and removes after it."""

    add: int = 0
    remove: int = 0


def schedule(settings: AnyFit, count: int, total: int) -> dict[int, Event]:
    """The event of each iteration, from 0, at which `count` splats grow towards `total` or are pruned."""
    events: dict[int, Event] = {}
    if settings.growth:
        for iteration, grown in settings.growth.counts(total, settings.iterations).items():
            events[iteration] = Event(add=max(0, grown - count))
            count = max(count, grown)
    if settings.pruning:
        for done, removed in settings.pruning.counts(count, settings.iterations).items():
            events[done - 1] = events.get(done - 1, Event())._replace(remove=removed)
    return events


class Events:
    """Adds splats to a population and removes them by its `schedule`; `last` is the last iteration with an event."""

    def __init__(
        self, population: Population, objective: Objective, settings: FitSettings, total: int, rng: Generator
    ) -> None:
        self._population, self._objective, self._rng = population, objective, rng
        self._schedule = schedule(settings, len(population), total)
        self.last = max(self._schedule, default=-1)

    def add(self, iteration: int) -> bool:
        """Add the splats that come before the step of an iteration, once it is evaluated; whether there are any."""
        count, population = self._schedule.get(iteration, Event()).add, self._population
        if count:
            population.append(new_splats(self._objective, count, len(population) + count, self._rng), KEPT_WEIGHT)
        return count > 0

    def remove(self, iteration: int) -> bool:
        """Remove the splats that go after the step of an iteration; whether there are any."""
        count, population = self._schedule.get(iteration, Event()).remove, self._population
        if count:
            population.take(prune(population.weights, count))
        return count > 0


def new_splats(
    objective: Objective, count: int, total: int, rng: Generator, where: NDArray[np.bool_] | None = None
) -> Splats:
    """Splats where the last evaluated picture differs most from the target, sized for `total` splats in all.

    `where` is (H, W) bool, the pixels to look at; None: all.
    """
    size = NEW_SIZE * math.sqrt(objective.width * objective.height / total)
    missing = -objective.residual()
    return residual_splats(missing if where is None else missing * where[..., None], count, size, rng)
