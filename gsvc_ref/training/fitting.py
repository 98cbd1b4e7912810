"""Fitting the splats of one frame to its picture, before anything is quantised."""

import numpy as np

from gsvc_ref.rendering import Objective
from gsvc_ref.training.events import Events
from gsvc_ref.training.loop import OnIteration, minimise
from gsvc_ref.training.population import Population
from gsvc_ref.training.settings import FitSettings


def fit(
    population: Population,
    objective: Objective,
    settings: FitSettings,
    rng: np.random.Generator,
    *,
    total: int | None = None,
    on_iteration: OnIteration | None = None,
) -> tuple[float, int]:
    """Minimise the loss of one frame over the parameters of a population, which is changed in place.

    Parameters
    ----------
    population
        The splats to begin with.
    objective
        The frame's picture.
    settings
        How to fit.
    rng
        Draws the splats that growth adds.
    total
        The number of splats that growth leads to; needed when `settings.growth` is set.
    on_iteration
        Called after each iteration.

    Returns
    -------
    loss
        The loss (10-1) of the parameters at the end.
    iterations
        The number of iterations made.
    """
    events = Events(population, objective, settings, total or len(population), rng)
    iterations = minimise(population, objective, settings, events, on_iteration)
    return objective.loss(population.parameters()), iterations
