"""Hard because they last: thousands of steps of learned scales and of codebooks."""

from typing import Final

import numpy as np
from mpmath import mpf
from numpy.typing import NDArray

from gsvc_ref.paper.lsq_parameters import SCALE_FLOOR
from tests.hard_cases.catalogue import Entry, LongRun
from tests.hard_cases.long_quantizers import (
    CHOSEN,
    DOWN,
    RVQ,
    UPDATES,
    VECTORS,
    averages,
    averages_in_binary32,
    begun,
    scale_learned_itself,
    scales,
)
from tests.hard_cases.measuring import Measurement, Objects, Truth, Worst, compared, exactly, precise

FLOOR: Final = float(SCALE_FLOOR)


def pulled_down() -> Measurement:
    """The scale at the end of the pull, which is the floor: none is below, and none stays above."""

    def error(scale: NDArray[np.float32]) -> float:
        return float(abs(scale - np.float64(FLOOR)).max())

    return Measurement({"gsvc_ref": Worst(error(scales()[DOWN]), 0.0)}, Worst(error(scale_learned_itself()), 0.0))


@precise
def averaged() -> Measurement:
    """(10-22) as a closed form: a^k old + (1 - a^k) batch."""
    faded = mpf(RVQ.decay) ** UPDATES

    def after(old: Objects, batch: Objects) -> Objects:
        return faded * old + (1 - faded) * batch

    users = [exactly(VECTORS[CHOSEN[:, 0] == b]) for b in range(3)]
    counts = after(exactly(begun().counts[0]), exactly(np.array([len(part) for part in users])))
    none = exactly(np.zeros(3))
    sums = after(exactly(begun().sums[0]), np.stack([sum(part, none) for part in users]))
    # Four roundings of binary64 an update, of numbers that are at most those of the start, and fade with the others.
    bound = 4 * 2.0**-53 / (1 - RVQ.decay) * 100

    def worst(found: tuple[NDArray[np.floating], NDArray[np.floating]]) -> Worst:
        pairs = (compared(Truth(true), part, bound) for true, part in zip((counts, sums), found, strict=True))
        return max(pairs, key=lambda one: one.rank)

    return Measurement({"gsvc_ref": worst(averages())}, worst(averages_in_binary32()))


CASES: Final[tuple[Entry, ...]] = (
    LongRun(
        "a_scale_pulled_below_zero",
        "lsq_gradients",
        "A scale that every step makes smaller becomes 0, then negative: codes are infinite, then mirrored.",
        "The logarithm is learned, by steps of at most 2.4 % at this rate, and 2^-24 px is the floor: a finer step is "
        "lost in the rounding of a value near 1 px.",
        "Adan on the scale itself",
        pulled_down,
    ),
    LongRun(
        "averages_of_5000_updates",
        "rvq_update",
        "A decay and its complement, each rounded for itself, do not add up to 1, and averages settle elsewhere.",
        "Averages forget: an error fades like what it is an error of, so that the whole is 4 roundings / (1 - a).",
        "averages in binary32",
        averaged,
    ),
)
