"""The figures: quality over rate for each clip and metric, and quality over seconds."""

import math
import re
from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any, Final

from gsvc_base.cli.text import plural
from gsvc_lab.bench.codecs import CODECS
from gsvc_lab.bench.coders import ALONE, LONG, MAIN, OWN, OWN_ALONE, PAPER, SLOW
from gsvc_lab.bench.measure import METRICS, Curve
from gsvc_lab.experiments.experiment import Run
from gsvc_lab.experiments.figures import COLORS, log_axis, new_figure, save_figure
from gsvc_lab.experiments.rate_distortion.plan import slug

PANELS: Final = ("psnr", "ms_ssim", "vmaf")
"""The metrics of the paper's figure."""

ACROSS: Final = 3
"""Panels in a row."""

MAX_MARKS: Final = 9
"""Maximum number of marks on a logarithmic axis."""

COORDINATE: Final = re.compile(r"(?<=[ \"(])(-?\d+\.\d\d)\d+")
INDENT: Final = re.compile(r"\n +")
"""Parts of a written SVG that nobody sees; labels, which stand after a >, are not coordinates."""

OURS: Final = {
    MAIN.name: (COLORS[6], "-", "o", True),
    SLOW.name: (COLORS[6], "--", "o", False),
    PAPER.name: (COLORS[7], "-", "o", True),
    LONG.name: (COLORS[7], "--", "o", False),
    ALONE.name: (COLORS[7], "-", "X", True),
    OWN.name: (COLORS[7], ":", "o", False),
    OWN_ALONE.name: (COLORS[7], ":", "X", False),
}
"""Colour, line, mark and whether the mark is filled."""

STANDARDS: Final = {"AVC": ("#0072B2", "s"), "HEVC": ("#D55E00", "^"), "AV1": ("#009E73", "D"), "VVC": ("#CC79A7", "v")}

FIRST: Final = frozenset(codec.label() for codec in CODECS)


def style(coder: str) -> dict[str, Any]:
    """The style of a coder's curve: a colour for each codec, dashed and hollow for its other variants."""
    if coder in OURS:
        color, dashes, mark, filled = OURS[coder]
    else:
        color, mark = STANDARDS[coder.split(" ", 1)[0]]
        filled = coder in FIRST
        dashes = "-" if filled else "--" if "chroma" not in coder and "psycho" not in coder else ":"
    face = color if filled else "white"
    wide = 2.4 if coder in (MAIN.name, PAPER.name) else 1.4
    return {"color": color, "linestyle": dashes, "marker": mark, "markerfacecolor": face, "linewidth": wide}


def draw_clip(curves: Sequence[Curve], title: str, number: int, folder: Path) -> dict[str, str]:
    """Quality over bits per pixel of one clip; the name of the figure with its caption."""
    figure, axes = new_figure(10.5, 4.6, 1, len(PANELS))
    for place, metric in zip(axes.flat, PANELS, strict=True):
        for curve in curves:
            pairs = [(rate, quality) for rate, quality in curve.pairs(metric) if quality == quality]
            if pairs:
                place.plot(*zip(*pairs, strict=True), label=curve.coder, **style(curve.coder))
        _finish(place, "bits/pixel", METRICS[metric])
        if not place.lines:
            place.text(0.5, 0.5, "could not be measured", ha="center", transform=place.transAxes)
    _legend(figure, axes.flat[0], title)
    missing = "".join(f" {curve.coder} could not be run." for curve in curves if not curve.points)
    caption = (
        f"{title}: quality over rate, from the bare streams of all its frames; black (white on dark pages) "
        f"is profile main, grey profile paper, blue and hollow x264 without B-frames or not tuned for PSNR. "
        f"The rate axis is logarithmic.{missing}"
    )
    return {_save(figure, folder, slug(title.split(",")[0], number)): caption}


def draw_seconds(curves: Sequence[Curve], titles: Sequence[str], run: Run) -> dict[str, str]:
    """PSNR over seconds of encoding; the name of the figure with its caption."""
    rows = -(-len(titles) // ACROSS)
    figure, axes = new_figure(10.5, 1 + 3.2 * rows, rows, min(len(titles), ACROSS))
    for place, title in zip_longest(axes.flat, titles):
        if title is None:
            place.set_axis_off()
            continue
        for curve in (curve for curve in curves if curve.clip == title and curve.points):
            seconds = [point.encoding_seconds for point in curve.points]
            place.plot(seconds, [point.psnr for point in curve.points], label=curve.coder, **style(curve.coder))
        _finish(place, "encoding, s/frame", METRICS["psnr"])
        place.set_title(title, parse_math=False, fontsize=9)
    _legend(figure, axes[0][0], None)
    threads = "all threads" if run.threads is None else plural(run.threads, "thread")
    caption = f"Quality over the seconds that a frame takes to encode, {threads}; the axis of seconds is logarithmic."
    return {_save(figure, run.folder, "seconds"): caption}


def _finish(place: Any, x: str, y: str) -> None:
    place.set(xlabel=x, ylabel=y)
    values = [float(value) for line in place.lines for value in line.get_xdata()]
    if values:
        log_axis(place, marks(min(values), max(values)))


def marks(low: float, high: float) -> list[float]:
    """Round numbers on a logarithmic axis from low to high, not too many; 1, 2 and 5 or powers of ten."""
    tens = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for steps in ((1, 2, 5), (1,)):
        found = [float(f"{step}e{ten}") for ten in tens for step in steps if low <= float(f"{step}e{ten}") <= high]
        if len(found) <= MAX_MARKS:
            break
    return found or [float(f"{low:.1g}")]


def _legend(figure: Any, place: Any, title: str | None) -> None:
    handles, labels = place.get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    if title is not None:
        figure.suptitle(title, parse_math=False, x=0.01, ha="left", fontsize=10)


def _save(figure: Any, folder: Path, name: str) -> str:
    """Write a figure with coordinates to a hundredth of a point, which takes a fifth less room; returns its name."""
    saved = save_figure(figure, folder, f"rate_distortion-{name}")
    path = folder / f"{saved}.svg"
    text = COORDINATE.sub(r"\1", path.read_text(encoding="utf-8"))
    path.write_text(INDENT.sub("\n", text.replace("; stroke-linejoin: miter", "")), encoding="utf-8")
    return saved
