"""One page of the site: what stands around its text."""

import html
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

ICON: Final = (
    "data:image/svg+xml,%3Csvg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 16 16'%3E"
    "%3Cellipse cx='7' cy='9' rx='6.5' ry='3.5' transform='rotate(-35 7 9)' fill='%232f6fde'/%3E"
    "%3Ccircle cx='11.5' cy='4.5' r='3' fill='%23e8842c'/%3E%3C/svg%3E"
)
TOP: Final = (
    ("spec.html", "Specification"),
    ("syntax.html", "Syntax"),
    ("glance.html", "At a glance"),
    ("readme.html", "Guides"),
    ("viewer/index.html", "Viewer"),
)


@dataclass(frozen=True)
class Page:
    """A page before it is put together."""

    name: str  # file name
    title: str  # its title, as text
    group: str  # the heading under which the contents name it
    body: str  # its text as HTML
    inner: Sequence[tuple[str, str]] = ()  # anchor and text of the headings that the contents show while it is open
    wide: bool = False  # whether it takes the whole width and has no contents beside it


def documents(pages: Sequence[Page]) -> dict[str, str]:
    """The HTML of each page by its file name; they follow each other as they are given."""
    groups: dict[str, list[Page]] = {}
    for page in pages:
        if page.group:
            groups.setdefault(page.group, []).append(page)
    turned = [page for page in pages if page.group]
    return {page.name: _document(page, groups, turned) for page in pages}


def _document(page: Page, groups: dict[str, list[Page]], turned: Sequence[Page]) -> str:
    title = html.escape(page.title if page.title == "GSVC" else f"{page.title} · GSVC")
    links = "".join(f'<a href="{name}"{_current(_is_in(page, name))}>{text}</a>' for name, text in TOP)
    place = turned.index(page) if page in turned else -1
    before = turned[place - 1] if place > 0 else None
    behind = turned[place + 1] if 0 <= place < len(turned) - 1 else None
    turn = _turn("prev", "Previous", before) + _turn("next", "Next", behind)
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{title}</title>
<link rel="icon" href="{ICON}">
<link rel="stylesheet" href="site.css">
<script src="site.js" defer></script>
</head>
<body{' class="wide"' if page.wide else ""}>
<a class="skip" href="#site-main">Skip to the text</a>
<header class="top">
<a class="home" href="index.html">GSVC</a>
<nav aria-label="Parts">{links}</nav>
<div class="search" role="search">
<input id="site-query" type="search" placeholder="Search" aria-label="Search" aria-controls="site-results"
 autocomplete="off" spellcheck="false">
<ol id="site-results" hidden></ol>
</div>
<a class="to-contents" href="#site-contents">Contents</a>
</header>
<div class="columns">
<main id="site-main" tabindex="-1">
{page.body}
<nav class="turn" aria-label="Previous and next">{turn}</nav>
</main>
<nav id="site-contents" aria-label="Contents">{_contents(page, groups)}</nav>
</div>
</body>
</html>
"""


def _is_in(page: Page, name: str) -> bool:
    """Whether a page belongs to a part that the top of the page names."""
    of_group = {"spec.html": "Specification", "readme.html": "Guides"}.get(name)
    return page.name == name or (page.group == of_group and page.name not in ("syntax.html", "glance.html"))


def _current(holds: bool) -> str:
    return ' aria-current="page"' if holds else ""


def _turn(rel: str, word: str, page: Page | None) -> str:
    if not page:
        return "<span></span>"
    return f'<a rel="{rel}" href="{page.name}"><small>{word}</small>{html.escape(page.title)}</a>'


def _contents(page: Page, groups: dict[str, list[Page]]) -> str:
    parts = []
    for group, members in groups.items():
        rows = "".join(_entry(member, member is page) for member in members)
        parts.append(f"<h2>{html.escape(group)}</h2>\n<ul>{rows}</ul>")
    return "\n".join(parts)


def _entry(page: Page, is_open: bool) -> str:
    link = f'<a href="{page.name}"{_current(is_open)}>{html.escape(page.title)}</a>'
    inner = (
        "".join(f'<li><a href="#{html.escape(anchor)}">{text}</a></li>' for anchor, text in page.inner)
        if is_open
        else ""
    )
    return f"<li>{link}{f'<ul>{inner}</ul>' if inner else ''}</li>"
