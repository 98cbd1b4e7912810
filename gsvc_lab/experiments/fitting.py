"""Fitting one picture as the encoder fits an I-frame, before quantisation, and measuring what came of it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gsvc_base.arrays import Frame
from gsvc_base.splats import Splats
from gsvc_lab.clips import as_picture
from gsvc_ref.encoder.main.target import Target
from gsvc_ref.encoder.quick import grown
from gsvc_ref.encoder.settings.paper import FrameSettings
from gsvc_ref.metrics import ms_ssim, ms_ssim_scales, psnr
from gsvc_ref.rendering import Objective, Renderer
from gsvc_ref.training import NEW, NEW_WEIGHT, FitSettings, Population, fit, random_splats, uniform_numbers


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

    `threads`: threads to compute with; None: all.
    """

    def __init__(self, frame: Frame, threads: int | None) -> None:
        self.frame = frame  # (H, W, 3) u1
        self.samples = as_picture(frame)  # (H, W, 3) f4
        self.height, self.width = frame.shape[:2]
        self.threads, self.objective = threads, Objective(self.samples, threads)
        self._renderer = Renderer(self.width, self.height, threads=threads)

    def rendered(self, splats: Splats) -> Frame:
        """The decoded picture of splats, (H, W, 3) u1."""
        return np.asarray(self._renderer.frame(splats, 8))

    def quality(self, splats: Splats) -> Quality:
        """The quality of that picture."""
        decoded = self.rendered(splats)
        return Quality(psnr(self.frame, decoded, 255), ms_ssim(self.frame, decoded, 255))


def fitted(
    picture: Picture,
    settings: FrameSettings,  # settings of an I-frame
    count: int,  # splats at the start, at random places
    seed: int,  # seed of the start
    # Called after each iteration with its number, the loss that it began with, and the population
    on_step: Callable[[int, float, Population], None] | None = None,
    *,
    weight: float = NEW_WEIGHT,  # the w that all splats begin with
) -> tuple[Population, int]:
    """Fit a picture as an I-frame of preset `paper`; the population and the number of iterations made."""
    uniforms = uniform_numbers(count, np.random.default_rng(seed))
    start = random_splats(uniforms, picture.width, picture.height)
    assert isinstance(settings.fit, FitSettings)
    population = Population(start, weight, np.full(count, NEW, np.int64), settings.fit.optimizer)
    step = None if on_step is None else lambda done, _, loss: on_step(done, loss, population)
    _, done = fit(population, picture.objective, settings.fit, step)
    return population, done


def quickly_fitted(picture: Picture, count: int, iterations: int, seed: int) -> tuple[Splats, int]:
    """Fit a picture as an I-frame of preset `quick`; the splats and the number of evaluations made."""
    losses: list[float] = []
    target = Target(picture.samples, threads=picture.threads, on_evaluation=losses.append)
    splats = grown(target, count, iterations, np.random.default_rng(seed))
    return Splats.from_array(splats), len(losses)


def pruned_to(count: int, settings: FrameSettings) -> int:
    """The splats to begin with so that pruning leaves this many."""
    assert isinstance(settings.fit, FitSettings)
    fraction = settings.fit.pruning.fraction if settings.fit.pruning else 0.0
    return round(count / (1 - fraction))
