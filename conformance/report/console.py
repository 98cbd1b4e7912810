"""A run of the suite in lines of text."""

import math
from collections import Counter
from collections.abc import Sequence
from typing import Final

from conformance.results import FAULTS, Report, Result, Summary
from gsvc_ref.cli.text import plural, table

INDENT: Final = "  "


def describe(report: Report, most: int) -> list[str]:
    """The whole report: tables, at most so many failures, and the verdict last.

    Parameters
    ----------
    report
        The report.
    most
        How many failures to describe.
    """
    lines = [*stage_table(report), ""]
    faults = report.faults
    for result in faults[:most]:
        lines += [*describe_fault(result, report.again(result.id)), ""]
    if len(faults) > most:
        lines += [f"... and {plural(len(faults) - most, 'more vector')} (--show N, --html FILE, --json FILE)", ""]
    lines += [f"waived: {result.id}: {result.message}" for result in report.results if result.outcome == "waived"]
    lines += [f"note: {note}" for note in report.notes]
    lines += class_table(report)
    return [*lines, "", "PASSED" if report.passed else "FAILED"]


def stage_table(report: Report) -> list[str]:
    """Counts and the worst ratio of each stage."""
    rows = [_cells(summary) for summary in report.stages()]
    return table(["stage", "vectors", "pass", "wrong", "unsupported", "excused", "worst error/bound"], rows)


def class_table(report: Report) -> list[str]:
    """The verdict of each class."""
    groups = report.groups()
    width = max(len(group.name) for group in groups)
    of = f" (only {report.selection})" if report.selection else ""
    return [f"class {group.name.ljust(width)}  {group.verdict}{of}: {group.reason}" for group in groups]


def _cells(summary: Summary) -> list[str]:
    count = summary.counts
    excused = count.get("waived", 0) + count.get("skipped", 0)
    numbers = (summary.total, count.get("pass", 0), summary.faults, count.get("unsupported", 0), excused)
    return [summary.name, *(str(number) for number in numbers), ratio_text(summary.ratio)]


def describe_fault(result: Result, command: str) -> list[str]:
    """What is wrong with one vector, why perhaps, and how to run it again."""
    lines = [f"{result.outcome.upper()} {result.id}: {result.title}", f"{INDENT}{result.message}"]
    lines += [f"{INDENT}looks like {cause}" for cause in result.causes]
    lines += [f"{INDENT}| {line}" for line in result.log.splitlines()[-6:]]
    return [*lines, f"{INDENT}again: {command}"]


def ratio_text(ratio: float | None) -> str:
    """An error/bound ratio in three digits."""
    if ratio is None:
        return ""
    return f"{ratio:.3g}" if math.isfinite(ratio) else "infinite"


def progress_text(stage: str, results: Sequence[Result]) -> str:
    """What the progress line says of the stage that runs."""
    count = Counter(result.outcome for result in results if result.stage == stage)
    wrong = sum(count[outcome] for outcome in FAULTS)
    parts = [f"{count['pass']} pass", f"{wrong} wrong" if wrong else "", plural_unsupported(count["unsupported"])]
    return f"{stage}: {', '.join(part for part in parts if part)}"


def plural_unsupported(count: int) -> str:
    """How many are unsupported, or nothing."""
    return f"{count} unsupported" if count else ""
