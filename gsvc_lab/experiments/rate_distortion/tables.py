"""The tables of the experiment: BD-rates, seconds, how it was compared, and what the paper publishes."""

from collections.abc import Sequence
from typing import Final

from gsvc_lab.experiments.experiment import Table
from gsvc_lab.experiments.rate_distortion.bd_rate import LITTLE, BdRate, rate_at
from gsvc_lab.experiments.rate_distortion.compare import WORDS, Comparison, Ratios
from gsvc_lab.experiments.rate_distortion.decisions import DECISIONS, WHY
from gsvc_lab.experiments.rate_distortion.goals import percent
from gsvc_lab.experiments.rate_distortion.layers import Layered
from gsvc_lab.experiments.rate_distortion.measure import METRICS, Curve

PUBLISHED: Final = (
    ("GSVC, N = 10,000", "0.20", "33.92", "0.93", "87.95"),
    ("GSVC, N = 20,000", "0.41", "35.73", "0.95", "93.98"),
    ("GSVC, N = 30,000", "0.61", "36.72", "0.96", "94.95"),
    ("GSVC, N = 40,000", "0.81", "37.32", "0.96", "95.67"),
    ("GSVC, N = 50,000", "1.04", "37.72", "0.97", "96.13"),
)
"""UVG's Beauty, HoneyBee and Jockey at 1920x1080, means over the three."""

NOT_DECODABLE: Final = (
    "by the authors' code not a rate that can be decoded: sums of sizes in memory, P-frames as differences to "
    "parameters of the frame itself, which a decoder does not have"
)

NOT_RUN: Final = (
    ("DCVC-HEM", "needs trained networks, not run; the paper gives a curve without numbers: better than GSVC, and in "
     "MS-SSIM better than VVC; trained, it says, on UVG"),
    ("DCVC-DC", "as DCVC-HEM; decodes 2.4 frames/s, the paper says"),
    ("VGR", "not run, and not compared by the paper: made for editing, its sizes are not comparable"),
    ("VeGaS", "as VGR"),
)  # fmt: skip


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


def main_table(curves: Sequence[Curve], coder: str, anchors: Sequence[str]) -> Table:
    """Each point of a coder of profile `main`, and what others take at its PSNR."""
    rows = []
    for curve in (curve for curve in curves if curve.coder == coder):
        others = {other.coder: other for other in curves if other.clip == curve.clip}
        for point in curve.points:
            ratios = []
            for name in anchors:
                rate = rate_at(others[name].pairs("psnr"), point.psnr) if name in others else None
                ratios.append("–" if rate is None else f"{point.bits_per_pixel / rate:.2f}")
            length = point.code_length
            over = "–" if length is None else percent(8 * point.bytes / length.bits)
            vmaf = "–" if point.vmaf is None else f"{point.vmaf:.1f}"
            rows.append(
                (
                    curve.clip, point.setting, f"{8 * point.bytes:,}", f"{point.bits_per_pixel:.3f}",
                    f"{point.psnr:.2f}", f"{point.ms_ssim:.4f}", vmaf, *ratios, over, f"{point.encoding_seconds:.3f}",
                )
            )  # fmt: skip
    columns = (
        "clip", "N", "bits", "bits/pixel", "PSNR, dB", "MS-SSIM", "VMAF", *(f"/ {name}" for name in anchors),
        "file over ideal", "encoding, s/frame",
    )  # fmt: skip
    return Table(f"{coder}: every point, and its bits over those of others at its PSNR", columns, tuple(rows))


def layers_table(found: Sequence[Layered]) -> Table:
    """Three layers against one."""
    rows = [
        (
            one.clip,
            ", ".join(map(str, one.splats)),
            f"{one.psnr:.2f}",
            f"{8 * one.bytes:,}",
            "–" if one.single_bytes is None else f"{8 * one.single_bytes:,.0f}",
            "–" if one.ratio is None else percent(one.ratio),
        )
        for one in found
    ]
    columns = ("clip", "N of the layers together", "PSNR of all, dB", "bits", "bits of one layer there", "more")
    return Table("GSVC main, quick: three layers against one at full quality", columns, rows)


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


def published_table() -> Table:
    """The paper's published numbers, to stand beside."""
    rows = [(*row, NOT_DECODABLE) for row in PUBLISHED]
    rows += [(name, "–", "–", "–", "–", remark) for name, remark in NOT_RUN]
    title = "What the paper publishes (1920x1080, means over UVG's Beauty, HoneyBee and Jockey)"
    return Table(title, ("coder", "bits/pixel", "PSNR, dB", "MS-SSIM", "VMAF", "remark"), tuple(rows))


def why_table() -> Table:
    """Why profile `main` takes more bits than video codecs where it does."""
    return Table("Where profile main loses against video codecs, and why", ("where", "why"), WHY)


def decisions_table(curves: Sequence[Curve], clips: Sequence[str], software: str, start: float) -> Table:
    """The conditions of the comparison, and what the coders reported."""
    rows = [(topic, text.format(software=software, start=start, clips="; ".join(clips))) for topic, text in DECISIONS]
    rows += [("reported", note) for note in reported(curves)]
    return Table("How it was compared", ("about", "what was done"), tuple(rows))


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
