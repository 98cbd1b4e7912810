"""What computes the loss of splats and its gradient: the CPU, or a device that another package offers."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, Protocol, cast

import numpy as np

from gsvc_base.arrays import F4
from gsvc_base.errors import UsageError
from gsvc_ref import plugins
from gsvc_ref.rendering.fast.jobs import LOSS, LOSS_AND_GRADIENTS, PICTURE, Job
from gsvc_ref.rendering.fast.rasterizer import Rasterizer
from gsvc_ref.rendering.fast.regions import Regions
from gsvc_ref.rendering.fast.tile_pictures import to_tiles
from gsvc_ref.rendering.fast.tiles import EMPTY
from gsvc_ref.rendering.losses import total_loss
from gsvc_ref.rendering.precision import Precision, check_precision


class Evaluator(Protocol):
    """The loss of splats against one target, and its gradient, on one device.

    `Objective` has checked all arguments: splats are (N, 8) f4 and finite. The sum of a pixel begins with the
    background, goes on with the splats held, and ends with those evaluated, each in index order. On one device the same
    calls give the same bits. Where the device fails, or is not there, a RuntimeError says in a sentence what to do.
    """

    def hold(self, splats: F4) -> None:
        """From now on these splats are in every picture, in place of those held before."""

    def evaluate(self, splats: F4, *, drawn: bool) -> tuple[float, F4]:
        """The loss and its gradient (N, 8) f4 by the splats alone (R-10.2-1); `drawn`: `picture` will follow."""

    def loss(self, splats: F4, *, drawn: bool) -> float:
        """The loss alone."""

    def picture(self) -> F4:
        """A new array: the picture (H, W, 3) f4, clamped to [0, 1], of the splats evaluated last (none before)."""


def make_evaluator(target: F4, background: F4, device: str, precision: Precision, threads: int | None) -> Evaluator:
    """The evaluator of a device, for a target (H, W, 3) f4 and splats (B, 8) f4 that are in every picture.

    A device other than ``cpu`` has a precision and threads of its own, and computes as fast as it can.
    """
    check_precision(precision, ("fast", "deterministic"))
    check_device(device, precision)
    if device == plugins.CPU:
        return CpuEvaluator(target, background, precision, threads)
    made = _explained(device, plugins.devices()[device].load())(target, background)
    asked = {name: _explained(device, getattr(made, name)) for name in ("hold", "evaluate", "loss", "picture")}
    return cast(Evaluator, SimpleNamespace(**asked))


def check_device(device: str, precision: Precision) -> None:
    """Refuse a device that is not there, or that cannot have this precision."""
    plugins.check_device(device)
    if device != plugins.CPU and precision == "deterministic":
        raise UsageError(f"precision deterministic computes on the CPU: leave out device {device}, or the precision")


def _explained(device: str, call: Callable[..., Any]) -> Callable[..., Any]:
    """A call whose RuntimeErrors become UsageErrors: an encode that they end keeps the frames done so far."""

    def explained(*arguments: Any, **named: Any) -> Any:
        try:
            return call(*arguments, **named)
        except RuntimeError as error:
            raise UsageError(f"device {device}: {error}") from error

    return explained


class CpuEvaluator:
    """The `Evaluator` of the CPU, in one pass over the tiles; the bits do not depend on the number of threads."""

    def __init__(self, target: F4, background: F4, precision: Precision, threads: int | None) -> None:
        self._shape = height, width, _ = target.shape
        self._target = to_tiles(target)  # (tiles, H * ROW) f4
        self._losses = np.zeros(len(self._target))  # (tiles,) f8
        self._rasterizer = Rasterizer(width, height, threads)
        self._regions = Regions.all_of(len(self._target), height, height)
        self._job = Job(width, height, strict=precision == "deterministic")
        self._background = self._base = EMPTY  # what sums begin with: without and with the splats held
        self._drawn: F4 | None = None  # the picture of the splats evaluated last, where it was kept
        self.hold(background)
        self._background = self._base
        self._rasterizer.binning.load(background[:0])

    def hold(self, splats: F4) -> None:
        """Render the splats once: every sum begins with theirs."""
        self._base, self._drawn = self._background, None
        if len(splats):
            self._rasterizer.binning.load(splats)
            self._base = to_tiles(self._draw(clamp=False))

    def evaluate(self, splats: F4, *, drawn: bool) -> tuple[float, F4]:
        """As `Evaluator.evaluate`."""
        height, width, _ = self._shape
        return self._loss(splats, LOSS_AND_GRADIENTS, drawn), self._rasterizer.gradients(2 / (height * width))  # (10-2)

    def loss(self, splats: F4, *, drawn: bool) -> float:
        """As `Evaluator.loss`: the same bits as `evaluate` returns, in about 40 % of its time."""
        return self._loss(splats, LOSS, drawn)

    def picture(self) -> F4:
        """As `Evaluator.picture`; where it was not drawn on the way, the splats are rendered again."""
        return self._draw(clamp=True) if self._drawn is None else self._drawn.copy()

    def _loss(self, splats: F4, kind: int, drawn: bool) -> float:
        """Load splats, and do a job that finds their loss and may draw their picture."""
        self._rasterizer.binning.load(splats)
        self._drawn = np.empty(self._shape, np.float32) if drawn else None
        self._run(kind, self._drawn, clamp=True)
        return total_loss(self._losses, self._shape[0] * self._shape[1])

    def _draw(self, *, clamp: bool) -> F4:
        """The picture (H, W, 3) f4 of the splats loaded last, on the base."""
        picture = np.empty(self._shape, np.float32)
        self._run(PICTURE, picture, clamp=clamp)
        return picture

    def _run(self, kind: int, picture: F4 | None, *, clamp: bool) -> None:
        """Do a job with the splats loaded last; their picture is drawn where there is one to draw into."""
        job = self._job._replace(
            kind=kind, base=self._base, target=self._target, losses=self._losses, clamp=clamp,
            moments=self._rasterizer.moments if kind == LOSS_AND_GRADIENTS else EMPTY,
            picture=EMPTY if picture is None else picture.reshape(len(picture), -1),
        )  # fmt: skip
        self._rasterizer.run(job, self._regions)
