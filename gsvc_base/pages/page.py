"""One self-contained HTML page in the house's style, with key numbers and notes."""

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from gsvc_base.pages.tables import html_table


@dataclass(frozen=True)
class Figure:
    """One more key number for the top of the page."""

    label: str
    value: str
    unit: str = ""
    note: str = ""  # one short line below it


def document(title: str, sections: Sequence[str]) -> str:
    """A page from its sections, in the house's style; empty ones are left out."""
    style = Path(__file__).with_name("style.css").read_text(encoding="utf-8")
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{html.escape(title)}</title>\n<style>\n{style}</style>\n</head>\n<body>\n"
        + "\n".join(section for section in sections if section)
        + "\n</body>\n</html>\n"
    )


def cards_section(cards: Sequence[Figure]) -> str:
    """Key numbers side by side."""
    return f'<div class="cards">{"".join(_card(card) for card in cards)}</div>'


def _card(figure: Figure) -> str:
    note = f'<div class="note">{html.escape(figure.note)}</div>' if figure.note else ""
    unit = f' <span class="unit">{html.escape(figure.unit)}</span>' if figure.unit else ""
    return (
        f'<div class="card"><div class="name">{html.escape(figure.label)}</div>'
        f'<div class="value">{html.escape(figure.value)}{unit}</div>{note}</div>'
    )


def notes_section(sentences: Sequence[str], environment: Mapping[str, str]) -> str:
    """Sentences that a reader must know, and the machine."""
    notes = "".join(f"<li>{html.escape(sentence)}</li>" for sentence in sentences)
    table = html_table((), list(environment.items()), ("text", "text long"))
    return (f"<h2>Notes</h2><ul>{notes}</ul>" if notes else "") + (
        f"<h2>What it ran on</h2>{table}" if environment else ""
    )
