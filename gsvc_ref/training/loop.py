"""The loop of all training: evaluate, step, prune, test for convergence.

`fit` runs it over the nine values of each splat, `fine_tune` over the eight that are quantised and coded.
"""

from collections.abc import Callable, Mapping
from typing import ClassVar, Final, Protocol

import numpy as np

from gsvc_base.arrays import F4
from gsvc_base.splats import PARAMETERS_PER_SPLAT
from gsvc_ref.rendering import Objective
from gsvc_ref.training.adan import Adan
from gsvc_ref.training.settings import FitSettings

MIN_FACTOR: Final = np.float32(0.25)
"""Smallest l11 and l22 in pixels: a smaller splat can lie between all pixel centres and then gets no gradient."""

STEP_SIZES: Final = (0.3, 4.0)
"""Limits in pixels of the step factor of a splat, half its mean radius sqrt(l11 l22), where steps are relative."""

GEOMETRY: Final = np.arange(PARAMETERS_PER_SPLAT + 1) < 5
"""The columns that steps relative to a splat's size apply to: position and Cholesky factor, (9,) bool."""

OnIteration = Callable[[int, int, float], None]
"""Called after each iteration with the steps so far, their maximum number, and the loss that the iteration found."""


class Model(Protocol):
    """Splats in training, as the loop sees them."""

    values: F4  # (N, P) f4, changed in place: the first P columns of `Population.values`, P = 8 or 9
    optimizer: Adan
    # The result is the best of all values evaluated: training ends with an evaluation; otherwise it ends with a step.
    keeps_best: ClassVar[bool]

    def evaluate(self, objective: Objective) -> tuple[float, F4]:
        """The loss, and its gradient by `values`, (N, P) f4."""
        ...

    def learn(self, factor: float) -> None:
        """One step of what is learned besides `values`, from the last evaluation; `factor` is that on the rates."""


def minimise(
    model: Model,
    objective: Objective,
    settings: FitSettings,
    on_iteration: OnIteration | None = None,
    removals: Mapping[int, Callable[[], None]] | None = None,
) -> int:
    """Minimise the loss of a picture over the values of a model, in place; the number of steps made.

    `removals` are called after the steps of their numbers, from 1: splats that GSP removes. Training does not stop
    early before the last of them.
    """
    columns = model.values.shape[1]
    unit = learned_unit(settings.learn_pixels, objective.width, objective.height)[:columns]
    rates = learned_rates(settings)[:columns]
    convergence = settings.convergence.start() if settings.convergence else None
    iterations = settings.iterations + 1 if model.keeps_best else settings.iterations
    removals = removals or {}
    last_removal = max(removals, default=0)
    steps = 0
    for i in range(iterations):
        loss, gradient = model.evaluate(objective)
        stop = i + 1 == iterations or bool(convergence and convergence.update(loss) and i + 1 >= last_removal)
        if not (stop and model.keeps_best):
            factor = settings.schedule(i)
            model.learn(factor)
            model.optimizer.step(
                model.values, gradient, rates * factor, units=unit, row_columns=GEOMETRY[:columns],
                row_factors=step_factors(model.values) if settings.relative_steps else None,
            )  # fmt: skip
            keep_factors(model.values)
            steps += 1
        if i + 1 in removals:
            removals[i + 1]()
        if on_iteration:
            on_iteration(steps, settings.iterations, loss)
        if stop:
            break
    return steps


def learned_unit(learn_pixels: bool, width: int, height: int) -> F4:
    """Pixels per learned unit of each column, (9,) f4."""
    unit = np.ones(PARAMETERS_PER_SPLAT + 1, np.float32)
    if not learn_pixels:
        unit[0], unit[1] = width / 2, height / 2
    return unit


def learned_rates(settings: FitSettings) -> F4:
    """The learning rate of each column, (9,) f4: weights are learned only if splats are pruned by them."""
    rates = settings.rates.columns()
    if not settings.pruning:
        rates[-1] = 0
    return rates


def step_factors(values: F4) -> F4:
    """The factor of each splat's position and Cholesky steps: half its mean radius within STEP_SIZES, (N,) f4."""
    radius = np.sqrt(np.maximum(values[:, 2] * values[:, 4], 0))
    return np.asarray(np.clip(radius / 2, *STEP_SIZES), np.float32)


def keep_factors(values: F4) -> None:
    """Put l11 and l22 back to at least MIN_FACTOR, in place."""
    np.maximum(values[:, 2], MIN_FACTOR, out=values[:, 2])
    np.maximum(values[:, 4], MIN_FACTOR, out=values[:, 4])
