"""What splats of an I-frame are fitted to: a picture, with the error of splats in their coordinates."""

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.random import Generator

from gsvc_base.arrays import F4, F8
from gsvc_base.portable import log10
from gsvc_ref.rendering import Objective, Precision
from gsvc_ref.training.augmentation import image_start
from gsvc_ref.training.coarse import Sizes, step_for
from gsvc_ref.training.coordinates import gradient_by_coordinates, to_coordinates

OnEvaluation = Callable[[float], None]
"""Called with the loss, as in `Objective`."""

SQUARE_OF_8_BITS: Final = 255.0 * 255.0  # A squared error of 1 in units of 8 bits
LEAST_LOSS: Final = 1e-12  # the loss of a picture without error, so that its PSNR is finite


class Target:
    """A picture to be described, with the squared error of splats in units of 8 bits.

    While splats are few, a smaller picture does (`training.coarse`): `resize` chooses what is evaluated. The squared
    error is always that of the whole picture, or about that.

    `base` (B, 8) f4 are splats that are in every picture, such as those of a lower layer; `on_evaluation` is called
    after each evaluation.
    """

    def __init__(
        self,
        picture: F4,
        base: F4 | None = None,
        threads: int | None = None,
        precision: Precision = "fast",
        on_evaluation: OnEvaluation | None = None,
    ) -> None:
        self._on_evaluation = on_evaluation
        self.height, self.width = picture.shape[:2]
        self._picture, self._objective = picture, Objective(picture, threads, precision=precision)
        self._sizes = Sizes(picture, threads, precision=precision, full=self._objective)
        self._size = self._sizes.of(1)
        self._scale = self.height * self.width * SQUARE_OF_8_BITS
        self._base = np.zeros((0, 8), np.float32) if base is None else base
        self.hold(self._base[:0])

    def start(self, count: int, rng: Generator) -> F8:
        """Coordinates (count, 8) of splats to begin with."""
        if len(self._base):
            self._objective.loss(self._base[:0])
            return self.new_splats(count, count + len(self._base), rng)
        return to_coordinates(image_start(self._picture, count, rng).to_array())

    def new_splats(self, count: int, total: int, rng: Generator) -> F8:
        """Coordinates (count, 8) of splats where the splats evaluated last, of `total`, leave the most."""
        return to_coordinates(self._size.new_splats(count, total, rng))

    def resize(self, splats: int | None = None) -> bool:
        """Evaluate from now on at the size that does for so many splats, None: the full one; whether that is another.

        A picture with a base stays as large as it is; one in which splats are held is to be of the full size.
        """
        step = 1 if splats is None or len(self._base) else step_for(self.width, self.height, splats)
        before, self._size = self._size, self._sizes.of(step)
        return self._size is not before

    def hold(self, parameters: F4) -> None:
        """From now on splats (n, 8) f4 are in every picture of the full size, with the base and those evaluated."""
        self._objective.hold(np.concatenate([self._base, parameters]))

    def evaluate(self, parameters: F4) -> tuple[float, F8]:
        """The squared error of splats (N, 8) f4, and its gradient (N, 8) f8 by (u, v, m, r, s, n0, n1, n2)."""
        loss, gradient = self._size.evaluate(parameters)
        if self._on_evaluation:
            self._on_evaluation(loss)
        return loss * self._scale, gradient_by_coordinates(parameters, gradient * np.float32(self._scale))

    def psnr(self, parameters: F4) -> float:
        """The PSNR in dB of the picture of the base and splats (N, 8) f4."""
        self.hold(parameters)
        error = self._objective.loss(parameters[:0])
        return 10 * float(log10(3 / max(error, LEAST_LOSS)))
