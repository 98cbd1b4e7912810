"""What is wrong, on the page: folded by operation and by cause, the simplest first, each with its command."""

import html
from collections.abc import Iterable, Mapping, Sequence
from typing import Final

import numpy as np

from gsvc_base.cli.text import plural
from gsvc_conformance.causes import looks_like
from gsvc_conformance.report.console import ends, probable_causes, ratio_text
from gsvc_conformance.report.element_tables import Cell, ElementTable
from gsvc_conformance.report.measures import LEAST_POWER, MOST_POWER, NOT_FINITE, ramp
from gsvc_conformance.report.overview import places_text
from gsvc_conformance.report.pictures import Picture, View
from gsvc_conformance.report.png import png_uri
from gsvc_conformance.results import Result, Table
from gsvc_conformance.side_by_side import RIGHT
from gsvc_conformance.verdicts import Report

MAX_FAULTS: Final = 2000
"""Maximum number of wrong vectors that are described; all of them stand in the table of vectors."""
MAX_VIEW_BYTES: Final = 1_500_000
"""Maximum size of all pictures and tables of elements; those of the simplest failures come first."""
MAX_LINKS: Final = 40
"""Maximum number of vectors that are listed with a cause."""
SHOWN_PIXELS: Final = 288
"""A picture is enlarged to this width or height, by a whole factor."""
LARGEST_FACTOR: Final = 32
LEGEND_STEPS: Final = 256


NO_PICTURES: Final = "pictures need the outputs that `run --keep DIR` left: add --keep DIR"
"""What is said where a page is made of JSON alone, which has no pictures."""


def failures_section(report: Report, given: Mapping[str, View] | None) -> str:
    """The failures with their filter; nothing if nothing is wrong. Pictures are None where no outputs were there."""
    views = given or {}
    faults = report.simplest_first()
    if not faults:
        return ""
    shown, left_out = faults[:MAX_FAULTS], len(faults) - MAX_FAULTS
    drawn = _drawn(shown, views)
    groups = [
        _group(operation, [fault for fault in shown if fault.operation == operation], report, drawn, is_open=place == 0)
        for place, operation in enumerate(dict.fromkeys(fault.operation for fault in shown))
    ]
    more = f"<p>{left_out} more stand in the table of vectors.</p>" if left_out > 0 else ""
    rest = len(views) - len(drawn)
    undrawn = f'<p class="caption">The pictures of {plural(rest, "failure")} are left out.</p>' if rest else ""
    rest_of_it = f"{''.join(groups)}{more}{_by_cause(report, shown)}"
    lacking = f'<p class="caption">No pictures: {html.escape(NO_PICTURES)}.</p>' if given is None else ""
    return (
        "<h2>What is wrong, the simplest first</h2>"
        '<p class="caption">A command runs one vector again; with <code>--keep DIR</code> it leaves inputs, outputs '
        "and what is expected as files for a debugger.</p>"
        f"{lacking}{filter_form(report)}{_legend() if drawn else ''}{undrawn}{rest_of_it}"
    )


def filter_form(report: Report) -> str:
    """Boxes that choose among failures and vectors, which the script shows."""
    choices: dict[str, Iterable[str]] = {
        "outcome": dict.fromkeys(result.outcome for result in report.results),
        "operation": dict.fromkeys(result.operation for result in report.results),
        "tier": dict.fromkeys(result.tier for result in report.results),
    }
    boxes = "".join(
        f'<select name="{name}" aria-label="{name}"><option value="">every {name}</option>'
        + "".join(f"<option>{html.escape(value)}</option>" for value in values)
        + "</select>"
        for name, values in choices.items()
    )
    buttons = '<button type="button" name="open">open all</button><button type="button" name="close">close all</button>'
    return (
        '<form class="filter" hidden><input type="search" name="text" placeholder="filter: words, ids, causes" '
        f'aria-label="text">{boxes}{buttons if report.faults else ""}<output></output></form>'
    )


