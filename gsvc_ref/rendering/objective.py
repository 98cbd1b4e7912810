"""The loss that training descends, and its gradient, in one pass over the tiles."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_base.arrays import F4
from gsvc_base.errors import UsageError
from gsvc_base.splats import PARAMETERS_PER_SPLAT
from gsvc_ref.rendering.fast.jobs import LOSS, LOSS_AND_GRADIENTS, PICTURE, Job
from gsvc_ref.rendering.fast.rasterizer import Rasterizer
from gsvc_ref.rendering.fast.regions import Regions
from gsvc_ref.rendering.fast.threads import thread_count
from gsvc_ref.rendering.fast.tile_pictures import to_tiles
from gsvc_ref.rendering.fast.tiles import EMPTY
from gsvc_ref.rendering.losses import total_loss
from gsvc_ref.rendering.precision import Precision, check_precision


class Objective:
    """The paper's L2 between a target and the picture of a set of splats, with its gradient.

        L2 = 1/(H W) * sum over pixels of ||clamp(C, 0, 1) - target||^2

    summed over the three channels, not averaged: it is three times the mean squared error (paper section 3.7; the
    thresholds of the convergence and key-frame rules depend on this factor).

    The gradient uses dL/dC = 2 (clamp(C, 0, 1) - target) / (H W) everywhere. Where C is inside [0, 1] that is the
    derivative. Where C lies outside, the clamp's own derivative would be zero and the pixel would stop pulling; handed
    straight through, it pulls C back as long as the target is not at the same bound, and overshoot over a saturated
    target costs nothing.

    The results have the same bits for any number of threads. One objective serves one thread at a time; several
    objectives can work side by side.
    """

    def __init__(
        self,
        target: ArrayLike,  # (H, W, 3), R'G'B' with 1.0 = full scale
        threads: int | None = None,
        *,
        precision: Precision = "fast",
        background: ArrayLike | None = None,  # (B, 8) f4, splats of every picture, such as those of lower layers
    ) -> None:
        check_precision(precision, ("fast", "deterministic"))
        picture = np.ascontiguousarray(target, np.float32)  # (H, W, 3) f4
        if picture.ndim != 3 or picture.shape[2] != 3 or picture.size == 0:
            raise UsageError(f"the target has shape {picture.shape}; it must be (H, W, 3) with at least one pixel")
        if not np.isfinite(picture).all():
            raise UsageError("the target has a value that is NaN or infinite; 1.0 is full scale")
        self.height, self.width = picture.shape[:2]
        self.threads = thread_count(threads)
        self._target = to_tiles(picture)  # (tiles, H * ROW) f4
        self._picture = picture
        self._pixels = self.height * self.width
        self._losses = np.zeros(len(self._target))  # (tiles,) f8
        self._rasterizer = Rasterizer(self.width, self.height, threads)
        self._regions = Regions.all_of(len(self._target), self.height, self.height)
        self._job = Job(self.width, self.height, strict=precision == "deterministic")
        self._background = EMPTY
        if background is not None and len(packed := _checked(background)):
            self._rasterizer.binning.load(packed)
            # The background is rendered once: the sum of every pixel begins with it.
            self._background = to_tiles(self._draw(EMPTY, clamp=False))
            self._rasterizer.binning.load(packed[:0])
        self._base = self._background  # and the sum of the frozen splats
        self._moving: NDArray[np.int64] | None = None  # the indices of the others; None: all
        self._count = 0  # splats in all where some are frozen
        self._drawn: F4 | None = None  # the picture of the parameters evaluated last, where it was kept

    def evaluate(self, parameters: ArrayLike, *, drawn: bool = False) -> tuple[float, F4]:
        """The loss, summed in binary64 in a fixed order, and its gradient (N, 8) f4 for splats (N, 8) f4 (R-10.2-1).

        `drawn` keeps the picture, for which `picture` would have to render the splats again.
        """
        loss = self._run(parameters, LOSS_AND_GRADIENTS, self._new_picture() if drawn else None)
        gradient = self._rasterizer.gradients(2 / self._pixels)  # (10-2)
        if self._moving is None:
            return loss, gradient
        of_all = np.zeros((self._count, PARAMETERS_PER_SPLAT), np.float32)  # (N, 8) f4
        of_all[self._moving] = gradient
        return loss, of_all

    def freeze(self, parameters: ArrayLike, frozen: ArrayLike) -> None:
        """Hold some of the splats (N, 8) fixed: they are rendered once, and their rows of the gradient are zero.

        `frozen` is (N,) bool; all False is `thaw`. The sum of a pixel then begins with the frozen splats in index order
        and goes on with the others. `evaluate` still takes all N splats, and ignores the parameters of frozen ones.
        """
        packed, held = _checked(parameters), np.asarray(frozen)
        if held.dtype != np.bool_ or held.shape != (len(packed),):
            raise UsageError(f"frozen is {held.dtype} of shape {held.shape}; it must be bool of shape (N,)")
        self.thaw()
        if held.any():
            self._count = len(packed)
            self._rasterizer.binning.load(packed[held])
            self._base = to_tiles(self._draw(self._background, clamp=False))
            self._moving = np.flatnonzero(~held)

    def thaw(self) -> None:
        """Hold no splat fixed."""
        self._base, self._moving, self._drawn = self._background, None, None

    def hold(self, parameters: ArrayLike) -> None:
        """Add splats (n, 8) f4 to the background, in place of those that were held or frozen before; none: only it.

        They are rendered once.
        """
        packed = _checked(parameters)
        self.thaw()
        if len(packed):
            self._rasterizer.binning.load(packed)
            self._base = to_tiles(self._draw(self._background, clamp=False))

    def loss(self, parameters: ArrayLike, *, drawn: bool = False) -> float:
        """The loss alone: the same bits as `evaluate` returns, in about 40 % of its time; `drawn` is as there."""
        return self._run(parameters, LOSS, self._new_picture() if drawn else None)

    def picture(self) -> F4:
        """The picture (H, W, 3) f4, clamped to [0, 1], of the parameters evaluated last (black before that)."""
        return self._draw(self._base, clamp=True) if self._drawn is None else self._drawn.copy()

    def residual(self) -> F4:
        """The residual (H, W, 3) f4 of the parameters evaluated last: `picture()` minus the target."""
        drawn = self._draw(self._base, clamp=True) if self._drawn is None else self._drawn
        return np.asarray(drawn - self._picture)

    def _draw(self, base: F4, *, clamp: bool) -> F4:
        """The picture (H, W, 3) f4 of the splats loaded last, on a base."""
        picture = self._new_picture()
        job = self._job._replace(kind=PICTURE, base=base, picture=picture.reshape(self.height, -1), clamp=clamp)
        self._rasterizer.run(job, self._regions)
        return picture

    def _new_picture(self) -> F4:
        """Room for a picture, (H, W, 3) f4."""
        return np.empty((self.height, self.width, 3), np.float32)

    def _run(self, parameters: ArrayLike, kind: int, drawn: F4 | None = None) -> float:
        """Load the splats that are not frozen and do a job, which may draw the picture too; return the loss."""
        packed = _checked(parameters)
        if self._moving is not None:
            if len(packed) != self._count:
                raise UsageError(
                    f"there are {len(packed)} splats; some of {self._count} are frozen, so give all of those"
                )
            packed = packed[self._moving]
        self._rasterizer.binning.load(packed)
        moments = self._rasterizer.moments if kind == LOSS_AND_GRADIENTS else EMPTY
        job = self._job._replace(
            kind=kind, base=self._base, target=self._target, losses=self._losses, moments=moments,
            picture=EMPTY if drawn is None else drawn.reshape(self.height, -1), clamp=True,
        )  # fmt: skip
        self._rasterizer.run(job, self._regions)
        self._drawn = drawn
        return total_loss(self._losses, self._pixels)


def _checked(parameters: ArrayLike) -> F4:
    """The parameters as (N, 8) f4, all of them finite."""
    packed = np.asarray(parameters, np.float32)
    if packed.ndim != 2 or packed.shape[1] != PARAMETERS_PER_SPLAT:
        raise UsageError(f"the parameters have shape {packed.shape}; they must be (N, {PARAMETERS_PER_SPLAT})")
    if not np.isfinite(packed).all():
        bad = int(np.argwhere(~np.isfinite(packed))[0, 0])
        raise UsageError(f"splat {bad} has a parameter that is NaN or infinite; every parameter must be finite")
    return packed
