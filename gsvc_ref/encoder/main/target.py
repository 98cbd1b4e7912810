"""What splats are fitted to: a picture, with the error of splats in their coordinates, at the size that does for them.

Coarse to fine: a splat that is several pixels wide looks the same on fewer pixels, and an evaluation on a quarter of
the pixels takes about a quarter of the time. Parameters stay in pixels of the full size: with blocks of `step` by
`step` pixels, a splat of the parameters p has p / step in its position and Cholesky factor on the picture of the
blocks' means, and the derivatives by those five are 1 / step of the ones there. The loss is per pixel, and so about the
same at every size. What another size evaluates is another function, so that an optimizer must take no pair over the
change (as after `Walk.append`). The last evaluations belong to the full size.
"""

from collections.abc import Sequence
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.random import Generator

from gsvc_base.arrays import F4, F8, I8
from gsvc_ref.encoder.initialization import image_start
from gsvc_ref.encoder.main.coordinates import gradient_by_coordinates, to_coordinates
from gsvc_ref.encoder.main.edges import edge_splats, structure_tensor
from gsvc_ref.rendering import Objective
from gsvc_ref.training.reduction import block_means

SQUARE_OF_8_BITS: Final = 255.0 * 255.0
"""A squared error of 1 in units of 8 bits."""

PIXELS_OF_STEPS: Final = ((400, 4), (100, 2))
"""More pixels for each splat than the first number of a pair, on average, and its step is fine enough."""

MIN_REDUCED_SIDE: Final = 32  # smallest width and height in pixels of a reduced picture


def step_for(width: int, height: int, splats: int) -> int:
    """1, 2 or 4: how many times smaller a picture may be on which this many splats are fitted."""
    for pixels, step in PIXELS_OF_STEPS:
        if width * height > pixels * max(splats, 1) and min(width, height) >= step * MIN_REDUCED_SIDE:
            return step
    return 1


class Reduced:
    """The objective of a picture (h, w, 3) f4 that is reduced by a step, of splats in pixels of the full size."""

    def __init__(self, objective: Objective, picture: F4, step: int) -> None:
        self.objective, self._picture, self._step = objective, picture, step

    def evaluate(self, parameters: F4) -> tuple[float, F4]:
        """The loss, and its gradient (N, 8) f4 by the parameters."""
        loss, gradient = self.objective.evaluate(resized(parameters, 1 / self._step))
        return loss, resized(gradient, 1 / self._step)

    @cached_property
    def _tensor(self) -> F8:
        return structure_tensor(self._picture)

    def new_splats(self, count: int, total: int, rng: Generator) -> F4:
        """Splats (count, 8) f4 along edges where the splats evaluated last leave the most, of `total` in all."""
        missing = -self.objective.residual()
        return resized(edge_splats(self._tensor, missing, count, total, rng), self._step)


def resized(parameters: F4, factor: float) -> F4:
    """Parameters (N, 8) f4 on a picture that is `factor` times as large, which is a power of two: exact."""
    if factor == 1:
        return parameters
    other = parameters.copy()
    other[:, :5] *= np.float32(factor)
    return other


class Target:
    """A picture to be described, with the squared error of splats in units of 8 bits.

    While splats are few, a smaller picture does: `resize` chooses what is evaluated. The squared error is always that
    of the whole picture, or about that. `base` (B, 8) f4 are splats that are in every picture, such as those of a lower
    layer; `how` are other arguments of `Objective`.
    """

    def __init__(self, picture: F4, base: F4 | None = None, **how: Any) -> None:
        self.height, self.width = picture.shape[:2]
        self.base_count = 0 if base is None else len(base)
        self._picture, self._how = picture, how
        self._whole = Reduced(Objective(picture, background=base, **how), picture, 1)
        self._size, self._sizes = self._whole, {1: self._whole}  # by step, each made when it is first asked for
        self._scale = self.height * self.width * SQUARE_OF_8_BITS

    def start(self, count: int, rng: Generator) -> F8:
        """Coordinates (count, 8) of splats to begin with."""
        if self.base_count:
            self._whole.objective.loss(np.zeros((0, 8), np.float32))
            return self.new_splats(count, count + self.base_count, rng)
        return to_coordinates(image_start(self._picture, count, rng).to_array())

    def new_splats(self, count: int, total: int, rng: Generator) -> F8:
        """Coordinates (count, 8) of splats where the splats evaluated last, of `total`, leave the most."""
        return to_coordinates(self._size.new_splats(count, total, rng))

    def resize(self, splats: int | None = None) -> bool:
        """Evaluate from now on at the size that does for this many splats, None: the full one; whether it is another.

        A picture with a base stays as large as it is; one in which splats are held is to be of the full size.
        """
        step = 1 if splats is None or self.base_count else step_for(self.width, self.height, splats)
        if step not in self._sizes:
            small = block_means(self._picture, step)
            self._sizes[step] = Reduced(Objective(small, **self._how), small, step)
        before, self._size = self._size, self._sizes[step]
        return self._size is not before

    def hold(self, parameters: F4) -> None:
        """From now on splats (n, 8) f4 are in every picture of the full size, with the base and those evaluated."""
        self._whole.objective.hold(parameters)

    def evaluate(self, parameters: F4) -> tuple[float, F8]:
        """The squared error of splats (N, 8) f4, and its gradient (N, 8) f8 by (u, v, m, r, s, n0, n1, n2)."""
        loss, gradient = self._size.evaluate(parameters)
        return loss * self._scale, gradient_by_coordinates(parameters, gradient * np.float32(self._scale))


class LayeredTarget:
    """A picture to be described in several qualities: each has a target, and its squared error counts by its weight.

    Splats stand layer by layer. Quality l has those of layers 0 to l, and the topmost one has all of them, also those
    after the N whose layers (N,) are known, which are its own in the making.
    """

    def __init__(self, targets: Sequence[Target], weights: Sequence[float], layers: I8) -> None:
        self.targets, self.weights, self.layers = targets, weights, layers
        self.width, self.height = targets[-1].width, targets[-1].height

    def start(self, count: int, rng: Generator) -> F8:
        """As of `Target`, where the splats evaluated last, those of the layers below, leave the most."""
        return self.new_splats(count, count, rng)

    def new_splats(self, count: int, total: int, rng: Generator) -> F8:
        """As of `Target`, for the topmost quality, of which `total` splats are not of the layers below."""
        return self.targets[-1].new_splats(count, len(self.layers) + total, rng)

    def resize(self, splats: int | None = None) -> bool:
        """As of `Target`: the picture stays as large as it is."""
        return False

    def ends(self) -> list[int]:
        """How many splats each quality but the topmost one has."""
        below = np.arange(len(self.targets) - 1)
        return [int(end) for end in np.searchsorted(self.layers, below, side="right")]

    def hold(self, parameters: Sequence[F4]) -> None:
        """From now on splats (n, 8) f4, of each layer, are in the pictures of its quality and of all above it."""
        for quality, target in enumerate(self.targets):
            target.hold(np.concatenate(parameters[: quality + 1]))

    def evaluate(self, parameters: F4) -> tuple[float, F8]:
        """The weighted squared error of splats (N, 8) f4, and its gradient (N, 8) f8, as of `Target`."""
        total, gradient = 0.0, np.zeros(parameters.shape)
        for target, weight, end in zip(self.targets, self.weights, [*self.ends(), len(parameters)], strict=True):
            error, of_quality = target.evaluate(parameters[:end])
            total += weight * error
            gradient[:end] += weight * of_quality
        return total, gradient
