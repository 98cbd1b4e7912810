"""The measurements as one HTML page: plots of error against time and of PSNR against seconds, and every number."""

import html
from collections.abc import Callable, Sequence
from typing import Final

from gsvc_base.arrays import U1
from gsvc_base.pages.page import Figure, cards_section, document, notes_section
from gsvc_base.pages.tables import html_table
from gsvc_lab.accuracy.groups import Kind
from gsvc_lab.accuracy.results import AccuracyReport, GroupResult, Measurement
from gsvc_lab.accuracy.runner import central
from gsvc_lab.accuracy.tables import (
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
    source_text,
    time_text,
)  # fmt: skip
from gsvc_lab.pages.charts import Axis, Point, Series, plot, thousands
from gsvc_lab.pages.pictures import png_uri, to_eight_bits

TITLE: Final = "What accuracy costs in time"

COLORS: Final = {"precision": 0, "cutoff": 2, "position": 0, "cholesky": 1, "color": 2, "splats": 0, "iterations": 1,
                 "start": 2, "rates": 3, "gradients": 4}  # fmt: skip
"""The colour of each group that is plotted; threads leave the picture as it is, and have their table."""

ORDERED: Final = {"cutoff", "position", "cholesky", "splats", "iterations"}
"""Groups whose settings go from coarse to fine, so that a line joins them."""

MAX_SHOWN_PIXELS: Final = 270_000
"""Maximum number of pixels that are shown; of a larger picture the middle, so that the page stays light."""

Value = Callable[[Measurement], float]

CURVE_COLORS: Final = {"quick": 0, "paper": 1}


def accuracy_html(report: AccuracyReport, command: str = "") -> str:
    """The whole page as text; it needs nothing else, no network and no scripts."""
    sections = [
        f"<h1>{TITLE}</h1>",
        "<p>Each group of settings varies one thing with all others fixed. Measured on "
        f"{html.escape(f'{source_text(report)}; {machine_text(report)}; in {report.seconds:.0f} seconds.')}</p>",
        f"<pre>{html.escape(command)}</pre>" if command else "",
        cards_section(_cards(report)),
        _rendering(report),
        _pictures(report),
        _curves(report),
        _training(report),
        _coding(report),
        notes_section([*LEGEND, *report.notes], report.machine),
    ]
    return document(TITLE, sections)


def _cards(report: AccuracyReport) -> list[Figure]:
    """The key numbers, as far as they were measured."""
    found = {(result.group.name, one.setting.name): one for result in report.groups for one in result.measurements}
    cards = []
    exact = found.get(("precision", "exact"))
    for name, label in (("fast", "Fast renderer"), ("deterministic", "Deterministic")):
        if (measured := found.get(("precision", name))) and exact:
            factor = exact.seconds.median / measured.seconds.median
            note = f"{number(measured.errors.largest)} steps off at most; {factor:,.0f} × as fast as exact"
            cards.append(Figure(label, *_time_parts(measured), note))
    for curve in report.curves:
        last, psnr = curve.points[-1]
        cards.append(Figure(f"Preset {curve.preset}", decibels(psnr, 2), "dB", f"after {time_text(last)} of encoding"))
    return cards


def _time_parts(measured: Measurement) -> tuple[str, str]:
    value, unit = time_text(measured.seconds.median).split()
    return value, unit


def _curves(report: AccuracyReport) -> str:
    """PSNR against seconds of each preset."""
    if not report.curves:
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
        for curve in report.curves
    ]
    lines = [Series("", one.points, one.color, marks=False) for one in series]
    ends = [Series(one.name, one.points[-1:], one.color, line=False) for one in series]
    chart = plot([*lines, *ends], Axis("seconds of encoding", _plain, log=True), Axis("PSNR, dB", _plain),
                 "PSNR against seconds while encoding, by preset")  # fmt: skip
    milestones = "".join(f"<li>{html.escape(line)}</li>" for line in curve_lines(report)[len(report.curves) :])
    return (
        "<h2>PSNR against seconds while encoding</h2>"
        '<p class="caption">One I-frame from the beginning, with each preset; the picture before rounding against the '
        "source, and at the end the decoded frame. Where a preset chooses quantisers, time passes without a point; "
        "then fine-tuning begins, with the picture as a decoder will have it.</p>"
        f"{chart}<ul>{milestones}</ul>"
    )


