"""Tables in HTML and in Markdown."""

import html
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Table:
    """A table with a heading or a sentence before it, the names of its columns with units, and rows of text."""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]

    def markdown(self) -> str:
        """The title and the table as aligned Markdown, which a terminal shows well too."""
        return f"{self.title}\n\n{markdown_table(self.columns, self.rows, aligned=True)}"


class Markup(str):
    """A cell that is HTML already."""

    __slots__ = ()


def html_table(
    header: Sequence[str],
    rows: Iterable[Sequence[str]],
    classes: Sequence[str] = (),
    *,
    foot: Sequence[str] = (),
    title: str = "",
    key_rows: Collection[int] = (),
) -> str:
    """A table that scrolls sideways where the page is narrow; all cells but `Markup` are escaped.

    `classes` are those of the first columns, such as ``text`` for what stands at the left; `title` is shown under the
    pointer, and rows of the numbers `key_rows` stand out.
    """

    def line(tag: str, cells: Sequence[str], kind: str = "") -> str:
        marks = [*(f' class="{name}"' if name else "" for name in classes), *[""] * (len(cells) - len(classes))]
        texts = [cell if isinstance(cell, Markup) else html.escape(cell) for cell in cells]
        return f"<tr{kind}>" + "".join(f"<{tag}{m}>{t}</{tag}>" for m, t in zip(marks, texts, strict=True)) + "</tr>"

    body = "".join(line("td", row, ' class="key"' if n in key_rows else "") for n, row in enumerate(rows))
    return (
        f'<div class="scroll"><table{f" title={chr(34)}{html.escape(title)}{chr(34)}" if title else ""}>'
        + (f"<thead>{line('th', header)}</thead>" if header else "")
        + f"<tbody>{body}</tbody>"
        + (f"<tfoot>{line('td', foot)}</tfoot>" if foot else "")
        + "</table></div>"
    )


def markdown_table(
    header: Sequence[str], rows: Iterable[Sequence[str]], numbers: Collection[int] = (), *, aligned: bool = False
) -> str:
    """A table in Markdown; a ``|`` in a cell is escaped.

    Columns of the numbers `numbers` stand at the right. `aligned` makes all cells of a column equally wide, which a
    terminal shows well too.
    """
    lines = [[cell.replace("|", "\\|") for cell in row] for row in (header, *rows)]
    widths = [max(len(line[k]) for line in lines) if aligned else 0 for k in range(len(header))]
    filled = ["| " + " | ".join(c.ljust(w) for c, w in zip(line, widths, strict=True)) + " |" for line in lines]
    marks = [":" if k in numbers else "" for k in range(len(header))]
    rule = "|".join("-" * max(3, w + 2 - len(mark)) + mark for w, mark in zip(widths, marks, strict=True))
    return "\n".join([filled[0], f"|{rule}|", *filled[1:]])
