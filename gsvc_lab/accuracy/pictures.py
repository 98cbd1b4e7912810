"""Where the errors of a few renderers lie in the picture."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from gsvc_lab.accuracy.choices import Rendering, Subject
from gsvc_lab.accuracy.measure import STEPS
from gsvc_lab.accuracy.oracle import F8
from gsvc_lab.accuracy.rungs import Group
from gsvc_lab.pages.pictures import U1

SHOWN: Final = (("precision", "fast"), ("exp", "degree 2"), ("cutoff", "1/255"))
"""The rungs whose errors are shown, where their group is measured."""

QUANTILE: Final = 0.999
"""This part of the samples is shown without being clipped."""

GREY_LEVELS: Final = 120
"""Grey levels on either side of the middle."""


@dataclass(frozen=True, eq=False)
class ErrorPicture:
    """The errors of a rung, amplified.

    Attributes
    ----------
    group, rung
        Whose they are.
    picture
        (H, W, 3) u1, 128 where there is no error.
    gain
        Grey levels for an error of one step of 8 bits.
    """

    group: Group
    rung: str
    picture: U1
    gain: float


def error_pictures(subject: Subject, groups: tuple[Group, ...]) -> tuple[ErrorPicture, ...]:
    """The errors of the rungs that are SHOWN."""
    found = []
    for group in groups:
        for rung in group.rungs:
            if (group.name, rung.name) in SHOWN:
                uncut = isinstance(rung.choice, Rendering) and rung.choice.uncut
                error = rung.choice.run(subject, 0) - (subject.uncut if uncut else subject.exact)
                found.append(ErrorPicture(group, rung.name, *amplified(error * STEPS)))
    return tuple(found)


def amplified(error: F8) -> tuple[U1, float]:
    """Errors (H, W, 3) in steps of 8 bits as a picture around grey, and its gain: 1, 2 or 5 times a power of ten."""
    usual = float(np.quantile(np.abs(error), QUANTILE))
    if usual == 0:
        return np.full(error.shape, 128, np.uint8), 1.0
    power = 10.0 ** math.floor(math.log10(GREY_LEVELS / usual))
    gain = max(factor * power for factor in (1, 2, 5) if factor * power <= GREY_LEVELS / usual)
    return np.clip(np.rint(128 + gain * error), 0, 255).astype(np.uint8), gain