def _drawn(faults: Sequence[Result], views: Mapping[str, View]) -> dict[str, str]:
    """The views as HTML, by id, as many as have room."""
    drawn: dict[str, str] = {}
    room = MAX_VIEW_BYTES
    for fault in faults:
        text = _view(views[fault.id]) if fault.id in views else ""
        if text and len(text) <= room:
            drawn[fault.id] = text
            room -= len(text)
    return drawn


def _group(operation: str, faults: Sequence[Result], report: Report, drawn: Mapping[str, str], *, is_open: bool) -> str:
    """The failures of an operation; the first one of the first operation is open."""
    ratios = [fault.ratio for fault in faults if fault.ratio is not None]
    worst = f"worst error/bound {ratio_text(max(ratios))}" if ratios else ""
    total = sum(result.operation == operation for result in report.results)
    entries = "".join(
        _fault(fault, report.again(fault.id), drawn.get(fault.id, ""), is_open=is_open and place == 0)
        for place, fault in enumerate(faults)
    )
    name = html.escape(operation)
    return (
        f'<details class="group" id="operation-{name}"{" open" * is_open}><summary><b>{name}</b> '
        f'{len(faults)} of {total} wrong <span class="muted">{worst}</span></summary>'
        f'<pre class="command">{html.escape(report.command)} --operation {name}</pre>{entries}</details>'
    )


def _fault(result: Result, command: str, drawn: str, *, is_open: bool) -> str:
    causes = "".join(f"<li>{html.escape(looks_like(cause))}</li>" for cause in result.causes)
    log = "\n".join(ends(result.log))
    ratio = f"{ratio_text(result.ratio)} × bound" if result.ratio is not None else ""
    return (
        f'<details class="fault" id="{html.escape(result.id)}" data-outcome="{result.outcome}"{" open" * is_open}>'
        f'<summary><span class="badge bad">{result.outcome}</span> {html.escape(result.id)} '
        f'<span class="muted">{ratio}</span></summary>'
        f"<p>{html.escape(result.title)}</p><p>{html.escape(result.message)}</p>"
        + (f'<ul class="causes">{causes}</ul>' if causes else "")
        + (drawn or _ratios(result.table))
        + (f'<pre class="log">{html.escape(log)}</pre>' if log else "")
        + f'<pre class="command">{html.escape(command)}</pre></details>'
    )


def _by_cause(report: Report, shown: Sequence[Result]) -> str:
    """The failures again, as links, by what they look like."""
    causes = probable_causes(report)
    named = {result.id for cause in causes for result in cause.results}
    place = {result.id: number for number, result in enumerate(shown)}
    folds = "".join(
        _links(f"cause-{number}", cause.text, places_text(cause), cause.results, place)
        for number, cause in enumerate(causes, 1)
    )
    rest = tuple(result for result in shown if result.id not in named)
    if rest and causes:
        folds += _links(
            "cause-none", "No cause that many have, or not examined", plural(len(rest), "failure"), rest, place
        )
    return f"<h2>By cause</h2>{folds}" if causes else ""


def _links(name: str, sentence: str, where: str, results: Sequence[Result], place: Mapping[str, int]) -> str:
    there = sorted((result for result in results if result.id in place), key=lambda result: place[result.id])
    items = "".join(
        f'<li><a href="#{html.escape(result.id)}">{html.escape(result.id)}</a></li>' for result in there[:MAX_LINKS]
    )
    more = f"<li>{len(there) - MAX_LINKS} more</li>" if len(there) > MAX_LINKS else ""
    return (
        f'<details class="group" id="{name}"><summary><b>{html.escape(sentence)}</b> '
        f'<span class="muted">{html.escape(where)}</span></summary><ul>{items}{more}</ul></details>'
    )


