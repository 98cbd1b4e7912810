"""The loss of splats against a picture, and its gradients, all of it on the device (spec.md 10.2, 10.3)."""

from collections.abc import Callable
from typing import Any, Final

import numpy as np

from gsvc_conformance.adapters.cuda.device import Buffer, address, download, launch, replay, storage
from gsvc_conformance.adapters.cuda.rendering import GRADIENT_WARPS, Scene

FIRST_SLOTS: Final = 32
"""Slots of a splat that there is room for at first, on average; there will be more where they are needed."""


class Evaluation:
    """The loss (10-1) of sets of splats against one target, and their gradients: buffers in, buffers out.

    Parameters
    ----------
    target
        (H, W, 3) f4, 1 is full scale.
    width, height
        Of it, in pixels.
    most_splats
        There is room for so many.
    base
        A sum (H, W, 3) f4 that the splats come on top of, such as that of splats which do not move.
    slots
        There is room for the moments of so many pairs of a splat and a block of its box, at first.

    Attributes
    ----------
    gradients
        Those of the splats evaluated last, (N, 8) f4.
    """

    def __init__(
        self, target: Buffer, width: int, height: int, most_splats: int, *, base: Buffer | None = None,
        slots: int | None = None,
    ) -> None:  # fmt: skip
        self.target, self.base = target, base
        self.gradients = storage(32 * most_splats)
        self._told = storage(16)
        self._make_room(width, height, most_splats, FIRST_SLOTS * most_splats if slots is None else slots)
        self._tiles = GRADIENT_WARPS * self.scene.blocks[0] * self.scene.blocks[1]
        self._losses = storage(8 * self._tiles)

    def _make_room(self, width: int, height: int, most_splats: int, slots: int) -> None:
        self.scene = Scene(width, height, most_splats, slots=max(slots, 1))
        self._recorded: tuple[tuple[Any, ...], Callable[[], None]] | None = None

    def start(self, parameters: Buffer, count: int, *, gradients: bool = True, picture: Buffer | None = None) -> None:
        """Launch an evaluation of splats (count, 8) f4 and return at once: `device.replay` may record it.

        `gradients` says whether there are any, and `picture` gets the sums (H, W, 3) f4 of the splats on their base.
        """
        scene = self.scene
        pixels, told = scene.width * scene.height, (self.base, self.target)
        scene.fill(parameters, count)
        if gradients:
            scene.draw("loss_and_gradients", GRADIENT_WARPS, *told, self._losses, scene.moments, picture)
            scene.gradients(parameters, count, 2 / pixels, self.gradients)  # (10-2)
        else:
            scene.draw("loss_of_splats", GRADIENT_WARPS, *told, self._losses, picture)
        launch("add_losses", 1, 256, self._losses, self._tiles, np.float64(1 / pixels), scene.slots_needed, self._told)

    def evaluate(
        self, parameters: Buffer, count: int, *, gradients: bool = True, picture: Buffer | None = None
    ) -> float:
        """The loss of splats, for which it waits; `gradients` and `picture` as in `start`.

        Whoever keeps the buffers and the number of splats has the launches of an evaluation recorded and replayed.
        """
        key = count, gradients, *(one if one is None else address(one) for one in (parameters, picture, self.base))
        if self._recorded is None or self._recorded[0] != key:
            self._recorded = key, replay(lambda: self.start(parameters, count, gradients=gradients, picture=picture))
        else:
            self._recorded[1]()
        loss, slots_needed = download(self._told, (2,), "f8")
        if gradients and slots_needed > self.scene.slots:
            scene = self.scene
            self._make_room(scene.width, scene.height, scene.most_splats, int(slots_needed * 1.25))
            return self.evaluate(parameters, count, gradients=gradients, picture=picture)
        return float(loss)
