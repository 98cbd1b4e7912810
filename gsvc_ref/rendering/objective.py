"""The loss that training descends, and its gradient."""

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_base.arrays import F4
from gsvc_base.errors import UsageError
from gsvc_base.splats import PARAMETERS_PER_SPLAT
from gsvc_ref import plugins
from gsvc_ref.rendering.evaluator import make_evaluator
from gsvc_ref.rendering.fast.threads import thread_count
from gsvc_ref.rendering.precision import Precision

OnEvaluation = Callable[[float], None]
"""Called with the loss after each evaluation of a gradient."""

_NO_SPLATS: Final[F4] = np.zeros((0, PARAMETERS_PER_SPLAT), np.float32)


class Objective:
    """The paper's L2 between a target and the picture of a set of splats, with its gradient.

        L2 = 1/(H W) * sum over pixels of ||clamp(C, 0, 1) - target||^2

    summed over the three channels, not averaged: it is three times the mean squared error (paper section 3.7; the
    thresholds of the convergence and key-frame rules depend on this factor).

    The gradient uses dL/dC = 2 (clamp(C, 0, 1) - target) / (H W) everywhere. Where C is inside [0, 1] that is the
    derivative. Where C lies outside, the clamp's own derivative would be zero and the pixel would stop pulling; handed
    straight through, it pulls C back as long as the target is not at the same bound, and overshoot over a saturated
    target costs nothing.

    An `Evaluator` computes it: on the CPU with the same bits for any number of threads, on another device with other
    ones. One objective serves one thread at a time; several objectives can work side by side.
    """

    def __init__(
        self,
        target: ArrayLike,  # (H, W, 3), R'G'B' with 1.0 = full scale
        threads: int | None = None,
        *,
        precision: Precision = "fast",
        background: ArrayLike | None = None,  # (B, 8) f4, splats of every picture, such as those of lower layers
        device: str = plugins.CPU,
        on_evaluation: OnEvaluation | None = None,
    ) -> None:
        picture = np.ascontiguousarray(target, np.float32)  # (H, W, 3) f4
        if picture.ndim != 3 or picture.shape[2] != 3 or picture.size == 0:
            raise UsageError(f"the target has shape {picture.shape}; it must be (H, W, 3) with at least one pixel")
        if not np.isfinite(picture).all():
            raise UsageError("the target has a value that is NaN or infinite; 1.0 is full scale")
        self.height, self.width = picture.shape[:2]
        self.threads = thread_count(threads)
        self._target, self._on_evaluation = picture, on_evaluation
        behind = _checked(_NO_SPLATS if background is None else background)
        self._evaluator = make_evaluator(picture, behind, device, precision, threads)
        self._moving: NDArray[np.int64] | None = None  # the indices of the splats that are not frozen; None: all
        self._count = 0  # splats in all where some are frozen

    def evaluate(self, parameters: ArrayLike, *, drawn: bool = False) -> tuple[float, F4]:
        """The loss, summed in binary64 in a fixed order, and its gradient (N, 8) f4 for splats (N, 8) f4 (R-10.2-1).

        `drawn` keeps the picture, for which `picture` would have to render the splats again.
        """
        loss, gradient = self._evaluator.evaluate(self._moved(parameters), drawn=drawn)
        if self._on_evaluation:
            self._on_evaluation(loss)
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
        self.hold(packed[held])
        if held.any():
            self._count, self._moving = len(packed), np.flatnonzero(~held)

    def thaw(self) -> None:
        """Hold no splat fixed."""
        self.hold(_NO_SPLATS)

    def hold(self, parameters: ArrayLike) -> None:
        """Add splats (n, 8) f4 to the background, in place of those that were held or frozen before; none: only it."""
        self._evaluator.hold(_checked(parameters))
        self._moving = None

    def loss(self, parameters: ArrayLike, *, drawn: bool = False) -> float:
        """The loss alone, in less time than `evaluate` takes; `drawn` is as there."""
        return self._evaluator.loss(self._moved(parameters), drawn=drawn)

    def picture(self) -> F4:
        """The picture (H, W, 3) f4, clamped to [0, 1], of the parameters evaluated last (black before that)."""
        return self._evaluator.picture()

    def residual(self) -> F4:
        """The residual (H, W, 3) f4 of the parameters evaluated last: `picture()` minus the target."""
        picture = self._evaluator.picture()
        picture -= self._target
        return picture

    def _moved(self, parameters: ArrayLike) -> F4:
        """The parameters (n, 8) f4 of the splats that are not frozen."""
        packed = _checked(parameters)
        if self._moving is None:
            return packed
        if len(packed) != self._count:
            raise UsageError(f"there are {len(packed)} splats; some of {self._count} are frozen, so give all of those")
        return packed[self._moving]


def _checked(parameters: ArrayLike) -> F4:
    """The parameters as (N, 8) f4, all of them finite."""
    packed = np.asarray(parameters, np.float32)
    if packed.ndim != 2 or packed.shape[1] != PARAMETERS_PER_SPLAT:
        raise UsageError(f"the parameters have shape {packed.shape}; they must be (N, {PARAMETERS_PER_SPLAT})")
    if not np.isfinite(packed).all():
        bad = int(np.argwhere(~np.isfinite(packed))[0, 0])
        raise UsageError(f"splat {bad} has a parameter that is NaN or infinite; every parameter must be finite")
    return packed
