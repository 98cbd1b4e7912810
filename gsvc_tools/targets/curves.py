"""What groups of pictures cost with more or fewer splats, and how bits are spent on them at equal slope.

A group was encoded with N splats a frame. Its bits and its squared error with another N are taken to follow lines over
log2 N: 2^s times the bits for twice the splats, with an s for I-frames and one for P-frames, and 2^-s times the error.
Lines that go through what was measured, with slopes from a second measurement or, without one, usual ones.

The sum of all errors is least for a given number of bits where one more bit buys as much in each group, which is where
error + lambda bits of each group is least, with one lambda for all of them. All of this is computed with
`gsvc_base.portable`, so that a plan is the same on every machine.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Self

import numpy as np

from gsvc_base.arrays import F8
from gsvc_base.portable import log2, power, total
from gsvc_ref.paper import FrameType


@dataclass(frozen=True)
class Slopes:
    """Slopes over log2 N: of log2 of the bits of I- and of P-frames, and of log2 of the squared error, which falls.

    The usual ones are those of the scenes ``pan`` and ``water``, 128x96, 8 frames, 40 to 1,280 splats.
    """

    intra: float = 1.05
    inter: float = 1.4
    error: float = 1.1


USUAL: Final = Slopes()

LIMITS: Final = {"intra": (0.7, 1.4), "inter": (0.7, 2.5), "error": (0.4, 2.0)}
"""Slopes that two measurements may give; beyond them it was chance that was measured."""

APART: Final = 0.25
"""The least octaves of N between two measurements that give slopes."""

ENOUGH_BITS: Final = 400
"""The least bits of each of two measurements of P-frames that give a slope."""

SPREAD: Final = 1.5
"""The most octaves of N by which a group differs from the N that all would have in common."""

GRID: Final = 1 / 16
"""Octaves between the values of N that equal slope is looked for among."""

HALVINGS: Final = 60
"""The number of times that an interval is halved to find a number in it."""


@dataclass(frozen=True)
class FrameCost:
    """What a frame took."""

    number: int  # in the stream
    type: FrameType
    bits: float  # of its whole chunk
    error: float  # the mean squared error, with 1 for the square of the peak


@dataclass(frozen=True)
class GroupCurve:
    """The bits and the error of a group of pictures over log2 N."""

    frames: tuple[FrameCost, ...]  # what its frames took
    octave: float  # log2 of the N that they were encoded with
    slopes: Slopes = USUAL  # how that changes with N

    def frame_bits(self, octave: float) -> list[float]:
        """The bits of each frame with another N; an R-frame always has the same."""
        by_type = {
            "I": _power_of_two(self.slopes.intra * (octave - self.octave)),
            "P": _power_of_two(self.slopes.inter * (octave - self.octave)),
        }
        return [frame.bits * by_type.get(frame.type, 1.0) for frame in self.frames]

    def bits(self, octaves: F8) -> F8:
        """The bits of the group for each of some values of log2 N, (n,) f8."""
        parts = {kind: total([frame.bits for frame in self.frames if frame.type == kind]) for kind in "IPR"}
        away = octaves - self.octave
        intra, inter = power(2.0, self.slopes.intra * away), power(2.0, self.slopes.inter * away)
        return np.asarray(parts["I"] * intra + parts["P"] * inter + parts["R"])

    def error(self, octaves: F8) -> F8:
        """The sum of the frames' errors for each of some values of log2 N, (n,) f8."""
        measured = total([frame.error for frame in self.frames])
        return np.asarray(measured * power(2.0, -self.slopes.error * (octaves - self.octave)))

    def with_slopes(self, frames: Sequence[FrameCost], octave: float) -> Self:
        """The curve with slopes by a second measurement of its first frames, as far as that gives some.

        `frames` are what the first frames took with another N, whose log2 is `octave`.
        """
        away = octave - self.octave
        if abs(away) < APART:
            return self
        first = self.frames[: len(frames)]
        found: dict[str, float] = {}
        for name, kind, least in (("intra", "I", 1), ("inter", "P", ENOUGH_BITS)):
            here, there = (total([one.bits for one in part if one.type == kind]) for part in (first, frames))
            if min(here, there) >= least:
                found[name] = float(log2(there / here)) / away
        here, there = (total([one.error for one in part]) for part in (first, frames))
        if min(here, there) > 0:
            found["error"] = -float(log2(there / here)) / away
        inside = {name: min(max(value, LIMITS[name][0]), LIMITS[name][1]) for name, value in found.items()}
        return replace(self, slopes=replace(self.slopes, **inside))


def equal_slope(curves: Sequence[GroupCurve], bits: float, low: float, high: float) -> list[float]:
    """log2 N of each group, so that all together have these bits and the least error.

    They may take `bits` in all, and log2 N is from `low` to `high`: if all groups at one limit take more than `bits`,
    or less, all are there.
    """
    even = same_for_all(curves, bits, low, high)
    least, most = max(low, even - SPREAD), min(high, even + SPREAD)
    octaves = least + GRID * np.arange(int((most - least) / GRID) + 1)
    costs, errors = (np.stack([getattr(curve, name)(octaves) for curve in curves]) for name in ("bits", "error"))
    groups = np.arange(len(curves))

    def chosen(exponent: float) -> Any:
        return np.argmin(errors + _power_of_two(exponent) * costs, axis=1)

    dear, cheap = -100.0, 100.0  # with lambda 2^-100 only the error counts, with 2^100 only the bits
    for _ in range(HALVINGS):
        middle = (dear + cheap) / 2
        if total(costs[groups, chosen(middle)]) > bits:
            dear = middle
        else:
            cheap = middle
    found = octaves[chosen(cheap)]

    def moved(shift: float) -> list[float]:
        return [min(max(float(octave) + shift, low), high) for octave in found]

    def taken(shift: float) -> float:
        return total([float(curve.bits(np.array([at]))[0]) for curve, at in zip(curves, moved(shift), strict=True)])

    return moved(_largest(taken, bits, low - high, high - low))


def same_for_all(curves: Sequence[GroupCurve], bits: float, low: float, high: float) -> float:
    """The log2 N, from low to high, with which all groups together have these bits, or the nearest."""

    def taken(octave: float) -> float:
        return total([float(curve.bits(np.array([octave]))[0]) for curve in curves])

    return _largest(taken, bits, low, high)


def _largest(rising: Any, most: float, low: float, high: float) -> float:
    """The largest number from low to high for which a rising function is at most `most`, or low."""
    if rising(high) <= most:
        return high
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if rising(middle) <= most else (low, middle)
    return low


def _power_of_two(exponent: float) -> float:
    return float(power(2.0, min(max(exponent, -200.0), 200.0)))
