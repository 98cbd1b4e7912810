"""The index of the search: a script, because a page that was opened from a disk may load scripts and nothing else."""

import json
from collections.abc import Sequence
from html.parser import HTMLParser
from typing import Final

from gsvc_lab.site.document import Targets
from gsvc_lab.site.page import Page

HEADINGS: Final = ("h1", "h2", "h3", "h4")
APART: Final = frozenset({"div", "p", "li", "tr", "td", "th", "b", "small", "br", "pre"})
SILENT: Final = frozenset({"math", "script", "style"})


class _Entries(HTMLParser):
    """Title, anchor and text of each part of a page between two headings."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[list[str]] = [["", "", ""]]
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag in APART:
            self.found[-1][2] += " "
        is_heading = tag in HEADINGS and "id" in dict(attrs)
        if is_heading:
            self.found.append(["", str(dict(attrs)["id"]), ""])
        if tag in SILENT or is_heading or (tag == "a" and ("class", "here") in attrs):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if self.open[-1:] == [tag]:
            self.open.pop()

    def handle_data(self, data: str) -> None:
        if not self.open:
            self.found[-1][2] += data
        elif self.open[-1] in HEADINGS:
            self.found[-1][0] += data


def index(pages: Sequence[Page], targets: Targets) -> str:
    """A script that keeps everything that can be found in ``window.GSVC_INDEX``.

    ``parts`` has rows of title, title of the page, URL and text; ``ids`` leads from rules, equations, elements and
    operations to their URLs.
    """
    rows = []
    for page in pages:
        entries = _Entries()
        entries.feed(page.body)
        for title, anchor, text in entries.found:
            words = " ".join(text.split())
            if title or words:
                url = f"{page.name}#{anchor}" if anchor else page.name
                rows.append([" ".join(title.split()) or page.title, page.title, url, words])
    equations = {f"({number})": url for number, url in targets.equations.items()}
    ids = targets.rules | equations | targets.elements | targets.operations
    return f"window.GSVC_INDEX = {json.dumps({'parts': rows, 'ids': ids}, ensure_ascii=False)};\n"
