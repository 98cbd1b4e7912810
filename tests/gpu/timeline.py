"""The time line of a frame on the device as a drawing: which kernel runs from when to when."""

import html
from collections.abc import Mapping, Sequence
from typing import Any, Final

WIDTH: Final = 900
LEFT: Final = 220
RIGHT: Final = 80
BAR: Final = 22
ROW: Final = 46
TITLE: Final = 24
COLORS: Final = ("#3b78c3", "#b5651d", "#3f8f55", "#a45ab0", "#c25555", "#66727f")

Span = tuple[str, float, float]
"""A kernel with its begin and its end in milliseconds."""


def drawing(cards: Sequence[Mapping[str, Any]]) -> str:
    """An SVG with a bar for each kernel of each card's time lines, to one scale; nothing if no card has any."""
    drawn = [card for card in cards if card["timeline"]]
    if not drawn:
        return ""
    lines = [spans for card in drawn for spans in card["timeline"].values()]
    scale = (WIDTH - LEFT - RIGHT) / max(end for spans in lines for _, _, end in spans)
    colors = {
        kernel: COLORS[k % len(COLORS)] for k, kernel in enumerate(dict.fromkeys(s[0] for line in lines for s in line))
    }
    parts, y = [], 0
    for card in drawn:
        machine = card["machine"]
        title = f"{card['card']}, commit {machine.get('commit', '?')}, {machine.get('date', '?')}"
        parts.append(f'<text x="8" y="{y + 17}" font-weight="bold">{html.escape(title)}</text>')
        y += TITLE
        for name, spans in card["timeline"].items():
            parts.append(_line(name, spans, y, scale, colors))
            y += ROW
    size, font = f'width="{WIDTH}" height="{y}"', 'font-family="sans-serif" font-size="12"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {y}" {size} {font}>'
    return "\n".join([head, f'<rect {size} fill="#fff"/>', *parts, "</svg>", ""])


def _line(name: str, spans: Sequence[Span], y: int, scale: float, colors: Mapping[str, str]) -> str:
    """The bars of one time line, its name before them, its length behind, and below what each takes."""
    bars = [
        f'<rect x="{LEFT + scale * begin:.1f}" y="{y}" width="{max(scale * (end - begin), 1):.1f}" height="{BAR}" '
        f'fill="{colors[kernel]}"/>'
        for kernel, begin, end in spans
    ]
    each = [
        f'<tspan fill="{colors[kernel]}">{html.escape(kernel)} {end - begin:.3f}</tspan>'
        for kernel, begin, end in spans
    ]
    last = spans[-1][2]
    return "\n".join([
        f'<text x="{LEFT - 8}" y="{y + 15}" text-anchor="end">{html.escape(name)}</text>', *bars,
        f'<text x="{LEFT + scale * last + 6:.1f}" y="{y + 15}">{last:.3f} ms</text>',
        f'<text x="{LEFT}" y="{y + BAR + 13}" font-size="11">{" · ".join(each)}</text>',
    ])  # fmt: skip
