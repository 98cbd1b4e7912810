"""An experiment, and its results: a figure, a JSON with its numbers, the paper's claim and a verdict."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from gsvc_base.pages.tables import Table as Table

Holds = Literal["yes", "partly", "no", "cannot be compared"]


@dataclass(frozen=True)
class Run:
    """Options that experiments run with.

    Attributes
    ----------
    full
        The large version: more frames, larger ones, counts nearer to the paper's; hours to days instead of minutes.
    clips
        Files that the user gives in place of the built-in clips.
    uvg
        The folder of the UVG sequences, or None.
    folder
        Folder of the results.
    threads
        Threads to compute with; None: all.
    say
        Called with a sentence of progress.
    """

    full: bool
    folder: Path
    say: Callable[[str], None]
    clips: tuple[Path, ...] = ()
    uvg: Path | None = None
    threads: int | None = None


@dataclass(frozen=True)
class Verdict:
    """Whether the paper's claim holds here.

    Attributes
    ----------
    holds
        Verdict in a word.
    sentence
        Why, with the numbers it rests on and the distance where it falls short.
    """

    holds: Holds
    sentence: str

    def about(self, run: Run, measured: str, large: str) -> "Verdict":
        """The same, with what it is about and, of a small version, what the large one would settle."""
        further = "" if run.full else f"; {large}"
        return replace(self, sentence=f"{self.sentence} This is about {measured}{further}.")


@dataclass(frozen=True)
class Result:
    """The result of an experiment.

    Attributes
    ----------
    setting
        Sentences about what was measured: clips, frames, sizes, splats, iterations, seeds.
    numbers
        Everything measured, for the JSON.
    tables
        Tables for people.
    figures
        Names of the figures drawn into `Run.folder`, without suffix, with a caption each.
    verdict
        Verdict on the paper's claim.
    """

    setting: str
    numbers: Any
    tables: tuple[Table, ...]
    figures: dict[str, str] = field(default_factory=dict)
    verdict: Verdict = Verdict("cannot be compared", "")


@dataclass(frozen=True)
class Experiment:
    """One of the paper's experiments.

    Attributes
    ----------
    name
        Name on the command line: ``python -m gsvc_lab.experiments NAME``.
    title
        A heading.
    claim
        The paper's claim in our words, with its numbers and where they stand (figure, section).
    run
        Makes it.
    small_threads
        Threads of the small version unless the user says otherwise; None: all. Tiny frames gain nothing from more.
    """

    name: str
    title: str
    claim: str
    run: Callable[[Run], Result]
    small_threads: int | None = None

    def threads(self, given: int | None, *, full: bool) -> int | None:
        """Threads to compute with, given what the user asks for."""
        return given if given is not None or full else self.small_threads
