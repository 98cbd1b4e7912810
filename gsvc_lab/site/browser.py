"""The syntax browser: tables on one side, what spec.md says about their elements on the other."""

import re
from collections.abc import Sequence

from gsvc_lab.site.document import FENCED, Part, Targets
from gsvc_lab.site.markdown import LinkMap, rendered
from gsvc_lab.site.syntax import TABLE, articles_of


def browser(parts: Sequence[Part], targets: Targets, link_map: LinkMap) -> str:
    """The two sides as HTML; without scripts all texts stand below each other, and a click leads to the right one."""
    articles, places = [], {}
    for heading, anchors, text in articles_of(parts):
        names = [anchor.removeprefix("element-") for anchor in anchors]
        for name in names:
            places[name] = f"#about-{names[0]}"
        inner = rendered(f"### {heading}\n\n{text}", link_map, normative=True)
        inner = re.sub(r' id="[^"]*"', "", re.sub(r'<a class="here".*?</a>', "", inner))
        home = targets.elements[names[0]]
        articles.append(
            f'<article id="about-{names[0]}">{inner}'
            f'<p class="home"><a href="{home}">In the specification</a></p></article>'
        )
    tables = []
    for part in parts:
        for found in TABLE.finditer(FENCED.sub("", part.text)):
            tables.append(
                f'<div id="table-{found[1]}">{_with_links(rendered(found[0], link_map), found[1], places)}</div>'
            )
    return (
        f'<div class="browser"><div class="tables">{"".join(tables)}</div>\n'
        '<div class="about" aria-live="polite"><p class="hint">Choose an element to read what it means.</p>'
        f"{''.join(articles)}</div></div>"
    )


def _with_links(table: str, name: str, places: dict[str, str]) -> str:
    """A table whose elements lead to their texts, and whose calls lead to other tables."""

    def element(found: re.Match[str]) -> str:
        own = f"{found[1]}-{name}" if f"{found[1]}-{name}" in places else found[1]
        return f'<code><a href="{places[own]}">{found[1]}</a></code>' if own in places else found[0]

    head, body = table.split("</thead>")
    calls = re.sub(
        r"\b(plane|splat_block|chunk|main_header|frame_body|densities)\(", r'<a href="#table-\1">\1</a>(', body
    )
    return head + "</thead>" + re.sub(r"<code>(\w+)</code>", element, calls)
