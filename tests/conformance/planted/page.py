"""docs/what-the-report-names.md: the counts, and what the report says first of each fault of the last lists."""

import json
import re
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Final

from gsvc_conformance.causes import MEND
from planted import COLUMNS, COUNTS, Part, Said, all_planted, rows

PAGE: Final = Path(__file__).parents[3] / "docs" / "what-the-report-names.md"
BEGIN: Final = "<!-- begin: python -m planted --write -->\n"
END: Final = "<!-- end -->\n"
MAIN: Final = ("reported", "third, held back")
LISTED: Final[dict[str, tuple[Part, ...]]] = {
    "Decoders of profile `main`": (*MAIN, "fresh", "raising", "unchecked"),
    "Public implementations": ("peers",),
    "Gradients by autograd": ("autograd",),
}
LONGEST: Final = 200
"""Characters of a cause in the table."""


def page(found: Iterable[Said]) -> str:
    """The page, with other numbers and sentences between its marks."""
    found = list(found)
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    sections = [*_counts(found)]
    for title, parts in LISTED.items():
        sections += ["", f"## {title}", "", *_list([one for one in found if one.mutant.part in parts])]
    return before + BEGIN + "\n" + "\n".join(sections) + "\n\n" + end + after


def _counts(found: list[Said]) -> list[str]:
    head = ["| |" + "|".join(COLUMNS) + "|", "|---|" + "---:|" * len(COLUMNS)]
    return [*head, *(f"| {title} | {' | '.join(map(str, counts))} |" for title, counts in rows(found))]


def _list(found: list[Said]) -> list[str]:
    head = ["| fault | verdict | first cause, or the vector to begin with |", "|---|---|---|"]
    return [*head, *(f"| {one.mutant.name} | {one.verdict} | {_cell(first_of(one))} |" for one in found)]


def first_of(one: Said) -> str:
    """What a reader sees first, and what is said of an operation that is to be mended."""
    told = [COUNTS.sub("", line) for line in one.lines[:2]] or [one.begin]
    return "; ".join(told if told[0].endswith(MEND) else told[:1])


def _cell(text: str) -> str:
    short = text if len(text) <= LONGEST else f"{text[: LONGEST - 1]}…"
    return re.sub(r"([|<*_`\\])", r"\\\1", short)


def short(one: Said) -> list[str]:
    """A fault on the console."""
    head = f"{one.verdict.upper()}: {one.mutant.area}, {one.mutant.name} (to be told: {one.mutant.right})"
    return [head, *(f"    {line}" for line in (*one.lines, one.begin))]


def to_json(found: Iterable[Said]) -> str:
    """What was found, for the next run."""
    entries = ({**vars(one), "mutant": one.mutant.name} for one in found)
    return json.dumps(list(entries), indent=1)


def kept(path: Path) -> list[Said]:
    """What earlier runs found of the faults that there are; none if there is no such file."""
    entries = json.loads(path.read_text(encoding="utf-8")) if path.exists() else []
    by_name = {fault.name: replace(fault, functions=dict) for fault in all_planted()}
    return [
        Said(**{**entry, "mutant": by_name[entry["mutant"]], "lines": tuple(entry["lines"])})
        for entry in entries
        if entry["mutant"] in by_name
    ]


def _share(found: list[Said], part: str, *verdicts: str) -> float:
    """The fraction of the caught faults of a part that have one of some verdicts; 1 if none was run."""
    caught = [one.verdict for one in found if one.mutant.part == part and one.verdict != "not caught"]
    return sum(verdict in verdicts for verdict in caught) / len(caught) if caught else 1.0


def _wrong(found: list[Said], part: str) -> float:
    """The fraction that is named wrongly; 0 if none was run."""
    return 1 - _share(found, part, "right", "place", "nothing")


TOLD: Final[dict[str, Callable[[list[Said]], bool]]] = {
    "every fault of main is caught": lambda found: (
        not any(one.verdict == "not caught" for one in found if one.mutant.area == "main")
    ),
    "85 % of main are named or located": lambda found: all(
        _share(found, part, "right", "place") >= 0.85 for part in MAIN
    ),
    "2 % of main are named wrongly at most": lambda found: all(_wrong(found, part) <= 0.02 for part in MAIN),
    "10 of 13 implementations are named rightly": lambda found: _share(found, "peers", "right") >= 10 / 13,
    "no implementation is named wrongly": lambda found: _wrong(found, "peers") == 0,
    "gradients by autograd are named rightly": lambda found: _share(found, "autograd", "right") == 1,
}
"""What is asked of the lists, in words."""
