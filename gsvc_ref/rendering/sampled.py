"""The loss on every second row, or on a quarter of the pixels: a share of the work, for steps that need no more."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gsvc_base.arrays import F4
from gsvc_base.errors import UsageError
from gsvc_ref.rendering.fast.threads import thread_count
from gsvc_ref.rendering.objective import Objective


class SampledObjective:
    """The loss of `Objective` on a lattice of pixels, and its gradient; each turn has another of the lattices.

    On every second row the picture of a splat is that of a splat half as high on a picture half as high, and so for
    columns. So this takes nothing but smaller objectives, and nothing is smoothed: the mean of the gradients of all
    turns is that of the whole target, as long as its sides are multiples of the steps. A descent with momentum that
    takes the lattices in turns hardly notices as long as there are many pixels for each splat.
    """

    def __init__(
        self,
        target: F4,
        threads: int | None = None,
        *,
        background: ArrayLike | None = None,
        down: int = 1,  # 2: each lattice has every second row
        right: int = 1,
        **how: Any,  # other arguments of `Objective`
    ) -> None:
        if down not in (1, 2) or right not in (1, 2):
            raise UsageError(f"the steps are {down} and {right}; each must be 1 or 2")
        self.height, self.width = target.shape[:2]
        self._down, self._right = min(down, self.height), min(right, self.width)  # a side of one pixel has the step 1
        high, wide = 1 / self._down, 1 / self._right
        self._scale = np.array([wide, high, wide, high, high, 1, 1, 1], np.float32)  # of x, y, l11, l21, l22, colours
        self.threads = thread_count(threads)
        self._origins = [(y, x) for y in range(self._down) for x in range(self._right)]
        background_splats = np.zeros((0, 8), np.float32) if background is None else np.asarray(background, np.float32)
        self._objectives = [
            Objective(
                target[y :: self._down, x :: self._right], threads,
                background=self._on_lattice(background_splats, y, x), **how,
            )
            for y, x in self._origins
        ]  # fmt: skip

    def evaluate(self, parameters: F4, turn: int = 0, *, drawn: bool = False) -> tuple[float, F4]:
        """The loss and its gradient (N, 8) f4 for splats (N, 8) f4, on the lattice of a turn.

        `drawn` is that of `Objective.evaluate`; `quarter` then renders nothing.
        """
        turn %= len(self._objectives)
        moved = self._on_lattice(parameters, *self._origins[turn])
        loss, gradient = self._objectives[turn].evaluate(moved, drawn=drawn)
        return loss, gradient * self._scale

    def hold(self, parameters: F4) -> None:
        """From now on splats (n, 8) f4 are in every picture, as in `Objective.hold`."""
        for objective, origin in zip(self._objectives, self._origins, strict=True):
            objective.hold(self._on_lattice(parameters, *origin))

    def quarter(self) -> F4:
        """Every second pixel of every second row of the picture, (ceil(H / 2), ceil(W / 2), 3) f4, of turn 0.

        The picture is that of the parameters which were evaluated last in that turn.
        """
        return self._objectives[0].picture()[:: 3 - self._down, :: 3 - self._right]

    def _on_lattice(self, parameters: F4, y: int, x: int) -> F4:
        """The splats (N, 8) f4 on the picture of the lattice that begins with the pixel in row y and column x."""
        moved = np.asarray(parameters, np.float32) * self._scale
        for column, origin in enumerate((x, y)):
            half = np.float32(0.5)
            # Centres of pixels are at .5, and the first of the lattice is that of `origin`.
            moved[:, column] = (parameters[:, column] - (np.float32(origin) + half)) * self._scale[column] + half
        return moved
