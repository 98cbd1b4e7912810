"""The syntax tables of spec.md, read: what stands in what, under which condition, in how many bits."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from gsvc_lab.site.document import FENCED, Part, element_names

TABLE: Final = re.compile(r"^\| (\w+)\(([^|]*)\) \| descriptor \|\n\|[-|: ]+\|\n((?:\|.*\|\n)+)", re.MULTILINE)


@dataclass
class Item:
    """An element, or a call of another table."""

    label: str  # what the table says, in Markdown
    descriptor: str  # its descriptor, in Markdown

    @property
    def bits(self) -> int | None:
        """Its size, where that is fixed."""
        found = re.fullmatch(r"(u|le|f)\(?(\d+)\)?|(\d+) bytes", self.descriptor)
        if not found:
            return None
        if found[3]:
            return 8 * int(found[3])
        return int(found[2]) * (8 if found[1] == "le" else 1)


@dataclass
class Group:
    """Items under a condition, or repeated; the outermost has no condition."""

    condition: str  # what the table says, in Markdown
    content: list["Item | Group"] = field(default_factory=list)  # what stands in it


@dataclass
class Table:
    """One table: its name, its arguments, and what it holds."""

    name: str
    arguments: str
    group: Group


def tables_of(syntax: Mapping[str, Any]) -> dict[str, Table]:
    """The tables of spec/syntax.json by name, in their order."""
    found = {}
    for structure in syntax["structures"]:
        outermost = Group("")
        stack = [outermost]
        for element in structure["elements"]:
            conditions = [_condition(one) for one in element["within"]]
            common = 0
            while common < min(len(conditions), len(stack) - 1) and stack[common + 1].condition == conditions[common]:
                common += 1
            del stack[common + 1 :]
            for condition in conditions[common:]:
                group = Group(condition)
                stack[-1].content.append(group)
                stack.append(group)
            stack[-1].content.append(_item(element))
        found[structure["name"]] = Table(structure["name"], ", ".join(structure["parameters"]), outermost)
    return found


def _condition(one: Mapping[str, str]) -> str:
    word, text = next(iter(one.items()))
    return f"{word} {text}" if text.startswith("each ") else f"{word} ({text})"


def _item(element: Mapping[str, Any]) -> Item:
    """An element, or a call: a name with brackets."""
    name = element["name"]
    label = name if "(" in name or name == "payload" else f"`{name}`"
    label += f"[{element['index']}]" if "index" in element else ""
    label += f" ({element['symbol']})" if "symbol" in element else ""
    label += f" {element['note']}" if "note" in element else ""
    return Item(label, element.get("descriptor", ""))


def articles_of(parts: Sequence[Part]) -> list[tuple[str, list[str], str]]:
    """Heading, anchors and Markdown of what spec.md says about each element, without code.

    What follows the elements of a section, under a title in bold, is not about the last of them.
    """
    found = []
    for part in parts:
        for heading, text in re.findall(
            r"^#### (.+)\n((?:(?!#|\*\*\w+\.\*\*|\|.*\| descriptor \|).*\n)*)",
            FENCED.sub("", part.text + "\n"),
            re.MULTILINE,
        ):
            if element_names(heading):
                found.append((heading, element_names(heading), text.strip()))
    return found
