"""Fitting on the device, for whoever minimises: the loss of splats against a target that stays there, and its gradient.

    gsvc encode --device cuda IN OUT      # gsvc_ref finds `Evaluator` by an entry point, and brings its own optimiser

An evaluation takes the parameters of the splats to the device and their gradient back, 32 bytes a splat each way, and
nothing else. All sums have a fixed order, so a fit has the same bytes in every run on the same card.
"""

from typing import Final

import numpy as np

from gsvc_conformance.adapters.cuda.device import Buffer, Floats, download, storage, upload, write
from gsvc_conformance.adapters.cuda.evaluation import Evaluation

ROOM: Final = 1.25
"""Space for more splats than there are: their number changes from step to step."""


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
        self._shape, self._target, self._picture = target.shape, upload(target, "f4"), storage(target.nbytes)
        self._is_drawn = False  # whether `_picture` has the splats evaluated last
        # What every sum begins with: that of the background, and one with the splats held as well.
        self._background: Buffer | None = None
        self._held: Buffer | None = None
        self._base: Buffer | None = None  # which of the two, or none
        self._make_room(len(background))
        self.hold(background)
        self._background, self._held = self._base, None

    def hold(self, splats: Floats) -> None:
        """From now on these splats, (n, 8) f4, are in every picture, in place of those held before."""
        self._base = self._background
        if len(splats):
            self._load(splats)
            self._held = storage(self._picture.size) if self._held is None else self._held
            self._sum(self._held, self._background)
            self._base = self._held
        self._evaluation.base, self._count, self._is_drawn = self._base, 0, False

    def evaluate(self, splats: Floats, *, drawn: bool) -> tuple[float, Floats]:
        """The loss and its gradient, (N, 8) f4: R-10.2-1 and R-10.3-1; `drawn` keeps the picture."""
        loss = self._loss(splats, drawn, gradients=True)
        return loss, download(self._evaluation.gradients, splats.shape, "f4")

    def loss(self, splats: Floats, *, drawn: bool) -> float:
        """The loss alone."""
        return self._loss(splats, drawn, gradients=False)

    def picture(self) -> Floats:
        """The picture of the splats evaluated last, (H, W, 3) f4, clamped to [0, 1]."""
        if not self._is_drawn:
            self._sum(self._picture, self._base)
            self._is_drawn = True
        sums = download(self._picture, self._shape, "f4")
        return np.fmin(np.fmax(sums, 0, out=sums), 1, out=sums)

    def _loss(self, splats: Floats, drawn: bool, *, gradients: bool) -> float:
        self._load(splats)
        self._is_drawn = drawn
        picture = self._picture if drawn else None
        return self._evaluation.evaluate(self._splats, self._count, gradients=gradients, picture=picture)

    def _sum(self, into: Buffer, base: Buffer | None) -> None:
        """The sum of the splats loaded last on top of another."""
        self._evaluation.scene.fill(self._splats, self._count)
        self._evaluation.scene.sum(into, base)

    def _load(self, splats: Floats) -> None:
        """Bring splats to the device."""
        self._count = len(splats)
        if self._count > self._evaluation.scene.most_splats:
            self._make_room(self._count)
        write(self._splats, splats, "f4")

    def _make_room(self, splats: int) -> None:
        """Take other buffers, for so many splats and some more."""
        height, width, _ = self._shape
        most = max(int(ROOM * splats), 1)
        self._splats = storage(32 * most)
        self._evaluation = Evaluation(self._target, width, height, most, base=self._base)
