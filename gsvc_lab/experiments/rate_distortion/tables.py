"""The tables of the experiment alone: its points, how it was compared, and what the paper publishes."""

from collections.abc import Sequence
from typing import Final

from gsvc_lab.bench.bd_rate import rate_at
from gsvc_lab.bench.measure import Curve
from gsvc_lab.bench.tables import percent, reported
from gsvc_lab.experiments.experiment import Table
from gsvc_lab.experiments.rate_distortion.decisions import DECISIONS, WHY

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
