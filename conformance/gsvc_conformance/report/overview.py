"""The first screen of the page: verdicts, causes with counts, numbers, and which operations are wrong."""

import html
from collections.abc import Mapping, Sequence
from typing import Final

from gsvc_base.cli.text import plural
from gsvc_conformance.report.console import Cause, conclusion, folded, probable_causes, ratio_text
from gsvc_conformance.results import OUTCOMES
from gsvc_conformance.verdicts import Report, Summary

BADGES: Final[Mapping[str, str]] = {"passed": "good", "incomplete": "warn", "failed": "bad"}
"""Classes of style of verdicts and conclusions."""
MAX_CAUSES: Final = 5
"""Maximum number of causes on the first screen."""
MAX_PLACES: Final = 2
"""Maximum number of operations that are named with a cause; of more their number is."""
WRONG: Final = ("fail", "error", "crash", "timeout")


def overview_section(title: str, report: Report) -> str:
    """All that the first screen shows."""
    words = html.escape("".join(conclusion(report)).capitalize())
    color = "bad" if report.exit_code == 1 else BADGES.get(report.conclusion, "other")
    return (
        f'<h1>{html.escape(title)}</h1><p class="verdict {color}">{words}</p><p>{html.escape(report.verdict)}.</p>'
        + (quotes_list(report) if report.claim else "")
        + _numbers(report)
        + _causes(probable_causes(report))
        + _operations(report.operations())
        + f'<pre class="command">{html.escape(report.whole_command)}</pre>'
    )


def quotes_list(report: Report) -> str:
    """The verdicts in words that can be quoted."""
    quotes = "".join(f"<li>{html.escape(quote)}</li>" for quote in report.quotes())
    return f'<ul class="quotes">{quotes}</ul>' if quotes else ""


def _numbers(report: Report) -> str:
    count: dict[str, int] = {
        outcome: sum(result.outcome == outcome for result in report.results) for outcome in OUTCOMES
    }
    ratios = [operation.ratio for operation in report.operations() if operation.ratio is not None]
    excused = count["waived"] + count["skipped"]
    cards = [
        ("vectors", f"{len(report.results):,}", report.selection and f"only {report.selection}"),
        ("pass", f"{count['pass']:,}", ""),
        ("wrong", f"{len(report.faults):,}", _split(count, WRONG)),
        ("unsupported", f"{count['unsupported']:,}", ""),
        *[("excused", f"{excused:,}", _split(count, ("waived", "skipped")))] * bool(excused),
        *[("worst error/bound", ratio_text(max(ratios, default=None)), "1 is allowed")] * bool(ratios),
    ]
    items = "".join(
        f"<div><dt>{name}</dt><dd>{value}</dd>{f'<dd class=note>{html.escape(note)}</dd>' if note else ''}</div>"
        for name, value, note in cards
    )
    return f'<dl class="numbers">{items}</dl>'


def _split(count: Mapping[str, int], names: Sequence[str]) -> str:
    """The counts of several outcomes in words; nothing if there is one only."""
    found = [f"{count[name]} {name}" for name in names if count[name]]
    return ", ".join(found) if found[1:] or names != WRONG else ""


def _causes(causes: Sequence[Cause]) -> str:
    items = "".join(
        f'<li><a href="#cause-{number}">{html.escape(cause.text)}</a> '
        f'<span class="muted">({html.escape(places_text(cause))})</span></li>'
        for number, cause in enumerate(causes[:MAX_CAUSES], 1)
    )
    more = f'<li class="muted">{plural(len(causes) - MAX_CAUSES, "more cause")} below</li>'
    heading = f"<h2>{causes_heading(causes)}</h2>"
    return f'{heading}<ol class="causes">{items}{more * (len(causes) > MAX_CAUSES)}</ol>' if causes else ""


def causes_heading(causes: Sequence[Cause]) -> str:
    """The heading above causes; few failures may say no more than where errors are."""
    if all(cause.only_where for cause in causes):
        return "Where the errors are"
    return f"Probable cause{'s' * (len(causes) > 1)}"


def places_text(cause: Cause) -> str:
    """Where failures look like a cause, and how many: all operations if they are few."""
    if len(cause.places) <= MAX_PLACES:
        return ", ".join(cause.places)
    return f"{cause.places[0]}, and in {plural(len(cause.places) - 1, 'other operation')}"


def _operations(operations: Sequence[Summary]) -> str:
    """What is wrong first, each a link to its failures, with its share of wrong vectors as its ground."""
    answered, unsupported = folded(operations)
    wrong = [operation for operation in answered if operation.faults]
    right = [operation for operation in answered if not operation.faults]
    chips = [
        f'<a class="chip bad" href="#operation-{html.escape(operation.name)}" '
        f'style="--share:{100 * operation.faults // operation.total}%">{html.escape(operation.name)} '
        f"<b>{operation.faults} of {operation.total}</b></a>"
        for operation in wrong
    ]
    chips += [
        f'<span class="chip">{html.escape(operation.name)} {operation.counts.get("pass", 0)}</span>'
        for operation in right
    ]
    chips += [f'<span class="chip other">{html.escape(unsupported)}</span>'] * bool(unsupported)
    counted = f"{len(wrong)} of {plural(len(operations), 'operation')} wrong" if wrong else "Operations"
    return f'<h2>{counted}</h2><p class="chips">{" ".join(chips)}</p>' if chips else ""
