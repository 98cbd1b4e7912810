"""A run as a summary in Markdown, for the summary of a job or a comment, which it always fits into."""

import html
import re
from collections.abc import Sequence
from typing import Final

from gsvc_base.cli.text import plural
from gsvc_base.pages.tables import markdown_table
from gsvc_conformance.causes import looks_like
from gsvc_conformance.report.console import (
    conclusion,
    ends,
    folded,
    probable_causes,
    ratio_text,
)
from gsvc_conformance.report.overview import causes_heading, places_text
from gsvc_conformance.results import Result
from gsvc_conformance.verdicts import Report, Summary

MAX_BYTES: Final = 60_000
"""Maximum length: a comment on GitHub holds 65,536 characters."""
FIRST: Final = 3
"""Number of the simplest failures that are described at once."""
MORE: Final = 40
"""Number of further failures that are described in a fold."""
MAX_CAUSES: Final = 5
MARGIN: Final = 300
"""Bytes around a list of failures."""
MAX_TEXT: Final = 600
"""Maximum length of a sentence of the implementation or of a line of its log."""
MARKS: Final = re.compile(r"([\\`*_{}\[\]<>#~$@])")
"""Characters that mean something in Markdown, in formulas, or to GitHub; tables escape theirs."""


def summary_markdown(report: Report) -> str:
    """The summary: verdict, classes, causes, the first failures, and folds of the rest as far as there is room."""
    faults = report.simplest_first()
    head = [
        f"### GSVC conformance: {_plain(_cut(report.environment.get('implementation', '?')))}",
        f"**{_plain(''.join(conclusion(report)).capitalize())}** ({_counts(report)})",
        *[f"- {_plain(quote)}" for quote in report.quotes()],
        _classes(report.groups()),
        *_causes(report),
    ]
    first = [_failure(fault, report) for fault in faults[:FIRST]]
    tail = [_fold("Operations", _operations(report)), _fold("Command and environment", _environment(report))]
    text = _joined(head + ([f"#### {_begin(len(faults))}", *first] if first else []))
    left = MAX_BYTES - _size(text) - _size(_joined(tail))
    if left < 0:
        return text.encode()[:MAX_BYTES].decode(errors="ignore")
    return _joined([text.rstrip("\n"), *_further(faults[FIRST:], report, left), *tail])


def _size(text: str) -> int:
    """Bytes of a text in UTF-8."""
    return len(text.encode())


def _begin(count: int) -> str:
    return "The failure" if count == 1 else f"The simplest of {plural(count, 'failure')}"


def _joined(parts: Sequence[str]) -> str:
    return "\n\n".join(part for part in parts if part) + "\n"


def _counts(report: Report) -> str:
    counts = {"pass": sum(result.outcome == "pass" for result in report.results), "wrong": len(report.faults)}
    for outcome in ("unsupported", "waived", "skipped"):
        counts[outcome] = sum(result.outcome == outcome for result in report.results)
    found = ", ".join(f"{count:,} {name}" for name, count in counts.items() if count)
    selection = f"; only {_plain(report.selection)}" if report.selection else ""
    return f"{plural(len(report.results), 'vector')}: {found}{selection}"


def _classes(groups: Sequence[Summary]) -> str:
    """The classes of which anything passes or is wrong."""
    claimed = [group for group in groups if group.verdict != "not claimed"]
    rows = [(group.title, f"**{group.verdict}**", _plain(group.reason)) for group in claimed]
    others = [group.title for group in groups if group.verdict == "not claimed"]
    rows += [(", ".join(others), "not claimed", "")] * bool(others)
    return markdown_table(("class", "verdict", "because"), rows)


def _causes(report: Report) -> list[str]:
    causes = probable_causes(report)[:MAX_CAUSES]
    lines = [f"1. {_plain(cause.text)} ({places_text(cause)})" for cause in causes]
    return [f"#### {causes_heading(causes)}", "\n".join(lines)] if lines else []


def _failure(result: Result, report: Report) -> str:
    """A failure in a fold, with what it looks like and its command."""
    lines = [_plain(_cut(result.title)), _plain(_cut(result.message))]
    lines += [f"- {_plain(looks_like(cause))}" for cause in result.causes]
    log = [_code("\n".join(ends(result.log)), "text")] if result.log.strip() else []
    ratio = f" ({ratio_text(result.ratio)} × bound)" if result.ratio is not None else ""
    heading = f"{result.outcome} {result.id}{ratio}"
    return _fold(heading, _joined([*lines, *log, _code(report.again(result.id), "sh")]).rstrip("\n"))


def _further(faults: Sequence[Result], report: Report, room: int) -> list[str]:
    """The next failures in a fold, as far as there is room, and how many are left out."""
    shown: list[str] = []
    for fault in faults[:MORE]:
        line = f"- `{fault.id}`: {_plain(_cut(fault.message))}"
        room -= _size(line) + 1
        if room < MARGIN:
            break
        shown.append(line)
    left = len(faults) - len(shown)
    if not shown:
        return [f"{plural(left, 'more failure')}."] if left else []
    more = [f"- {left:,} more: see the page or the JSON"] if left else []
    return [_fold(f"{plural(len(faults), 'more failure')}", "\n".join([*shown, *more]))]


def _operations(report: Report) -> str:
    answered, unsupported = folded(report.operations())
    rows = [
        (summary.name, str(summary.total), str(summary.counts.get("pass", 0)), str(summary.faults),
         str(summary.excused), ratio_text(summary.ratio))
        for summary in answered
    ]  # fmt: skip
    head = ("operation", "vectors", "pass", "wrong", "excused", "worst error/bound")
    return _joined([markdown_table(head, rows, range(1, 6)) if rows else "", unsupported]).rstrip("\n")


def _environment(report: Report) -> str:
    rows = [
        (_plain(_cut(name)), _plain(_cut(value))) for name, value in {**report.runs_on, **report.environment}.items()
    ]
    return f"{_code(report.whole_command, 'sh')}\n\n{markdown_table(('', ''), rows)}"


def _fold(heading: str, content: str) -> str:
    return f"<details><summary>{html.escape(heading)}</summary>\n\n{content}\n\n</details>"


def _code(text: str, language: str) -> str:
    """A block of code, whose fence is longer than any inside."""
    longest = max(map(len, re.findall("`+", text)), default=0)
    fence = "`" * max(3, longest + 1)
    return f"{fence}{language}\n{text}\n{fence}"


def _cut(text: str) -> str:
    return text if len(text) <= MAX_TEXT else f"{text[:MAX_TEXT]}..."


def _plain(text: str) -> str:
    """Text of others on one line, in which nothing means anything in Markdown."""
    return MARKS.sub(r"\\\1", " ".join(text.split()))
