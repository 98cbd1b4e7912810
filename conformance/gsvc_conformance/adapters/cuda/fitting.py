"""Fitting on the device, for whoever minimises: the loss of splats against a target that stays there, and its gradient.

    gsvc encode --device cuda IN OUT      # gsvc_ref finds `Evaluator` by an entry point, and brings its own optimiser

An evaluation takes the parameters of the splats to the device and their gradient back, 32 bytes a splat each way, and
nothing else. All sums have a fixed order, so a fit has the same bytes in every run on the same card.
"""

import math
from typing import Final

import numpy as np

from gsvc_conformance.adapters.cuda.device import Buffer, Floats, download, launch, storage, upload
from gsvc_conformance.adapters.cuda.rendering import WARPS, Scene

ROOM: Final = 1.25
"""Space for more splats and slots than there are: both change from step to step."""

TOLD: Final = np.dtype([("loss", "f8"), ("slots_needed", "f8")])
"""What `add_losses` of gradients.cu tells; the gradients stand after it, so that both come in one copy."""


class Evaluator:
    """The loss of splats against one target, and its gradient, as gsvc_ref's `rendering.Evaluator` describes it.

    Parameters
    ----------
    target
        (H, W, 3) f4.
    background
        Splats (B, 8) f4 that are in every picture.

    Raises
    ------
    RuntimeError, NotImplementedError
        Here and in all methods: what is missing or has failed, and what to do.
    """

    def __init__(self, target: Floats, background: Floats) -> None:
        self._shape, self._pixels = target.shape, target.shape[0] * target.shape[1]
        self._target, self._none = upload(target, "f4"), upload(background[:0], "f4")
        self._splats, self._count, self._is_drawn = self._none, 0, False
        self._scene = self._new_scene(len(background), 1)
        self._tiles = WARPS * self._scene.blocks[0] * self._scene.blocks[1]
        self._losses, self._picture = storage(8 * self._tiles), storage(target.nbytes)
        self._background: Buffer | None = None  # the sums that every picture begins with, without the splats held,
        self._base: Buffer | None = None  # and with them
        if len(background):
            self.hold(background)
            self._background = self._base

    def hold(self, splats: Floats) -> None:
        """From now on these splats, (n, 8) f4, are in every picture, in place of those held before."""
        self._base = self._background
        if len(splats):
            self._load(splats)
            self._base = storage(4 * 3 * self._pixels)
            self._scene.sum(self._base, self._background)
        self._splats, self._count, self._is_drawn = self._none, 0, False

    def evaluate(self, splats: Floats, *, drawn: bool) -> tuple[float, Floats]:
        """The loss and its gradient, (N, 8) f4: R-10.2-1 and R-10.3-1; `drawn` keeps the picture."""
        self._load(splats)
        result = storage(TOLD.itemsize + splats.nbytes)
        self._draw("loss_and_gradients", self._scene.moments, drawn=drawn)
        self._scene.gradients(self._splats, self._count, 2 / self._pixels, result[TOLD.itemsize :])  # (10-2)
        told, gradients = self._told(result, splats.shape)
        if told["slots_needed"] > self._scene.slots:  # there was no room: again, with some
            self._scene = self._new_scene(self._scene.most_splats, int(ROOM * told["slots_needed"]))
            return self.evaluate(splats, drawn=drawn)
        return float(told["loss"]), gradients

    def loss(self, splats: Floats, *, drawn: bool) -> float:
        """The loss alone."""
        self._load(splats)
        self._draw("loss_of_splats", drawn=drawn)
        return float(self._told(storage(TOLD.itemsize), (0,))[0]["loss"])

    def picture(self) -> Floats:
        """The picture of the splats evaluated last, (H, W, 3) f4, clamped to [0, 1]."""
        if not self._is_drawn:
            self._scene.fill(self._splats, self._count)
            self._scene.sum(self._picture, self._base)
            self._is_drawn = True
        sums = download(self._picture, self._shape, "f4")
        return np.fmin(np.fmax(sums, 0, out=sums), 1, out=sums)

    def _new_scene(self, most_splats: int, slots: int) -> Scene:
        height, width, _ = self._shape
        return Scene(width, height, most_splats, slots=slots)

    def _load(self, splats: Floats) -> None:
        """Bring splats to the device, and list them."""
        self._splats, self._count = upload(splats, "f4"), len(splats)
        if self._count > self._scene.most_splats:
            self._scene = self._new_scene(int(ROOM * self._count), self._scene.slots)
        self._scene.fill(self._splats, self._count)

    def _draw(self, kernel: str, *moments: Buffer, drawn: bool) -> None:
        """Start a kernel that compares the picture with the target, and draws it if it will be wanted."""
        self._is_drawn = drawn
        picture = self._picture if drawn else None
        self._scene.draw(kernel, self._base, self._target, self._losses, *moments, picture)

    def _told(self, into: Buffer, shape: tuple[int, ...]) -> tuple[np.void, Floats]:
        """Add up the losses of tiles, and bring them here with the gradients that stand after them."""
        where = self._losses, self._tiles, np.float64(1 / self._pixels), self._scene.slots_needed
        launch("add_losses", 1, 256, *where, into)
        result = download(into, (TOLD.itemsize + 4 * math.prod(shape),), "u1")
        return result[: TOLD.itemsize].view(TOLD)[0], result[TOLD.itemsize :].view("f4").reshape(shape)
