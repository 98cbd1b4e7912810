"""The syntax tables of spec.md, read: what stands in what, under which condition, in how many bits."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from gsvc_lab.site.document import FENCED, Part, element_names

TABLE: Final = re.compile(r"^\| (\w+)\(([^|]*)\) \| descriptor \|\n\|[-|: ]+\|\n((?:\|.*\|\n)+)", re.MULTILINE)
CONDITION: Final = re.compile(r"\s*((?:if|for) \(|for each \w+)")
PIECE: Final = re.compile(r"\s*(?:(?P<open>\{)|(?P<close>\})|(?P<comma>,)|(?P<item>(?:`[^`]*`|\([^()]*\)|[^`{},()])+))")


@dataclass
class Item:
    """An element, or a call of another table.

    Attributes
    ----------
    label
        What the table says, in Markdown.
    descriptor
        Its descriptor, in Markdown.
    """

    label: str
    descriptor: str

    @property
    def bits(self) -> int | None:
        """Its size, where that is fixed."""
        found = re.fullmatch(r"`(u|le|f)\(?(\d+)\)?`|(\d+) bytes", self.descriptor)
        if not found:
            return None
        if found[3]:
            return 8 * int(found[3])
        return int(found[2]) * (8 if found[1] == "le" else 1)


@dataclass
class Group:
    """Items under a condition, or repeated; the outermost has no condition.

    Attributes
    ----------
    condition
        What the table says, in Markdown.
    content
        What stands in it.
    conditions
        How many groups the bracket that it ends with closes.
    """

    condition: str
    content: list["Item | Group"] = field(default_factory=list)
    conditions: int = 1


@dataclass
class Table:
    """One table: its name, its arguments, and what it holds."""

    name: str
    arguments: str
    group: Group


def tables_of(parts: Sequence[Part]) -> dict[str, Table]:
    """The syntax tables of spec.md by name, in their order."""
    found = {}
    for part in parts:
        for name, arguments, rows in TABLE.findall(FENCED.sub("", part.text)):
            found[name] = _table(name, arguments, rows)
    return found


def _table(name: str, arguments: str, rows: str) -> Table:
    outermost = Group("")
    stack = [outermost]
    for row in rows.splitlines():
        label, descriptor = (
            (cell.strip() for cell in row.strip("|").split(" | ", 1)) if " | " in row else (row.strip("| "), "")
        )
        _read_row(label, descriptor.removesuffix(" each").strip(" |"), stack)
    if len(stack) > 1:
        raise ValueError(f"a bracket of the table of {name}() in spec.md is never closed")
    return Table(name, arguments, outermost)


def _read_row(label: str, descriptor: str, stack: list[Group]) -> None:
    """Put the items of a row into the groups that are open, and open and close groups."""
    if re.match(r"\w+\(\) of ", label):
        stack[-1].content.append(Item(label, descriptor))
        return
    place, conditions = 0, 0
    while label[place:].strip():
        if found := CONDITION.match(label, place):
            begin = found.start(1)
            place = _end_of_condition(label, begin)
            group = Group(label[begin:place])
            stack[-1].content.append(group)
            stack.append(group)
            conditions += 1
        elif found := PIECE.match(label, place):
            place = found.end()
            if found["open"]:
                stack[-1].conditions, conditions = conditions, 0
            elif found["close"]:
                del stack[-stack[-1].conditions :]
            elif found["item"]:
                stack[-1].content.append(Item(found["item"].strip(), descriptor))
                del stack[len(stack) - conditions :]
                conditions = 0
        else:
            raise ValueError(f"the row {label!r} of a syntax table in spec.md cannot be read")


def _end_of_condition(label: str, begin: int) -> int:
    """Where a condition ends: behind its closing bracket, or behind ``each entry``."""
    each = re.match(r"for each \w+", label[begin:])
    if each:
        return begin + each.end()
    depth = 0
    for place in range(label.index("(", begin), len(label)):
        depth += {"(": 1, ")": -1}.get(label[place], 0)
        if depth == 0:
            return place + 1
    raise ValueError(f"a condition of {label!r} in spec.md has no end")


def articles_of(parts: Sequence[Part]) -> list[tuple[str, list[str], str]]:
    """Heading, anchors and Markdown of what spec.md says about each element, without code."""
    found = []
    for part in parts:
        for heading, text in re.findall(
            r"^#### (.+)\n((?:(?!#|\|.*\| descriptor \|).*\n)*)", FENCED.sub("", part.text + "\n"), re.MULTILINE
        ):
            if element_names(heading):
                found.append((heading, element_names(heading), text.strip()))
    return found
