"""Bjøntegaard's delta rate: how many more bits one coder takes than another for the same quality, on average."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from scipy.interpolate import PchipInterpolator

Pair = tuple[float, float]
"""Rate (any unit, above 0) and quality."""

LITTLE: Final = 0.5
"""A BD-rate over less of the test's range than this is marked, and so is a mean with one such or none."""


@dataclass(frozen=True)
class BdRate:
    """The mean difference of two rate-quality curves."""

    # Bits of the test over those of the anchor at equal quality, less 100 %; None where there is no common quality
    percent: float | None
    # The qualities that it is the mean over: those that both curves reach. Nothing is extrapolated.
    low: float | None = None
    high: float | None = None
    share: float = 0.0  # their part of the test's own range, 0..1
    reason: str | None = None  # reason for the absence of a number; None where there is one

    @property
    def ratio(self) -> float | None:
        """Bits of the test for one bit of the anchor."""
        return None if self.percent is None else 1 + self.percent / 100


def efficient(points: Sequence[Pair]) -> list[Pair]:
    """The points that no other one beats, by rate: quality rises strictly, as the interpolation needs it."""
    kept: list[Pair] = []
    for rate, quality in sorted((p for p in points if all(map(math.isfinite, p))), key=lambda p: (p[0], -p[1])):
        if not kept or quality > kept[-1][1]:
            kept.append((rate, quality))
    return kept


def bd_rate(anchor: Sequence[Pair], test: Sequence[Pair]) -> BdRate:
    """The delta rate of a test against an anchor.

    Logarithms of the rates are interpolated over quality piece by piece by cubic Hermite polynomials (PCHIP), as in the
    common test conditions of JVET, and integrated over the qualities that both curves reach.
    """
    curves = [efficient(points) for points in (anchor, test)]
    if min(map(len, curves)) < 2:
        return BdRate(None, reason="a curve has fewer than two points of rising quality")
    (first, last), (own_first, own_last) = ((curve[0][1], curve[-1][1]) for curve in curves)
    low, high = max(first, own_first), min(last, own_last)
    if low >= high:
        side = "below" if own_last <= first else "above"
        return BdRate(
            None, reason=f"no overlap: {own_first:.4g} to {own_last:.4g} lies {side} {first:.4g} to {last:.4g}"
        )
    base, own = (float(_log_rate(curve).integrate(low, high)) / (high - low) for curve in curves)
    return BdRate(100 * math.expm1(own - base), low, high, (high - low) / (own_last - own_first))


def rate_at(points: Sequence[Pair], quality: float) -> float | None:
    """The rate at which a curve has a quality, interpolated as `bd_rate` does; None where it does not reach it."""
    curve = efficient(points)
    if len(curve) < 2 or not curve[0][1] <= quality <= curve[-1][1]:
        return None
    return math.exp(float(_log_rate(curve)(quality)))


def _log_rate(curve: Sequence[Pair]) -> PchipInterpolator:
    """The logarithm of the rate over the quality."""
    return PchipInterpolator([quality for _, quality in curve], [math.log(rate) for rate, _ in curve])


def mean_ratio(ratios: Sequence[float | None]) -> float | None:
    """The geometric mean of the ratios there are, in which twice and half cancel out; None if there are none."""
    known = [ratio for ratio in ratios if ratio is not None]
    return math.exp(math.fsum(map(math.log, known)) / len(known)) if known else None
