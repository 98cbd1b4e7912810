"""Figures of matplotlib for phones: their columns below each other instead of side by side, by one rule.

A figure of three panels in a row has letters of four pixels on a phone. The narrow figure shows the same drawing
through windows, one for each column of panels and of the legend, so that its letters are as large as text.
"""

import html
import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Final, NamedTuple

WIDTH: Final = 300.0
"""Points that stand side by side on a phone: type of 9 points is then about 11 pixels high."""

LETTER: Final = 0.53
"""Width of a letter, about, for its height of 1."""

MARGIN: Final = 5.0
"""Points between windows."""

LEGEND_HANDLE: Final = 34.0
"""Points from the text of a legend back to the beginning of its line."""

LEGEND_LINE: Final = 11.0
"""Height of a line of a legend in points."""

_VIEW: Final = re.compile(r'width="[\d.]+pt" height="[\d.]+pt" viewBox="0 0 ([\d.]+) ([\d.]+)"')
_AXES: Final = re.compile(
    r'<g id="axes_\d+">\s*<g id="patch_\d+">\s*<path d="M ([\d.]+) ([\d.]+)\s+L ([\d.]+) [\d.]+\s+L [\d.]+ ([\d.]+)'
)
_LEGEND: Final = re.compile(r'<g id="legend_\d+">.*', re.DOTALL)
_TEXT: Final = re.compile(
    r'<text style="font-size: ([\d.]+)px;[^"]*text-anchor: (\w+)[^"]*" x="([\d.]+)" y="([\d.]+)" '
    r'transform="rotate\((-?\d+) [^>]*>([^<]*)'
)


class Label(NamedTuple):
    """A text of a figure: where it is anchored and how, and about where it begins and ends."""

    x: float
    y: float
    anchor: str
    left: float
    right: float


class Window(NamedTuple):
    """A part of a figure, in its points."""

    left: float
    top: float
    width: float
    height: float


def write_twin(figure: Path) -> bool:
    """Write the narrow form of a figure ``NAME.svg`` beside it, as ``NAME-narrow.svg``; False where it has none."""
    twin = narrow(figure.read_text(encoding="utf-8"))
    if twin is None:
        return False
    figure.with_name(f"{figure.stem}-narrow.svg").write_text(twin, encoding="utf-8")
    return True


def twin_source(name: str) -> str:
    """What lets a ``picture`` of ``NAME.svg`` be the narrow one on phones; the name as it stands in the page."""
    return f'<source media="(max-width: 640px)" srcset="{name}-narrow.svg">'


def narrow(svg: str) -> str | None:
    """The figure with its columns below each other; None where it has one column, or does not tell where they are."""
    view = _VIEW.search(svg)
    start = svg.find('<g id="figure_1">')
    if view is None or start < 0:
        return None
    width, height = float(view[1]), float(view[2])
    labels = _labels(_LEGEND.sub("", svg))
    boxes = [tuple(map(float, found.groups())) for found in _AXES.finditer(svg)]
    if len(boxes) < svg.count('<g id="axes_'):
        return None
    columns = sorted({(left, right) for left, _, right, _ in boxes})
    between = [_edge(labels, before[1], after[0]) for before, after in pairwise(columns)]
    inner = [edge for edge in between if edge is not None]
    if not inner or len(inner) < len(between):
        return None
    legend = _legend(svg, width, height)
    bottom = legend[0].top if legend else height
    edges = [0.0, *inner, width]
    panels = [Window(a, 0.0, b - a, bottom) for a, b in pairwise(edges)]
    placed, size = _placed([panels, legend])
    used = "".join(
        f'<svg x="{x:.1f}" y="{y:.1f}" width="{w.width:.1f}" height="{w.height:.1f}" '
        f'viewBox="{w.left:.1f} {w.top:.1f} {w.width:.1f} {w.height:.1f}"><use xlink:href="#figure_1"/></svg>\n'
        for x, y, w in placed
    )
    head = svg[:start].replace(
        view[0], f'width="{size[0]:.0f}pt" height="{size[1]:.0f}pt" viewBox="0 0 {size[0]:.1f} {size[1]:.1f}"'
    )
    paper = '<rect width="100%" height="100%" style="fill: #ffffff"/>\n'
    return f"{head}<defs>\n{svg[start:].replace('</svg>', '')}</defs>\n{paper}{used}</svg>\n"


def _labels(svg: str) -> list[Label]:
    """The texts of a figure."""
    labels = []
    for found in _TEXT.finditer(svg):
        size, x, y, angle = float(found[1]), float(found[3]), float(found[4]), int(found[5])
        wide = LETTER * size * len(html.unescape(found[6]))
        begin = x - {"start": 0.0, "middle": wide / 2, "end": wide}[found[2]]
        across = (begin, begin + wide) if angle == 0 else (x - size, x + size / 3)
        labels.append(Label(x, y, found[2] if angle == 0 else "turned", *across))
    return labels


def _edge(labels: Sequence[Label], end: float, begin: float) -> float | None:
    """Where to cut between a column that ends at `end` and one that begins at `begin`; None if that cannot be.

    What stands in the gap is of the second column, which has numbers of its own; what reaches into it is of the first.
    """
    if begin <= end:
        return None
    second = [label for label in labels if end < label.x < begin and label.anchor in ("end", "turned")]
    if not any(label.anchor == "end" for label in second):
        return None
    left = min(label.left for label in second)
    first = [label.right for label in labels if label.x <= end < label.right and label.anchor in ("start", "middle")]
    reach = max([end + 1, *first])
    return (reach + left) / 2 if reach <= left else None


def _legend(svg: str, width: float, height: float) -> list[Window]:
    """The columns of the legend below all panels; none where there is no such legend."""
    found = _LEGEND.search(svg)
    labels = _labels(found[0]) if found is not None else []
    if not labels:
        return []
    top = min(label.y for label in labels) - LEGEND_LINE
    starts: list[float] = []
    for x in sorted(label.x for label in labels):
        if not starts or x - starts[-1] > LEGEND_HANDLE:
            starts.append(x)
    edges = [*(max(x - LEGEND_HANDLE, 0.0) for x in starts), width]
    return [Window(a, top, b - a, height - top) for a, b in pairwise(edges)]


def _placed(
    groups: Sequence[Sequence[Window]],
) -> tuple[list[tuple[float, float, Window]], tuple[float, float]]:
    """Windows in lines of at most WIDTH points, each group on lines of its own, and the size of all."""
    placed: list[tuple[float, float, Window]] = []
    y = widest = 0.0
    for group in groups:
        x = tall = 0.0
        for window in group:
            if x and x + window.width > WIDTH:
                x, y, tall = 0.0, y + tall + MARGIN, 0.0
            placed.append((x, y, window))
            x, tall = x + window.width, max(tall, window.height)
            widest = max(widest, x)
        y += tall
    return placed, (widest, y)
