"""spec.md in parts, one a page, and where everything with an id stands."""

import re
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

from gsvc_lab.site.equations import NUMBERED
from gsvc_lab.site.markdown import RULE, slug

FENCED: Final = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
ROW_NUMBER: Final = re.compile(r"\| \((\d+-\d+)\) \|$")
OPERATIONS: Final = "Operations"
SYNTAX: Final = ("6", "15")
"""The sections that have the tables of the syntax."""


@dataclass(frozen=True)
class Part:
    """A section or an annex: a page."""

    name: str  # ``6`` or ``Annex A``; empty for what stands before the first section
    title: str  # its heading
    page: str  # file name of its page
    text: str  # its Markdown, with the heading

    @property
    def headings(self) -> list[str]:
        """Its headings of the next depth."""
        return re.findall(r"^### (.+)$", FENCED.sub("", self.text), re.MULTILINE)


@dataclass
class Targets:
    """Where what has an id stands: from the id to the URL."""

    rules: dict[str, str] = field(default_factory=dict)
    equations: dict[str, str] = field(default_factory=dict)
    elements: dict[str, str] = field(default_factory=dict)
    sections: dict[str, str] = field(default_factory=dict)
    operations: dict[str, str] = field(default_factory=dict)
    headings: dict[str, str] = field(default_factory=dict)


def parts_of(spec: str) -> list[Part]:
    """The parts of spec.md in their order, first what stands before section 1."""
    hidden = FENCED.sub(lambda block: "\x00" * len(block[0]), spec)
    starts = [0, *(found.start() for found in re.finditer(r"^## ", hidden, re.MULTILINE)), len(spec)]
    return [_part(spec[first:last]) for first, last in pairwise(starts)]


def _part(text: str) -> Part:
    heading = text.partition("\n")[0]
    title = heading.lstrip("# ")
    if heading.startswith("# "):
        return Part("", title, "spec.html", text)
    name = re.match(r"Annex [A-Z]|\d+", title)
    if not name:
        raise ValueError(f"the heading {title!r} of spec.md begins neither with a number nor with Annex and a letter")
    return Part(name[0], title, f"spec-{slug(name[0])}.html", text)


def element_names(heading: str) -> list[str]:
    """The anchors of the elements that a heading describes: names, and what tells two of one name apart."""
    more = re.search(r" \((\w+)\)$", heading)
    return [f"element-{name}{'-' + more[1] if more else ''}" for name in re.findall(r"`(\w+)`", heading)]


def targets_of(parts: list[Part]) -> Targets:
    """Where everything with an id stands."""
    found = Targets()
    for part in parts:
        text = FENCED.sub("", part.text)
        if part.name:
            found.sections[part.name] = part.page
        for rule in re.findall(rf"\*\*({RULE.pattern})\*\*", text) if part.name else ():
            found.rules[rule] = f"{part.page}#{rule}"
        for line in text.splitlines():
            number = NUMBERED.search(line) if line.startswith("    ") else ROW_NUMBER.search(line)
            if number:
                found.equations[number[1]] = f"{part.page}#eq-{number[1]}"
        for marks, heading in re.findall(r"^(#{1,4}) (.+)$", text, re.MULTILINE):
            found.headings[slug(heading)] = f"{part.page}#{slug(heading)}"
            section = re.match(r"(\d+\.\d+) ", heading)
            if marks == "###" and section:
                found.sections[section[1]] = f"{part.page}#{slug(heading)}"
            if marks == "####" and part.name in SYNTAX:
                for anchor in element_names(heading):
                    found.elements.setdefault(anchor.removeprefix("element-"), f"{part.page}#{anchor}")
            if marks == "###" and heading.endswith(f" {OPERATIONS}"):
                section_text = text[text.index(f"### {heading}") :].partition("\n### ")[0]
                for name in re.findall(r"^\| `(\w+)` \| [\d.]+ \|", section_text, re.MULTILINE):
                    found.operations[name] = f"{part.page}#operation-{name}"
    return found
