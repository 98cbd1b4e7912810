"""The ladder as one HTML page: plots of error against time and of PSNR against seconds, and every number."""

import html
import math
from collections.abc import Callable, Sequence
from typing import Final

from gsvc_lab.accuracy.cells import (
    BEST,
    LEGEND,
    WORK,
    cells,
    curve_lines,
    decibels,
    header,
    machine_text,
    number,
    run_counts,
    setting,
    time_text,
)  # fmt: skip
from gsvc_lab.accuracy.ladder import central
from gsvc_lab.accuracy.plots import Axis, Point, Series, plot
from gsvc_lab.accuracy.results import GroupResult, Ladder, Step
from gsvc_lab.accuracy.rungs import Kind
from gsvc_lab.pages import Figure
from gsvc_lab.pages.charts import thousands
from gsvc_lab.pages.page import cards_section, document, notes_section
from gsvc_lab.pages.pictures import U1, png_uri, to_eight_bits

TITLE: Final = "What accuracy costs in time"

COLORS: Final = {"precision": 0, "exp": 1, "cutoff": 2, "position": 0, "cholesky": 1, "color": 2, "splats": 0,
                 "iterations": 1, "start": 2, "rates": 3}  # fmt: skip
"""The colour of each group that is plotted; tiles leave the picture as it is, and have their table."""

ORDERED: Final = {"exp", "cutoff", "position", "cholesky", "splats", "iterations"}
"""Groups whose rungs go from coarse to fine, so that a line joins them."""

MAX_SHOWN_PIXELS: Final = 270_000
"""Of a larger picture the middle is shown, so that the page stays light."""

Value = Callable[[Step], float]

CURVE_COLORS: Final = {"quick": 0, "paper": 1}


def ladder_html(ladder: Ladder, command: str = "") -> str:
    """The whole page as text; it needs nothing else, no network and no scripts."""
    sections = [
        f"<h1>{TITLE}</h1>",
        f"<p>Each rung of this ladder is one choice with all others fixed. Measured on {html.escape(setting(ladder))}; "
        f"{html.escape(machine_text(ladder))}; in {ladder.seconds:.0f} seconds.</p>",
        f"<pre>{html.escape(command)}</pre>" if command else "",
        cards_section(_cards(ladder)),
        _rendering(ladder),
        _pictures(ladder),
        _curves(ladder),
        _training(ladder),
        _coding(ladder),
        notes_section([*LEGEND, *ladder.notes], ladder.machine),
    ]
    return document(TITLE, sections)


def _cards(ladder: Ladder) -> list[Figure]:
    """What stands out, as far as it was measured."""
    steps = {(result.group.name, step.rung.name): step for result in ladder.groups for step in result.steps}
    cards = []
    exact = steps.get(("precision", "exact"))
    for key, label in ((("precision", "fast"), "Fast renderer"), (("precision", "deterministic"), "Deterministic"),
                       (("precision", "binary64, polynomial exp"), "Binary64")):  # fmt: skip
        if (step := steps.get(key)) and exact:
            factor = exact.seconds.median / step.seconds.median
            note = f"{number(step.errors.largest)} steps off at most; {factor:,.0f} × as fast as exact"
            cards.append(Figure(label, *_time_parts(step), note))
    for curve in ladder.curves:
        last, psnr = curve.points[-1]
        cards.append(Figure(f"Preset {curve.preset}", decibels(psnr, 2), "dB", f"after {time_text(last)} of encoding"))
    return cards


def _time_parts(step: Step) -> tuple[str, str]:
    value, unit = time_text(step.seconds.median).split()
    return value, unit


def _curves(ladder: Ladder) -> str:
    """PSNR against seconds of each preset."""
    if not ladder.curves:
        return ""
    series = [
        Series(
            f"{curve.preset}: {curve.end}",
            (
                *(Point(seconds, psnr) for seconds, psnr in curve.points[:-1]),
                Point(*curve.points[-1], f"{curve.preset}, {decibels(curve.points[-1][1])} dB", curve.end),
            ),
            CURVE_COLORS[curve.preset],
        )
        for curve in ladder.curves
    ]
    lines = [Series("", one.points, one.color, marks=False) for one in series]
    ends = [Series(one.name, one.points[-1:], one.color, line=False) for one in series]
    chart = plot([*lines, *ends], Axis("seconds of encoding", _plain, log=True), Axis("PSNR, dB", _plain),
                 "PSNR against seconds while encoding, by preset")  # fmt: skip
    milestones = "".join(f"<li>{html.escape(line)}</li>" for line in curve_lines(ladder)[len(ladder.curves) :])
    return (
        "<h2>PSNR against seconds while encoding</h2>"
        '<p class="caption">One I-frame from the beginning, with each preset; the picture before rounding against the '
        "source, and at the end the decoded frame. Where a preset chooses quantisers, time passes without a point; "
        "then fine-tuning begins, with the picture as a decoder will have it.</p>"
        f"{chart}<ul>{milestones}</ul>"
    )


def _plain(value: float) -> str:
    return f"{value:g}"


def _results(ladder: Ladder, kind: Kind) -> list[GroupResult]:
    return [result for result in ladder.groups if result.group.kind == kind]


def _rendering(ladder: Ladder) -> str:
    """RMS error against milliseconds."""
    results = _results(ladder, "rendering")
    series = _series(results, lambda step: 1e3 * step.seconds.median, lambda step: step.errors.rms, 1e3)
    chart = ""
    if series:
        x, y = (
            Axis("milliseconds for the picture", _plain, log=True),
            Axis("RMS error, steps of 8 bits", _power, log=True),
        )
        chart = plot(series, x, y, "RMS error against time of rendering")
    text = (
        f"Time of {WORK['rendering']}. Left is faster, lower is closer; a full mark is Pareto-best in its group. A "
        "line through a mark holds half of the runs."
    )
    return _section("Rendering: error against time", text, chart, results)


