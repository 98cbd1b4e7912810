"""L-BFGS over splats in the coordinates of the metric, whose diagonal starts every inverse Hessian."""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F8, I8
from gsvc_ref._jit import kernel
from gsvc_ref.encoder.main.coordinates import ENERGY_SCALE, MIN_ENERGY, PER_ROOT2, exp_kernel, moved, squared_energy

MEMORY: Final = 8  # pairs of steps and changes of the gradient that are kept

FIRST_SCALE: Final = 0.25
RESTART_SCALE: Final = 0.1
MIN_SCALE: Final = 0.02
"""Shares of the metric's inverse that the inverse Hessian begins with: at first, after a restart, and at least."""

RESTART_OCTAVES: Final = 2
"""How many times the first step of a restart is halved, after one that found no smaller error."""

MIN_CURVATURE: Final = 1e-30  # a pair whose product step . change is not above this says nothing of the curvature
MAX_MOVE: Final = 0.7  # longest step of a position, in standard deviations of its splat
MAX_SHAPE: Final = 0.4  # largest change of size, aspect and shear
MAX_COLOR: Final = 0.3  # largest change of a color, of 1
RISE: Final = 1.01  # a walk goes back to its best point where the error is this many times as large


class Pairs(NamedTuple):
    """The last steps s and the changes y of the gradient along them, by (u, v, m, r, s, n0, n1, n2)."""

    steps: F8  # (MEMORY, N, 8)
    changes: F8  # (MEMORY, N, 8)
    inverse: F8  # (MEMORY,), 1 / (s . y)


class Point(NamedTuple):
    """A point of a walk: the error, the coordinates (N, 8) f8, and the gradient there."""

    error: float
    z: F8
    gradient: F8


class Walk:
    """L-BFGS over the splats of a picture, with one evaluation a step and no line search.

    The pairs of steps and changes of the gradient are kept in (u, v, m, r, s, n0, n1, n2). The inverse Hessian begins
    as `_scale` times that of the metric, with the scale that fits the last pair. Pairs of no positive curvature are
    left out. The step of each splat is limited. Where the error rises, the next step is halved; where it has risen
    much, the walk forgets its pairs and goes back to its best point.

    `D` bounds the units of faint splats: energies below MIN_ENERGY D count as that.
    """

    def __init__(self, count: int, D: float) -> None:
        self.best: Point | None = None  # that of the least error since the function or the splats changed
        self._D = D
        steps, changes = np.zeros((2, MEMORY, count, 8))
        self._pairs, self._known, self._last = Pairs(steps, changes, np.zeros(MEMORY)), 0, -1
        self._scale, self._shrink, self._error = FIRST_SCALE, 1.0, math.inf
        self._least, self._restarts = math.inf, 0  # the least error, and the restarts since then
        self._step: F8 | None = None  # (N, 8) f8, the last one made
        self._gradient = np.zeros((0, 8))

    def next(self, z: F8, error: float, gradient: F8) -> F8:
        """The coordinates (N, 8) to evaluate after z (N, 8), given the error there and its gradient (N, 8)."""
        if self.best is None or error < self.best.error:
            self.best = Point(error, z, gradient)
        elif error > RISE * self.best.error:
            error, z, gradient = self.best
            self._restart()
        return moved(z, self.learn(z, error, gradient))

    def learn(self, z: F8, error: float, gradient: F8) -> F8:
        """Take the pair that leads to a point, and return the step (N, 8) from there.

        It alone is for a point to stay at, where the function or the splats are about to change.
        """
        self._keep_pair(z, gradient)
        if error < self._least:
            self._least, self._restarts = error, 0
        self._shrink = 0.5 * self._shrink if error > self._error else min(1.0, 2 * self._shrink)
        self._error, self._gradient = error, gradient.copy()
        self._step = np.empty_like(z)
        ages = np.arange(self._last, self._last - self._known, -1) % MEMORY  # from the last pair back
        _direction(z, gradient, self._pairs, ages, self._D, self._scale, self._step)
        _limit(z, self._shrink, self._step)
        return self._step

    def append(self, new: int) -> None:
        """Let `new` splats follow, 0 where another function is evaluated from now on; the next gradient has no pair."""
        zeros = np.zeros((MEMORY, new, 8))
        self._change(*(np.concatenate([one, zeros], axis=1) for one in self._pairs[:2]))

    def take(self, indices: NDArray[np.int64]) -> None:
        """Go on with the splats of these indices alone; the next gradient has no pair."""
        self._change(*(one.take(indices, axis=1) for one in self._pairs[:2]))

    def _change(self, steps: F8, changes: F8) -> None:
        """Go on with other splats, or with another function: errors so far say nothing of it."""
        self._pairs = self._pairs._replace(steps=steps, changes=changes)
        self.best, self._step, self._error, self._least = None, None, math.inf, math.inf

    def _restart(self) -> None:
        """Forget all pairs, and begin again with a short step, a quarter as long as that of a restart in vain."""
        self._known, self._scale, self._step, self._error = 0, RESTART_SCALE, None, math.inf
        self._shrink = math.ldexp(1.0, -RESTART_OCTAVES * self._restarts)
        self._restarts += 1

    def _keep_pair(self, z: F8, gradient: F8) -> None:
        """Keep the pair of the last step, if its curvature is positive."""
        if self._step is None:
            return
        at = (self._last + 1) % MEMORY
        change = gradient - self._gradient
        product, square = _curvature(z, self._step, change, self._D)
        if product > MIN_CURVATURE:
            self._pairs.steps[at], self._pairs.changes[at], self._pairs.inverse[at] = self._step, change, 1 / product
            self._last, self._known = at, min(self._known + 1, MEMORY)
            self._scale = min(max(product / square, MIN_SCALE), 1.0)


