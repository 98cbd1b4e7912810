"""The errors of a few settings as pictures."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from gsvc_base.arrays import F8, U1
from gsvc_lab.accuracy.groups import Group
from gsvc_lab.accuracy.measure import STEPS
from gsvc_lab.accuracy.work import CutOff, SourcePicture

SHOWN: Final = (("precision", "fast"), ("precision", "deterministic"), ("cutoff", "1/255"))
"""The settings whose errors are shown, where their group is measured."""

QUANTILE: Final = 0.999
"""Fraction of the samples that is shown without being clipped."""

GREY_LEVELS: Final = 120
"""Grey levels on either side of the middle."""


@dataclass(frozen=True, eq=False)
class ErrorPicture:
    """The errors of a setting, amplified."""

    group: Group  # The group, and the name of its setting
    setting: str
    picture: U1  # (H, W, 3) u1, 128 where there is no error
    gain: float  # number of grey levels for an error of one step of 8 bits


def error_pictures(picture: SourcePicture, groups: tuple[Group, ...]) -> tuple[ErrorPicture, ...]:
    """The errors of the settings that are SHOWN."""
    found = []
    for group in groups:
        for setting in group.settings:
            if (group.name, setting.name) in SHOWN:
                reference = picture.uncut if isinstance(setting.work, CutOff) else picture.exact
                error = setting.work.run(picture, 0) - reference
                found.append(ErrorPicture(group, setting.name, *amplified(error * STEPS)))
    return tuple(found)


def amplified(error: F8) -> tuple[U1, float]:
    """Errors (H, W, 3) in steps of 8 bits as a picture around grey, and its gain: 1, 2 or 5 times a power of ten."""
    usual = float(np.quantile(np.abs(error), QUANTILE))
    if usual == 0:
        return np.full(error.shape, 128, np.uint8), 1.0
    power = 10.0 ** math.floor(math.log10(GREY_LEVELS / usual))
    gain = max(factor * power for factor in (1, 2, 5) if factor * power <= GREY_LEVELS / usual)
    return np.clip(np.rint(128 + gain * error), 0, 255).astype(np.uint8), gain