def _plain(value: float) -> str:
    return f"{value:g}"


def _results(report: AccuracyReport, kind: Kind) -> list[GroupResult]:
    return [result for result in report.groups if result.group.kind == kind]


def _rendering(report: AccuracyReport) -> str:
    """RMS error against milliseconds."""
    results = _results(report, "rendering")
    series = _series(results, lambda measured: 1e3 * measured.seconds.median, lambda measured: measured.errors.rms, 1e3)
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


def _pictures(report: AccuracyReport) -> str:
    """The source, and where errors lie; of a large picture the middle."""
    if not report.pictures:
        return ""
    source = to_eight_bits(report.source.frame, (1 << report.source.bit_depth) - 1)
    figures = [_figure(source, f"The source: {source_text(report)}")]
    for shown in report.pictures:
        measured = next(
            one
            for result in report.groups
            for one in result.measurements
            if result.group is shown.group and one.setting.name == shown.setting
        )
        text = (
            f"{shown.group.title}, {shown.setting}: errors against {shown.group.against}; "
            f"one step is {_gain(shown.gain)} grey levels. Largest: {number(measured.errors.largest)} steps"
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


def _training(report: AccuracyReport) -> str:
    """PSNR against seconds of fitting."""
    results = _results(report, "training")
    series = _series(
        results, lambda measured: measured.seconds.median, lambda measured: measured.source_psnr.median, 1.0
    )
    chart = ""
    if series:
        x, y = Axis("seconds of fitting", _plain, log=True), Axis("PSNR against the source, dB", _plain)
        chart = plot(series, x, y, "PSNR against time of fitting")
    text = f"Time of {WORK['training']}; every run has another seed. Left is faster, higher is better."
    return _section("Fitting: PSNR against time", text, chart, results)


def _coding(report: AccuracyReport) -> str:
    """PSNR against bytes."""
    results = _results(report, "coding")
    series = _series(
        results, lambda measured: float(measured.bytes or 0), lambda measured: measured.source_psnr.median, None
    )
    chart = ""
    if series:
        x, y = Axis("bytes of the I-frame", thousands), Axis("PSNR against the source, dB", _plain)
        chart = plot(series, x, y, "PSNR against bytes of the coded frame")
    before = f", which had {decibels(report.fitted_psnr, 2)} dB before" if report.fitted_psnr is not None else ""
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
                    x(measured), y(measured), measured.setting.name, _title(result, measured), measured.best,
                    *((measured.seconds.low * per_second, measured.seconds.high * per_second) if per_second else ()),
                )
                for measured in result.measurements
            )  # fmt: skip
            line = result.group.name in ORDERED
            series.append(Series(result.group.title, points, COLORS[result.group.name], line))
    return series


def _title(result: GroupResult, measured: Measurement) -> str:
    size = f", {measured.bytes:,} bytes" if measured.bytes is not None else ""
    return (
        f"{result.group.title}, {measured.setting.name}: {time_text(measured.seconds.median)}, RMS error "
        f"{number(measured.errors.rms)}, largest {number(measured.errors.largest)} steps{size}"
    )


def _power(value: float) -> str:
    """0.001 and above as it is, below as a digit times a power of ten, in SVG; the digit 1 is left out."""
    if value == 0:
        return "0"
    if 1e-3 <= value < 1e4:
        return f"{value:g}"
    digit, _, exponent = f"{value:.0e}".partition("e")
    factor = "" if digit == "1" else f"{digit}·"
    return f'{factor}10<tspan dy="-4" font-size="9">{"−" if value < 1 else ""}{abs(int(exponent))}</tspan>'


def _section(title: str, text: str, chart: str, results: Sequence[GroupResult]) -> str:
    """A heading, a chart and the tables of groups."""
    if not results:
        return ""
    return f'<h2>{title}</h2><p class="caption">{html.escape(text)}</p>{chart}' + "".join(map(_table, results))


def _table(result: GroupResult) -> str:
    group = result.group
    header_cells = ["", "", *header(group)[2:]]
    table = html_table(
        header_cells, [cells(group, one) for one in result.measurements], ("text best", "text"), title=BEST
    )
    note = f" {group.note}" if group.note else ""
    return (
        f'<h3>{html.escape(group.title)}</h3><p class="caption">Errors and PSNR against {html.escape(group.against)}; '
        f"{run_counts(result)}.{html.escape(note)}</p>{table}"
    )