@kernel(inline=True)
def _dot(a: F8, b: F8) -> float:
    """The sum of products: column by column from the first row on, then over the columns."""
    t0 = t1 = t2 = t3 = t4 = t5 = t6 = t7 = 0.0
    for i in range(len(a)):
        t0 += a[i, 0] * b[i, 0]
        t1 += a[i, 1] * b[i, 1]
        t2 += a[i, 2] * b[i, 2]
        t3 += a[i, 3] * b[i, 3]
        t4 += a[i, 4] * b[i, 4]
        t5 += a[i, 5] * b[i, 5]
        t6 += a[i, 6] * b[i, 6]
        t7 += a[i, 7] * b[i, 7]
    return ((t0 + t1) + (t2 + t3)) + ((t4 + t5) + (t6 + t7))


@kernel(inline=True)
def _inverse_metric(z: F8, g: F8, D: float, scale: float, out: F8) -> None:
    """Out = scale (2 metric)^-1 g, by (u, v, m, r, s, n)."""
    for i in range(len(z)):
        f = scale / max(squared_energy(z[i]), MIN_ENERGY * MIN_ENERGY * D * D)
        for k in range(4):
            out[i, k] = f * g[i, k]
        out[i, 4] = 2 * f * g[i, 4]
        for k in range(5, 8):
            out[i, k] = 0.5 * scale * g[i, k]


@kernel()
def _curvature(z: F8, step: F8, change: F8, D: float) -> tuple[float, float]:
    """The products step . change, and change . metric^-1 change."""
    out = np.empty_like(change)
    _inverse_metric(z, change, D, 1.0, out)
    return _dot(step, change), _dot(change, out)


@kernel()
def _direction(z: F8, gradient: F8, pairs: Pairs, ages: I8, D: float, scale: float, step: F8) -> None:
    """The inverse Hessian times the gradient, by the two loops over pairs (Nocedal 1980)."""
    steps, changes, inverse = pairs
    weights, q = np.empty(len(ages)), gradient.copy()
    for age in range(len(ages)):  # from the last pair to the first
        p = ages[age]
        weights[age] = inverse[p] * _dot(steps[p], q)
        for i in range(len(q)):
            for k in range(8):
                q[i, k] -= weights[age] * changes[p, i, k]
    _inverse_metric(z, q, D, scale, step)
    for age in range(len(ages) - 1, -1, -1):
        p = ages[age]
        f = weights[age] - inverse[p] * _dot(changes[p], step)
        for i in range(len(q)):
            for k in range(8):
                step[i, k] += f * steps[p, i, k]


@kernel()
def _limit(z: F8, shrink: float, step: F8) -> None:
    """Turn the direction around, and limit the step of each splat: geometry and color each keep their direction."""
    for i in range(len(step)):
        for k in range(8):
            step[i, k] *= -shrink
        move = math.sqrt(step[i, 0] * step[i, 0] + step[i, 1] * step[i, 1]) / MAX_MOVE
        shape = max(max(abs(step[i, 2]), abs(step[i, 3])), abs(step[i, 4])) / MAX_SHAPE
        over = max(move, shape)
        if over > 1:
            for k in range(5):
                step[i, k] /= over
        most = MAX_COLOR * ENERGY_SCALE * exp_kernel(z[i, 2] * PER_ROOT2)
        color = math.sqrt(step[i, 5] * step[i, 5] + step[i, 6] * step[i, 6] + step[i, 7] * step[i, 7]) / most
        if color > 1:
            for k in range(5, 8):
                step[i, k] /= color
