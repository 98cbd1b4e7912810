"""Charts as SVG; colours come from the page's style sheet, so that they follow its scheme."""

import html
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

COLORS: Final = 10
"""Number of classes ``c0``, ``c1``, ... of series colours in the style sheet."""

WIDTH: Final = 960
"""Width of a chart, in units of its own."""

NARROW: Final = 400
"""Width of the same chart as phones show it, so that its letters are about as large there."""

HEIGHT: Final = 430
LEFT: Final = 66
RIGHT: Final = 18
TOP: Final = 28
BOTTOM: Final = 44
LETTER: Final = 7.0
"""Width of a letter of a label, roughly."""
LINE: Final = 14.0
"""Height of a label."""
STROKE: Final = 6.0
"""Distance of the points of a line that labels are kept clear of."""
MARGIN: Final = 0.06
"""Empty part of an axis on either side."""

Box = tuple[float, float, float, float]
"""Left, top, right, bottom."""


@dataclass(frozen=True)
class Point:
    """A mark."""

    x: float  # Place of the mark; on a logarithmic axis 0 stands at the lower end
    y: float
    label: str = ""  # text beside it where there is room, or nothing
    title: str = ""  # text under the pointer
    filled: bool = True  # whether the mark is full or hollow
    low: float | None = None  # Ends of the spread along x, or None
    high: float | None = None


@dataclass(frozen=True)
class Series:
    """Points of one colour; `line` joins them in order, `marks` shows them."""

    name: str
    points: tuple[Point, ...]
    color: int
    line: bool = True
    marks: bool = True


@dataclass(frozen=True)
class Axis:
    """An axis: what it says, linear or logarithmic, and how its numbers are written."""

    label: str
    text: Callable[[float], str]
    log: bool = False


class Scale:
    """Values of one axis to places between two ends.

    A logarithmic axis has a place of its own for values of 0, below the smallest other one. It spans a decade or more:
    values that hardly differ lie beside each other, and there are powers to mark.
    """

    def __init__(self, values: Sequence[float], axis: Axis, begin: float, end: float) -> None:
        self.axis, self.begin, self.end = axis, begin, end
        shown = [value for value in values if value > 0] if axis.log else list(values)
        self.has_zero = axis.log and any(value <= 0 for value in values)
        low, high = (min(shown), max(shown)) if shown else (1.0, 10.0)
        if axis.log:
            low, high = math.log10(low), math.log10(high)
            missing = max(0.0, 1 - (high - low)) / 2
            low, high = low - missing, high + missing
        room = MARGIN * (high - low) or max(abs(high) * 0.1, 1.0)
        self.least, self.high = low - room, high + room
        self.low = self.least - (2 * room if self.has_zero else 0.0)

    def __call__(self, value: float) -> float:
        """The place of a value."""
        if self.axis.log:
            share = (math.log10(value) - self.low) / (self.high - self.low) if value > 0 else MARGIN / 3
        else:
            share = (value - self.low) / (self.high - self.low)
        return self.begin + share * (self.end - self.begin)

    def ticks(self, count: int) -> list[float]:
        """About `count` round values inside."""
        if not self.axis.log:
            return nice_ticks(self.low, self.high, count)
        first, last = math.ceil(self.least), math.floor(self.high)
        if last - first >= 2:
            step = max(1, math.ceil((last - first + 1) / count))
            powers = [10.0**power for power in range(first, last + 1) if (last - power) % step == 0]
        else:
            every = [digit * 10.0**power for power in range(first - 1, last + 1) for digit in (1, 2, 5)]
            powers = [value for value in every if self.least <= math.log10(value) <= self.high]
        return [0.0, *powers] if self.has_zero else powers


def plot(series: Sequence[Series], x: Axis, y: Axis, label: str) -> str:
    """A chart of series as SVG, with a legend below.

    `series`: at least one point in all. `x` and `y`: the axes. `label`: description of the chart for those who cannot
    see it.
    """
    legend = "".join(
        f'<span><span class="swatch c{one.color}"></span>{html.escape(one.name)}</span>' for one in series if one.name
    )
    chart = for_both(lambda width: _plot(series, x, y, label, width))
    return chart + (f'<div class="legend">{legend}</div>' if legend else "")


