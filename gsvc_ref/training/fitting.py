"""Splats are fitted to a picture, by Adan or L-BFGS, and become codes, by fine-tuning or rounding in stages."""

import numpy as np

from gsvc_ref.paper import FrameCodes, State
from gsvc_ref.rendering import Objective
from gsvc_ref.training.coarse import Sizes
from gsvc_ref.training.descending import descend
from gsvc_ref.training.events import Events
from gsvc_ref.training.fine_tuning import fine_tune
from gsvc_ref.training.frame_quantizer import FrameQuantizer
from gsvc_ref.training.loop import OnIteration, minimise
from gsvc_ref.training.population import Population
from gsvc_ref.training.settings import AnyFit, BlockSettings, DescentSettings, FitSettings, RoundingSettings
from gsvc_ref.training.staged_rounding import round_in_stages


def fit(
    population: Population,
    objective: Objective,
    settings: AnyFit,
    rng: np.random.Generator,
    *,
    total: int | None = None,
    sizes: Sizes | None = None,
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
        How to fit: by Adan (`loop`), or by L-BFGS (`descending`).
    rng
        Draws the splats that growth adds.
    total
        The number of splats that growth leads to; needed when `settings.growth` is set.
    sizes
        The picture at several sizes, of which `objective` is the full one. With them L-BFGS adds splats along edges
        and fits large ones coarse to fine.
    on_iteration
        Called after each iteration.

    Returns
    -------
    loss
        The loss (10-1) of the parameters at the end.
    iterations
        The number of iterations made.
    """
    if isinstance(settings, DescentSettings):
        return descend(population, objective, settings, rng, total or len(population), sizes, on_iteration)
    events = Events(population, objective, settings, total or len(population), rng)
    iterations = minimise(population, objective, settings, events, on_iteration)
    return objective.loss(population.parameters()), iterations


def quantised(
    population: Population,
    objective: Objective,
    intra: BlockSettings,
    inter: BlockSettings,
    before: State,
    rng: np.random.Generator,
    settings: FitSettings | RoundingSettings,
    on_iteration: OnIteration | None = None,
) -> tuple[FrameCodes, State, int]:
    """The codes of a fitted population, the decoder's state after them, and the number of iterations made.

    Parameters
    ----------
    population, objective, intra, inter, before, rng
        As in `FrameQuantizer`.
    settings
        How to quantise: by `fine_tune`, or by `round_in_stages`.
    on_iteration
        Called after each evaluation.
    """
    in_stages = isinstance(settings, RoundingSettings)
    quantizer = FrameQuantizer(population, objective, intra, inter, before, rng, in_stages=in_stages)
    if isinstance(settings, RoundingSettings):
        return round_in_stages(population.parameters(), quantizer, objective, settings, on_iteration)
    return fine_tune(population.parameters(), quantizer, objective, settings, on_iteration)
