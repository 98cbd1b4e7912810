"""The time line of a frame on the device as a drawing: which kernel runs from when to when."""

import html
from collections.abc import Mapping, Sequence
from typing import Any, Final

WIDTH: Final = 900
LEFT: Final = 250
ROW: Final = 34
TOP: Final = 26
COLORS: Final = ("#3b78c3", "#e08a3c", "#4d9e5f", "#a45ab0", "#c25555", "#7b8794")
LETTER: Final = 6.6
"""Width of a letter of a label, roughly."""


def drawing(cards: Sequence[Mapping[str, Any]]) -> str:
    """An SVG with a bar for each kernel of each card's time lines, to one scale; nothing if no card has any."""
    lines = [(card, name, spans) for card in cards for name, spans in card.get("timeline", {}).items()]
    if not lines:
        return ""
    longest = max(end for _, _, spans in lines for _, _, end in spans)
    scale = (WIDTH - LEFT - 60) / longest
    kernels = list(dict.fromkeys(kernel for _, _, spans in lines for kernel, _, _ in spans))
    parts, y, card_before = [], TOP, None
    for card, name, spans in lines:
        if card is not card_before:
            title = f"{card['card']}, {card['machine'].get('date', '')} {card['note']}"
            parts.append(f'<text x="8" y="{y}" font-weight="bold">{html.escape(title.strip())}</text>')
            y, card_before = y + 14, card
        parts.append(f'<text x="{LEFT - 8}" y="{y + 17}" text-anchor="end">{html.escape(name)}</text>')
        parts += [_bar(kernel, begin, end, y, scale, COLORS[kernels.index(kernel) % len(COLORS)]) for kernel, begin, end in spans]
        last = spans[-1][2]
        parts.append(f'<text x="{LEFT + scale * last + 6:.1f}" y="{y + 17}">{last:.3f} ms</text>')
        y += ROW if (card, name) != (lines[-1][0], lines[-1][1]) else ROW
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {y + 6}" font-family="sans-serif" font-size="12">\n'
        f'<rect width="{WIDTH}" height="{y + 6}" fill="#fff"/>\n' + "\n".join(parts) + "\n</svg>\n"
    )


def _bar(kernel: str, begin: float, end: float, y: int, scale: float, color: str) -> str:
    """A kernel's bar, with its name where there is room for it."""
    x, width = LEFT + scale * begin, scale * (end - begin)
    title = f"<title>{html.escape(kernel)}: {end - begin:.4f} ms</title>"
    bar = f'<rect x="{x:.1f}" y="{y}" width="{max(width, 1):.1f}" height="26" fill="{color}">{title}</rect>'
    if LETTER * len(kernel) + 8 > width:
        return bar
    return bar + f'<text x="{x + 5:.1f}" y="{y + 17}" fill="#fff">{html.escape(kernel)}</text>'
