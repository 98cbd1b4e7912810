"""L-BFGS from one point of a picture's splats to the next: what the fit of a frame and its refits share.

`FreeSplats` makes the squared error a function of the coordinates (`coordinates`) of what is free; `Walk` holds the
optimiser (`descent`), the best point so far and the way back to it; `pull_plain` is the pull towards a reference.
"""

from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4, F8
from gsvc_base.portable import exp
from gsvc_ref._jit import kernel
from gsvc_ref.training.coordinates import (
    PER_ROOT2,
    ROOT2,
    exp_kernel,
    gradient_by_coordinates,
    log_kernel,
    moved,
    to_coordinates,
    to_parameters,
)
from gsvc_ref.training.descent import LBFGS
from gsvc_ref.training.loop import MIN_FACTOR

Free = NDArray[np.bool_]
"""(n, 3) bool: whether position, Cholesky factor and colour of a splat may change."""

COLUMNS: Final = (2, 3, 3)
"""The columns of position, Cholesky factor and colour, of parameters and of coordinates alike."""

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


class Evaluated(Protocol):
    """What is needed of an `Objective` or a `Level`."""

    def evaluate(self, parameters: F4) -> tuple[float, F4]:
        """The loss, and its gradient (N, 8) f4."""
        ...

    def loss(self, parameters: F4) -> float:
        """The loss alone."""
        ...

    def freeze(self, parameters: F4, frozen: NDArray[np.bool_]) -> None:
        """Hold splats fixed."""

    def thaw(self) -> None:
        """Hold no splat fixed."""


