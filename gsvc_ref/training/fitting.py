"""The fit of a frame's splats by Adan, in binary32 and before quantisation (paper sections 3.4 and 3.7)."""

from functools import partial

from gsvc_ref.rendering import Objective
from gsvc_ref.training.loop import OnIteration, minimise
from gsvc_ref.training.population import Population
from gsvc_ref.training.settings import FitSettings


def fit(
    population: Population, objective: Objective, settings: FitSettings, on_iteration: OnIteration | None = None
) -> tuple[float, int]:
    """Minimise the loss of one frame over the parameters of a population, which is changed in place.

    Parameters
    ----------
    population
        The splats to begin with; GSP removes some, if the settings have it.
    objective
        The frame's picture.
    settings
        How to fit.
    on_iteration
        Called after each iteration.

    Returns
    -------
    loss
        The loss (10-1) of the parameters at the end.
    iterations
        The number of iterations made.
    """
    counts = settings.pruning.counts(len(population), settings.iterations) if settings.pruning else {}
    removals = {done: partial(population.prune, count) for done, count in counts.items()}
    iterations = minimise(population, objective, settings, on_iteration, removals)
    return objective.loss(population.parameters()), iterations