def for_both(draw: Callable[[int], str]) -> str:
    """A chart drawn for wide pages and again for narrow ones, of which the style sheet shows one."""
    return f'<div class="wide">{draw(WIDTH)}</div><div class="narrow">{draw(NARROW)}</div>'


def _plot(series: Sequence[Series], x: Axis, y: Axis, label: str, width: int) -> str:
    """The chart of `plot` at a width, without its legend."""
    points = [point for one in series for point in one.points]
    ends = [value for point in points for value in (point.x, point.low, point.high) if value is not None]
    across = Scale(ends, x, LEFT, width - RIGHT)
    up = Scale([point.y for point in points], y, HEIGHT - BOTTOM, TOP)
    parts = _axes(across, up, width)
    for one in series:
        if one.line and len(one.points) > 1:
            path = " ".join(f"{across(point.x):.1f},{up(point.y):.1f}" for point in one.points)
            parts.append(f'<polyline class="curve s{one.color}" points="{path}"/>')
    marked = [(one, point) for one in series for point in one.points if one.marks]
    parts += [_mark(point, one.color, across, up) for one, point in marked]
    strokes = [box for one in series if one.line for box in _along([(p.x, p.y) for p in one.points], across, up)]
    strokes += [box for _, p in marked if p.low and p.high for box in _along([(p.low, p.y), (p.high, p.y)], across, up)]
    parts += _labels([point for _, point in marked], strokes, across, up, width)
    return svg_chart(parts, HEIGHT, label, width)


def _axes(across: Scale, up: Scale, width: int) -> list[str]:
    """Grid lines with their numbers, and the labels of the axes."""
    bottom, right = HEIGHT - BOTTOM, width - RIGHT
    parts = y_axis(up.ticks(7), up, up.axis.label, up.axis.text, width)
    for tick in across.ticks(tick_count(width)):
        place = across(tick)
        parts.append(f'<path class="grid" d="M{place:.1f} {TOP}V{bottom}"/>')
        parts.append(f'<text x="{place:.1f}" y="{bottom + 17}" text-anchor="middle">{across.axis.text(tick)}</text>')
    parts.append(f'<path class="axis" d="M{LEFT} {bottom}H{right}"/>')
    parts.append(f'<text x="{right}" y="{HEIGHT - 8}" text-anchor="end">{html.escape(across.axis.label)}</text>')
    return parts


def _mark(point: Point, color: int, across: Scale, up: Scale) -> str:
    x, y = across(point.x), up(point.y)
    title = f"<title>{html.escape(point.title)}</title>" if point.title else ""
    spread = ""
    if point.low is not None and point.high is not None:
        spread = f'<path class="curve s{color}" d="M{across(point.low):.1f} {y:.1f}H{across(point.high):.1f}"/>'
    kind = f"c{color}" if point.filled else f"hollow s{color}"
    return f'<g>{title}{spread}<circle class="{kind}" cx="{x:.1f}" cy="{y:.1f}" r="{5 if point.filled else 4}"/></g>'


def _along(places: Sequence[tuple[float, float]], across: Scale, up: Scale) -> list[Box]:
    """Small boxes that cover the lines from place to place."""
    boxes = []
    for a, b in pairwise(places):
        ax, ay, bx, by = across(a[0]), up(a[1]), across(b[0]), up(b[1])
        count = max(1, round(math.hypot(bx - ax, by - ay) / STROKE))
        for n in range(count):
            x, y = ax + (bx - ax) * (n + 0.5) / count, ay + (by - ay) * (n + 0.5) / count
            boxes.append((x - 1, y - 1, x + 1, y + 1))
    return boxes


