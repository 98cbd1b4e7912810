"""Choosing the number of splats: which are worth least, and how many hold a quality (paper section 3.4).

Constant rate keeps N splats a frame. Constant quality removes splats while the frame stays above a PSNR, and adds some
where it does not.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_ref.render import Objective
from gsvc_ref.splats import F4
from gsvc_ref.training.fit import FitSettings, Population, fit, new_splats

ADDED_FRACTION: Final = 0.15
"""Constant quality: splats added at a time, of those that there are."""

REMOVED_FRACTIONS: Final = (0.2, 0.1, 0.05)
"""Constant quality: splats removed at a time; the next fraction is tried when the one before was too many."""


def psnr_of_loss(loss: float) -> float:
    """PSNR in dB of a loss (paper, the L2 equation), which is three times the mean squared error; infinite for 0."""
    return 10 * math.log10(3 / loss) if loss > 0 else math.inf


def quality_goal(psnr: float | None) -> float | None:
    """The loss of a PSNR in dB; None for none."""
    return None if psnr is None else 3 * 10 ** (-psnr / 10)


def visibility(parameters: F4) -> F4:
    """What removing each splat adds to the sum of squared errors at a minimum of the loss, up to a constant, (N,) f4.

    Removing c' g from the picture adds -2 <e, c' g> + |c' g|^2; the first term is zero where dL/dc' is, and the second,
    summed over all pixels, is |c'|^2 pi l11 l22.
    """
    strength = np.square(parameters[:, 5:8]).sum(axis=1)
    area = np.maximum(parameters[:, 2], 0) * np.maximum(parameters[:, 4], 0)
    return np.asarray(strength * area, np.float32)


def most_visible(parameters: F4, count: int) -> NDArray[np.int64]:
    """The indices, ascending, of the `count` most visible splats; a tie goes to the lower index."""
    return np.sort(np.argsort(-visibility(parameters), kind="stable")[: max(0, count)])


def exchange_splats(
    population: Population, objective: Objective, new: int, total: int, rng: np.random.Generator
) -> None:
    """Replace the least visible splats by `new` ones where the prediction is wrong, with at most `total` in all."""
    room = total - len(population)
    if new > room:
        population.take(most_visible(population.parameters(), total - new))
    if new > 0:
        objective.loss(population.parameters())
        population.append(new_splats(objective, new, len(population) + new, rng), 1.0)


def hold_quality(
    population: Population,
    objective: Objective,
    goal: float,
    most: int,
    settings: FitSettings,
    rng: np.random.Generator,
) -> int:
    """Add splats until the loss is at most `goal`, or remove some while it stays there; returns the iterations made.

    Parameters
    ----------
    population
        Changed in place.
    goal
        The largest loss allowed.
    most
        The largest number of splats allowed.
    settings
        The short fit after each change.
    """
    done = 0
    loss = objective.loss(population.parameters())
    if loss > goal:
        while loss > goal and len(population) < most:
            new = min(max(1, round(len(population) * ADDED_FRACTION)), most - len(population))
            objective.loss(population.parameters())
            population.append(new_splats(objective, new, len(population) + new, rng), 1.0)
            loss, made = fit(population, objective, settings, rng)
            done += made
        return done
    for fraction in REMOVED_FRACTIONS:
        while len(population) > 1:
            saved = population.copy()
            population.take(most_visible(population.parameters(), max(1, int(len(population) * (1 - fraction)))))
            loss, made = fit(population, objective, settings, rng)
            done += made
            if loss > goal:
                population.assign(saved)
                break
    return done
