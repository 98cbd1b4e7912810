"""The results of vectors as plain data."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Any, Final, Literal, get_args

from gsvc_base.cli.text import printable
from gsvc_conformance.profiles import ANY
from gsvc_conformance.spec import complexity

Outcome = Literal["pass", "fail", "unsupported", "error", "crash", "timeout", "skipped", "waived"]
TIERS: Final = ("core", "uncommon", "stress", "faulty", "full", "own")
"""From the simple to the hard."""

REFUSED: Final = ("rule and bit", "rule", "kind", "nothing")
"""Parts of a refusal that may be right."""

OUTCOMES: Final[tuple[Outcome, ...]] = get_args(Outcome)
FAULTS: Final[tuple[Outcome, ...]] = ("fail", "error", "crash", "timeout")
"""Outcomes of something that is wrong."""

NOT_ASKED: Final = "not asked: the time of --seconds was used"
"""The message of a vector that is skipped for want of time."""


@dataclass(frozen=True)
class OutputResult:
    """The judgement of one output.

    Attributes
    ----------
    name, check
        The output and its class of check.
    passed, message, ratio, place, wrong
        As in `expectations.Judgement`.
    refused
        The right part of a refusal that names the rule and the bit, of `REFUSED`; empty for everything else.
    advice
        Of a refusal of the right kind that names another rule than expected: both rules, in words.
    """

    name: str
    check: str
    passed: bool
    message: str = ""
    ratio: float | None = None
    place: tuple[int, ...] | None = None
    wrong: int = 0
    refused: str = ""
    advice: str = ""


@dataclass(frozen=True)
class Table:
    """A few rows of a wrong output, for people.

    Attributes
    ----------
    title
        The sentence of its manifest that says what it shows.
    columns
        Their names.
    rows
        The name of each row and its cells.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def __post_init__(self) -> None:
        make_printable(self)


@dataclass(frozen=True)
class Result:
    """The outcome of one vector.

    Attributes
    ----------
    id, title
        Id, title and class of the vector; the id is ``tier/operation/slug``.
    group
        The conformance class.
    outcome
        One of `OUTCOMES`.
    message
        Why it did not pass, a sentence; for a pass, how the answers differed, if they did.
    outputs
        The judgement of each output; none where there was no answer.
    causes
        Sentences about what the wrong outputs look like, the most likely first.
    log
        The beginning and the end of what a process printed.
    seconds
        The time that the implementation took, in seconds.
    table
        The worst rows of a wrong table of splats: what was given as a multiple of what is expected.
    size
        Bytes of the inputs; of what is wrong only.
    level
        The level of spec.md section 5 from which on a claim needs the vector.
    unusual
        Whether a splat of the inputs is degenerate, a needle, very small or large; of what is wrong only.
    outside
        What the vector needs beside the features of the implementation, in words; empty if nothing, or not asked.
    profile
        The profile whose claims need the vector, or ``any``; of an answer of an encoder, that of its stream.
    """

    id: str
    title: str
    group: str
    outcome: Outcome
    message: str = ""
    outputs: tuple[OutputResult, ...] = ()
    causes: tuple[str, ...] = ()
    log: str = ""
    seconds: float = 0.0
    table: Table | None = None
    size: int = 0
    unusual: bool = False
    level: int = 1
    outside: str = ""
    profile: str = ANY

    def __post_init__(self) -> None:
        make_printable(self)

    @property
    def passed(self) -> bool:
        """Whether every output is as it must be."""
        return self.outcome == "pass"

    @property
    def tier(self) -> str:
        """``core``, ``uncommon``, ``stress``, ``faulty``, ``full`` or ``own``."""
        return self.id.split("/")[0]

    @property
    def operation(self) -> str:
        """The name of the operation."""
        return self.id.split("/")[1]

    @property
    def simplicity(self) -> tuple[int, bool, int, str]:
        """The place among the results of its operation in the order in which to look at them: core, plain, small."""
        tier = TIERS.index(self.tier) if self.tier in TIERS else len(TIERS)
        return tier, self.unusual, self.size, self.id

    @property
    def ratio(self) -> float | None:
        """The worst error as a multiple of its bound, of all outputs that have one."""
        return max((output.ratio for output in self.outputs if output.ratio is not None), default=None)


def simplest_first(results: Iterable[Result]) -> list[Result]:
    """Results in the order in which to look at them: leaf operations first, core tiers, plain and small inputs."""
    return sorted(results, key=lambda result: (difficulty(result.operation), result.simplicity))


def difficulty(operation: str) -> float:
    """The rank of an operation from leaves to what is made of them; one that spec.md has no code for is the last."""
    return complexity(operation) or math.inf


def make_printable(record: Any) -> None:
    """Let texts of others (logs, titles, names) in a record do nothing to the terminal or file that shows them."""
    for name in (entry.name for entry in fields(record)):
        object.__setattr__(record, name, _printable(getattr(record, name)))


def _printable(value: Any) -> Any:
    if isinstance(value, str):
        return printable(value)
    if isinstance(value, Mapping):
        return {_printable(key): _printable(item) for key, item in value.items()}
    if isinstance(value, tuple | list) and all(isinstance(item, str) for item in value):
        return type(value)(map(printable, value))
    return value