def _legend() -> str:
    """The scale of errors: logarithmic, with 1 marked."""
    powers = np.linspace(LEAST_POWER, MOST_POWER, LEGEND_STEPS)
    bar = png_uri(ramp(10.0**powers)[None])
    span = MOST_POWER - LEAST_POWER
    ticks = "".join(
        f'<span{" class=one" if power == 0 else ""} style="left:{100 * (power - LEAST_POWER) / span:.1f}%">'
        f"{_power(power)}</span>"
        for power in range(LEAST_POWER, MOST_POWER + 1)
    )
    pink = f"#{bytes(NOT_FINITE).hex()}"
    return (
        f'<figure class="scale"><img src="{bar}" alt="dark to green up to 1, yellow to crimson above">'
        f'<div class="ticks">{ticks}</div><figcaption>error/bound, where 1 is allowed. Of numbers that must be '
        "exact: units in the last place; of integers: steps beyond what is allowed, and 1 more. "
        f'<span class="swatch" style="background:{pink}"></span>is no number, or an error where none is allowed. '
        "A box marks the worst pixel.</figcaption>"
        "</figure>"
    )


def _power(power: int) -> str:
    """A power of ten, such as 0.01 or 10⁶."""
    return f"{10.0**power:g}" if power < 3 else f"10<sup>{power}</sup>"


def _view(view: View) -> str:
    """Pictures side by side, or a table."""
    if isinstance(view, ElementTable):
        return _elements(view)
    return f'<div class="pictures">{"".join(map(_picture, view))}</div>'


def _picture(picture: Picture) -> str:
    """A picture, enlarged by a whole factor, with its worst pixel marked."""
    width, height, (x, y) = picture.width, picture.height, picture.mark
    factor = max(1, min(LARGEST_FACTOR, SHOWN_PIXELS // width, SHOWN_PIXELS // height))
    caption = html.escape(picture.caption)
    return (
        f'<figure><div class="frame" style="width:{width * factor}px"><img class="pixels" src="{picture.uri}" '
        f'alt="{caption}"><i style="left:{100 * (x + 0.5) / width:.2f}%;top:{100 * (y + 0.5) / height:.2f}%;'
        f'width:{100 / width:.2f}%;height:{100 / height:.2f}%"></i></div><figcaption>{caption}</figcaption></figure>'
    )


def _elements(table: ElementTable) -> str:
    single = not any(table.columns)
    head = "".join(f"<th>{html.escape(name)}</th>" for name in table.columns)
    body = "".join(
        f'<tr><th class="text">{html.escape(name)}</th>{"".join(map(_cell, cells))}</tr>' for name, cells in table.rows
    )
    titles = "" if single else f"<thead><tr><th></th>{head}</tr></thead>"
    return (
        f'<p class="caption">{html.escape(table.title)} A wrong cell has what was given, what is expected, and how the '
        f'two relate.</p><div class="scroll"><table class="elements{" single" * single}">{titles}'
        f"<tbody>{body}</tbody></table></div>"
    )


def _cell(cell: Cell) -> str:
    given = html.escape(cell.given)
    if cell.color is None:
        return f'<td class="muted">{given}</td>'
    ground, ink = cell.color
    relation = f"<span>{html.escape(cell.ratio)}</span>" if cell.ratio else ""
    return (
        f'<td style="background:{ground};color:{ink}"><b>{given}</b><span>not {html.escape(cell.expected)}</span>'
        f"{relation}</td>"
    )


def _ratios(shown: Table | None) -> str:
    """A table of ratios, what is wrong marked."""
    if shown is None:
        return ""
    rows = "".join(
        f'<tr><th class="text">{html.escape(row[0])}</th>'
        + "".join(f"<td{_mark(cell)}>{html.escape(cell)}</td>" for cell in row[1:])
        + "</tr>"
        for row in shown.rows
    )
    head = "".join(f"<th>{html.escape(name)}</th>" for name in shown.columns)
    return (
        f'<p class="caption">{html.escape(shown.title)}</p><div class="scroll"><table><thead><tr><th></th>{head}</tr>'
        f"</thead><tbody>{rows}</tbody></table></div>"
    )


def _mark(cell: str) -> str:
    return "" if cell == RIGHT else ' class="off"'
