"""Errors of single elements as multiples of what is allowed, and their colours on a logarithmic scale."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_conformance.expectations import Bounded, Decision, Exact, Interval

U1 = NDArray[np.uint8]
F8 = NDArray[np.float64]
Expected = Exact | Decision | Bounded | Interval
"""The expectations of an array."""

LEAST_POWER: Final = -3
MOST_POWER: Final = 6
"""The ends of the scale are ratios of 10 to these powers."""
STEPS: Final = 0.0001
"""Distance, in powers of ten, from the colour of 1, which is allowed, to that of what is just not allowed."""
STOPS: Final = (LEAST_POWER, 0.0, STEPS, 3.0, MOST_POWER)
STOP_COLORS: Final = np.array([(24, 28, 36), (42, 157, 143), (255, 214, 10), (222, 40, 30), (128, 0, 64)], np.float64)
"""Dark to green up to 1, yellow to red and crimson above."""
NOT_FINITE: Final = (255, 0, 200)
LIGHT: Final = 140
"""Luma of the darkest colour that black text stands on."""


def error_ratios(expectation: Expected, actual: NDArray[Any]) -> F8:
    """Error/bound of each element, or what stands for it: 0 for a right element, infinity for what is no number.

    Of floating-point numbers that must be exact it is the distance in units in the last place, at least 1 where a bit
    differs; of integers the distance from what is allowed, and 1 more.
    """
    if isinstance(expectation, Bounded):
        with np.errstate(all="ignore"):
            error = abs(actual.astype(np.float64) - expectation.value)
            ratio = np.where(error == 0, 0.0, error / np.asarray(expectation.bound, np.float64))
            ratio = np.where(actual == expectation.value, 0.0, ratio)  # an infinity that is expected
        return np.where(np.isnan(ratio), np.inf, ratio)
    if in_units(expectation):
        return _units_between(actual, expectation.value)
    wide = actual.astype(np.float64)
    if isinstance(expectation, Interval):
        beyond = np.maximum(expectation.lowest - wide, wide - expectation.highest)
    else:
        beyond = abs(wide - expectation.value)
        if isinstance(expectation, Decision) and expectation.alternative is not None:
            beyond = np.minimum(beyond, abs(wide - expectation.alternative))
    return np.where(beyond > 0, 1 + beyond, 0.0)


def measure_of(expectation: Expected) -> str:
    """The words for what `error_ratios` are."""
    if isinstance(expectation, Bounded):
        return "error/bound"
    return "error in units in the last place" if in_units(expectation) else "1 + error in steps"


def in_units(expectation: Expected) -> bool:
    """Whether errors are measured in units in the last place: of floating-point numbers that must be exact."""
    return isinstance(expectation, Exact) and expectation.value.dtype.kind == "f"


def wrong_elements(expectation: Expected, ratio: F8) -> NDArray[np.bool_]:
    """The elements that are wrong by themselves, from their `error_ratios`."""
    return np.asarray(ratio > (0 if in_units(expectation) else 1))


def colors_of(expectation: Expected, ratio: F8) -> U1:
    """(..., 3) u1 colours of `error_ratios`; a single unit in the last place is wrong already."""
    return ramp(ratio * (1.01 if in_units(expectation) else 1.0))


def ramp(ratio: F8) -> U1:
    """(..., 3) u1 colours of error/bound ratios, along their logarithm."""
    with np.errstate(divide="ignore"):
        power = np.log10(np.maximum(ratio, 10.0**LEAST_POWER))
    along = np.where(ratio > 1, np.maximum(power, STEPS), power)
    channels = [np.interp(along, STOPS, STOP_COLORS[:, c]) for c in range(3)]
    colors = np.rint(np.stack(channels, axis=-1)).astype(np.uint8)
    colors[~np.isfinite(ratio)] = NOT_FINITE
    return colors


def text_color(color: U1) -> str:
    """The colour of text that can be read on a (3,) u1 colour."""
    return "#000" if float(color @ np.array([0.299, 0.587, 0.114])) >= LIGHT else "#fff"


def _units_between(actual: NDArray[Any], expected: NDArray[Any]) -> F8:
    """The distance of two arrays of one type in floating-point numbers; infinite if only one is finite, or a NaN."""
    bits = [np.ascontiguousarray(array).view(f"i{array.dtype.itemsize}") for array in (actual, expected)]
    steps = [np.where(b < 0, np.iinfo(b.dtype).min - b, b).astype(np.float64) for b in bits]
    apart = np.where(bits[0] == bits[1], 0.0, np.maximum(abs(steps[0] - steps[1]), 1))
    return np.where(np.isfinite(actual) & np.isfinite(expected) | (apart == 0), apart, np.inf)
