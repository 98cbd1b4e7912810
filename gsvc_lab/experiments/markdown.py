"""All results as a Markdown document with its figures beside it."""

import re
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

from gsvc_base.cli.text import duration, plural
from gsvc_base.files import write_text
from gsvc_base.pages.tables import markdown_table
from gsvc_lab.experiments.page import INTRODUCTION, TITLE
from gsvc_lab.experiments.results import text_columns

LARGEST_FIGURE: Final = 60_000
"""Bytes of a figure that is kept with the sources."""

ROW: Final = re.compile(r"^\| \[(?P<title>[^]]+)\]\(#[^)]*\) \|.*$", re.MULTILINE)
"""A row of the overview."""

FIGURE: Final = re.compile(r"^!\[[^]]*\]\([^/)]+/(?P<name>[^)]+)\)$", re.MULTILINE)
"""A figure of a section."""


def write_document(records: Sequence[dict[str, Any]], folder: Path, target: Path, say: Callable[[str], None]) -> None:
    """Write the document to `target` and copy its figures to a folder beside it, named like it without its suffix.

    Sections of a document that is there already stay as they are where there is no record of their experiments; figures
    of the others that no section shows any more are removed.

    `records`: records as `results.read_all` returns them. `folder`: folder of the figures. `target`: such as
    ``docs/experiments.md``. `say`: called with a sentence for each figure above LARGEST_FIGURE.
    """
    before = target.read_text(encoding="utf-8") if target.is_file() else ""
    figures = target.with_suffix("")
    figures.mkdir(parents=True, exist_ok=True)
    for name in (name for made in records for name in made["figures"]):
        copied = Path(shutil.copyfile(folder / f"{name}.svg", figures / f"{name}.svg"))
        if (size := copied.stat().st_size) > LARGEST_FIGURE:
            say(f"{copied} has {size} bytes; figures that are kept should have at most {LARGEST_FIGURE}")
    text = document(records, figures.name, before)
    for name in {found["name"] for found in FIGURE.finditer(before)} - {
        found["name"] for found in FIGURE.finditer(text)
    }:
        (figures / name).unlink(missing_ok=True)
    write_text(text, target)


def document(records: Sequence[dict[str, Any]], figures: str, before: str = "") -> str:
    """The text of the document.

    `records`: records as `results.read_all` returns them. `figures`: name of the folder of the figures. `before`: the
    document that there is; its sections stay, in their order, where no record replaces them.
    """
    rows = {found["title"]: found[0] for found in ROW.finditer(before)}
    sections = {part.split("\n", 1)[0]: f"## {part}".rstrip() for part in before.split("\n## ")[1:]}
    for made in records:
        title = made["title"]
        cells = f"[{title}](#{anchor(title)})", made["verdict"]["holds"], duration(made["seconds"])
        rows[title] = f"| {' | '.join(cells)} |"
        sections[title] = section(made, figures)
    columns = markdown_table(("experiment", "does the claim hold?", "took"), (), (2,))
    parts = [
        f"# {TITLE}",
        f"{INTRODUCTION} `make experiments` makes them all; "
        "`python -m gsvc_lab.experiments --markdown docs/experiments.md` wrote this page from their JSON.",
        "\n".join([columns, *rows.values()]),
        *sections.values(),
    ]
    return "\n\n".join(parts) + "\n"


def section(made: dict[str, Any], figures: str) -> str:
    """One experiment."""
    machine, verdict = made["environment"], made["verdict"]
    pictures = [f"![{made['title']}]({figures}/{name}.svg)\n\n*{caption}*" for name, caption in made["figures"].items()]
    tables = [f"{one['title']}:\n\n{table(one)}" for one in made["tables"]]
    version = "the large version" if made["full"] else "the small version"
    machine_text = f"{machine['cpu']}, {plural(machine['threads'], 'thread')}"
    took = f"`{made['command']}`, {version}, took {duration(made['seconds'])} on {machine_text}."
    return "\n\n".join(
        [
            f"## {made['title']}",
            f"The paper: {made['claim']}",
            f"**Here: {verdict['holds']}.** {verdict['sentence']}",
            made["setting"],
            *pictures,
            *tables,
            took,
        ]
    )


def table(made: dict[str, Any]) -> str:
    """A table of a record: text to the left, numbers to the right."""
    numbers = [k for k, text in enumerate(text_columns(made)) if not text]
    return markdown_table(made["columns"], made["rows"], numbers)


def anchor(title: str) -> str:
    """The name of a heading in links."""
    return "".join(c for c in title.lower().replace(" ", "-") if c.isalnum() or c in "-_")
