"""The number of splats: those that are worth least are removed, and as few as hold a quality kept (paper section 3.4).

Constant rate keeps N splats a frame. Constant quality removes splats while the frame stays above a PSNR, and adds some
where it does not.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4, F8
from gsvc_base.portable import power
from gsvc_base.splats import Splats
from gsvc_ref.rendering import Objective
from gsvc_ref.training import KEPT_WEIGHT, AnyFit, OnIteration, Population, fit, new_splats, psnr_of_loss
from gsvc_ref.training.coarse import Sizes

DB_PER_DOUBLING: Final = 3.4
"""PSNR gained by twice the splats, as measured on photographs, by which the sizes of changes are guessed."""

GRADIENT_PART: Final = 0.5
"""The part of its gradient's term by which a splat is judged before it is removed. On 30 frames of `carphone` and
`bikes` at N = 700 1/4 and 1/2 gave the same within 0.2 dB and 2 % of the bytes; 1 took 0.4 dB from `carphone`."""

TOLERANCE: Final = 0.3
"""Constant quality: no splats are removed for fewer dB above the goal: a fit takes long, and `coarser` does as well."""

SMALLEST_CHANGE, LARGEST_CHANGE = 0.02, 0.2
"""Constant quality: limits of the fraction of the splats that is added or removed at a time."""

CAUTION: Final = 0.7
"""Constant quality: the fraction of the superfluous splats that is removed at a time."""

MAX_CHANGES: Final = 12
"""Constant quality: maximum number of changes of the number of splats in a row."""


def visibility(parameters: F4) -> F4:
    """The squared error that removing each splat adds at a minimum of the loss, up to a constant factor, (N,) f4.

    Removing c' g from the picture adds -2 <e, c' g> + |c' g|^2; the first term is zero where dL/dc' is, and the second,
    summed over all pixels, is |c'|^2 pi l11 l22.
    """
    strength = np.square(parameters[:, 5:8]).sum(axis=1)
    area = np.maximum(parameters[:, 2], 0) * np.maximum(parameters[:, 4], 0)
    return np.asarray(strength * area, np.float32)


def most_visible(parameters: F4, count: int) -> NDArray[np.int64]:
    """The indices, ascending, of the `count` most visible splats; a tie goes to the lower index."""
    return np.sort(np.argsort(-visibility(parameters), kind="stable")[: max(0, count)])


def removal_errors(parameters: F4, gradient: F4, pixels: int) -> F8:
    """What the squared error is expected to rise by without each splat once the others are fitted, (N,) f8.

    Removing c' g from the picture changes the error by |c' g|^2 - c' . dE/dc'. The second term is large for a splat
    that stands where the picture no longer has what it showed. A fit makes up for a part of it, and splats that
    overlap share it, so that GRADIENT_PART of it counts.

    Parameters
    ----------
    parameters, gradient
        (N, 8) f4, the splats and the gradient of the loss by them.
    pixels
        The number of pixels, by which the loss is divided.
    """
    product = parameters[:, 5:8].astype(np.float64) * gradient[:, 5:8]
    return np.asarray(
        math.pi * visibility(parameters).astype(np.float64)
        - GRADIENT_PART * pixels * ((product[:, 0] + product[:, 1]) + product[:, 2])
    )


def make_room(population: Population, objective: Objective, new: int, total: int) -> int:
    """Remove splats that are not frozen until `new` fit into `total`; the number that then does.

    Those go without which the picture's error rises least, by `removal_errors`; of equal ones the later.
    """
    excess = new - (total - len(population))
    if excess > 0:
        parameters = population.parameters()
        _, gradient = objective.evaluate(parameters)
        added = removal_errors(parameters, gradient, objective.width * objective.height)
        moving = np.flatnonzero(~population.frozen)
        kept = moving[np.argsort(-added[moving], kind="stable")[: max(0, len(moving) - excess)]]
        population.take(np.sort(np.concatenate([np.flatnonzero(population.frozen), kept])))
        if population.frozen.any():
            new = min(new, max(0, total - len(population)))
    return new


def add_where_wrong(
    population: Population,
    objective: Objective,
    new: int,
    rng: np.random.Generator,
    where: NDArray[np.bool_],
    sizes: Sizes | None = None,
) -> None:
    """Add `new` splats where the picture is wrong and `where` (H, W) bool is set; with `sizes` along its edges."""
    objective.loss(population.parameters())
    total = len(population) + new
    if sizes is None:
        splats = new_splats(objective, new, total, rng, where)
    else:
        splats = Splats.from_array(sizes.of(1).new_splats(new, total, rng, where))
    population.append(splats, KEPT_WEIGHT)


def hold_quality(
    population: Population,
    objective: Objective,
    goal: float,
    most: int,
    settings: AnyFit,
    rng: np.random.Generator,
    on_iteration: OnIteration | None = None,
    *,
    may_prune: bool = True,
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
    on_iteration
        Called after each iteration of these fits.
    may_prune
        Whether splats may be removed.
    """
    done = 0
    loss = objective.loss(population.parameters())
    for _ in range(MAX_CHANGES):
        surplus = psnr_of_loss(loss) - psnr_of_loss(goal)
        growth = power(2.0, -surplus / DB_PER_DOUBLING)
        if (
            0 <= surplus < TOLERANCE
            or (surplus < 0 and len(population) >= most)
            or (surplus > 0 and (len(population) == 1 or not may_prune))
        ):
            break
        saved = population.copy()
        if surplus < 0:
            fraction = min(max(growth - 1, SMALLEST_CHANGE), LARGEST_CHANGE)
            new = min(max(1, round(len(population) * fraction)), most - len(population))
            population.append(new_splats(objective, new, len(population) + new, rng), KEPT_WEIGHT)
        else:
            fraction = min(max(CAUTION * (1 - growth), SMALLEST_CHANGE), LARGEST_CHANGE)
            fewer = len(population) - max(1, round(len(population) * fraction))
            population.take(most_visible(population.parameters(), fewer))
        loss, made = fit(population, objective, settings, rng, on_iteration=on_iteration)
        done += made
        if surplus > 0 and loss > goal:
            population.assign(saved)
            break
    return done