def _labels(points: Sequence[Point], strokes: Sequence[Box], across: Scale, up: Scale, width: int) -> list[str]:
    """The labels of points, each where it hides no mark and no other label, and no line if that can be.

    Those without room are left out.
    """
    taken: list[Box] = []
    for point in points:
        x, y = across(point.x), up(point.y)
        taken.append((x - 5, y - 5, x + 5, y + 5))
    parts = []
    for point in points:
        if not point.label:
            continue
        x, y = across(point.x), up(point.y)
        wide = LETTER * len(point.label)
        boxes = [(left, top, left + wide, top + LINE) for left, top in _places(x, y, wide)]
        free = [box for box in boxes if _inside(box, width) and not any(_overlap(box, other) for other in taken)]
        clear = [box for box in free if not any(_overlap(box, stroke) for stroke in strokes)]
        if free:
            left, top, _, _ = box = (clear or free)[0]
            taken.append(box)
            parts.append(f'<text class="name" x="{left:.1f}" y="{top + 11:.1f}">{html.escape(point.label)}</text>')
    return parts


def _inside(box: Box, width: int) -> bool:
    return box[0] >= LEFT and box[2] <= width and box[1] >= 0 and box[3] <= HEIGHT - BOTTOM + 4


def _places(x: float, y: float, wide: float) -> list[tuple[float, float]]:
    """The places where the label of a mark may stand, left and top, best first."""
    middle, above, below = y - LINE / 2, y - LINE - 6, y + 6
    near = [(x + 9, middle), (x - 6 - wide, middle), (x - wide / 2, above), (x - wide / 2, below)]
    slanted = [(x + 6, above), (x + 6, below), (x - 3 - wide, above), (x - 3 - wide, below)]
    return [*near, *slanted, (x - wide / 2, above - 10), (x - wide / 2, below + 10)]


def _overlap(a: Box, b: Box) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def y_axis(
    ticks: Sequence[float], place: Callable[[float], float], label: str, text: Callable[[float], str], width: int
) -> list[str]:
    """Grid lines with their numbers, and the axis label above them."""
    parts = [f'<text class="label" x="0" y="12">{html.escape(label)}</text>']
    for tick in ticks:
        y = place(tick)
        parts.append(f'<path class="grid" d="M{LEFT} {y:.1f}H{width - RIGHT}"/>')
        parts.append(f'<text class="tick" x="{LEFT - 8}" y="{y + 4:.1f}" text-anchor="end">{text(tick)}</text>')
    return parts


def tick_count(width: int) -> int:
    """The number of marks along a chart of this width."""
    return 9 if width == WIDTH else 5


def nice_ticks(low: float, high: float, count: int) -> list[float]:
    """About `count` round numbers (1, 2 or 5 times a power of ten apart) that lie in low..high."""
    if high <= low:
        return [low]
    rough = (high - low) / max(count, 1)
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= rough * 0.999)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [index * step for index in range(first, last + 1)]


def color_classes(shares: Mapping[str, float]) -> dict[str, int]:
    """The colour of each part by its rank in size, in the order given: large ones differ, the smallest are all grey."""
    ranked = sorted(shares, key=lambda name: -shares[name])
    return {name: min(ranked.index(name), COLORS - 1) for name in shares}


def share_bar(shares: Mapping[str, float], label: str) -> str:
    """One horizontal bar whose parts are as long as their share of the whole."""
    total = sum(shares.values())
    colors = color_classes(shares)
    parts, x = [], 0.0
    for name, value in shares.items():
        width = WIDTH * value / total if total else 0.0
        title = f"<title>{html.escape(name)}: {100 * value / total if total else 0:.1f} %</title>"
        parts.append(f'<rect class="c{colors[name]}" x="{x:.2f}" y="0" width="{width:.2f}" height="30">{title}</rect>')
        x += width
    return (
        f'<svg class="bar" viewBox="0 0 {WIDTH} 30" preserveAspectRatio="none" role="img" '
        f'aria-label="{html.escape(label)}">{"".join(parts)}</svg>'
    )


def thousands(value: float) -> str:
    """A whole number with commas between thousands."""
    return f"{round(value):,}"


def decibels(psnr: float) -> str:
    """A PSNR with its unit."""
    return f"{psnr:.2f} dB" if math.isfinite(psnr) else "identical"


def svg_chart(parts: Sequence[str], height: int, label: str, width: int) -> str:
    """A chart of `width` by `height` from its parts."""
    return (
        f'<svg class="chart" viewBox="0 0 {width} {height}" role="img" '
        f'aria-label="{html.escape(label)}">{"".join(parts)}</svg>'
    )
