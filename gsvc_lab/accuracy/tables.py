"""The measurements as text: the cells of their tables, as Markdown, and as an object for JSON."""

import math
from typing import Any, Final

from gsvc_base.pages.tables import markdown_table
from gsvc_lab.accuracy.encoding import Curve
from gsvc_lab.accuracy.groups import Group, Kind
from gsvc_lab.accuracy.measure import Spread
from gsvc_lab.accuracy.results import AccuracyReport, GroupResult, Measurement

BEST_MARK: Final = "*"

UNITS: Final = (
    "Errors are in steps of 8 bits (full scale is 255 of them) over all samples, not rounded; 99.999 % of the samples "
    "are within the column of that name. PSNR is against what the group's errors are against, source PSNR against the "
    "picture that the splats were fitted to."
)
TIMES: Final = (
    "Times are medians of runs that took turns; half of the runs lie between the two times after it. The ratio is to "
    "the setting marked with =."
)
BEST: Final = (
    "* Pareto-best: no other setting of the group is at least as good in RMS error and cost, and better in one. "
    "Cost is the time, and where frames are coded, their bytes."
)
LEGEND: Final = (UNITS, TIMES, BEST)

WORK: Final[dict[Kind, str]] = {
    "rendering": "rendering the picture once, on one thread but where threads are varied",
    "coding": "quantising, fine-tuning and coding the fitted splats as an I-frame, on all threads",
    "training": "fitting the splats, on all threads",
}
"""The work that is timed."""

BEGIN: Final = "<!-- begin: gsvc accuracy --markdown -->"
END: Final = "<!-- end: gsvc accuracy --markdown -->"


def header(group: Group) -> list[str]:
    """The names of the columns of a group; the first two are the mark and the setting."""
    names = ["", group.title, "largest", "99.999 %", "RMS", "PSNR, dB"]
    names += ["source PSNR"] if group.kind != "training" else []
    names += ["bytes"] if group.kind == "coding" else []
    return [*names, "time", "half of the runs", "ratio"]


def cells(group: Group, measured: Measurement) -> list[str]:
    """The cells of a setting, under `header`."""
    errors, seconds = measured.errors, measured.seconds
    usual = f" ({measured.setting.usual})" if measured.setting.usual else ""
    row = [BEST_MARK if measured.best else "", f"{measured.setting.name}{usual}"]
    row += [number(errors.largest), number(errors.quantile), number(errors.rms), decibels(errors.psnr)]
    row += [decibels(measured.source_psnr.median, 2)] if group.kind != "training" else []
    row += [f"{measured.bytes:,}"] if measured.bytes is not None else []
    ratio = "=" if measured.setting.base else f"{measured.ratio:.3g}"
    return [*row, time_text(seconds.median), between(seconds), ratio]


def number(value: float) -> str:
    """An error: ``0``, ``6.5e-13``, ``0.0018``, ``0.23``, ``12.4``."""
    if value == 0:
        return "0"
    if value < 1e-3:
        return f"{value:.1e}"
    return f"{value:.1f}" if value >= 1 else f"{value:.2g}"


def decibels(value: float, digits: int = 1) -> str:
    """A PSNR; an infinite one is ``identical``."""
    return f"{value:.{digits}f}" if math.isfinite(value) else "identical"


def time_text(seconds: float) -> str:
    """A time: ``0.82 ms``, ``4.6 ms``, ``123 ms``, ``1.72 s``."""
    if seconds >= 1:
        return f"{seconds:.2f} s"
    return f"{1e3 * seconds:.{0 if seconds >= 0.1 else 1 if seconds >= 0.01 else 2}f} ms"


def between(spread: Spread) -> str:
    """The quartiles: ``4.5..4.8 ms``."""
    low, high = time_text(spread.low), time_text(spread.high)
    return f"{low.split()[0]}..{high}" if low.split()[1] == high.split()[1] else f"{low}..{high}"


def source_text(report: AccuracyReport) -> str:
    """The picture and its splats, in one sentence."""
    source = report.source
    height, width = source.frame.shape[:2]
    frame = f", frame {source.number}" if source.number else ""
    text = f"{source.name}{frame}, {width}x{height}"
    if report.fitted_psnr is not None:
        text += f", {report.splats:,} splats fitted to {decibels(report.fitted_psnr, 2)} dB"
    return text


