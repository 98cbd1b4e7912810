"""A run of the suite as one HTML page that needs nothing else: no network, no scripts."""

import html
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from gsvc_conformance.report.console import cause_lines, conclusion, feature_counts, folded, ratio_text, rule_counts
from gsvc_conformance.report.pictures import KEY, Picture
from gsvc_conformance.results import OUTCOMES, Report, Result, Summary, Table
from gsvc_conformance.side_by_side import RIGHT
from gsvc_lab.pages.data import Figure
from gsvc_lab.pages.page import cards_section, document, notes_section

MAX_FAULTS: Final = 200
"""Maximum number of wrong vectors that are described; all of them stand in the table of vectors."""

COLORS: Final = {"passed": "good", "incomplete": "warn", "failed": "bad"}
"""Classes of style of verdicts and conclusions."""


def report_html(report: Report, pictures: Mapping[str, Sequence[Picture]] | None = None) -> str:
    """The page.

    Parameters
    ----------
    report
        The report.
    pictures
        The pictures of wrong vectors, by id.
    """
    title = f"GSVC conformance: {report.environment.get('implementation', 'an implementation')}"
    sections = [
        f"<h1>{html.escape(title)}</h1>",
        _verdict(report),
        _causes(report),
        f"<pre>{html.escape(report.command)}</pre>",
        cards_section(_cards(report)),
        _runs_on(report.runs_on),
        _features(report),
        _classes(report.groups()),
        _quotes(report.quotes()),
        _refusals(report),
        _operations(report.operations()),
        _faults(report, pictures or {}),
        _waived(report.results),
        _vectors(report.results),
        notes_section([*report.stale, *report.notes], report.environment),
    ]
    style = Path(__file__).with_name("style.css").read_text(encoding="utf-8")
    return document(title, sections).replace("</style>", f"{style}</style>", 1)


def _verdict(report: Report) -> str:
    words = html.escape("".join(conclusion(report)).capitalize())
    color = "bad" if report.exit_code == 1 else COLORS.get(report.conclusion, "other")
    return f'<p class="verdict {color}">{words}</p>\n<p>{html.escape(report.verdict)}.</p>'


def _causes(report: Report) -> str:
    items = "".join(f"<li>{html.escape(cause)}</li>" for cause in cause_lines(report))
    return f'<h2>Probable cause</h2><ul class="causes">{items}</ul>' if items else ""


def _runs_on(entries: Mapping[str, str]) -> str:
    rows = "".join(
        f'<tr><td class="text">{html.escape(name)}</td><td class="text long">{html.escape(value)}</td></tr>'
        for name, value in entries.items()
    )
    table = f'<div class="scroll"><table><tbody>{rows}</tbody></table></div>'
    return f"<h2>What the implementation runs on</h2>{table}" if entries else ""


def _features(report: Report) -> str:
    """The features that it was judged by."""
    words = html.escape(f"{report.features}: {feature_counts(report)}.")
    return f"<h2>What it is made for</h2><p>{words}</p>" if report.features else ""


def _cards(report: Report) -> list[Figure]:
    count: dict[str, int] = {
        outcome: sum(result.outcome == outcome for result in report.results) for outcome in OUTCOMES
    }
    ratios = [operation.ratio for operation in report.operations() if operation.ratio is not None]
    cards = [
        Figure("Vectors", f"{len(report.results):,}", "", report.selection and f"only {report.selection}"),
        Figure("Pass", f"{count['pass']:,}"),
        Figure("Wrong", f"{len(report.faults):,}", "", _split(count, ("fail", "error", "crash", "timeout"))),
        Figure("Unsupported", f"{count['unsupported']:,}"),
    ]
    if count["waived"] or count["skipped"]:
        excused = count["waived"] + count["skipped"]
        cards.append(Figure("Excused", f"{excused:,}", "", _split(count, ("waived", "skipped"))))
    if ratios:
        cards.append(Figure("Worst error/bound", ratio_text(max(ratios)), "", "1 is allowed"))
    return cards


def _split(count: Mapping[str, int], names: Sequence[str]) -> str:
    return ", ".join(f"{count[name]} {name}" for name in names if count[name])


def _classes(groups: Sequence[Summary]) -> str:
    rows = "".join(
        f'<tr><td class="text">{html.escape(group.name)}</td>'
        f'<td class="text"><span class="badge {_badge(group)}">{group.verdict}</span></td>'
        f'<td class="text long">{html.escape(group.reason)}</td></tr>'
        for group in groups
    )
    return f"<h2>Classes</h2>{_table(('class', 'verdict', 'because'), rows, 3)}"


def _quotes(quotes: Sequence[str]) -> str:
    """The verdicts in words that can be quoted."""
    return f"<ul>{''.join(f'<li>{html.escape(quote)}</li>' for quote in quotes)}</ul>" if quotes else ""


