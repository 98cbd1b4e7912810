"""An experiment, and its results: a figure, a JSON with its numbers, the paper's claim and a verdict."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from gsvc_base.pages.tables import Table as Table

Holds = Literal["yes", "partly", "no", "cannot be compared"]


@dataclass(frozen=True)
class Run:
    """Options that experiments run with."""

    # The large version: more frames, larger ones, counts nearer to the paper's; hours to days instead of minutes
    full: bool
    folder: Path  # folder of the results
    say: Callable[[str], None]  # called with a sentence of progress
    clips: tuple[Path, ...] = ()  # files that the user gives in place of the built-in clips
    uvg: Path | None = None  # the folder of the UVG sequences, or None
    threads: int | None = None  # threads to compute with; None: all


@dataclass(frozen=True)
class Verdict:
    """Whether the paper's claim holds here."""

    holds: Holds  # verdict in a word
    sentence: str  # why, with the numbers it rests on and the distance where it falls short

    def about(self, run: Run, measured: str, large: str) -> "Verdict":
        """The same, with what it is about and, of a small version, what the large one would settle."""
        further = "" if run.full else f"; {large}"
        return replace(self, sentence=f"{self.sentence} This is about {measured}{further}.")


@dataclass(frozen=True)
class Result:
    """The result of an experiment."""

    setting: str  # sentences about what was measured: clips, frames, sizes, splats, iterations, seeds
    numbers: Any  # everything measured, for the JSON
    tables: tuple[Table, ...]  # tables for people
    # Names of the figures drawn into `Run.folder`, without suffix, with a caption each
    figures: dict[str, str] = field(default_factory=dict)
    verdict: Verdict = Verdict("cannot be compared", "")  # verdict on the paper's claim


@dataclass(frozen=True)
class Experiment:
    """One of the paper's experiments."""

    name: str  # name on the command line: ``python -m gsvc_lab.experiments NAME``
    title: str  # a heading
    claim: str  # the paper's claim in our words, with its numbers and where they stand (figure, section)
    run: Callable[[Run], Result]  # makes it
    # Threads of the small version unless the user says otherwise; None: all. Tiny frames gain nothing from more.
    small_threads: int | None = None

    def threads(self, given: int | None, *, full: bool) -> int | None:
        """Threads to compute with, given what the user asks for."""
        return given if given is not None or full else self.small_threads
