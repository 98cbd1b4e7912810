"""``python -m tests.gpu.page``: write the measured tables and the time line of docs/gpu.md.

It reads docs/reports: the files of `results`, and those of speeds beside them.
"""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from gsvc_base.files import write_text
from gsvc_base.pages.markers import put_between
from gsvc_base.pages.tables import markdown_table
from tests.gpu.results import CARDS
from tests.gpu.speeds import KINDS
from tests.gpu.survey import ROOT
from tests.gpu.timeline import drawing

DOCUMENT: Final = ROOT / "docs" / "gpu.md"
TIMELINE: Final = ROOT / "docs" / "gpu-frame.svg"
BEGIN: Final = "<!-- begin: tests.gpu -->"
END: Final = "<!-- end -->"
EMPTY: Final = "–"


def write_page(reports: Path) -> None:
    """Write what the files in the folder of the reports say into the document, and draw the time line."""
    cards = [json.loads(path.read_text(encoding="utf-8")) for path in sorted((reports / CARDS).glob("*.json"))]
    speeds = [json.loads(path.read_text(encoding="utf-8")) for path in sorted(reports.glob("speeds-*.json"))]
    text = "\n\n".join([*(part for file in speeds for part in speed_parts(file)), *map(card_part, cards)])
    put_between(DOCUMENT, BEGIN, END, text)
    if drawn := drawing(cards):
        write_text(drawn, TIMELINE)


def speed_parts(speeds: Mapping[str, Any]) -> Iterator[str]:
    """A machine and its table: a work of an implementation a row, a scene a column."""
    machine = ", ".join(f"{name} {text}" for name, text in speeds["machine"].items() if name not in ("card", "note"))
    note = speeds["machine"].get("note", "")
    yield f"### {speeds['machine']['card']}, {speeds['date']}"
    yield f"{machine}. {note}".strip()
    scenes = scenes_of(speeds["works"])
    rows = [
        [f"{what}, {unit(kind)}", one["implementation"].rpartition(".")[2], *cells]
        for kind, what in KINDS.items()
        for one in speeds["implementations"]
        if any(cells := [cell(one, kind, scene) for scene in scenes])
    ]
    numbers = range(2, 2 + len(scenes))
    yield markdown_table(
        ["on the device, nothing copied", "by", *scenes.values()],
        [[text or EMPTY for text in row] for row in rows], numbers,
    )  # fmt: skip
    if others := [work for work in speeds["works"] if kind_of(work) is None]:
        implementations = [one["implementation"].rpartition(".")[2] for one in speeds["implementations"]]
        show = [per_second if work in speeds["rates"] else milliseconds for work in others]
        table = [
            [speeds["works"][work], *(text(one, work) or EMPTY for one in speeds["implementations"])]
            for work, text in zip(others, show, strict=True)
        ]
        heads = ["milliseconds, or frames a second (/s)", *implementations]
        yield markdown_table(heads, table, range(1, len(heads)))


def kind_of(work: str) -> str | None:
    """The kind of a work that stays on the device."""
    return next((kind for kind in KINDS if work.startswith(f"{kind}_")), None)


def scenes_of(works: Mapping[str, str]) -> dict[str, str]:
    """The scenes of works that stay on the device, by the end of their ids, in words."""
    return {
        work.removeprefix(f"{kind}_"): sentence.removeprefix(f"{KINDS[kind]}, ")
        for work, sentence in works.items()
        if (kind := kind_of(work))
    }


def unit(kind: str) -> str:
    """What a row of a kind is in."""
    return "ms" if kind == "evaluation" else "frames/s"


def cell(implementation: Mapping[str, Any], kind: str, scene: str) -> str:
    """Frames a second, or milliseconds; nothing if that was not measured."""
    work = f"{kind}_{scene}"
    if kind == "evaluation":
        return milliseconds(implementation, work)
    return per_second(implementation, work).removesuffix(" /s")


def per_second(implementation: Mapping[str, Any], work: str) -> str:
    """One by the median, or nothing if that was not measured."""
    seconds = implementation["seconds"].get(work)
    return f"{1 / seconds['median']:,.0f} /s" if seconds else ""


def milliseconds(implementation: Mapping[str, Any], work: str) -> str:
    """The median, or nothing if that was not measured."""
    seconds = implementation["seconds"].get(work)
    return f"{1000 * seconds['median']:.3g}" if seconds else ""


def card_part(card: Mapping[str, Any]) -> str:
    """What was judged on a card."""
    rows = [[part["what"], part["state"], part["told"]] for part in card["parts"]]
    head = f"### What was judged on {card['card']}, {card['machine'].get('date', '')}"
    return f"{head}\n\n{markdown_table(['part', '', 'result'], rows)}"


if __name__ == "__main__":
    write_page(ROOT / "docs" / "reports")
