"""What changes of splats do to the picture, to second order and for each splat alone, and the steps that follow."""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4, F8
from gsvc_ref.training.settings import BlockSettings

Active = NDArray[np.bool_]
"""(n, 3) bool: whether position, Cholesky factor and colour of a splat may differ from the reference."""

FIXED_STEPS: Final = (1 / 64, 1.0)
"""The finest and the coarsest fixed step, in pixels."""


def effects(values: F4, reference: F4) -> F4:
    """What changes from `reference` to `values` do to the picture, (n, 3) f4: by position, Cholesky factor, colour.

    That is a sum of squared differences over all pixels, to second order and for one splat alone: with A = pi l11 l22
    (the sum of g^2), the change (du, dv) = L^-1 dmu and the relative changes p = dl11/l11, q = dl22/l22,
    s = (dl21 - l21 p)/l22, it is |c'|^2 A (du^2 + dv^2) / 2 for the position;
    |c'|^2 A (3 p^2 + 3 q^2 + 2 p q + s^2) / 4 for the Cholesky factor; |dc'|^2 A for the colour.
    """
    difference = values - reference
    l11, l21, l22 = values[:, 2], values[:, 3], values[:, 4]
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):  # of needles, whose effects are not finite
        area = math.pi * l11 * l22
        seen = np.square(values[:, 5:8]).sum(axis=1) * area
        du = difference[:, 0] / l11
        dv = (difference[:, 1] - l21 * du) / l22
        p, q = difference[:, 2] / l11, difference[:, 4] / l22
        s = (difference[:, 3] - l21 * p) / l22
        shape = (3 * p * p + 3 * q * q + 2 * p * q + s * s) / 4
        color = np.square(difference[:, 5:8]).sum(axis=1) * area
        return np.stack([seen * (du * du + dv * dv) / 2, seen * shape, color], axis=1)


def shape_error(values: F4, reference: F4) -> float:
    """What other Cholesky factors do to the picture, over all splats."""
    return math.fsum(effects(values, reference)[:, 1])


def shape_weights(values: F4) -> F8:
    """What the square of an error of each Cholesky factor counts in `effects`, over pi / 4, (n, 3) f8."""
    l11, l21, l22 = values[:, 2:5].astype(np.float64).T
    seen = np.square(values[:, 5:8].astype(np.float64)).sum(axis=1) * (l11 * l22)
    slant = (l21 / l22) * (l21 / l22)
    weights = seen[:, None] * np.stack([(3 + slant) / (l11 * l11), 1 / (l22 * l22), 3 / (l22 * l22)], axis=1)
    return np.asarray(weights, np.float64)


def steps_for(values: F4, active: Active | None, error: float, settings: BlockSettings) -> BlockSettings:
    """The settings with the fixed ones of their steps such that positions and factors add about `error` each.

    An attribute that is rounded to a step h is off by h^2 / 12 on average, in squares. In `effects`, with
    t = (1 + (l21 / l11)^2) / l22^2, that makes h^2 / 12 times |c'|^2 A (1 / l11^2 + t) / 2 for the position, and
    |c'|^2 A (3 / l11^2 + 3 / l22^2 + t) / 4 for the factors. Steps are powers of two, so that they last for long.
    """
    l11, l21, l22 = values[:, 2:5].astype(np.float64).T
    seen = np.square(values[:, 5:8].astype(np.float64)).sum(axis=1) * (math.pi * l11 * l22)
    wide, high = 1 / (l11 * l11), 1 / (l22 * l22)
    t = high * (1 + l21 * l21 * wide)
    costs = np.stack([seen * (wide + t) / 2, seen * (3 * wide + 3 * high + t) / 4], axis=1)  # (n, 2) f8
    if active is not None:
        costs = np.where(active[:, :2], costs, 0)
    steps = [_step(error, math.fsum(column)) for column in costs.T]
    fixed = settings.position_step is not None, settings.cholesky_step is not None
    position_step, cholesky_step = (step if has else None for step, has in zip(steps, fixed, strict=True))
    return settings.with_(position_step=position_step, cholesky_step=cholesky_step)


def _step(error: float, cost: float) -> float:
    """The largest power of two h within FIXED_STEPS with cost h^2 / 12 <= error."""
    least, most = FIXED_STEPS
    if not cost > 0:
        return most
    if not error > 0:
        return least
    return min(max(math.ldexp(0.5, math.frexp(math.sqrt(12 * error / cost))[1]), least), most)
