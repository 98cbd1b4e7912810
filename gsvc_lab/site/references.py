"""Links from every mention of a rule, an equation, a syntax element, an operation or a section to its place."""

import html
import re
from collections.abc import Callable, Container
from html.parser import HTMLParser
from typing import Final

from gsvc_lab.site.document import Targets
from gsvc_lab.site.markdown import RULE

VOID: Final = frozenset({"meta", "img", "source", "br", "hr", "link", "input", "wbr"})
UNTOUCHED: Final = frozenset({"a", "h1", "h2", "h3", "h4", "script", "style", "svg", "summary"})
IDS: Final = re.compile(rf"(?P<rule>{RULE.pattern})(?!\d)|\((?P<equation>\d+-\d+)\)")
NUMBER: Final = r"\d+(?:\.\d+)?"
LIST: Final = rf"(?:Annex [A-Z]|{NUMBER})(?:(?:,\s|\sand\s|\sor\s|\sto\s){NUMBER})*"
SECTIONS: Final = re.compile(
    rf"(?P<lead>\b[Ss]ections?\s){LIST}|Annex [A-Z]\b|\((?:{NUMBER}(?:, )?)+\)|"
    r"\b(?:of|in|by|as|that|with)\s\d+\.\d+(?:\s(?:or|and)\s\d+\.\d+)*\b(?!\s*[εη%])"
)
RAISED: Final = re.compile(r"\^(?:(−?\w+)|\(([^()]+)\))")
LOWERED: Final = re.compile(
    r"(?<![\w`])(?:([A-Za-zγδσμηΔ]{1,2}|mean)_(?:([A-Za-z0-9]+)|\(([^()]+)\))|"
    r"(?:(l)(11|21|22)|([uvrkeaβδC])(\d))(?![A-Za-z0-9_]))"
)
TAG: Final = re.compile(r"\[(paper|upstream|ours)([^\]]*)\]")
ONE: Final = re.compile(rf"Annex [A-Z]|{NUMBER}")


class Linker(HTMLParser):
    """Writes a page again, with its mentions as links.

    `targets`: where everything stands. `page`: file name of the page, for links within it. `in_spec`: whether numbers
    of sections are those of spec.md.
    """

    def __init__(self, targets: Targets, page: str, *, in_spec: bool) -> None:
        super().__init__(convert_charrefs=False)
        self.targets, self.page, self.in_spec = targets, page, in_spec
        self.out: list[str] = []
        self.open: list[str] = []
        self.heads: list[str] = []
        self.column = -1

    def linked(self, body: str) -> str:
        """A body with links."""
        self.feed(body)
        self.close()
        return "".join(self.out)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Copy a tag, and note where in a table it stands."""
        self.out.append(self.get_starttag_text() or "")
        if tag not in VOID:
            self.open.append(tag)
        if tag == "table":
            self.heads = []
        if tag == "tr":
            self.column = -1
        if tag in ("td", "th"):
            self.column += 1
        if tag == "th":
            self.heads.append("")

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Copy a tag without content."""
        self.out.append(self.get_starttag_text() or "")

    def handle_endtag(self, tag: str) -> None:
        """Copy the end of a tag."""
        if tag in self.open:
            while self.open.pop() != tag:
                pass
        self.out.append(f"</{tag}>")

    def handle_entityref(self, name: str) -> None:
        """Copy a named character."""
        self.out.append(f"&{name};")

    def handle_charref(self, name: str) -> None:
        """Copy a numbered character."""
        self.out.append(f"&#{name};")

    def handle_comment(self, data: str) -> None:
        """Leave comments out."""

    def handle_data(self, data: str) -> None:
        """Link what a piece of text mentions."""
        if self.heads and "th" in self.open:
            self.heads[-1] += data
        text = html.escape(data, quote=False) if "script" not in self.open else data
        if UNTOUCHED & set(self.open):
            self.out.append(text)
        elif "code" in self.open and "pre" not in self.open:
            self.out.append(self._name(text))
        else:
            text = self._ids(text)
            if self.in_spec and not {"pre", "math", "code"} & set(self.open):
                text = self._sections(text)
                pieces = re.split("(<[^>]*>)", text)
                text = "".join(piece if piece.startswith("<") else _scripts(piece) for piece in pieces)
                text = TAG.sub(r'<span class="tag \1">\1\2</span>', text)
            self.out.append(text)

    def _link(self, text: str, target: str | None, kind: str) -> str:
        if not target:
            return text
        return f'<a class="{kind}" href="{target.removeprefix(self.page) if "#" in target else target}">{text}</a>'

    def _name(self, text: str) -> str:
        """A name in code: an operation or an element."""
        if text in self.targets.operations:
            return self._link(text, self.targets.operations[text], "name")
        if text in self.targets.elements and (self.in_spec or "_" in text):
            return self._link(text, self.targets.elements[text], "name")
        return self._ids(text)

    def _ids(self, text: str) -> str:
        in_rule = self.open[-1:] == ["strong"]

        def link(found: re.Match[str]) -> str:
            if found["rule"]:
                target = self.targets.rules.get(found["rule"])
                return self._link(found[0], target, "self" if in_rule else "id")
            return self._link(found[0], self.targets.equations.get(found["equation"]), "id")

        return IDS.sub(link, text)

    def _sections(self, text: str) -> str:
        column = self.heads[self.column] if -1 < self.column < len(self.heads) and "td" in self.open else ""
        if column == "section":
            return ONE.sub(lambda one: self._link(one[0], self.targets.sections.get(one[0]), "section"), text)
        pieces = re.split(r"(<a .*?</a>)", text)
        return "".join(
            piece if piece.startswith("<a ") else SECTIONS.sub(self._each_section, piece) for piece in pieces
        )

    def _each_section(self, found: re.Match[str]) -> str:
        bare = found["lead"] is None

        def link(one: re.Match[str]) -> str:
            if bare and "." not in one[0] and not one[0].startswith("Annex"):
                return one[0]
            return self._link(one[0], self.targets.sections.get(one[0]), "section")

        return ONE.sub(link, found[0])


def _scripts(text: str) -> str:
    """Plain text whose symbols have their scripts, set as in the equations."""
    raised = RAISED.sub(lambda found: f"<sup>{found[1] or found[2]}</sup>", text)
    return LOWERED.sub(_lowered, raised)


def _lowered(found: re.Match[str]) -> str:
    """A symbol with its lower script."""
    symbol, script = (group for group in found.groups() if group)
    return f"<i>{symbol}</i><sub>{script}</sub>"


def with_anchors(body: str, anchors: Callable[[str], list[str]], operations: Container[str]) -> str:
    """A body whose headings of elements, and whose rows of operations, have anchors.

    `body`: the HTML. `anchors`: from the text of a heading to the anchors that it needs. `operations`: the names of the
    operations.
    """

    def heading(found: re.Match[str]) -> str:
        plain = re.sub(r"<code>(.*?)</code>", r"`\1`", found[3]).partition("<a ")[0]
        spans = "".join(f'<span class="anchor" id="{anchor}"></span>' for anchor in anchors(plain))
        return f"{found[1]}{spans}{found[3]}</{found[2]}>"

    def row(found: re.Match[str]) -> str:
        name = found[1]
        return f'<tr id="operation-{name}">\n<td><code>{name}</code></td>' if name in operations else found[0]

    body = re.sub(r"(<(h[34])[^>]*>)(.*?)</\2>", heading, body)
    return re.sub(r"<tr>\n<td><code>(\w+)</code></td>(?=\n<td>[\d.]+</td>)", row, body)
