"""Fitting one picture as the encoder fits an I-frame, before quantisation, and measuring what came of it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gsvc_base.arrays import Frame
from gsvc_base.splats import Splats
from gsvc_lab.clips import as_picture
from gsvc_ref.encoder.frame_settings import FrameSettings
from gsvc_ref.metrics import ms_ssim, ms_ssim_scales, psnr
from gsvc_ref.rendering import Objective, Renderer
from gsvc_ref.training import KEPT_WEIGHT, NEW, NEW_WEIGHT, Population, fit, image_start, random_splats, uniform_numbers
from gsvc_ref.training.coarse import Sizes


@dataclass(frozen=True)
class Quality:
    """The likeness of 8-bit pictures: PSNR in dB over all R'G'B' samples, and MS-SSIM."""

    psnr: float
    ms_ssim: float


def scales_missing(*sizes: tuple[int, int]) -> str:
    """A sentence for pictures (width, height) on which MS-SSIM has not all its five scales, else nothing."""
    least = min(ms_ssim_scales(height, width) for width, height in sizes)
    return f" MS-SSIM has {least} of its 5 scales at this size." if least < 5 else ""


class Picture:
    """A picture to fit splats to.

    Parameters
    ----------
    frame
        (H, W, 3) u1.
    threads
        Threads to compute with; None: all.
    """

    def __init__(self, frame: Frame, threads: int | None) -> None:
        self.frame = frame
        self.samples = as_picture(frame)  # (H, W, 3) f4
        self.height, self.width = frame.shape[:2]
        self.objective = Objective(self.samples, threads)
        self._renderer = Renderer(self.width, self.height, threads=threads)

    def rendered(self, splats: Splats) -> Frame:
        """The decoded picture of splats, (H, W, 3) u1."""
        return np.asarray(self._renderer.frame(splats, 8))

    def quality(self, splats: Splats) -> Quality:
        """The quality of that picture."""
        decoded = self.rendered(splats)
        return Quality(psnr(self.frame, decoded, 255), ms_ssim(self.frame, decoded, 255))


def intra_start(
    picture: Picture, settings: FrameSettings, count: int, rng: np.random.Generator, weight: float | None = None
) -> Population:
    """The splats that an I-frame of `count` splats begins with; a weight replaces that of the settings' start."""
    first = settings.fit.growth.start(count) if settings.fit.growth else count
    if settings.start == "image":
        splats, usual = image_start(picture.samples, first, rng), KEPT_WEIGHT
    else:
        splats, usual = random_splats(uniform_numbers(first, rng), picture.width, picture.height), NEW_WEIGHT
    return Population(splats, usual if weight is None else weight, np.full(first, NEW, np.int64), settings.fit)


def fitted(
    picture: Picture,
    settings: FrameSettings,
    count: int,
    seed: int,
    on_step: Callable[[int, float, Population], None] | None = None,
    *,
    weight: float | None = None,
) -> tuple[Population, int]:
    """Fit a picture as an I-frame; the population and the number of iterations made.

    Parameters
    ----------
    settings
        Settings of an I-frame.
    count
        Splats at the start where they are random, at the end where they grow.
    seed
        Seed of start and growth.
    on_step
        Called after each iteration with its number, the loss that it began with, and the population.
    weight
        The w that all splats begin with; None: that of the settings' start.
    """
    rng = np.random.default_rng(seed)
    population = intra_start(picture, settings, count, rng, weight)
    sizes = Sizes(picture.samples, full=picture.objective)
    step = None if on_step is None else lambda done, _, loss: on_step(done, loss, population)
    _, done = fit(population, picture.objective, settings.fit, rng, total=count, sizes=sizes, on_iteration=step)
    return population, done


def pruned_to(count: int, settings: FrameSettings) -> int:
    """The splats to begin with so that pruning leaves this many."""
    fraction = settings.fit.pruning.fraction if settings.fit.pruning else 0.0
    return round(count / (1 - fraction))
