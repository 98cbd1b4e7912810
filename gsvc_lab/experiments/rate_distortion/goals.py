"""What profile `main` has to reach, and what it reaches."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from gsvc_lab.bench.bd_rate import LITTLE, mean_ratio
from gsvc_lab.bench.codecs import CODECS
from gsvc_lab.bench.coders import MAIN, PAPER
from gsvc_lab.bench.compare import Comparison
from gsvc_lab.bench.measure import Curve
from gsvc_lab.bench.tables import percent
from gsvc_lab.experiments.experiment import Table
from gsvc_lab.experiments.rate_distortion.speed import Seconds

X264_IP: Final = CODECS[0].label(1)
"""The name of x264 slow with I- and P-frames only."""

FAVOURITE: Final = "carphone"
"""How the title of the clip begins that has goals of its own."""


@dataclass(frozen=True)
class Goal:
    """A number that has to be small enough."""

    about: str  # what it is the number of
    must: float | None  # Largest values: 1.3 for 30 % more; None: there is none
    aim: float
    measured: float | None  # the number; None where it was not measured
    remark: str  # where it comes from
    as_percent: bool = True  # whether people read it as a percentage more or less rather than as a factor
    # Whether it was measured on all clips that it is about; a goal is not reached where it was not
    complete: bool = True

    @property
    def reached(self) -> str:
        """How far it came: aim, must, or neither."""
        if self.measured is None:
            return "not measured"
        if not self.complete:
            return "not on all clips"
        if self.measured <= self.aim:
            return "aim"
        if self.must is None:
            return "no must"
        return "must" if self.measured <= self.must else "no"

    def row(self) -> tuple[str, ...]:
        """The goal in a table."""
        numbers = [self._said(self.must, 0), self._said(self.aim, 0), self._said(self.measured, 1)]
        return self.about, *numbers, self.reached, self.remark

    def _said(self, value: float | None, decimals: int) -> str:
        if value is None:
            return "–"
        return f"{100 * (value - 1):+.{decimals}f} %" if self.as_percent else f"{value:.{1 + decimals}f}"


def ratios_by_clip(comparisons: Sequence[Comparison], anchor: str) -> dict[str, float]:
    """The ratio of bits at equal PSNR on each clip that has one."""
    found = {c.clip: c.rates["psnr"].ratio for c in comparisons if c.anchor == anchor}
    return {clip: ratio for clip, ratio in found.items() if ratio is not None}


def goals_of(against: Sequence[Comparison], curves: Sequence[Curve], seconds: Seconds | None) -> list[Goal]:
    """The goals, given the comparisons of `main` quick with all others."""
    paper, x264 = ratios_by_clip(against, PAPER.name), ratios_by_clip(against, X264_IP)
    clips = len({c.clip for c in against})
    over, over_remark = _over_code_length(curves)
    encoding, decoding = (None, None) if seconds is None else (seconds.encoding, seconds.decoding)
    turns = "" if seconds is None else f"{seconds.clip}, N {seconds.splats}, in turns; "
    return [
        Goal("BD-rate against paper quick, geometric mean", 0.45, 0.30, mean_ratio(list(paper.values())),
             f"{len(paper)} of {clips} clips{_little(against)}", complete=len(paper) == clips),
        Goal("BD-rate against paper quick, the worst clip", 0.70, 0.50, *_worst(paper),
             complete=len(paper) == clips),
        Goal("BD-rate against paper quick, carphone", 0.35, 0.25, *_favourite(paper)),
        Goal("BD-rate against x264 slow, I and P only, carphone", 1.05, 0.90, *_favourite(x264)),
        Goal("BD-rate against x264 slow, I and P only, the worst clip", None, 2.00, *_worst(x264),
             complete=len(x264) == clips),
        Goal("seconds of encoding, quick over paper's quick", 1.0, 0.5, encoding and encoding[1] / encoding[0],
             turns + _pair(encoding), as_percent=False),
        Goal("seconds of decoding over those of paper", 1.3, 1.0, decoding and decoding[1] / decoding[0],
             turns + _pair(decoding), as_percent=False),
        Goal("real files over the ideal code length", 1.03, 1.01, over, over_remark),
    ]  # fmt: skip


def _little(against: Sequence[Comparison]) -> str:
    """The clips on which `main` and `paper` have little quality in common, in words."""
    rates = {c.clip: c.rates["psnr"] for c in against if c.anchor == PAPER.name}
    clips = [clip for clip, rate in rates.items() if rate.percent is not None and rate.share < LITTLE]
    return f"; less than half of main's range on {'; '.join(clips)}" if clips else ""


def _pair(seconds: tuple[float, float] | None) -> str:
    return "–" if seconds is None else f"medians, s/frame: paper {seconds[0]:.4f}, main {seconds[1]:.4f}"


def _worst(ratios: Mapping[str, float]) -> tuple[float | None, str]:
    clip = max(ratios, key=lambda one: ratios[one], default=None)
    return (None, "–") if clip is None else (ratios[clip], clip)


def _favourite(ratios: Mapping[str, float]) -> tuple[float | None, str]:
    clip = next((clip for clip in ratios if clip.startswith(FAVOURITE)), None)
    return (None, "–") if clip is None else (ratios[clip], clip)


def _over_code_length(curves: Sequence[Curve]) -> tuple[float | None, str]:
    """Bits of the files of `main` quick over their ideal code lengths, and the same of single files in words."""
    points = [point for curve in curves if curve.coder == MAIN.name for point in curve.points]
    found = [(8 * point.bytes, point.code_length.bits) for point in points if point.code_length is not None]
    if not found:
        return None, "–"
    single = [size / length for size, length in found]
    remark = f"bits of all files of main together; single files {percent(min(single))} to {percent(max(single))}"
    return sum(size for size, _ in found) / sum(length for _, length in found), remark


def goals_table(found: Sequence[Goal]) -> Table:
    """The goals and how far they were reached."""
    columns = ("profile main", "must", "aim", "measured", "reached", "from")
    return Table("What profile main has to reach (at most), and what it reaches", columns, [one.row() for one in found])


def summary(against: Sequence[Comparison]) -> str:
    """Sentences on what `main` takes, the least and the most over the clips, for those who read nothing else."""
    paper = ratios_by_clip(against, PAPER.name)
    if not paper:
        return f"{MAIN.name}, has no common quality with profile paper. {against_x264(against)}"
    low, high, mean = min(paper.values()), max(paper.values()), mean_ratio(list(paper.values())) or 1.0
    return (
        f"Bits of profile main, quick, at equal PSNR against profile paper, quick: {percent(low)} to {percent(high)} "
        f"by clip, mean {percent(mean)}. {against_x264(against)}"
    )


def against_x264(against: Sequence[Comparison]) -> str:
    """A sentence on the bits of `main` over those of x264 with I- and P-frames, clip by clip, the best first."""
    ratios = ratios_by_clip(against, X264_IP)
    if not ratios:
        return "Against x264 with I- and P-frames there is no number."
    ordered = sorted(ratios.items(), key=lambda one: one[1])
    said = "; ".join(f"{clip.split(',')[0]} {percent(ratio)}" for clip, ratio in ordered)
    mean = mean_ratio(list(ratios.values())) or 1.0
    return f"Against x264 slow with I- and P-frames only: {said}; mean {percent(mean)}."