def machine_text(report: AccuracyReport) -> str:
    """The processor and the versions of Python, NumPy and Numba."""
    name = report.machine
    return (
        f"{name['processor']}, {name['processors']} processors, Python {name['Python']}, NumPy {name['numpy']}, "
        f"Numba {name['numba']}"
    )


def run_counts(result: GroupResult) -> str:
    """The number of runs that the medians are of."""
    counts = {measured.seconds.runs for measured in result.measurements}
    text = " to ".join(str(count) for count in sorted({min(counts), max(counts)}))
    return f"{text} {'run' if counts == {1} else 'runs'} each"


def curve_lines(report: AccuracyReport) -> list[str]:
    """A sentence on each curve, and when they first had what."""
    lines = [f"preset {curve.preset}: {curve.end}" for curve in report.curves]
    for psnr in milestones(report):
        reached = [f"{curve.preset} {_when(curve, psnr)}" for curve in report.curves]
        lines.append(f"{psnr:.0f} dB: {', '.join(reached)}")
    return lines


def milestones(report: AccuracyReport) -> list[float]:
    """Round numbers of dB that at least one curve reaches, the highest three of them, 3 dB apart."""
    best = max((psnr for curve in report.curves for _, psnr in curve.points if math.isfinite(psnr)), default=0.0)
    return [psnr for psnr in (math.floor(best) - 6.0, math.floor(best) - 3.0, math.floor(best) - 0.0) if psnr > 0]


def _when(curve: Curve, psnr: float) -> str:
    seconds = curve.seconds_to(psnr)
    return f"not within {time_text(curve.points[-1][0])}" if seconds is None else f"after {time_text(seconds)}"


def markdown(report: AccuracyReport) -> str:
    """All groups as Markdown tables."""
    lines = [f"Measured on {source_text(report)}; {machine_text(report)}.", ""]
    for result in report.groups:
        group = result.group
        lines += [f"**{group.title}** (`{group.name}`): errors against {group.against}; {run_counts(result)}.", ""]
        names = header(group)
        rows = [[cell.replace("*", "\\*") for cell in cells(group, one)] for one in result.measurements]
        lines.append(markdown_table(names, rows, range(2, len(names))))
        lines += ["", *([group.note, ""] if group.note else [])]
    if report.curves:
        lines += ["**Encoding one I-frame**: PSNR against the source, before rounding.", ""]
        lines += [f"- {line}" for line in curve_lines(report)] + [""]
    lines += [f"Note: {note}." for note in report.notes]
    return "\n".join(lines).rstrip() + "\n"


def accuracy_object(report: AccuracyReport) -> dict[str, Any]:
    """The report for JSON; a PSNR of equal pictures is infinite here, which strict JSON must turn into null."""
    height, width = report.source.frame.shape[:2]
    return {
        "source": {"name": report.source.name, "frame": report.source.number, "width": width, "height": height},
        "splats": report.splats,
        "fitted_psnr": report.fitted_psnr,
        "machine": report.machine,
        "seconds": report.seconds,
        "groups": [_group_object(result) for result in report.groups],
        "curves": [
            {"preset": curve.preset, "iterations": curve.iterations, "end": curve.end,
             "points": [{"seconds": seconds, "psnr": psnr} for seconds, psnr in curve.points]}
            for curve in report.curves
        ],
        "notes": report.notes,
    }  # fmt: skip


def _group_object(result: GroupResult) -> dict[str, Any]:
    group = result.group
    return {
        "name": group.name,
        "title": group.title,
        "kind": group.kind,
        "errors_against": group.against,
        "timed": WORK[group.kind],
        "cost": group.cost,
        "rungs": [
            {
                "name": measured.setting.name,
                "usual": measured.setting.usual or None,
                "base": measured.setting.base,
                "pareto_best": measured.best,
                "largest_error": measured.errors.largest,
                "error_quantile_99999": measured.errors.quantile,
                "rms_error": measured.errors.rms,
                "psnr": measured.errors.psnr,
                "source_psnr": measured.source_psnr,
                "bytes": measured.bytes,
                "seconds": measured.seconds,
                "ratio": measured.ratio,
            }
            for measured in result.measurements
        ],
    }
