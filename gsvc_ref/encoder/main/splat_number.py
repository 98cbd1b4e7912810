"""How many splats go with a step D that is asked for: `quantizer_for`, the other way round."""

from typing import Final

from numpy.random import Generator

from gsvc_base.portable import power
from gsvc_ref.encoder.main.intra import grow, quantizer_for
from gsvc_ref.encoder.main.settings import IntraSettings
from gsvc_ref.encoder.main.target import Target

STEPS_PER_DOUBLING: Final = 7.0
"""By how many eighths of an octave D falls with twice the splats; measured on four pictures, 5 to 11."""

CLOSE: Final = 2
"""A quantiser of the rule that is as close as this to the one asked for is not improved."""

TRIES: Final = 3
"""Maximum number of fits."""


def splats_for(
    target: Target, quantizer: int, rng: Generator, settings: IntraSettings, *, splats: int, most_splats: int
) -> int:
    """The number of splats for which `quantizer_for` gives about this quantiser, found by fits of other numbers.

    Parameters
    ----------
    target
        The picture.
    quantizer
        0..79.
    rng, settings
        As in `encode_intra`.
    splats, most_splats
        The first number that is tried, and the largest.
    """
    number, seed = min(splats, most_splats), rng.spawn(TRIES)
    for attempt in seed:
        z = grow(target, max(1, round(settings.surplus * number)), attempt, settings)
        missing = quantizer_for(z) - quantizer
        if abs(missing) <= CLOSE:
            return number
        following = min(max(1, round(number * float(power(2.0, missing / STEPS_PER_DOUBLING)))), most_splats)
        if following == number:
            return number
        number = following
    return number
