"""The decisions of an encoder in lines, for ``gsvc info --decisions``."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from gsvc_base.cli.text import plural, table

if TYPE_CHECKING:
    from gsvc_ref.encoder.log import Decision
    from gsvc_ref.stream import StreamSummary

    Decisions = Sequence[Sequence[Decision]]

MAX_RUNS: Final = 12
"""Maximum number of runs of frames that are listed for an effect, so that a long video stays readable."""

NUMBER_IN_REASON: Final = re.compile(r"[0-9][0-9,]*(?:[.][0-9]+)?")
"""A number in a reason: reasons that differ in their numbers alone are of one kind."""


class Run(NamedTuple):
    """Frames in a row with the same decision for the same kind of reason."""

    first: int
    last: int
    done: bool
    reason: str

    def __str__(self) -> str:
        frames = f"{self.first}" if self.first == self.last else f"{self.first}-{self.last}"
        return f"    {frames:>11}  {'done' if self.done else 'left out':8}  {self.reason}"


def stream_decisions(summary: "StreamSummary") -> "tuple[Decisions, str | None]":
    """The decisions in the log of a stream, and a note if there is none that can be read."""
    from gsvc_base.errors import UsageError
    from gsvc_ref.encoder.log import read_log

    again = "encode it again with gsvc encode, without --no-decisions"
    if summary.ancillary is None:
        why = "what is left of it does not" if summary.error or summary.gaps else "the stream does not"
        return [], f"{why} tell what the encoder decided; {again}"
    try:
        return read_log(summary.ancillary, len(summary.frames)), None
    except UsageError as error:
        return [], f"{error}; {again}"


def decision_lines(decisions: "Decisions") -> list[str]:
    """A table of the effects, then for each one the runs of frames with the same decision."""
    rows = []
    runs: list[str] = []
    for column in zip(*decisions, strict=True):
        effect, done = column[0].effect, sum(one.done for one in column)
        iterations, saved = (sum(getattr(one, name) for one in column) for name in ("iterations", "saved"))
        rows.append([effect, f"{done:,}", f"{len(column) - done:,}", f"{iterations:,}", f"{saved:,}", _usual(column)])
        found = list(_runs(column))
        more = len(found) - MAX_RUNS
        runs += [f"  {effect}", *(str(run) for run in found[:MAX_RUNS])]
        runs += [f"    and {plural(more, 'more run')} (--json has all)"] if more > 0 else []
    header = ("effect", "done", "left out", "iterations", "saved", "mostly")
    lines = table(header[:5], [row[:5] for row in rows])
    usual = [header[5], *(row[5] for row in rows)]
    width = max(len(line) for line in lines)
    return [f"{line.ljust(width)}  {why}" for line, why in zip(lines, usual, strict=True)] + ["", *runs]


def _usual(column: "Sequence[Decision]") -> str:
    """The most frequent kind of reason, with the span of its numbers."""
    (kind, count), *_ = Counter(_kind(one) for one in column).most_common(1)
    share = "" if count == len(column) else f" ({count:,} of {len(column):,})"
    return _reason([one for one in column if _kind(one) == kind]) + share


def _runs(column: "Sequence[Decision]") -> Iterator[Run]:
    """Frames in a row with the same decision and kind of reason, numbered from 0."""
    first = 0
    for (done, _), group in groupby(column, key=lambda one: (one.done, _kind(one))):
        same = list(group)
        yield Run(first, first + len(same) - 1, done, _reason(same))
        first += len(same)


def _kind(one: "Decision") -> str:
    """The reason without its numbers."""
    return NUMBER_IN_REASON.sub("#", one.reason)


def _reason(same: "Sequence[Decision]") -> str:
    """The reason of decisions of one kind, each number of it as the span of their numbers."""
    spans = map(_span, zip(*(NUMBER_IN_REASON.findall(one.reason) for one in same), strict=True))
    return NUMBER_IN_REASON.sub(lambda _: next(spans), same[0].reason)


def _span(numbers: Sequence[str]) -> str:
    ordered = sorted(numbers, key=lambda number: float(number.replace(",", "")))
    return ordered[0] if ordered[0] == ordered[-1] else f"{ordered[0]} to {ordered[-1]}"


def decisions_object(decisions: "Decisions") -> list[list[dict[str, Any]]]:
    """All decisions for ``--json``, without seconds, which no stream has."""
    names = ("effect", "done", "reason", "iterations", "saved")
    return [[{name: getattr(one, name) for name in names} for one in frame] for frame in decisions]