class FreeSplats:
    """The squared error of a picture by the coordinates of what is free of its splats.

    Parameters
    ----------
    objective
        The picture; it holds the splats of which nothing is free until `Evaluated.thaw`.
    parameters
        (N, 8) f4 of all splats.
    free
        (N, 3) bool; None: all.
    pixels
        The number of pixels of the full size, by which losses are divided.
    hold
        Whether the objective is to hold the others; it does already if not.

    Attributes
    ----------
    rows
        The indices of the splats of which something is free.
    parameters
        (N, 8) f4, those that were evaluated last.
    """

    def __init__(
        self, objective: Evaluated, parameters: F4, free: Free | None, pixels: int, *, hold: bool = True
    ) -> None:
        self._objective, self.parameters = objective, parameters.copy()
        some = np.ones(len(parameters), np.bool_) if free is None else np.asarray(free.any(axis=1))
        self.rows = np.flatnonzero(some)
        self._held: NDArray[np.bool_] | None = None  # (n, 8) bool
        if free is not None and not free[self.rows].all():
            self._held = np.repeat(~free[self.rows], COLUMNS, axis=1)
        if hold and not some.all():
            objective.freeze(parameters, ~some)
        self._scale = pixels * 255.0 * 255.0

    def start(self) -> F8:
        """The coordinates (n, 8) of the rows."""
        return to_coordinates(self.parameters[self.rows])

    def at(self, z: F8) -> F4:
        """The parameters (N, 8) f4 of all splats with the rows at z (n, 8); what is held keeps its bits."""
        own = to_parameters(z)
        if self._held is not None:
            own = np.where(self._held, self.parameters[self.rows], own)
        self.parameters[self.rows] = own
        return self.parameters

    def error(self, z: F8) -> float:
        """The squared error in units of 8 bits."""
        return self._objective.loss(self.at(z)) * self._scale

    def evaluate(self, z: F8) -> tuple[float, float, F8]:
        """The loss, the squared error in units of 8 bits, and its gradient (n, 8) by (u, v, m, r, s, n0, n1, n2)."""
        loss, gradient = self._objective.evaluate(self.at(z))
        own = self.parameters[self.rows]
        by_own = gradient[self.rows] * np.float32(self._scale)
        if self._held is not None:
            by_own[self._held] = 0  # so that a colour that is held does not count in its splat's size
        by_z = gradient_by_coordinates(own, by_own)
        if self._held is not None:
            by_z[self._held] = 0
        return loss, loss * self._scale, by_z


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
    l11, l22 = exp((z[:, 2] + z[:, 3]) * PER_ROOT2), exp((z[:, 2] - z[:, 3]) * PER_ROOT2)
    o11, o22 = exp((start[:, 2] + start[:, 3]) * PER_ROOT2), exp((start[:, 2] - start[:, 3]) * PER_ROOT2)
    u = (z[:, 0] - start[:, 0]) / o11
    v = (z[:, 1] - start[:, 1]) / o22 - start[:, 4] * u
    m, r = z[:, 2] - start[:, 2], z[:, 3] - start[:, 3]
    s = z[:, 4] - start[:, 4] * exp(ROOT2 * r)
    n = z[:, 5:] - start[:, 5:]
    pull = (energy * ((u * u + v * v + m * m + r * r) / 2 + s * s / 4)).sum() + (weights * (n * n).sum(axis=1)).sum()
    by_x, by_y = energy * (u - v * start[:, 4]) / o11, energy * v / o22
    gradient = np.empty(z.shape)
    gradient[:, 0] = l11 * by_x + z[:, 4] * l22 * by_y
    gradient[:, 1] = l22 * by_y
    gradient[:, 2], gradient[:, 3] = energy * m, energy * (r + s * s / ROOT2)
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
        l11, l22 = exp_kernel((z[i, 2] + z[i, 3]) * PER_ROOT2), exp_kernel((z[i, 2] - z[i, 3]) * PER_ROOT2)
        o11 = exp_kernel((start[i, 2] + start[i, 3]) * PER_ROOT2)
        o22 = exp_kernel((start[i, 2] - start[i, 3]) * PER_ROOT2)
        u = (z[i, 0] - start[i, 0]) / o11
        v = (z[i, 1] - start[i, 1]) / o22 - start[i, 4] * u
        m, r = z[i, 2] - start[i, 2], z[i, 3] - start[i, 3]
        s = z[i, 4] - start[i, 4] * exp_kernel(min(ROOT2 * r, 700.0))
        total += energy * (((u * u + v * v) + (m * m + r * r)) / 2 + s * s / 4)
        by_x, by_y = energy * (u - v * start[i, 4]) / o11, energy * v / o22
        gradient[i, 0] += l11 * by_x + z[i, 4] * l22 * by_y
        gradient[i, 1] += l22 * by_y
        gradient[i, 2] += energy * m
        gradient[i, 3] += energy * (r + s * s * PER_ROOT2)
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
        by_a, by_b = (gradient[i, 2] + gradient[i, 3]) * PER_ROOT2, (gradient[i, 2] - gradient[i, 3]) * PER_ROOT2
        a_is_held = (z[i, 2] + z[i, 3]) * PER_ROOT2 < low and by_a > 0
        b_is_held = (z[i, 2] - z[i, 3]) * PER_ROOT2 < low and by_b > 0
        if a_is_held or b_is_held:
            by_a, by_b = 0.0 if a_is_held else by_a, 0.0 if b_is_held else by_b
            gradient[i, 2], gradient[i, 3] = (by_a + by_b) * PER_ROOT2, (by_a - by_b) * PER_ROOT2
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
        a, b = (following[i, 2] + following[i, 3]) * PER_ROOT2, (following[i, 2] - following[i, 3]) * PER_ROOT2
        if a < low or b < low:
            a, b = max(a, low), max(b, low)
            following[i, 2], following[i, 3] = (a + b) * PER_ROOT2, (a - b) * PER_ROOT2
            step[i, 2], step[i, 3] = following[i, 2] - z[i, 2], following[i, 3] - z[i, 3]
            following[i, 4] = z[i, 4] * exp_kernel(ROOT2 * step[i, 3]) + step[i, 4]
        if abs(following[i, 4]) > MOST_SHEAR:
            following[i, 4] = min(max(following[i, 4], -MOST_SHEAR), MOST_SHEAR)
            step[i, 4] = following[i, 4] - z[i, 4] * exp_kernel(ROOT2 * step[i, 3])
