"""L-BFGS over splats in the coordinates of the metric, whose diagonal starts every inverse Hessian."""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F8
from gsvc_ref._jit import kernel
from gsvc_ref.training.coordinates import ENERGY_SCALE, HALF, LEAST_ENERGY, exp_kernel

MEMORY: Final = 8
FIRST_SCALE: Final = 0.25
LEAST_SCALE: Final = 0.02

RESTART_OCTAVES: Final = 2
"""How many times the first step of a restart is halved, after one that found no smaller error."""

MOST_MOVE: Final = 0.7
"""Longest step of a position, in standard deviations of its splat."""
MOST_SHAPE: Final = 0.4
"""Largest change of size, aspect and shear."""
MOST_COLOR: Final = 0.3
"""Largest change of a colour, of 1."""


class LBFGS:
    """Limited-memory BFGS with one evaluation a step and no line search.

    The pairs of steps and changes of the gradient are kept in (u, v, m, r, s, n0, n1, n2). The inverse Hessian begins
    as `scale` times that of the metric, with the scale that fits the last pair. Pairs of no positive curvature are
    left out. Where the error rises, the next step is halved. The step of each splat is limited.

    Parameters
    ----------
    count
        The number of splats.
    quantizer
        D, below LEAST_ENERGY times which the energy of a splat counts as that.

    Attributes
    ----------
    quantizer
        The one given.
    """

    def __init__(self, count: int, quantizer: float) -> None:
        self.quantizer = quantizer
        self._steps, self._changes = np.zeros((2, MEMORY, count, 8))  # (MEMORY, N, 8) f8 each
        self._inverse = np.zeros(MEMORY)  # (MEMORY,) f8: 1 / (step . change)
        self._pairs, self._last, self._scale, self._shrink, self._error = 0, -1, FIRST_SCALE, 1.0, math.inf
        self._least, self._restarts = math.inf, 0  # the least error, and the restarts since then
        self._step: F8 | None = None  # (N, 8) f8, the last one made
        self._gradient = np.zeros((0, 8))

    def append(self, new: int) -> None:
        """Let `new` splats, or none, follow the others; the next gradient makes no pair."""
        zeros = np.zeros((MEMORY, new, 8))
        self._steps, self._changes = (np.concatenate([a, zeros], axis=1) for a in (self._steps, self._changes))
        self._step, self._error, self._least = None, math.inf, math.inf

    def take(self, indices: NDArray[np.int64]) -> None:
        """Keep the splats of these indices; the next gradient makes no pair."""
        self._steps, self._changes = self._steps[:, indices], self._changes[:, indices]
        self._step, self._error, self._least = None, math.inf, math.inf

    def step(self, z: F8, error: float, gradient: F8) -> F8:
        """The step (N, 8) from coordinates z (N, 8), given the error there and its gradient (N, 8)."""
        self._learn(z, gradient)
        if error < self._least:
            self._least, self._restarts = error, 0
        self._shrink = 0.5 * self._shrink if error > self._error else min(1.0, 2 * self._shrink)
        self._error, self._gradient = error, gradient.copy()
        self._step = np.empty_like(z)
        _direction(
            z, gradient, self._steps, self._changes, self._inverse, self._pairs, self._last, self._scale,
            self.quantizer, self._shrink, self._step,
        )  # fmt: skip
        return self._step

    def restart(self, length: float | None = None) -> None:
        """Forget all pairs, and begin again with a short step, a quarter as long as that of a restart in vain.

        With a length the next step is `length` times as long, and those after it grow to twice the one before.
        """
        self._pairs, self._scale, self._step, self._error = 0, 0.1, None, math.inf
        self._shrink = math.ldexp(1.0, -RESTART_OCTAVES * self._restarts)
        self._restarts += 1
        if length is not None:
            self._shrink = length / 2  # the next step doubles it

    def _learn(self, z: F8, gradient: F8) -> None:
        """Keep the pair of the last step, if its curvature is positive."""
        if self._step is None:
            return
        at = (self._last + 1) % MEMORY
        change = gradient - self._gradient
        product, square = _curvature(z, self._step, change, self.quantizer)
        if product > 1e-30:
            self._steps[at], self._changes[at], self._inverse[at] = self._step, change, 1 / product
            self._last, self._pairs = at, min(self._pairs + 1, MEMORY)
            self._scale = min(max(product / square, LEAST_SCALE), 1.0)


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
def _inverse_metric(z: F8, g: F8, quantizer: float, scale: float, out: F8) -> None:
    """Out = scale (2 metric)^-1 g, by (u, v, m, r, s, n)."""
    for i in range(len(z)):
        energy = z[i, 5] * z[i, 5] + z[i, 6] * z[i, 6] + z[i, 7] * z[i, 7]
        f = scale / max(energy, LEAST_ENERGY * LEAST_ENERGY * quantizer * quantizer)
        for k in range(4):
            out[i, k] = f * g[i, k]
        out[i, 4] = 2 * f * g[i, 4]
        for k in range(5, 8):
            out[i, k] = 0.5 * scale * g[i, k]


@kernel()
def _curvature(z: F8, step: F8, change: F8, quantizer: float) -> tuple[float, float]:
    """The products step . change, and change . metric^-1 change."""
    out = np.empty_like(change)
    _inverse_metric(z, change, quantizer, 1.0, out)
    return _dot(step, change), _dot(change, out)


@kernel()
def _direction(
    z: F8, gradient: F8, steps: F8, changes: F8, inverse: F8, pairs: int, last: int, scale: float, quantizer: float,
    shrink: float, step: F8,
) -> None:  # fmt: skip
    """The two loops, and the limits of each splat's step."""
    memory = len(steps)
    weights = np.empty(memory)
    q = gradient.copy()
    for age in range(pairs):
        p = (last - age) % memory
        weights[p] = inverse[p] * _dot(steps[p], q)
        for i in range(len(q)):
            for k in range(8):
                q[i, k] -= weights[p] * changes[p, i, k]
    _inverse_metric(z, q, quantizer, scale, step)
    for age in range(pairs - 1, -1, -1):
        p = (last - age) % memory
        f = weights[p] - inverse[p] * _dot(changes[p], step)
        for i in range(len(q)):
            for k in range(8):
                step[i, k] += f * steps[p, i, k]
    for i in range(len(q)):
        for k in range(8):
            step[i, k] *= -shrink
        move = math.sqrt(step[i, 0] * step[i, 0] + step[i, 1] * step[i, 1]) / MOST_MOVE
        shape = max(max(abs(step[i, 2]), abs(step[i, 3])), abs(step[i, 4])) / MOST_SHAPE
        over = max(move, shape)
        if over > 1:
            for k in range(5):
                step[i, k] /= over
        most = MOST_COLOR * ENERGY_SCALE * exp_kernel(z[i, 2] * HALF)
        color = math.sqrt(step[i, 5] * step[i, 5] + step[i, 6] * step[i, 6] + step[i, 7] * step[i, 7]) / most
        if color > 1:
            for k in range(5, 8):
                step[i, k] /= color
