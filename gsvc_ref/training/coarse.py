"""Coarse to fine: the objective of a large frame at a half or a quarter of its size, while splats are large.

A splat that is several pixels wide looks the same on fewer pixels, and an evaluation on a quarter of the pixels takes
about a quarter of the time. Parameters stay in pixels of the full size: with blocks of `step` by `step` pixels, a
splat of the parameters p has p / step in its position and Cholesky factor on the picture of the blocks' means, and the
derivatives by those five are 1 / step of the ones there. The loss is per pixel, and so about the same at every size.

A fit with growth begins at the step for its first splats and goes on with a finer one whenever it has added some::

    sizes = Sizes(picture, threads, precision=precision)
    level = sizes.of(step_for(width, height, len(parameters)))
    loss, gradient = level.evaluate(parameters)
    more = level.new_splats(count, total, rng)

What a finer picture evaluates is another function, so that an optimiser must take no pair over the change (as after
`LBFGS.append`). The last iterations belong to the full size.
"""

from typing import Final

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from gsvc_base.arrays import F4
from gsvc_ref.rendering import Objective, Precision
from gsvc_ref.training.edges import Edges
from gsvc_ref.training.reduction import block_means

PIXELS_OF_STEPS: Final = ((400, 4), (100, 2))
"""More pixels for each splat than the first number of a pair, on average, and its step is fine enough."""

LEAST_SIDE: Final = 32
"""Smallest width and height in pixels of a reduced picture."""


def step_for(width: int, height: int, splats: int) -> int:
    """1, 2 or 4: how many times smaller a picture may be on which so many splats are fitted."""
    for pixels, step in PIXELS_OF_STEPS:
        if width * height > pixels * max(splats, 1) and min(width, height) >= step * LEAST_SIDE:
            return step
    return 1


class Level:
    """The objective of a picture reduced by a step, of splats in pixels of the full size.

    It has what a fit needs of an `Objective`: `evaluate`, `loss`, `freeze` and `thaw`, with parameters (N, 8) f4.

    Parameters
    ----------
    objective
        That of the reduced picture.
    picture
        The reduced picture, (h, w, 3) f4.
    step
        The side of the blocks, 1 for the picture itself.
    """

    def __init__(self, objective: Objective, picture: F4, step: int) -> None:
        self._objective, self._picture, self.step = objective, picture, step
        self._edges: Edges | None = None

    def evaluate(self, parameters: F4) -> tuple[float, F4]:
        """The loss, and its gradient (N, 8) f4 by the parameters."""
        loss, gradient = self._objective.evaluate(resized(parameters, 1 / self.step))
        return loss, resized(gradient, 1 / self.step)

    def loss(self, parameters: F4) -> float:
        """The loss alone."""
        return self._objective.loss(resized(parameters, 1 / self.step))

    def freeze(self, parameters: F4, frozen: NDArray[np.bool_]) -> None:
        """Hold splats fixed, as `Objective.freeze`."""
        self._objective.freeze(resized(parameters, 1 / self.step), frozen)

    def thaw(self) -> None:
        """Hold no splat fixed."""
        self._objective.thaw()

    def new_splats(self, count: int, total: int, rng: Generator, where: NDArray[np.bool_] | None = None) -> F4:
        """Splats (count, 8) f4 along edges where the splats evaluated last leave the most, of `total` in all.

        `where` is (h, w) bool, the pixels to look at; None: all.
        """
        if self._edges is None:
            self._edges = Edges(self._picture)
        missing = self._objective.residual()
        np.negative(missing, out=missing)
        if where is not None:
            missing *= where[..., None]
        return resized(self._edges.new_splats(missing, count, total, rng), self.step)


class Sizes:
    """The levels of one picture, each made when it is first asked for.

    Parameters
    ----------
    picture
        (H, W, 3) f4.
    threads, precision
        As in `Objective`.
    full
        The objective of the full size where there is one already.
    """

    def __init__(
        self,
        picture: F4,
        threads: int | None = None,
        *,
        precision: Precision = "fast",
        full: Objective | None = None,
    ) -> None:
        self._picture, self._threads, self._precision = picture, threads, precision
        self._levels: dict[int, Level] = {} if full is None else {1: Level(full, picture, 1)}

    def of(self, step: int) -> Level:
        """The picture reduced by a step."""
        if step not in self._levels:
            small = block_means(self._picture, step)
            objective = Objective(small, self._threads, precision=self._precision)
            self._levels[step] = Level(objective, small, step)
        return self._levels[step]


def resized(parameters: F4, factor: float) -> F4:
    """Parameters (N, 8) f4 on a picture that is `factor` times as large, which is a power of two: exact."""
    if factor == 1:
        return parameters
    other = parameters.copy()
    other[:, :5] *= np.float32(factor)
    return other
