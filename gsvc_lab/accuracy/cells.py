"""The ladder as text: the cells of its tables, as Markdown, and as an object for JSON."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from gsvc_lab.accuracy.encoding import Curve
from gsvc_lab.accuracy.measure import Spread
from gsvc_lab.accuracy.results import GroupResult, Ladder, Step
from gsvc_lab.accuracy.rungs import Group, Kind
from gsvc_ref.errors import UsageError
from gsvc_ref.files import write_text

BEST_MARK: Final = "*"

UNITS: Final = (
    "Errors are in steps of 8 bits (full scale is 255 of them) over all samples, not rounded; 99.999 % of the samples "
    "are within the column of that name. PSNR is against what the group's errors are against, source PSNR against the "
    "picture that the splats were fitted to."
)
TIMES: Final = (
    "Times are medians of runs that took turns; half of the runs lie between the two times after it. The ratio is to "
    "the rung marked with =."
)
BEST: Final = (
    "* Pareto-best: no other rung of the group is at least as good in RMS error and cost, and better in one. Cost is "
    "the time, and where frames are coded, their bytes."
)
LEGEND: Final = (UNITS, TIMES, BEST)

WORK: Final[dict[Kind, str]] = {
    "rendering": "rendering the picture once, on one thread",
    "coding": "quantising, fine-tuning and coding the fitted splats as an I-frame, on all threads",
    "training": "fitting the splats, on all threads",
}
"""What is timed."""

BEGIN: Final = "<!-- begin: gsvc accuracy --markdown -->"
END: Final = "<!-- end: gsvc accuracy --markdown -->"


def header(group: Group) -> list[str]:
    """The names of the columns of a group; the first two are the mark and the rung."""
    names = ["", group.title, "largest", "99.999 %", "RMS", "PSNR, dB"]
    names += ["source PSNR"] if group.kind != "training" else []
    names += ["bytes"] if group.kind == "coding" else []
    return [*names, "time", "half of the runs", "ratio"]


def cells(group: Group, step: Step) -> list[str]:
    """The cells of a rung, under `header`."""
    errors, seconds = step.errors, step.seconds
    usual = f" ({step.rung.usual})" if step.rung.usual else ""
    row = [BEST_MARK if step.best else "", f"{step.rung.name}{usual}"]
    row += [number(errors.largest), number(errors.quantile), number(errors.rms), decibels(errors.psnr)]
    row += [decibels(step.source_psnr.median, 2)] if group.kind != "training" else []
    row += [f"{step.bytes:,}"] if step.bytes is not None else []
    ratio = "=" if step.rung.base else f"{step.ratio:.3g}"
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


def setting(ladder: Ladder) -> str:
    """What the ladder was measured on, in one sentence."""
    source = ladder.source
    height, width = source.frame.shape[:2]
    frame = f", frame {source.number}" if source.number else ""
    text = f"{source.name}{frame}, {width}x{height}"
    if ladder.fitted_psnr is not None:
        text += f", {ladder.splats:,} splats fitted to {decibels(ladder.fitted_psnr, 2)} dB"
    return text


def machine_text(ladder: Ladder) -> str:
    """The processor and what interprets and compiles."""
    name = ladder.machine
    return (
        f"{name['processor']}, {name['processors']} processors, Python {name['Python']}, NumPy {name['numpy']}, "
        f"Numba {name['numba']}"
    )


def run_counts(result: GroupResult) -> str:
    """How many runs the medians are of."""
    counts = {step.seconds.runs for step in result.steps}
    text = " to ".join(str(count) for count in sorted({min(counts), max(counts)}))
    return f"{text} {'run' if counts == {1} else 'runs'} each"


def curve_lines(ladder: Ladder) -> list[str]:
    """A sentence on each curve, and when they first had what."""
    lines = [f"preset {curve.preset}: {curve.end}" for curve in ladder.curves]
    for psnr in milestones(ladder):
        reached = [f"{curve.preset} {_when(curve, psnr)}" for curve in ladder.curves]
        lines.append(f"{psnr:.0f} dB: {', '.join(reached)}")
    return lines


def milestones(ladder: Ladder) -> list[float]:
    """Round numbers of dB that at least one curve reaches, the highest three of them, 3 dB apart."""
    best = max((psnr for curve in ladder.curves for _, psnr in curve.points if math.isfinite(psnr)), default=0.0)
    return [psnr for psnr in (math.floor(best) - 6.0, math.floor(best) - 3.0, math.floor(best) - 0.0) if psnr > 0]


def _when(curve: Curve, psnr: float) -> str:
    seconds = curve.seconds_to(psnr)
    return f"not within {time_text(curve.points[-1][0])}" if seconds is None else f"after {time_text(seconds)}"


def markdown(ladder: Ladder) -> str:
    """All groups as Markdown tables."""
    lines = [f"Measured on {setting(ladder)}; {machine_text(ladder)}.", ""]
    for result in ladder.groups:
        group = result.group
        lines += [f"**{group.title}** (`{group.name}`): errors against {group.against}; {run_counts(result)}.", ""]
        names = header(group)
        lines.append(f"| {' | '.join(names)} |")
        lines.append(f"|{'|'.join(['---', '---', *['---:'] * (len(names) - 2)])}|")
        lines += [f"| {' | '.join(_escaped(cells(group, step)))} |" for step in result.steps]
        lines += ["", *([group.note, ""] if group.note else [])]
    if ladder.curves:
        lines += ["**Encoding one I-frame**: PSNR against the source, before rounding.", ""]
        lines += [f"- {line}" for line in curve_lines(ladder)] + [""]
    lines += [f"Note: {note}." for note in ladder.notes]
    return "\n".join(lines).rstrip() + "\n"


def _escaped(row: Sequence[str]) -> list[str]:
    return [cell.replace("*", "\\*").replace("|", "\\|") for cell in row]


def check_markers(path: Path) -> None:
    """Refuse a file that `update_markdown` cannot update.

    Raises
    ------
    UsageError
        It does not hold the two markers, each once and in order.
    FileNotFoundError
        There is no such file.
    """
    text = path.read_text(encoding="utf-8")
    if text.count(BEGIN) != 1 or text.count(END) != 1 or text.index(BEGIN) > text.index(END):
        raise UsageError(f"{path} needs the line {BEGIN!r} once, and after it the line {END!r} once: tables go between")


def update_markdown(path: Path, ladder: Ladder) -> None:
    """Put the tables between the markers of a file, in place of what stands there.

    Raises
    ------
    UsageError, FileNotFoundError
        As `check_markers`.
    """
    check_markers(path)
    text = path.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    after = rest.split(END)[1]
    write_text(f"{before}{BEGIN}\n\n{markdown(ladder)}\n{END}{after}", path)


def ladder_object(ladder: Ladder) -> dict[str, Any]:
    """The ladder for JSON; a PSNR of equal pictures is infinite here, which strict JSON must turn into null."""
    height, width = ladder.source.frame.shape[:2]
    return {
        "source": {"name": ladder.source.name, "frame": ladder.source.number, "width": width, "height": height},
        "splats": ladder.splats,
        "fitted_psnr": ladder.fitted_psnr,
        "machine": ladder.machine,
        "seconds": ladder.seconds,
        "groups": [_group_object(result) for result in ladder.groups],
        "curves": [
            {"preset": curve.preset, "iterations": curve.iterations, "end": curve.end,
             "points": [{"seconds": seconds, "psnr": psnr} for seconds, psnr in curve.points]}
            for curve in ladder.curves
        ],
        "notes": ladder.notes,
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
                "name": step.rung.name,
                "usual": step.rung.usual or None,
                "base": step.rung.base,
                "pareto_best": step.best,
                "largest_error": step.errors.largest,
                "error_quantile_99999": step.errors.quantile,
                "rms_error": step.errors.rms,
                "psnr": step.errors.psnr,
                "source_psnr": step.source_psnr,
                "bytes": step.bytes,
                "seconds": step.seconds,
                "ratio": step.ratio,
            }
            for step in result.steps
        ],
    }
