"""The fit of a frame's splats by Adan, in binary32 and before quantisation (paper sections 3.4 and 3.7)."""

from functools import partial

from gsvc_ref.rendering import Objective
from gsvc_ref.training.loop import OnIteration, minimise
from gsvc_ref.training.population import Population
from gsvc_ref.training.settings import FitSettings


def fit(
    population: Population, objective: Objective, settings: FitSettings, on_iteration: OnIteration | None = None
) -> tuple[float, int]:
    """Minimise the loss of one frame over a population, which is changed in place.

    Returns the loss (10-1) at the end and the number of iterations. GSP removes splats, if the settings have it.
    """
    counts = settings.pruning.counts(len(population), settings.iterations) if settings.pruning else {}
    removals = {done: partial(population.prune, count) for done, count in counts.items()}
    iterations = minimise(population, objective, settings, on_iteration, removals)
    return objective.loss(population.parameters()), iterations
