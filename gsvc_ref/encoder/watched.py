"""The objectives that search a P-frame of profile `main`: all pixels, or a part in turns."""

from typing import Any, Final

from gsvc_base.arrays import F4
from gsvc_ref.encoder.settings import Settings
from gsvc_ref.rendering import Objective, SampledObjective
from gsvc_ref.rendering.objective import OnEvaluation

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
    how: dict[str, Any] = {**settings.computing, "background": beside, "on_evaluation": on_evaluation}
    return Objective(picture, **how), SampledObjective(picture, **how, down=down, right=right)
