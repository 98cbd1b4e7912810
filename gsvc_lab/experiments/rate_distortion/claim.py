"""The verdict on the paper's claim, from the BD-rates against each coder."""

from typing import Final

from gsvc_lab.bench.coders import ALONE
from gsvc_lab.bench.compare import WORDS, Ratios, first_of
from gsvc_lab.experiments.experiment import Verdict

CLAIMED: Final = ("AVC", "HEVC", "AV1")
"""Coders with which the paper calls GSVC comparable or better in MS-SSIM and VMAF; VVC is excepted."""

COMPARABLE: Final = 1.1
"""Ratio of bits at equal quality up to which coders count as comparable."""

SAID: Final = ("psnr", "ms_ssim", "vmaf")
"""The metrics of the paper, which the verdict names."""


def verdict(found: Ratios, clips: int) -> Verdict:
    """Whether GSVC is better than every frame alone, and comparable with AVC, HEVC and AV1 in MS-SSIM and VMAF.

    `found`: BD-rates of GSVC against each coder. `clips`: number of clips that the means are over.
    """
    alone = [ratio for ratio in found.get(ALONE.name, {}).values() if ratio is not None]
    better = all(ratio < 1 for ratio in alone) if alone else None
    near: dict[str, bool] = {}
    for standard in CLAIMED:
        name = first_of(standard, found)
        known = [found[name][metric] for metric in ("ms_ssim", "vmaf")] if name else []
        if any(ratio is not None for ratio in known):
            near[standard] = all(ratio <= COMPARABLE for ratio in known if ratio is not None)
    sentence = " ".join(
        part for part in (_against_alone(found, better), _against_codecs(found, near), _means(clips)) if part
    )
    held = [better] * (better is not None) + [all(near.values())] * bool(near)
    if not held:
        return Verdict("cannot be compared", sentence)
    if all(held) and len(held) == 2:
        return Verdict("yes", sentence)
    return Verdict("partly" if any(held) or any(near.values()) else "no", sentence)


def _against_alone(found: Ratios, better: bool | None) -> str:
    if better is None:
        return "Against every frame on its own there is no number."
    takes = "takes fewer bits" if better else "does not by all measures take fewer bits"
    return (
        f"Profile paper, quick, for the same quality {takes} than every frame on its own: {_times(found[ALONE.name])}."
    )


def _against_codecs(found: Ratios, near: dict[str, bool]) -> str:
    parts = []
    for standard in (*CLAIMED, "VVC"):
        name = first_of(standard, found)
        parts.append(f"{name}: {_times(found[name])}" if name else f"{standard}: could not be compared")
    comparable = [standard for standard, close in near.items() if close]
    which = (" and ".join(comparable) if comparable else "none") + f" of {', '.join(CLAIMED)}"
    return f"Against {'; '.join(parts)}. Comparable or better in MS-SSIM and VMAF with {which}."


def _times(by_metric: dict[str, float | None]) -> str:
    return ", ".join(
        f"{WORDS[metric]} {f'{ratio:.2f}' if ratio is not None else 'no common quality'}"
        for metric, ratio in by_metric.items()
        if metric in SAID
    )


def _means(clips: int) -> str:
    over = f"geometric means over those of {clips} clips that have a common quality" if clips > 1 else "of one clip"
    return (
        f"The numbers of profile paper are its bits over those of the other at equal PSNR, MS-SSIM or VMAF, "
        f"1 + BD-rate, {over}; comparable means at most {COMPARABLE:g}."
    )
