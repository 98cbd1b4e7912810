"""The fit of a frame by L-BFGS: splats come along edges, large ones coarse to fine, until steps gain too little."""

from typing import Final

import numpy as np
from numpy.random import Generator

from gsvc_base.arrays import F8
from gsvc_base.portable import power
from gsvc_base.splats import Splats
from gsvc_ref.rendering import Objective
from gsvc_ref.training.augmentation import KEPT_WEIGHT
from gsvc_ref.training.coarse import Level, Sizes, step_for
from gsvc_ref.training.coordinates import to_coordinates, to_parameters
from gsvc_ref.training.events import new_splats, schedule
from gsvc_ref.training.loop import OnIteration
from gsvc_ref.training.population import NEW, Population
from gsvc_ref.training.settings import DescentSettings
from gsvc_ref.training.walk import FreeSplats, Walk, add_pull

PATIENCE: Final = 3
"""Evaluations that must gain too little together for a fit to be over."""

COARSE_PART: Final = 0.8
"""The part of the evaluations up to which a picture may be reduced: the others belong to the full size."""


def descend(
    population: Population,
    objective: Objective,
    settings: DescentSettings,
    rng: Generator,
    total: int,
    sizes: Sizes | None = None,
    on_iteration: OnIteration | None = None,
) -> tuple[float, int]:
    """`fit` by L-BFGS: the population is changed in place; the loss of its best point, and the evaluations made."""
    population.put(population.parameters())
    if settings.iterations == 0:
        return objective.loss(population.parameters()), 0
    work = _Descent(population, objective, settings, rng, total, sizes)
    done = 0
    for i in range(settings.iterations):
        loss = work.evaluate()
        done += 1
        if on_iteration:
            on_iteration(done, settings.iterations, loss)
        if work.is_over(i) and not work.has_refined():
            break
        work.step(i)
    return work.finish(), done


class _Descent:
    """The work of `descend`: the walk, the picture at its present size, and the splats that come and go."""

    def __init__(
        self,
        population: Population,
        objective: Objective,
        settings: DescentSettings,
        rng: Generator,
        total: int,
        sizes: Sizes | None,
    ) -> None:
        self._population, self._objective, self._settings, self._rng = population, objective, settings, rng
        self._sizes = sizes
        self._pixels = objective.width * objective.height
        self._events = schedule(settings, len(population), total)
        self._last_event = max(self._events, default=-1)
        self._enough = float(power(10.0, -PATIENCE * settings.least_gain / 10))
        self._least: list[float] = []  # the least error after each evaluation of the present splats
        self._is_refined = False
        self._level: Objective | Level = self._level_of(0)
        self._begin()
        self._walk = Walk(len(self._z))

    def _level_of(self, iteration: int) -> Objective | Level:
        """The picture at the size for the splats of now; P-frames, whose splats are made already, have the full one."""
        if self._sizes is None:
            return self._objective
        is_early = iteration < COARSE_PART * self._settings.iterations
        is_coarse = self._settings.growth is not None and is_early and not self._is_refined
        width, height = self._objective.width, self._objective.height
        return self._sizes.of(step_for(width, height, len(self._population)) if is_coarse else 1)

    def _begin(self) -> None:
        """Take the splats of the population at the present size."""
        population = self._population
        free = np.repeat(~population.frozen[:, None], 3, axis=1) if population.frozen.any() else None
        self._free = FreeSplats(self._level, population.parameters(), free, self._pixels)
        self._z = self._free.start()
        origins = population.origins[self._free.rows]
        self._start, self._pull = self._z.copy(), np.where(origins == NEW, 0.0, self._settings.pull)

    def evaluate(self) -> float:
        """The loss here; keeps the error and its gradient for the step."""
        loss, self._error, self._gradient = self._free.evaluate(self._z)
        if self._pull.any():
            self._error += add_pull(self._z, self._start, self._pull, self._gradient)
        self._least.append(min([self._error, *self._least[-1:]]))
        return loss

    def is_over(self, iteration: int) -> bool:
        """Whether the last evaluations gained too little for another one."""
        if iteration <= self._last_event or self._settings.least_gain == 0 or len(self._least) <= PATIENCE:
            return False
        return self._least[-1] > self._enough * self._least[-1 - PATIENCE]

    def has_refined(self) -> bool:
        """Go on at the full size from now on, unless that is the size already."""
        is_reduced = isinstance(self._level, Level) and self._level.step > 1
        self._is_refined |= is_reduced
        return is_reduced

    def step(self, iteration: int) -> None:
        """Add splats or change the size where it is time for that, go one step, and remove splats."""
        event = self._events.get(iteration)
        if event and event.add:
            self._grow(event.add)
        level = self._level_of(iteration + 1)
        if level is not self._level:
            self._change(level)
        self._z = self._walk.next(self._z, self._error, self._gradient)
        if event and event.remove:
            self._prune(event.remove)

    def _grow(self, count: int) -> None:
        """Add splats where the picture is worst, and evaluate it with them."""
        self._walk.append(self._z, self._error, self._gradient, count)
        total = len(self._population) + count
        if isinstance(self._level, Level):
            new = Splats.from_array(self._level.new_splats(count, total, self._rng))
        else:
            new = new_splats(self._objective, count, total, self._rng)
        self._keep(self._z)
        self._population.append(new, KEPT_WEIGHT)
        self._again(np.concatenate([self._z, to_coordinates(new.to_array())]))

    def _change(self, level: Objective | Level) -> None:
        """Go on at another size, where the function is another."""
        self._walk.append(self._z, self._error, self._gradient, 0)
        self._keep(self._z)
        self._level = level
        self._again(self._z)

    def _prune(self, count: int) -> None:
        """Remove the faintest splats, those of the least |n|; of equal ones the later."""
        self._keep(self._z)
        energy = (self._z[:, 5] * self._z[:, 5] + self._z[:, 6] * self._z[:, 6]) + self._z[:, 7] * self._z[:, 7]
        kept = np.sort(np.argsort(-energy, kind="stable")[: max(0, len(energy) - count)])
        self._walk.take(kept)
        start, z = self._start[kept], self._z[kept]
        every = np.concatenate([np.flatnonzero(self._population.frozen), self._free.rows[kept]])
        self._population.take(np.sort(every))
        self._begin()
        self._start, self._z = start, z

    def _again(self, z: F8) -> None:
        """Evaluate other splats, or the same ones at another size."""
        start = self._start
        self._begin()
        self._start[: len(start)], self._z = start, z
        self.evaluate()
        self._least = []

    def _keep(self, z: F8) -> None:
        """Put coordinates into the population."""
        parameters = self._population.parameters()
        parameters[self._free.rows] = to_parameters(z)
        self._population.put(parameters)

    def finish(self) -> float:
        """Put the last point into the population, or the best one where that is better; its loss."""
        self._keep(self._z)
        loss = self._objective.loss(self._population.parameters())
        error = loss * self._pixels * 255.0 * 255.0
        if self._pull.any():
            error += add_pull(self._z, self._start, self._pull, np.zeros_like(self._z))
        if self._walk.best is not None and self._walk.best[0] < error:
            self._keep(self._walk.best[1])
            loss = self._objective.loss(self._population.parameters())
        self._objective.thaw()
        return loss
