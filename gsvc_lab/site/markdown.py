"""Markdown to HTML: headings with the anchors of GitHub, tables that scroll, code in colours, equations."""

import html
import re
from collections import Counter
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, Final, cast

from markdown_it import MarkdownIt
from markdown_it.renderer import RendererHTML
from markdown_it.token import Token
from pygments import highlight
from pygments.formatters import HtmlFormatter
from pygments.lexers import get_lexer_by_name
from pygments.util import ClassNotFound

from gsvc_lab.site.equations import NotCertainError, equation_block, equation_numbers, mathml

LANGUAGES: Final = {"": "text", "hex": "text"}
RULE: Final = re.compile(r"R-\d+(?:\.\d+)?-\d+")
CELL_NUMBER: Final = re.compile(r"\((\d+-\d+)\)")

INDENTED_ROW: Final = re.compile(r"^\| ((?:  )+)(?=\S)", re.MULTILINE)
"""The beginning of a row of a syntax table that stands further in, which Markdown would forget."""

POWER: Final = re.compile(r"\^(?:\((<code>[^<]*</code>[^()<]*)\)|(<code>[^<]*</code>))")
"""A power whose exponent has the name of an element."""

LinkMap = Callable[[str], str | None]
"""From the target of a link in a document to that of the site, or None where the site has none."""


def slug(heading: str) -> str:
    """The anchor that GitHub gives to a heading."""
    return re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-")


def highlighted(code: str, language: str) -> str:
    """Code in colours, which the style sheet has."""
    try:
        lexer = get_lexer_by_name(LANGUAGES.get(language, language))
    except ClassNotFound:
        lexer = get_lexer_by_name("text")
    inner = highlight(code, lexer, HtmlFormatter(nowrap=True))
    return f'<pre tabindex="0"><code>{inner}</code></pre>\n'


def rendered(text: str, link_map: LinkMap, *, normative: bool = False, raised: int = 0) -> str:
    """A document, or a part of one, as HTML.

    `text`: the Markdown. `link_map`: where its links lead; a link to what the site has not becomes plain text.
    `normative`: whether it is spec.md, whose indented blocks are equations and whose bold ids are the rules themselves.
    `raised`: how many ranks its headings go up.
    """
    parser = MarkdownIt("commonmark").enable("table")
    rules: dict[str, Any] = {
        "heading_close": _heading_close,
        "table_open": lambda *_: '<div class="scroll" tabindex="0"><table>\n',
        "table_close": lambda *_: "</table></div>\n",
        "fence": lambda tokens, at, *_: highlighted(tokens[at].content, tokens[at].info.strip()),
    }
    if normative:
        rules["code_block"] = lambda tokens, at, *_: _equations(tokens[at].content)
    cast(RendererHTML, parser.renderer).rules.update(rules)
    tokens = parser.parse(INDENTED_ROW.sub(lambda row: "| " + "&emsp;" * (len(row[1]) // 2), text))
    _map_links(tokens, link_map)
    _prepare_headings(tokens, raised)
    if normative:
        for place in range(len(tokens)):
            _mark_rules(tokens[place])
            _set_equations_of_a_row(tokens, place)
    page = str(parser.renderer.render(tokens, parser.options, {}))
    return POWER.sub(lambda found: f"<sup>{found[1] or found[2]}</sup>", page) if normative else page


def _heading_close(tokens: Sequence[Token], at: int, *_: object) -> str:
    anchor = html.escape(str(tokens[at - 2].attrGet("id")))
    return f'<a class="here" href="#{anchor}" aria-label="Link to this heading">#</a></{tokens[at].tag}>\n'


def _prepare_headings(tokens: Sequence[Token], raised: int) -> None:
    """Give headings their rank and their anchors; as on GitHub, a number tells those of one text apart."""
    seen: Counter[str] = Counter()
    for at, token in enumerate(tokens):
        if token.type.startswith("heading_"):
            token.tag = f"h{int(token.tag[1]) - raised}"
        if token.type == "heading_open":
            anchor = slug(tokens[at + 1].content)
            token.attrSet("id", f"{anchor}-{seen[anchor]}" if seen[anchor] else anchor)
            seen[anchor] += 1


def _map_links(tokens: Sequence[Token], link_map: LinkMap) -> None:
    """Lead the links of a document to pages of the site."""
    for token in tokens:
        if token.type == "inline" and token.children:
            closing: list[str] = []
            for child in token.children:
                if child.type == "link_open":
                    target = link_map(str(child.attrGet("href")))
                    closing.append("a" if target else "span")
                    child.tag = closing[-1]
                    child.attrs = {"href": target} if target else {"class": "elsewhere"}
                elif child.type == "link_close":
                    child.tag = closing.pop()
                elif child.type == "image":
                    child.attrSet("src", str(link_map(str(child.attrGet("src")))))
                    child.attrSet("loading", "lazy")


def _mark_rules(token: Token) -> None:
    """Give a bold id of a rule its anchor."""
    children = token.children or []
    for opened, text in pairwise(children):
        if opened.type == "strong_open" and RULE.fullmatch(text.content):
            opened.attrs = {"class": "rule", "id": text.content}


def _equations(text: str) -> str:
    """A block of equations, set if it is certain how, else as it is."""
    try:
        return equation_block(text)
    except NotCertainError:
        lines = html.escape(text.rstrip("\n"))
        for number in equation_numbers(text):
            lines = lines.replace(
                f"({number})", f'<a class="number" id="eq-{number}" href="#eq-{number}">({number})</a>'
            )
        return f'<pre class="plain equations" tabindex="0">{lines}</pre>\n'


def _set_equations_of_a_row(tokens: Sequence[Token], place: int) -> None:
    """Set the equations in a row of a table whose last cell is their number."""
    if tokens[place].type != "tr_open":
        return
    end = next(at for at in range(place, len(tokens)) if tokens[at].type == "tr_close")
    cells = [token for token in tokens[place:end] if token.type == "inline"]
    found = CELL_NUMBER.fullmatch(cells[-1].content) if cells else None
    if not found:
        return
    number = found[1]
    cells[-1].children = [_raw(f'<span class="number" id="eq-{number}"><a href="#eq-{number}">({number})</a></span>')]
    for cell in cells[:-1]:
        if " = " in cell.content:
            cell.children = [_raw(mathml(cell.content))]


def _raw(content: str) -> Token:
    return Token("html_inline", "", 0, content=content)