def _refusals(report: Report) -> str:
    """The rules and bits that refusals name: advice, since the kind alone is judged."""
    counts = "".join(
        f"<li>class {html.escape(name)}: {rule_counts(refused)}</li>" for name, refused in report.refusals().items()
    )
    named = report.advice()
    advice = "".join(
        f"<li>{html.escape(result.id)} {html.escape(output.advice)}</li>" for result, output in named[:MAX_FAULTS]
    )
    left = len(named) - MAX_FAULTS
    more = f"<li>{left} more</li>" if left > 0 else ""
    heading = "<h2>Refusals</h2><p>Only the kind of an error is judged; rule and bit are advice.</p>"
    return f"{heading}<ul>{counts}{advice}{more}</ul>" if counts else ""


def _badge(group: Summary) -> str:
    return COLORS.get(str(group.verdict), "other")


def _operations(operations: Sequence[Summary]) -> str:
    rows = ""
    answered, unsupported = folded(operations)
    for operation in answered:
        excused = operation.counts.get("waived", 0) + operation.counts.get("skipped", 0)
        right, unsupported_ones = (operation.counts.get(outcome, 0) for outcome in ("pass", "unsupported"))
        numbers = (operation.total, right, operation.faults, unsupported_ones, excused)
        cells = "".join(f"<td>{number or ''}</td>" for number in numbers)
        mark = ' class="key"' if operation.faults else ""
        rows += (
            f'<tr{mark}><td class="text">{html.escape(operation.name)}</td>{cells}'
            f"<td>{ratio_text(operation.ratio)}</td>"
            f'<td class="text long">{html.escape(operation.place)}</td></tr>'
        )
    head = ("operation", "vectors", "pass", "wrong", "unsupported", "excused", "worst error/bound", "where")
    others = f"<p>{unsupported}.</p>" if unsupported else ""
    return f"<h2>Operations</h2>{_table(head, rows, 1) if rows else ''}{others}"


def _faults(report: Report, pictures: Mapping[str, Sequence[Picture]]) -> str:
    faults = report.simplest_first()
    if not faults:
        return ""
    left_out = len(faults) - MAX_FAULTS
    more = f"<p>{left_out} more stand in the table of vectors.</p>" if left_out > 0 else ""
    shown = "".join(
        _fault(result, report.again(result.id), pictures.get(result.id, ())) for result in faults[:MAX_FAULTS]
    )
    return f'<h2>What is wrong</h2><p class="caption">{KEY}</p>{shown}{more}'


def _ratios(shown: Table | None) -> str:
    """A table of ratios, what is wrong marked."""
    if shown is None:
        return ""
    rows = "".join(
        f'<tr><td class="text">{html.escape(row[0])}</td>'
        + "".join(f"<td{_mark(cell)}>{html.escape(cell)}</td>" for cell in row[1:])
        + "</tr>"
        for row in shown.rows
    )
    return f'<p class="caption">{html.escape(shown.title)}</p>{_table(("", *shown.columns), rows, 1)}'


def _mark(cell: str) -> str:
    return "" if cell == RIGHT else ' class="off"'


def _fault(result: Result, command: str, pictures: Sequence[Picture]) -> str:
    causes = "".join(f"<li>looks like {html.escape(cause)}</li>" for cause in result.causes)
    figures = "".join(
        f'<figure><img class="pixels" src="{picture.uri}" alt="{html.escape(picture.caption)}">'
        f"<figcaption>{html.escape(picture.caption)}</figcaption></figure>"
        for picture in pictures
    )
    return (
        f'<section class="fault"><h3><span class="badge bad">{result.outcome}</span> {html.escape(result.id)}</h3>'
        f"<p>{html.escape(result.title)}</p><p>{html.escape(result.message)}</p>"
        + (f'<ul class="causes">{causes}</ul>' if causes else "")
        + _ratios(result.table)
        + (f'<div class="grid3">{figures}</div>' if figures else "")
        + (f'<pre class="log">{html.escape(result.log)}</pre>' if result.log else "")
        + f"<pre>{html.escape(command)}</pre></section>"
    )


def _waived(results: Sequence[Result]) -> str:
    waived = [result for result in results if result.outcome in ("waived", "skipped")]
    items = "".join(f"<li>{html.escape(r.id)}, {r.outcome}: {html.escape(r.message)}</li>" for r in waived)
    return f"<h2>What does not count</h2><ul>{items}</ul>" if items else ""


def _vectors(results: Sequence[Result]) -> str:
    rows = "".join(
        f'<tr><td class="text">{html.escape(result.id)}</td><td class="text">{result.outcome}</td>'
        f'<td>{ratio_text(result.ratio)}</td><td class="text long">{html.escape(result.title)}</td></tr>'
        for result in results
    )
    head = ("vector", "result", "worst error/bound", "what it shows")
    return (
        f"<h2>Every vector</h2><details><summary>Table of {len(results):,} vectors</summary>"
        f"{_table(head, rows, 2)}</details>"
    )


def _table(head: Sequence[str], rows: str, texts: int) -> str:
    """A table whose first columns, and the last one, are texts."""
    last = len(head) - 1
    cells = "".join(
        f'<th class="text">{name}</th>' if index < texts or index == last else f"<th>{name}</th>"
        for index, name in enumerate(head)
    )
    return f'<div class="scroll"><table><thead><tr>{cells}</tr></thead><tbody>{rows}</tbody></table></div>'
