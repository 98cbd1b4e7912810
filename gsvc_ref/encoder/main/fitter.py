"""Float splats close to a picture, by L-BFGS: what I-frames of profile `main` and preset `quick` of `paper` begin with.

`fit` adds splats where the picture is worst, on a smaller picture as long as they are few. `descend` goes on with given
splats. Coordinates are those of `coordinates`, and a `Target` holds the picture.
"""

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.random import Generator

from gsvc_base.arrays import F8
from gsvc_ref._jit import kernel
from gsvc_ref.encoder.initialization import Growth
from gsvc_ref.encoder.main.coordinates import limited, log_kernel, to_parameters
from gsvc_ref.encoder.main.descent import Walk
from gsvc_ref.encoder.main.target import LayeredTarget, Target

GROWTH: Final = Growth(end=0.45)  # splats are added early, so that the last ones find their places too
FIT_D: Final = 16.0  # D of the metric while only the error counts: it bounds the steps of the faintest splats
MIN_SIZE: Final = 0.27  # smallest l11 and l22 in pixels: a smaller splat can lie between all pixel centers
MAX_SIZE: Final = 400.0  # largest l11 and l22 in pixels
MAX_SHEAR: Final = 12.0  # largest |l21 / l22|: what every density can hold

MIN_MARGIN: Final = 0.01
"""Smallest distance in pixels of a center from the edge of the frame, inside of which a cell must hold it."""

_NONE_BELOW: Final[F8] = np.zeros((0, 8))

Penalty = Callable[[F8, F8], float]
"""A term beside the error, of coordinates (N, 8); its gradient is added to another (N, 8)."""


def fit(target: Target | LayeredTarget, total: int, rng: Generator, evaluations: int, below: F8 = _NONE_BELOW) -> F8:
    """Coordinates (N, 8) of `total` splats close to a picture, without rounding and at any number of bits.

    `rng` draws their places. The evaluations are those of all splats, beside one for each addition. Splats (B, 8) of
    layers below stand in front of them, and move with them.
    """
    z = np.concatenate([below, target.start(GROWTH.start(total), rng)])
    plan = GROWTH.counts(total, evaluations)
    walk = Walk(len(z), FIT_D)
    for i in range(evaluations):
        if target.resize(len(z) if i <= max(plan, default=0) else None):
            walk.append(0)
        keep_inside(z, target.width, target.height)
        error, gradient = target.evaluate(to_parameters(z))
        new = plan.get(i, 0) + len(below) - len(z)
        if new > 0:
            walk.learn(z, error, gradient)
            walk.append(new)
            z = np.concatenate([z, target.new_splats(new, plan[i], rng)])
            error, gradient = target.evaluate(to_parameters(z))
        z = walk.next(z, error, gradient)
    target.resize()
    return z if walk.best is None else walk.best.z


def descend(target: Target | LayeredTarget, z: F8, walk: Walk, evaluations: int, penalty: Penalty | None = None) -> F8:
    """The best coordinates (N, 8) on a walk from z (N, 8); those that the target holds are not in z."""
    walk.best = None
    for _ in range(evaluations):
        keep_inside(z, target.width, target.height)
        error, gradient = target.evaluate(to_parameters(z))
        if penalty is not None:
            error += penalty(z, gradient)
        z = walk.next(z, error, gradient)
    return z if walk.best is None else walk.best.z


@kernel()
def keep_inside(z: F8, width: int, height: int) -> None:
    """Move coordinates, in place, to where an I-frame can have them: inside, neither too small nor too slanted."""
    low, high = log_kernel(MIN_SIZE), log_kernel(MAX_SIZE)
    for i in range(len(z)):
        z[i, 2], z[i, 3] = limited(z[i, 2], z[i, 3], low, high)
        z[i, 4] = min(max(z[i, 4], -MAX_SHEAR), MAX_SHEAR)
        z[i, 0] = min(max(z[i, 0], MIN_MARGIN), width - MIN_MARGIN)
        z[i, 1] = min(max(z[i, 1], MIN_MARGIN), height - MIN_MARGIN)
