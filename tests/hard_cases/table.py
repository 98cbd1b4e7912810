"""The table of all hard cases: what a naive formula, our code and the bound say."""

import sys
from collections.abc import Iterable, Iterator

import numpy as np

from tests.hard_cases.catalogue import Entry, catalogue
from tests.hard_cases.measuring import Measurement, Worst

HEADER = (
    "case", "operation", "naive formula", "naive / bound", "ours / bound", "naive error", "our error", "bound",
)  # fmt: skip

BEGIN = "<!-- the table of `python -m tests.hard_cases --markdown`: begin -->"
END = "<!-- end -->"


def number(value: float) -> str:
    """Two digits."""
    if value == 0:
        return "0"
    return f"{value:.2g}" if np.isfinite(value) else "not finite"


def _in_bounds(worst: Worst) -> str:
    """An error as a multiple of its bound; where there is one legal value, whether it is that."""
    if not np.isfinite(worst.error):
        return "not finite"
    if worst.bound == 0:
        return "another value" if worst.error else "equal"
    return number(worst.ratio)


def row(entry: Entry, measured: Measurement) -> tuple[str, ...]:
    """One line of the table; the naive error and ours are each those of their own worst element."""
    naive, ours = measured.naive, measured.worst
    return (
        entry.name, entry.operation, entry.naive_name, _in_bounds(naive), _in_bounds(ours),
        number(naive.error), number(ours.error), number(ours.bound) if ours.bound else "exact",
    )  # fmt: skip


def measurements() -> Iterator[tuple[Entry, Measurement]]:
    """All cases, measured one after the other; progress goes to the standard error, if that is a terminal."""
    shown = sys.stderr.isatty()
    for done, entry in enumerate(catalogue().values(), 1):
        if shown:
            print(f"\r{done} of {len(catalogue())}", end="", file=sys.stderr)
        yield entry, entry.measure()
    if shown:
        print(file=sys.stderr)


def failures(measured: Iterable[tuple[Entry, Measurement]]) -> list[str]:
    """The cases in which an error of ours is outside of its bound, or the naive one is not."""
    return [entry.name for entry, found in measured if found.worst.ratio > 1 or found.naive.ratio <= 1]


def plain(lines: Iterable[tuple[str, ...]]) -> str:
    """The table for a terminal."""
    table = [HEADER, *lines]
    widths = [max(len(line[k]) for line in table) for k in range(len(HEADER))]
    return "\n".join("  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)) for line in table)


def markdown(lines: Iterable[tuple[str, ...]]) -> str:
    """The table for a page, and below it what could go wrong and how accurate each case can be."""
    lines = list(lines)
    names = [f"`{operation}` {case}" for case, operation, *_ in lines]
    parts = [
        "| case | naive formula | naive / bound | ours / bound | naive error | our error | bound |",
        "|---|---|---:|---:|---:|---:|---:|",
    ]
    parts += [f"| {name} | {' | '.join(line[2:])} |" for name, line in zip(names, lines, strict=True)]
    parts += ["", "| case | what could go wrong | how accurate the result can be |", "|---|---|---|"]
    entries = catalogue().values()
    parts += [f"| {name} | {e.danger} | {e.condition} |" for name, e in zip(names, entries, strict=True)]
    return "\n".join(parts)