def _pictures(ladder: Ladder) -> str:
    """The source, and where errors lie; of a large picture the middle."""
    if not ladder.pictures:
        return ""
    source = to_eight_bits(ladder.source.frame, (1 << ladder.source.bit_depth) - 1)
    figures = [_figure(source, f"The source: {setting(ladder)}")]
    for shown in ladder.pictures:
        step = next(step for result in ladder.groups for step in result.steps
                    if result.group is shown.group and step.rung.name == shown.rung)  # fmt: skip
        text = (
            f"{shown.group.title}, {shown.rung}: errors against {shown.group.against}; one step is {_gain(shown.gain)} "
            f"grey levels. Largest: {number(step.errors.largest)} steps"
        )
        figures.append(_figure(shown.picture, text))
    return f'<h2>Where the errors are</h2><div class="grid4">{"".join(figures)}</div>'


def _gain(value: float) -> str:
    return thousands(value) if value >= 1 else f"{value:g}"


def _figure(picture: U1, text: str) -> str:
    shown = central(picture, MAX_SHOWN_PIXELS)
    caption = html.escape(text)
    size = f'width="{shown.shape[1]}" height="{shown.shape[0]}"'
    return f'<figure><img src="{png_uri(shown)}" alt="{caption}" {size}><figcaption>{caption}</figcaption></figure>'


def _training(ladder: Ladder) -> str:
    """PSNR against seconds of fitting."""
    results = _results(ladder, "training")
    series = _series(results, lambda step: step.seconds.median, lambda step: step.source_psnr.median, 1.0)
    chart = ""
    if series:
        x, y = Axis("seconds of fitting", _plain, log=True), Axis("PSNR against the source, dB", _plain)
        chart = plot(series, x, y, "PSNR against time of fitting")
    text = f"Time of {WORK['training']}; every run has another seed. Left is faster, higher is better."
    return _section("Fitting: PSNR against time", text, chart, results)


def _coding(ladder: Ladder) -> str:
    """PSNR against bytes."""
    results = _results(ladder, "coding")
    series = _series(results, lambda step: float(step.bytes or 0), lambda step: step.source_psnr.median, None)
    chart = ""
    if series:
        x, y = Axis("bytes of the I-frame", thousands), Axis("PSNR against the source, dB", _plain)
        chart = plot(series, x, y, "PSNR against bytes of the coded frame")
    before = f", which had {decibels(ladder.fitted_psnr, 2)} dB before" if ladder.fitted_psnr is not None else ""
    text = (
        f"The same fitted splats{before}, coded with one quantiser changed. These choices cost bytes rather than time; "
        f"the tables also have the time of {WORK['coding']}."
    )
    return _section("Coding: PSNR against bytes", text, chart, results)


def _series(results: Sequence[GroupResult], x: Value, y: Value, per_second: float | None) -> list[Series]:
    """A series per plotted group; `per_second` scales the spread of the time to x, None shows none."""
    series = []
    for result in results:
        if result.group.name in COLORS:
            points = tuple(
                Point(
                    x(step), y(step), step.rung.name, _title(result, step), step.best,
                    *((step.seconds.low * per_second, step.seconds.high * per_second) if per_second else ()),
                )
                for step in result.steps
            )  # fmt: skip
            line = result.group.name in ORDERED
            series.append(Series(result.group.title, points, COLORS[result.group.name], line))
    return series


def _title(result: GroupResult, step: Step) -> str:
    size = f", {step.bytes:,} bytes" if step.bytes is not None else ""
    return (
        f"{result.group.title}, {step.rung.name}: {time_text(step.seconds.median)}, RMS error "
        f"{number(step.errors.rms)}, largest {number(step.errors.largest)} steps{size}"
    )


def _power(value: float) -> str:
    """0.001 and above as it is, below as a power of ten."""
    if value == 0:
        return "0"
    if 1e-3 <= value < 1e4:
        return f"{value:g}"
    exponent = round(math.log10(value))
    return f'10<tspan dy="-4" font-size="9">{"−" if exponent < 0 else ""}{abs(exponent)}</tspan>'


def _section(title: str, text: str, chart: str, results: Sequence[GroupResult]) -> str:
    """A heading, a chart and the tables of groups."""
    if not results:
        return ""
    return f'<h2>{title}</h2><p class="caption">{html.escape(text)}</p>{chart}' + "".join(map(_table, results))


def _table(result: GroupResult) -> str:
    group = result.group
    names = "".join(
        f"<th{' class=' + chr(34) + 'text' + chr(34) if index < 2 else ''}>{html.escape(name)}</th>"
        for index, name in enumerate(["", "", *header(group)[2:]])
    )
    rows = "".join(_row(cells(group, step)) for step in result.steps)
    note = f" {group.note}" if group.note else ""
    return (
        f'<h3>{html.escape(group.title)}</h3><p class="caption">Errors and PSNR against {html.escape(group.against)}; '
        f"{run_counts(result)}.{html.escape(note)}</p>"
        f'<div class="scroll"><table title="{html.escape(BEST)}"><thead><tr>{names}</tr></thead><tbody>{rows}</tbody>'
        "</table></div>"
    )


def _row(row: Sequence[str]) -> str:
    numbers = "".join(f"<td>{html.escape(cell)}</td>" for cell in row[2:])
    return (
        f'<tr><td class="text best">{html.escape(row[0])}</td><td class="text">{html.escape(row[1])}</td>{numbers}</tr>'
    )
