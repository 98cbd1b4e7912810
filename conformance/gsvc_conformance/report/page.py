"""A run of the suite as one HTML page that needs nothing else: no network, and a script for its filter only."""

import base64
import hashlib
import html
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from gsvc_base.cli.text import plural
from gsvc_base.pages.page import document
from gsvc_conformance.report.console import feature_counts, folded, ratio_text, rule_counts
from gsvc_conformance.report.failures import failures_section, filter_form
from gsvc_conformance.report.overview import BADGES, overview_section, quotes_list
from gsvc_conformance.report.pictures import View
from gsvc_conformance.results import FAULTS, Result
from gsvc_conformance.verdicts import Report, Summary

MAX_ADVICE: Final = 200
"""Maximum number of refusals whose rule is another one that are listed."""


def report_html(report: Report, pictures: Mapping[str, View] | None = None) -> str:
    """The page.

    Parameters
    ----------
    report
        The report.
    pictures
        Pictures or tables of wrong outputs, by the id of the vector; None where no outputs are there to be shown.
    """
    title = f"GSVC conformance: {report.environment.get('implementation', 'an implementation')}"
    failures = failures_section(report, pictures)
    sections = [
        overview_section(title, report),
        failures or filter_form(report),
        _fold("Classes", _classes(report), is_open=not report.faults),
        _fold("What it is made for", _features(report)),
        _fold("Operations", _operations(report.operations())),
        _fold("Refusals", _refusals(report)),
        _fold("What does not count", _waived(report.results)),
        _fold(f"All {plural(len(report.results), 'vector')}", _vectors(report.results), name="vectors"),
        _fold("Stale waivers", "".join(f"<li>{html.escape(sentence)}</li>" for sentence in report.stale), is_open=True),
        _fold("Notes", "".join(f"<li>{html.escape(note)}</li>" for note in report.notes)),
        _fold("What the implementation runs on", _pairs(report.runs_on)),
        _fold("Kit, vectors and machine", _pairs(report.environment)),
        f"<script>{_file('page.js')}</script>",
    ]
    return _with_head(document(title, sections))


def _with_head(page: str) -> str:
    """The page with its style, and a policy by which the browser loads nothing and runs no script but the page's."""
    script = base64.b64encode(hashlib.sha256(_file("page.js").encode()).digest()).decode()
    policy = f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'sha256-{script}'"
    meta = f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
    return page.replace("</style>", f"{_file('style.css')}</style>\n{meta}", 1)


def _file(name: str) -> str:
    return Path(__file__).with_name(name).read_text(encoding="utf-8")


def _fold(heading: str, content: str, *, is_open: bool = False, name: str = "") -> str:
    """A section that can be folded; nothing if it has no content."""
    if not content:
        return ""
    words = f"{f' id={name}' if name else ''}{' open' if is_open else ''}"
    inside = f"<ul>{content}</ul>" if content.startswith("<li>") else content
    return f'<details class="section"{words}><summary><h2>{html.escape(heading)}</h2></summary>{inside}</details>'


def _pairs(entries: Mapping[str, str]) -> str:
    rows = "".join(
        f'<tr><td class="text">{html.escape(name)}</td><td class="text long">{html.escape(value)}</td></tr>'
        for name, value in entries.items()
    )
    return f'<div class="scroll"><table><tbody>{rows}</tbody></table></div>' if rows else ""


def _classes(report: Report) -> str:
    """The verdicts, and the words for them; those of a claim stand in the overview."""
    rows = "".join(
        f'<tr><td class="text">{html.escape(group.title)}</td>'
        f'<td class="text"><span class="badge {BADGES.get(str(group.verdict), "other")}">{group.verdict}</span></td>'
        f'<td class="text long">{html.escape(group.reason)}</td></tr>'
        for group in report.groups()
    )
    quotes = "" if report.claim else quotes_list(report)
    return (_table(("class", "verdict", "because"), rows, 3) if rows else "") + quotes


def _features(report: Report) -> str:
    """The features that it was judged by."""
    return f"<p>{html.escape(f'{report.features}: {feature_counts(report)}.')}</p>" if report.features else ""


def _refusals(report: Report) -> str:
    """The rules and bits that refusals name: advice, since the kind alone is judged."""
    counts = "".join(
        f"<li>class {html.escape(name)}: {rule_counts(refused)}</li>" for name, refused in report.refusals().items()
    )
    named = report.advice()
    advice = "".join(
        f"<li>{html.escape(result.id)} {html.escape(output.advice)}</li>" for result, output in named[:MAX_ADVICE]
    )
    left = len(named) - MAX_ADVICE
    more = f"<li>{left} more</li>" if left > 0 else ""
    why = "<p>Only the kind of an error is judged; rule and bit are advice.</p>"
    return f"{why}<ul>{counts}{advice}{more}</ul>" if counts else ""


def _operations(operations: Sequence[Summary]) -> str:
    rows = ""
    answered, unsupported = folded(operations)
    for operation in answered:
        right, unsupported_ones = (operation.counts.get(outcome, 0) for outcome in ("pass", "unsupported"))
        numbers = (operation.total, right, operation.faults, unsupported_ones, operation.excused)
        cells = "".join(f"<td>{number or ''}</td>" for number in numbers)
        mark = ' class="key"' if operation.faults else ""
        rows += (
            f'<tr{mark}><td class="text">{html.escape(operation.name)}</td>{cells}'
            f"<td>{ratio_text(operation.ratio)}</td>"
            f'<td class="text long">{html.escape(operation.place)}</td></tr>'
        )
    head = ("operation", "vectors", "pass", "wrong", "unsupported", "excused", "worst error/bound", "where")
    others = f"<p>{unsupported}.</p>" if unsupported else ""
    return (_table(head, rows, 1) if rows else "") + others


def _waived(results: Sequence[Result]) -> str:
    waived = [result for result in results if result.outcome in ("waived", "skipped")]
    return "".join(f"<li>{html.escape(r.id)}, {r.outcome}: {html.escape(r.message)}</li>" for r in waived)


def _vectors(results: Sequence[Result]) -> str:
    rows = "".join(
        f"<tr><td>{_link(result)}</td><td>{result.outcome}</td><td>{ratio_text(result.ratio)}</td>"
        f"<td>{html.escape(result.title)}</td></tr>"
        for result in results
    )
    return _table(("vector", "result", "worst error/bound", "what it shows"), rows, 2)


def _link(result: Result) -> str:
    """The id; of what is wrong it leads to its description."""
    name = html.escape(result.id)
    return f'<a href="#{name}">{name}</a>' if result.outcome in FAULTS else name


def _table(head: Sequence[str], rows: str, texts: int) -> str:
    """A table whose first columns, and the last one, are texts."""
    last = len(head) - 1
    cells = "".join(
        f'<th class="text">{name}</th>' if index < texts or index == last else f"<th>{name}</th>"
        for index, name in enumerate(head)
    )
    return f'<div class="scroll"><table><thead><tr>{cells}</tr></thead><tbody>{rows}</tbody></table></div>'
