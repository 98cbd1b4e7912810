"""The objectives that search a P-frame of profile `main`: all pixels, or a part in turns."""

from typing import Any, Final

from gsvc_base.arrays import F4
from gsvc_ref.encoder.main.target import OnEvaluation
from gsvc_ref.encoder.settings import Settings
from gsvc_ref.rendering import Objective, SampledObjective

HALF_FROM: Final = 48.0
QUARTER_FROM: Final = 160.0
"""Half of the pixels are looked at in turns from the first number of pixels for each splat on, and a quarter from the
second on. With fewer the search follows what single pixels say, and that costs bits."""


def watched_objectives(
    picture: F4,  # (H, W, 3) f4
    beside: F4,  # (B, 8) f4, splats that are in it beside those that are searched
    splats: int,  # all of them, at least 1
    settings: Settings,
    on_evaluation: OnEvaluation,
) -> tuple[Objective, SampledObjective]:
    """The objective of a picture (H, W, 3) f4, and the one that looks at a part of its pixels in turns."""
    pixels = picture[:, :, 0].size / splats
    down, right = (2 if pixels >= least else 1 for least in (HALF_FROM, QUARTER_FROM))
    how: dict[str, Any] = {"threads": settings.threads, "precision": settings.precision, "background": beside}
    objective = _WatchedObjective(picture, **how)
    sampled = _WatchedSamples(picture, **how, down=down, right=right)
    objective.on_evaluation = sampled.on_evaluation = on_evaluation
    return objective, sampled


class _WatchedObjective(Objective):
    on_evaluation: OnEvaluation

    def evaluate(self, parameters: Any, *, drawn: bool = False) -> tuple[float, F4]:
        """As `Objective.evaluate`."""
        loss, gradient = super().evaluate(parameters, drawn=drawn)
        self.on_evaluation(loss)
        return loss, gradient


class _WatchedSamples(SampledObjective):
    on_evaluation: OnEvaluation

    def evaluate(self, parameters: F4, turn: int = 0, *, drawn: bool = False) -> tuple[float, F4]:
        """As `SampledObjective.evaluate`."""
        loss, gradient = super().evaluate(parameters, turn, drawn=drawn)
        self.on_evaluation(loss)
        return loss, gradient
