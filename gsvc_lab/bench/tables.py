"""Tables of rates and distortions: BD-rates, ends of the curves with seconds, and what the coders reported."""

from collections.abc import Sequence

from gsvc_base.pages.tables import Table
from gsvc_lab.bench.bd_rate import LITTLE, BdRate
from gsvc_lab.bench.compare import WORDS, Comparison, Ratios
from gsvc_lab.bench.measure import METRICS, Curve


def percent(ratio: float) -> str:
    """A ratio as a percentage with its sign; from 100 % on without decimals, which say nothing there."""
    value = round(100 * (ratio - 1), 1) + 0.0  # no minus before a zero
    return f"{value:+.0f} %" if abs(value) >= 100 else f"{value:+.1f} %"


def cell(rate: BdRate) -> str:
    """A BD-rate in a table."""
    if rate.ratio is None:
        return "no overlap" if rate.low is None and "overlap" in (rate.reason or "") else "–"
    return percent(rate.ratio) + (" *" if rate.share < LITTLE else "")


def common(rate: BdRate) -> str:
    """The qualities that a BD-rate is the mean over."""
    return "–" if rate.low is None or rate.high is None else f"{rate.low:.1f}–{rate.high:.1f}"


def bd_table(title: str, comparisons: Sequence[Comparison], means: Ratios, *, clips: bool = True) -> Table:
    """GSVC against each coder on each of the clips, if asked for or the only one, and means over several."""
    count = len({c.clip for c in comparisons})
    rows = [
        (c.clip, c.anchor, *(cell(c.rates[metric]) for metric in METRICS), common(c.rates["psnr"]))
        for c in comparisons
        if clips or count == 1
    ]
    if count > 1:
        for name, by_metric in means.items():
            own = [c for c in comparisons if c.anchor == name]
            counted = sum(c.rates["psnr"].percent is not None for c in own)
            rows.append(("mean of the clips", name, *mean_cells(by_metric, own), f"{counted} of {count} clips"))
    return Table(title, ("clip", "against", *(WORDS[metric] for metric in METRICS), "common PSNR, dB"), tuple(rows))


def anchor_table(title: str, comparisons: Sequence[Comparison], means: Ratios) -> Table:
    """Every coder against one anchor, means over clips."""
    rows = [
        (name, *mean_cells(by_metric, [c for c in comparisons if c.test == name])) for name, by_metric in means.items()
    ]
    return Table(title, ("coder", *(WORDS[metric] for metric in METRICS)), tuple(rows))


def mean_cells(by_metric: dict[str, float | None], comparisons: Sequence[Comparison]) -> list[str]:
    """Ratios as percentages, marked where one of the clips has little in common or nothing."""
    cells = []
    for metric, ratio in by_metric.items():
        little = any(c.rates[metric].percent is None or c.rates[metric].share < LITTLE for c in comparisons)
        cells.append("–" if ratio is None else percent(ratio) + (" *" if little else ""))
    return cells


def points_table(curves: Sequence[Curve]) -> Table:
    """The ends of each curve, and seconds; what could not be run says why."""
    rows = []
    for curve in curves:
        if not curve.points:
            rows.append((curve.clip, curve.coder, *["–"] * 6, f"not run: {curve.missing}"))
            continue
        first, last = curve.points[0], curve.points[-1]
        vmaf = [p.vmaf for p in (first, last)]
        rows.append(
            (
                curve.clip,
                curve.coder,
                f"{first.bits_per_pixel:.3f}–{last.bits_per_pixel:.3f}",
                f"{first.psnr:.1f}–{last.psnr:.1f}",
                f"{first.ms_ssim:.3f}–{last.ms_ssim:.3f}",
                "–" if None in vmaf else "–".join(f"{score:.1f}" for score in vmaf),
                "–".join(f"{p.encoding_seconds:.3f}" for p in (first, last)),
                "–".join(f"{p.decoding_seconds:.4f}" for p in (first, last)),
                f"{first.setting} to {last.setting}",
            )
        )
    columns = (
        "clip", "coder", "bits/pixel", "PSNR, dB", "MS-SSIM", "VMAF", "encoding, s/frame", "decoding, s/frame",
        "from, to",
    )  # fmt: skip
    return Table("Ends of the curves, and seconds a frame there", columns, tuple(rows))


def reported(curves: Sequence[Curve]) -> list[str]:
    """The reports of the coders; where one is not the same on all clips, with their names."""
    on: dict[tuple[str, str], list[str]] = {}
    for curve in curves:
        for note in curve.notes:
            on.setdefault((curve.coder, note), []).append(curve.clip)
    coded = {coder: sum(curve.coder == coder for curve in curves) for coder, _ in on}
    return [
        f"{coder}: {note}" + (f" ({'; '.join(clips)})" if len(clips) < coded[coder] else "")
        for (coder, note), clips in on.items()
    ]
