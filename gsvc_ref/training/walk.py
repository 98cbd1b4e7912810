"""L-BFGS from one point of a picture's splats to the next.

`Walk` holds the optimiser (`descent`), the best point so far and the way back to it; `pull_plain` is the pull towards a
reference.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F8
from gsvc_base.portable import exp
from gsvc_ref._jit import kernel
from gsvc_ref.training.coordinates import (
    HALF,
    ROOT,
    exp_kernel,
    log_kernel,
    moved,
)
from gsvc_ref.training.descent import LBFGS
from gsvc_ref.training.loop import MIN_FACTOR

FAINTEST: Final = 16.0
"""D of the metric, in units of 8 bits: splats with less energy than 1.5 D move as those that have it."""

RISE: Final = 1.01
"""The walk goes back to its best point where the error is this many times as large."""

MOST_SHEAR: Final = 16.0
"""Largest |l21 / l22|, so that no needle spreads the steps of a quantiser over its own length."""

SOON: Final = 5
"""A walk that goes back again after fewer evaluations begins with a quarter of the step after the last time."""

AT_BOUND: Final = 1e-9
"""What is nearer to a bound than this stands at it."""


class Walk:
    """L-BFGS that goes back to its best point where the error has risen.

    Attributes
    ----------
    best
        The least error so far, with the coordinates and the gradient there.
    """

    def __init__(self, count: int) -> None:
        self._descent = LBFGS(count, FAINTEST)
        self._since, self._length = SOON, 1.0  # evaluations since the last return, and the length of the step after it
        self.best: tuple[float, F8, F8] | None = None

    def next(self, z: F8, error: float, gradient: F8) -> F8:
        """The coordinates (n, 8) to evaluate after z (n, 8), given the error there and its gradient (n, 8)."""
        if self.best is None or error < self.best[0]:
            self.best = error, z, gradient
        elif error > RISE * self.best[0]:
            error, z, gradient = self.best
            self._length = self._length / 4 if self._since < SOON else 1.0
            self._since = 0
            self._descent.restart(self._length)
        self._since += 1
        hold_at_bounds(z, gradient)
        step = self._descent.step(z, error, gradient)
        following = moved(z, step)
        keep_shapes(z, following, step)
        return following

    def append(self, z: F8, error: float, gradient: F8, new: int) -> None:
        """Learn from z, then let `new` splats follow, 0 where another function is evaluated from now on."""
        self._descent.step(z, error, gradient)
        self._descent.append(new)
        self.best = None

    def take(self, indices: NDArray[np.int64]) -> None:
        """Go on with the splats of these indices alone."""
        self._descent.take(indices)
        self.best = None


def pull_plain(z: F8, start: F8, weights: F8) -> tuple[float, F8]:
    """The definition of `add_pull`: the pull, and its gradient (n, 8)."""
    energy = weights * ((start[:, 5] * start[:, 5] + start[:, 6] * start[:, 6]) + start[:, 7] * start[:, 7])
    l11, l22 = exp((z[:, 2] + z[:, 3]) * HALF), exp((z[:, 2] - z[:, 3]) * HALF)
    o11, o22 = exp((start[:, 2] + start[:, 3]) * HALF), exp((start[:, 2] - start[:, 3]) * HALF)
    u = (z[:, 0] - start[:, 0]) / o11
    v = (z[:, 1] - start[:, 1]) / o22 - start[:, 4] * u
    m, r = z[:, 2] - start[:, 2], z[:, 3] - start[:, 3]
    s = z[:, 4] - start[:, 4] * exp(ROOT * r)
    n = z[:, 5:] - start[:, 5:]
    pull = (energy * ((u * u + v * v + m * m + r * r) / 2 + s * s / 4)).sum() + (weights * (n * n).sum(axis=1)).sum()
    by_x, by_y = energy * (u - v * start[:, 4]) / o11, energy * v / o22
    gradient = np.empty(z.shape)
    gradient[:, 0] = l11 * by_x + z[:, 4] * l22 * by_y
    gradient[:, 1] = l22 * by_y
    gradient[:, 2], gradient[:, 3] = energy * m, energy * (r + s * s / ROOT)
    gradient[:, 4] = energy * s / 2
    gradient[:, 5:] = 2 * weights[:, None] * n
    return float(pull), gradient


@kernel()
def add_pull(z: F8, start: F8, weights: F8, gradient: F8) -> float:
    """The pull of splats towards where they began; its gradient is added to another.

    Parameters
    ----------
    z, start
        (n, 8), coordinates now and at the start.
    weights
        (n,), lambda of each splat.
    gradient
        (n, 8) by (u, v, m, r, s, n0, n1, n2), changed in place.

    Returns
    -------
    float
        The sum over the splats of lambda times the metric of their change, with the start's energy and axes: lambda
        times the error that the change would make, were it all in vain.
    """
    total = 0.0
    for i in range(len(z)):
        if weights[i] == 0:
            continue
        energy = weights[i] * (
            (start[i, 5] * start[i, 5] + start[i, 6] * start[i, 6]) + start[i, 7] * start[i, 7]
        )  # fmt: skip
        l11, l22 = exp_kernel((z[i, 2] + z[i, 3]) * HALF), exp_kernel((z[i, 2] - z[i, 3]) * HALF)
        o11 = exp_kernel((start[i, 2] + start[i, 3]) * HALF)
        o22 = exp_kernel((start[i, 2] - start[i, 3]) * HALF)
        u = (z[i, 0] - start[i, 0]) / o11
        v = (z[i, 1] - start[i, 1]) / o22 - start[i, 4] * u
        m, r = z[i, 2] - start[i, 2], z[i, 3] - start[i, 3]
        s = z[i, 4] - start[i, 4] * exp_kernel(min(ROOT * r, 700.0))
        total += energy * (((u * u + v * v) + (m * m + r * r)) / 2 + s * s / 4)
        by_x, by_y = energy * (u - v * start[i, 4]) / o11, energy * v / o22
        gradient[i, 0] += l11 * by_x + z[i, 4] * l22 * by_y
        gradient[i, 1] += l22 * by_y
        gradient[i, 2] += energy * m
        gradient[i, 3] += energy * (r + s * s * HALF)
        gradient[i, 4] += energy * s / 2
        for k in range(5, 8):
            n = z[i, k] - start[i, k]
            total += weights[i] * n * n
            gradient[i, k] += 2 * weights[i] * n
    return total


@kernel()
def hold_at_bounds(z: F8, gradient: F8) -> None:
    """Take from a gradient, in place, what would push splats over the bounds of `keep_shapes` that they stand at.

    What is left is the gradient over the directions that are open, so that no pair learns from a step that was cut off.
    """
    low = log_kernel(np.float64(MIN_FACTOR)) + AT_BOUND
    for i in range(len(z)):
        by_a, by_b = (gradient[i, 2] + gradient[i, 3]) * HALF, (gradient[i, 2] - gradient[i, 3]) * HALF
        a_is_held = (z[i, 2] + z[i, 3]) * HALF < low and by_a > 0
        b_is_held = (z[i, 2] - z[i, 3]) * HALF < low and by_b > 0
        if a_is_held or b_is_held:
            by_a, by_b = 0.0 if a_is_held else by_a, 0.0 if b_is_held else by_b
            gradient[i, 2], gradient[i, 3] = (by_a + by_b) * HALF, (by_a - by_b) * HALF
        if abs(z[i, 4]) > MOST_SHEAR - AT_BOUND and z[i, 4] * gradient[i, 4] < 0:
            gradient[i, 4] = 0.0


@kernel()
def keep_shapes(z: F8, following: F8, step: F8) -> None:
    """Move coordinates, in place, to where splats are neither smaller than MIN_FACTOR nor too slanted.

    `step` (n, 8), which led from z to `following`, becomes the one that was made. Shapes that make none stay.
    """
    low = log_kernel(np.float64(MIN_FACTOR))
    for i in range(len(z)):
        if step[i, 2] == 0 and step[i, 3] == 0 and step[i, 4] == 0:
            continue
        a, b = (following[i, 2] + following[i, 3]) * HALF, (following[i, 2] - following[i, 3]) * HALF
        if a < low or b < low:
            a, b = max(a, low), max(b, low)
            following[i, 2], following[i, 3] = (a + b) * HALF, (a - b) * HALF
            step[i, 2], step[i, 3] = following[i, 2] - z[i, 2], following[i, 3] - z[i, 3]
            following[i, 4] = z[i, 4] * exp_kernel(ROOT * step[i, 3]) + step[i, 4]
        if abs(following[i, 4]) > MOST_SHEAR:
            following[i, 4] = min(max(following[i, 4], -MOST_SHEAR), MOST_SHEAR)
            step[i, 4] = following[i, 4] - z[i, 4] * exp_kernel(ROOT * step[i, 3])
