"""All results as a Markdown document with its figures beside it."""

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

from gsvc_lab.experiments.page import INTRODUCTION, TITLE
from gsvc_lab.experiments.results import text_columns
from gsvc_lab.pages.tables import markdown_table
from gsvc_ref.cli.text import duration, plural
from gsvc_ref.files import write_text

LARGEST_FIGURE: Final = 60_000
"""Bytes of a figure that is kept with the sources."""


def write_document(records: Sequence[dict[str, Any]], folder: Path, target: Path, say: Callable[[str], None]) -> None:
    """Write the document to `target` and copy its figures to a folder beside it, named like it without its suffix.

    Parameters
    ----------
    records
        Records as `results.read_all` returns them.
    folder
        Folder of the figures.
    target
        Such as ``docs/experiments.md``.
    say
        Called with a sentence for each figure above LARGEST_FIGURE.
    """
    figures = target.with_suffix("")
    figures.mkdir(parents=True, exist_ok=True)
    for name in (name for made in records for name in made["figures"]):
        copied = Path(shutil.copyfile(folder / f"{name}.svg", figures / f"{name}.svg"))
        if (size := copied.stat().st_size) > LARGEST_FIGURE:
            say(f"{copied} has {size} bytes; figures that are kept should have at most {LARGEST_FIGURE}")
    write_text(document(records, figures.name), target)


def document(records: Sequence[dict[str, Any]], figures: str) -> str:
    """The text of the document; figures are in the folder of this name."""
    overview = [[f"[{made['title']}](#{anchor(made['title'])})", made["verdict"]["holds"], duration(made["seconds"])]
                for made in records]  # fmt: skip
    parts = [
        f"# {TITLE}",
        f"{INTRODUCTION} `make experiments` makes them all; "
        "`python -m gsvc_lab.experiments --markdown docs/experiments.md` wrote this page from their JSON.",
        table({"columns": ["experiment", "does the claim hold?", "took"], "rows": overview}),
        *(section(made, figures) for made in records),
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
