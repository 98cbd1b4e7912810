"""The result of a run as a badge: JSON for an endpoint of shields.io."""

import json
from collections.abc import Mapping, Sequence
from typing import Final

from gsvc_conformance.profiles import ANY
from gsvc_conformance.results import Result
from gsvc_conformance.verdicts import Conclusion, Report, Summary

LABEL: Final = "GSVC conformance"
COLORS: Final[Mapping[Conclusion, str]] = {
    "passed": "brightgreen", "incomplete": "yellowgreen", "failed": "red", "nothing judged": "lightgrey",
    "ended early": "lightgrey",
}  # fmt: skip
MAX_NAMES: Final = 2
"""Maximum number of classes or operations that are named; of more their number is."""


def badge_json(report: Report) -> str:
    """The text of the file."""
    color = "red" if report.exit_code == 1 else COLORS[report.conclusion]
    badge = {"schemaVersion": 1, "label": LABEL, "message": badge_message(report), "color": color}
    return json.dumps(badge, indent=2) + "\n"


def badge_message(report: Report) -> str:
    """What passes, in a few words: ``rendering level 2`` of a claim, else ``rendering 139/139``.

    Where vectors of a class were left out by the selection, it names operations in place of classes.
    """
    if report.ended and not report.faults:
        return "ended early"
    if report.claim:
        level = f"{_names(report.claim.judged)} level {report.claim.level}"
        waived = sum(result.outcome == "waived" for result in report.results)
        excused = f" ({waived} waived)" if waived else ""
        return f"{level}{excused}" if report.passed else f"{level}: not held"
    part = bool(report.selection) and not report.whole
    judged = [summary for summary in (report.operations() if part else report.groups()) if _answered(summary)]
    if not judged:
        return "nothing judged"
    results = [result for result in report.results if any(_is_about(summary, result, part) for summary in judged)]
    passing = sum(result.passed for result in results)
    names = [*dict.fromkeys(summary.name for summary in judged)]
    return f"{_names(names, 'operations' if part else 'classes')} {passing}/{len(results)}"


def _is_about(summary: Summary, result: Result, part: bool) -> bool:
    """Whether a result is one of those that a summary counts: of an operation, or of a class and its profile."""
    if part:
        return result.operation == summary.name
    return result.group == summary.name and (not summary.profile or result.profile in (ANY, summary.profile))


def _answered(summary: Summary) -> bool:
    """Whether anything passes or is wrong."""
    return bool(summary.counts.get("pass", 0) or summary.faults)


def _names(names: Sequence[str], what: str = "classes") -> str:
    return ", ".join(names) if len(names) <= MAX_NAMES else f"{len(names)} {what}"
