"""BD-rates between the curves of each clip, and their means over clips."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from gsvc_lab.bench.bd_rate import BdRate, bd_rate, mean_ratio
from gsvc_lab.bench.codecs import CODECS
from gsvc_lab.bench.measure import METRICS, Curve

WORDS: Final = {"psnr": "PSNR", "psnr_y": "PSNR of Y′", "ms_ssim": "MS-SSIM", "vmaf": "VMAF"}

Ratios = dict[str, dict[str, float | None]]
"""Bits of a test over those of its anchor at equal quality, by the one of them that names the row, and by metric; None
where no clip gives a number."""


@dataclass(frozen=True)
class Comparison:
    """The test against an anchor on a clip, by metric."""

    clip: str
    test: str
    anchor: str
    rates: dict[str, BdRate]


def compared(curves: Sequence[Curve], test: str, anchor: str | None = None) -> list[Comparison]:
    """The test against every other coder on each clip, or, given an anchor, every other coder against that."""
    found = []
    for clip in dict.fromkeys(curve.clip for curve in curves):
        coders = {curve.coder: curve for curve in curves if curve.clip == clip and curve.points}
        for other in coders.values():
            fixed = coders.get(test if anchor is None else anchor)
            if fixed is None or other is fixed:
                continue
            base, tested = (other, fixed) if anchor is None else (fixed, other)
            rates = {metric: bd_rate(base.pairs(metric), tested.pairs(metric)) for metric in METRICS}
            found.append(Comparison(clip, tested.coder, base.coder, rates))
    return found


def ratios(comparisons: Sequence[Comparison], *, by_anchor: bool = True) -> Ratios:
    """The geometric means over clips, by the anchor or by the test."""
    names = dict.fromkeys(c.anchor if by_anchor else c.test for c in comparisons)
    return {
        name: {
            metric: mean_ratio(
                [c.rates[metric].ratio for c in comparisons if (c.anchor if by_anchor else c.test) == name]
            )
            for metric in METRICS
        }
        for name in names
    }


def first_of(standard: str, found: Ratios) -> str | None:
    """The name of a codec's first variant among the coders."""
    names = (codec.label() for codec in CODECS if codec.standard == standard)
    return next((name for name in names if name in found), None)
