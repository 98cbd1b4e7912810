"""What an encoder decided about the frames, in lines: for ``gsvc encode`` and ``gsvc info --decisions``."""

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from gsvc_ref.cli.text import plural, table

if TYPE_CHECKING:
    from gsvc_ref.encoder.decisions import Decision
    from gsvc_ref.stream import StreamSummary

    Decisions = Sequence[Sequence[Decision]]

MAX_RUNS: Final = 12
"""Runs of frames that are listed for an effect, so that a long video stays readable."""


class Run(NamedTuple):
    """Frames in a row about which the same was decided for the same kind of reason."""

    first: int
    last: int
    done: bool
    reason: str

    def __str__(self) -> str:
        frames = f"{self.first}" if self.first == self.last else f"{self.first}-{self.last}"
        return f"    {frames:>11}  {'done' if self.done else 'left out':8}  {self.reason}"


def effects_line(decisions: "Decisions", types: Sequence[str]) -> str:
    """One line on what was left out, and what was not."""
    predicted = types.count("P")

    def done(effect: str, kinds: str) -> int:
        pairs = zip(decisions, types, strict=True)
        return sum(one.done for frame, kind in pairs if kind in kinds for one in frame if one.effect == effect)

    parts = [f"{plural(types.count('R'), 'frame')} repeated"] if "R" in types else []
    parts.append(f"DKS pre-trained {done('dks', 'IPR')} of {plural(len(types), 'frame')}")
    if predicted:
        whole = done("regions", "P")
        parts.append(f"GSA in {done('gsa', 'P')} of {plural(predicted, 'P-frame')}")
        parts.append(f"splats at rest in {predicted - whole}")
        parts.append(f"motion in {done('motion', 'P')}")
    parts.append(f"pruning in {done('gsp', 'IP')}")
    saved = sum(one.saved for frame in decisions for one in frame)
    return ", ".join(parts) + (f"; {plural(saved, 'iteration')} saved" if saved else "")


def stream_decisions(summary: "StreamSummary") -> "tuple[Decisions, str | None]":
    """The decisions that a stream tells, and a note where it does not tell them."""
    from gsvc_ref.encoder.decision_chunk import unpack
    from gsvc_ref.errors import UsageError

    again = "encode it again with gsvc encode, without --no-decisions"
    if summary.ancillary is None:
        why = "what is left of it does not" if summary.error or summary.gaps else "the stream does not"
        return [], f"{why} tell what the encoder decided; {again}"
    try:
        return unpack(summary.ancillary, len(summary.frames)), None
    except UsageError as error:
        return [], f"{error}; {again}"


def decision_lines(decisions: "Decisions") -> list[str]:
    """A table of the effects, then for each one the runs of frames with the same decision."""
    rows = []
    runs: list[str] = []
    for column in zip(*decisions, strict=True):
        effect, done = column[0].effect, sum(one.done for one in column)
        steps, saved = (sum(getattr(one, name) for one in column) for name in ("iterations", "saved"))
        rows.append([effect, f"{done:,}", f"{len(column) - done:,}", f"{steps:,}", f"{saved:,}", _usual(column)])
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
    """The most frequent reason, without its number where that differs."""
    (cause, count), *_ = Counter(one.cause for one in column).most_common(1)
    share = "" if count == len(column) else f" ({count:,} of {len(column):,})"
    return _reason([one for one in column if one.cause == cause]) + share


def _runs(column: "Sequence[Decision]") -> Iterator[Run]:
    """Frames in a row with the same decision and cause, numbered from 0."""
    first = 0
    for (done, _), group in groupby(column, key=lambda one: (one.done, one.cause)):
        same = list(group)
        yield Run(first, first + len(same) - 1, done, _reason(same))
        first += len(same)


def _reason(same: "Sequence[Decision]") -> str:
    """The reason of decisions of one cause, with the span of its numbers."""
    ordered = sorted(same, key=lambda one: one.value or 0)
    low, high = ordered[0], ordered[-1]
    if low.value == high.value:
        return low.reason
    from gsvc_ref.encoder.decisions import CAUSES

    return CAUSES[low.cause].text.format(n=f"{low.number} to {high.number}")


def decisions_object(decisions: "Decisions") -> list[list[dict[str, Any]]]:
    """All decisions for ``--json``; a stream does not tell the seconds."""
    names = ("effect", "done", "cause", "reason", "iterations", "saved")
    return [[{name: getattr(one, name) for name in names} for one in frame] for frame in decisions]
