"""All results as one page, ``index.html``, beside their figures."""

from collections.abc import Collection, Sequence
from html import escape
from pathlib import Path
from typing import Any, Final

from gsvc_base.cli.text import duration, plural
from gsvc_base.pages.page import document
from gsvc_base.pages.tables import Markup, html_table
from gsvc_lab.experiments.results import text_columns
from gsvc_lab.pages.narrow import twin_source, write_twin

TITLE: Final = "The paper's experiments"

LONG: Final = 24
"""Characters of a cell of text from which its column keeps room on narrow pages."""

INTRODUCTION: Final = (
    "Each experiment of the paper, made again with gsvc_ref: what the paper says in our words, what was measured here, "
    "and whether it holds. Small versions take minutes; the large ones (--full) come nearer to the "
    "paper's counts; each verdict says what it is based on. PSNR is of 8-bit R′G′B′; of several frames it is the mean "
    "of their dB."
)


def page(records: Sequence[dict[str, Any]], twins: Collection[str] = ()) -> str:
    """The page of these records; `twins` has the names of figures that have one for phones, ``NAME-narrow.svg``."""
    sections = (_section(made, twins) for made in records)
    return document(TITLE, [f"<h1>{TITLE}</h1><p>{INTRODUCTION}</p>", _overview(records), *sections])


def write_narrow(records: Sequence[dict[str, Any]], folder: Path) -> set[str]:
    """Write the twins for phones of the figures in a folder; the names of those that have one."""
    figures = {name: folder / f"{name}.svg" for record in records for name in record["figures"]}
    return {name for name, figure in figures.items() if figure.is_file() and write_twin(figure)}


def _overview(records: Sequence[dict[str, Any]]) -> str:
    rows = [
        (
            Markup(f'<a href="#{made["name"]}">{escape(made["title"])}</a>'),
            made["verdict"]["holds"],
            duration(made["seconds"]),
        )
        for made in records
    ]
    return html_table(("experiment", "does the claim hold?", "took"), rows, ("text", "text"))


def _section(made: dict[str, Any], twins: Collection[str]) -> str:
    machine = made["environment"]
    version = "the large version" if made["full"] else "the small version"
    took = f"{version}, {duration(made['seconds'])} on {machine['cpu']}, {plural(machine['threads'], 'thread')}"
    return "\n".join(
        [
            f'<h2 id="{made["name"]}">{escape(made["title"])}</h2>',
            f"<p><strong>The paper:</strong> {escape(made['claim'])}</p>",
            f"<p><strong>Here: {made['verdict']['holds']}.</strong> {escape(made['verdict']['sentence'])}</p>",
            f'<p class="caption">{escape(made["setting"])}</p>',
            *(_figure(name, caption, name in twins) for name, caption in made["figures"].items()),
            *(_table(table) for table in made["tables"]),
            f"<pre>{escape(made['command'])}</pre>",
            f'<p class="caption">{escape(took)}; <a href="{made["name"]}.json">all numbers</a></p>',
        ]
    )


def _figure(name: str, caption: str, has_twin: bool) -> str:
    image = f'<img class="drawn" src="{name}.svg" alt="{escape(caption)}">'
    if has_twin:
        image = f'<picture class="twin">{twin_source(name)}{image}</picture>'
    return f'<figure><div class="scroll">{image}</div><figcaption>{escape(caption)}</figcaption></figure>'


def _table(table: dict[str, Any]) -> str:
    columns = zip(table["columns"], *table["rows"], strict=True)
    long = [any(len(cell) > LONG for cell in cells) for cells in columns]
    classes = [
        "" if not text else "text long" if wide else "text"
        for text, wide in zip(text_columns(table), long, strict=True)
    ]
    return f"<h3>{escape(table['title'])}</h3>" + html_table(table["columns"], table["rows"], classes)
