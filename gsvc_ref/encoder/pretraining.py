"""Pre-training of frames, whose losses tell a cut (paper section 3.6)."""

import numpy as np

from gsvc_base.arrays import F4
from gsvc_base.splats import Splats
from gsvc_ref.encoder.initialization import image_start
from gsvc_ref.encoder.settings import Settings
from gsvc_ref.rendering import Objective
from gsvc_ref.training import (
    KEPT_WEIGHT,
    NEW,
    FitSettings,
    Population,
    fit,
    random_splats,
    uniform_numbers,
)
from gsvc_ref.training.reduction import reduced


class Pretraining:
    """Pre-trains frame after frame, from scratch and from the frame before (paper, algorithm 1, steps 1 and 2)."""

    def __init__(self, settings: Settings) -> None:
        self.settings, self.detection = settings, settings.detection
        self.rng = np.random.default_rng([settings.seed, 0x444B53])
        self.before: Splats | None = None
        self.iterations = 0  # made so far, of all frames

    def losses(self, picture: F4) -> tuple[float, float | None]:
        """The losses of a picture (H, W, 3) f4 as an I-frame and as a P-frame; the first frame has no second one."""
        small = reduced(picture, self.detection.longest_side)
        objective = Objective(small, **self.settings.computing)
        height, width = small.shape[:2]
        count = min(
            self.settings.splat_count(picture.shape[1], picture.shape[0]), self.detection.splats or width * height
        )
        start = image_start(small, count, self.rng) if self.detection.start == "image" else None
        intra_loss, splats = self._fit(
            start or random_splats(uniform_numbers(count, self.rng), width, height), objective, self.detection.intra_fit
        )
        inter_loss = None
        if self.before is not None:
            inter_loss, _ = self._fit(self.before, objective, self.detection.inter_fit)
        self.before = splats
        return intra_loss, inter_loss

    def _fit(self, start: Splats, objective: Objective, fit_settings: FitSettings) -> tuple[float, Splats]:
        """A short fit without pruning: its loss and splats."""
        settings = fit_settings.with_(iterations=self.detection.iterations, pruning=None)
        population = Population(start, KEPT_WEIGHT, np.full(len(start), NEW, np.int64), settings.optimizer)
        loss, made = fit(population, objective, settings)
        self.iterations += made
        return loss, population.splats()
