"""Two reports of one implementation, an earlier and a later one: what passed and does not pass any more."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from gsvc_base.cli.text import plural
from gsvc_base.errors import UsageError
from gsvc_conformance.report.console import describe_fault
from gsvc_conformance.results import FAULTS, Result, simplest_first
from gsvc_conformance.verdicts import Report

ALIKE: Final = ("vectors", "kit", "implementation")
"""Entries of the environment by which a change may be none of the implementation's own."""
MAX_NAMED: Final = 5
"""Maximum number of vectors that a line names; more are counted."""
LONGEST: Final = 40
"""Characters of an entry of the environment that are shown."""


@dataclass(frozen=True)
class Changes:
    """What became of the vectors between two reports.

    Attributes
    ----------
    regressions
        What passed and does not pass now, the simplest first, each as it is now.
    fixed
        What was wrong and passes now.
    broken
        What was neither right nor wrong, such as unsupported, and is wrong now.
    still
        What is wrong in both.
    new, missing
        What is in the later report alone, and in the earlier one alone.
    """

    regressions: Sequence[Result]
    fixed: Sequence[Result]
    broken: Sequence[Result]
    still: Sequence[Result]
    new: Sequence[Result]
    missing: Sequence[Result]


def changes(base: Report, now: Report) -> Changes:
    """Hold a report against an earlier one, vector by vector.

    Raises
    ------
    UsageError
        They have no vector in common.
    """
    before = {result.id: result for result in base.results}
    after = {result.id: result for result in now.results}
    common = [(before[name], result) for name, result in after.items() if name in before]
    if not common:
        raise UsageError("the reports have no vector in common: both must be of runs of the same operations")

    def wrong(result: Result) -> bool:
        return result.outcome in FAULTS

    return Changes(
        simplest_first(new for old, new in common if old.passed and not new.passed),
        simplest_first(new for old, new in common if wrong(old) and new.passed),
        simplest_first(new for old, new in common if not old.passed and not wrong(old) and wrong(new)),
        simplest_first(new for old, new in common if wrong(old) and wrong(new)),
        simplest_first(result for name, result in after.items() if name not in before),
        simplest_first(result for name, result in before.items() if name not in after),
    )


def describe_changes(base: Report, now: Report, found: Changes, most: int) -> list[str]:
    """The changes in lines: the regressions with their messages, then the rest by name.

    Parameters
    ----------
    base, now, found
        The reports, and their `changes`.
    most
        Maximum number of regressions to describe; the others are named.
    """
    lines = [*_notes(base, now)]
    for result in found.regressions[:most]:
        lines += [*_regression(result, now.again(result.id)), ""]
    lines += [f"REGRESSION {result.id}: {result.outcome}" for result in found.regressions[most:]]
    parts = {
        "fixed": found.fixed,
        "wrong now, neither right nor wrong before": found.broken,
        "still wrong": found.still,
    }
    lines += [f"{what}: {_listed(results)}" for what, results in parts.items() if results]
    for what, results in (("new", found.new), ("missing", found.missing)):
        if results:
            lines.append(f"{what}: {_listed(results)} ({_outcomes(results)})")
    return lines


def _regression(result: Result, command: str) -> list[str]:
    lines = describe_fault(result, command)
    return [f"REGRESSION {lines[0]}", *(line for line in lines[1:] if line.strip())]


def _notes(base: Report, now: Report) -> Iterable[str]:
    """What may have changed beside the implementation."""
    for name in ALIKE:
        old, new = (report.environment.get(name, "unknown") for report in (base, now))
        if old != new:
            yield f"note: not the same {name}: {old[:LONGEST]} before, {new[:LONGEST]} now"
    for what, report in (("first", base), ("second", now)):
        if report.ended:
            yield f"note: the {what} report is not whole: {report.ended}"
        elif base.selection != now.selection:
            yield f"note: the {what} report is of {report.selection or 'all vectors'}"


def conclusion_of(found: Changes) -> str:
    """The changes in one line, for those who read nothing else."""
    counts = {"fixed": found.fixed, "still wrong": found.still, "new": found.new, "missing": found.missing}
    rest = [f"{len(results)} {what}" for what, results in counts.items() if results]
    head = plural(len(found.regressions), "regression").upper() if found.regressions else "NO REGRESSION"
    return f"{head}{': ' if rest else ''}{', '.join(rest)}"


def _listed(results: Sequence[Result]) -> str:
    more = len(results) - MAX_NAMED
    return ", ".join(result.id for result in results[:MAX_NAMED]) + (f" and {more} more" if more > 0 else "")


def _outcomes(results: Sequence[Result]) -> str:
    return ", ".join(f"{count} {outcome}" for outcome, count in Counter(r.outcome for r in results).items())
