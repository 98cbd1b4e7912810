"""The files that a run leaves: the kit's reports, the speeds, and everything else about the card in one.

The last has the form

    {"form": "gpu/1", "card": "NVIDIA H200", "note": "", "machine": {"driver": "580.159.04", "commit": "...", ...},
     "adapters": {"cuda": {"device": "...", ...}, ...},        what each says of itself
     "missing": {"gsplat_cuda": "gsplat is not installed", ...},
     "parts": [{"name": "sums-cuda", "what": "...", "state": "right", "told": "0 bytes differ ...", "seconds": 31.2},
               ...],
     "timeline": {"picture, bounded": [["prepare", 0.0, 0.006], ...], ...}}     kernels, begin and end in milliseconds
"""

import json
import re
import shutil
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from gsvc_base.files import write_text
from tests.gpu.outcome import Outcome
from tests.gpu.survey import ADAPTERS, Survey

FORM: Final = "gpu/1"
MEASURED: Final = ("measured", "stopped", "failed")
"""States of parts that may have measured something."""
CARDS: Final = "gpu"
"""The folder of these files in that of the reports."""


def slug(card: str) -> str:
    """The name of a card in names of files."""
    return re.sub(r"[^a-z0-9]+", "-", card.lower()).strip("-") or "unknown"


@dataclass
class Results:
    """The files of a run, written again after each part.

    `kept` is the folder of the parts' own files, `out` where reports go.
    """

    survey: Survey
    kept: Path
    out: Path
    outcomes: list[Outcome] = field(default_factory=list)

    def add(self, outcome: Outcome) -> None:
        """Take in what became of a part, and write."""
        self.outcomes.append(outcome)
        if outcome.name in {adapter.name for adapter in ADAPTERS} and outcome.state in ("right", "wrong"):
            self.out.mkdir(parents=True, exist_ok=True)
            for suffix in (".json", ".html"):
                shutil.copyfile(self.kept / f"{outcome.name}{suffix}", self.out / f"{outcome.name}{suffix}")
        self.write()

    def write(self) -> None:
        """Write what is known."""
        name, machine = slug(self.survey.card), self.survey.machine
        parts = [
            {"name": one.name, "what": one.what, "state": one.state, "told": one.told, "seconds": round(one.seconds, 1)}
            for one in self.outcomes
        ]
        timeline = [one.values["timeline"] for one in self.outcomes if "timeline" in one.values]
        _write(self.out / CARDS / f"{name}.json", {
            "form": FORM, "card": self.survey.card, "note": "", "machine": machine, "adapters": self.survey.answers,
            "missing": self.survey.missing, "parts": parts, "timeline": timeline[0] if timeline else {},
        })  # fmt: skip
        speeds = merged(
            one.values for one in self.outcomes if one.state in MEASURED and "implementations" in one.values
        )
        if speeds["implementations"]:
            date = {"form": "speeds/1", "date": machine["date"], "machine": {"card": self.survey.card, **machine}}
            _write(self.out / f"speeds-{name}.json", {**date, **speeds})


def merged(files: Iterable[dict[str, Any]]) -> dict[str, Any]:
    """The speeds of several files of the form ``speeds/1`` together: an implementation stands once."""
    works: dict[str, str] = {}
    rates: list[str] = []
    implementations: dict[str, dict[str, Any]] = {}
    for values in files:
        works.update(values["works"])
        rates += [work for work in values.get("rates", ()) if work not in rates]
        for one in values["implementations"]:
            there = implementations.setdefault(one["implementation"], {**one, "seconds": {}, "missing": {}})
            there["seconds"] |= one["seconds"]
            there["missing"] |= one.get("missing", {})
    measured = {work for one in implementations.values() for work in one["seconds"]}
    return {
        "works": {work: sentence for work, sentence in works.items() if work in measured},
        "rates": [work for work in rates if work in measured],
        "implementations": list(implementations.values()),
    }


def summary(outcomes: Sequence[Outcome]) -> list[str]:
    """A line for each part, what is wrong first."""
    order = ("wrong", "failed", "stopped", "right", "measured", "skipped")
    width = max((len(one.what) for one in outcomes), default=0)
    lines = sorted(outcomes, key=lambda one: order.index(one.state))
    return [f"{one.state:8}  {one.what:{width}}  {one.told}" for one in lines]


def _write(path: Path, values: dict[str, Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(json.dumps(values, indent=1) + "\n", path)
