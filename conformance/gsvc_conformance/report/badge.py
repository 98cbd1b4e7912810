"""The result of a run as a badge: JSON for an endpoint of shields.io."""

import json
from collections.abc import Mapping, Sequence
from typing import Final

from gsvc_conformance.results import Conclusion, Report, Summary

LABEL: Final = "GSVC conformance"
COLORS: Final[Mapping[Conclusion, str]] = {
    "passed": "brightgreen", "incomplete": "yellowgreen", "failed": "red", "nothing judged": "lightgrey",
    "ended early": "lightgrey",
}  # fmt: skip
MAX_NAMES: Final = 2
"""Maximum number of classes that are named; of more their number is."""


def badge_json(report: Report) -> str:
    """The text of the file."""
    color = "red" if report.exit_code == 1 else COLORS[report.conclusion]
    badge = {"schemaVersion": 1, "label": LABEL, "message": badge_message(report), "color": color}
    return json.dumps(badge, indent=2) + "\n"


def badge_message(report: Report) -> str:
    """What passes, in a few words: ``rendering level 2`` of a claim, else ``rendering 139/139``."""
    groups = [group for group in report.groups() if group.verdict != "not claimed"]
    if report.ended and not report.faults:
        return "ended early"
    if report.claim:
        level = f"{_names(report.claim.judged)} level {report.claim.level}"
        return level if report.passed else f"{level}: not held"
    if not groups:
        return "nothing judged"
    passing = sum(_passing(group) for group in groups)
    return f"{_names([group.name for group in groups])} {passing}/{sum(group.total for group in groups)}"


def _passing(group: Summary) -> int:
    return group.counts.get("pass", 0)


def _names(groups: Sequence[str]) -> str:
    return ", ".join(groups) if len(groups) <= MAX_NAMES else f"{len(groups)} classes"
