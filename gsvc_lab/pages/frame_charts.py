"""The charts of a report about one encoding, over its frames."""

import html
import math
from collections.abc import Mapping, Sequence
from typing import Final

from gsvc_lab.pages.charts import BOTTOM, LEFT, RIGHT, TOP, WIDTH, decibels, nice_ticks, svg_chart, thousands, y_axis
from gsvc_lab.pages.data import FrameRecord

_PLOT_WIDTH: Final = WIDTH - LEFT - RIGHT
_MIN_LABEL_GAP: Final = 14
_MIN_MARK_GAP: Final = 5


def psnr_chart(frames: Sequence[FrameRecord], mean: float) -> str:
    """PSNR in dB over the frame number: a line with a mark per frame (I, P, R), and the mean."""
    finite = [frame.psnr for frame in frames if math.isfinite(frame.psnr)] or [40.0]
    low, high = math.floor(min(finite) - 0.5), math.ceil(max(finite) + 0.5)
    height = 240
    plot_height = height - TOP - BOTTOM

    def y_of(psnr: float) -> float:
        return TOP + plot_height * (1 - (min(psnr, high) - low) / (high - low))

    parts = y_axis(nice_ticks(low, high, 5), y_of, "PSNR, dB", lambda value: f"{value:g}")
    parts += _frame_axis(frames, height)
    if math.isfinite(mean):
        parts.append(f'<path class="mean" d="M{LEFT} {y_of(mean):.1f}H{WIDTH - RIGHT}"/>')
        parts.append(f'<text class="meantext" x="{WIDTH - RIGHT}" y="{y_of(mean) - 5:.1f}">mean {mean:.2f} dB</text>')
    points = " ".join(f"{_x(index, frames):.1f},{y_of(frame.psnr):.1f}" for index, frame in enumerate(frames))
    parts.append(f'<polyline class="line" points="{points}"/>')
    crowded = _PLOT_WIDTH / len(frames) < _MIN_MARK_GAP
    for index, frame in enumerate(frames):
        if not crowded or frame.type != "P":
            parts.append(_mark(frame, _x(index, frames), y_of(frame.psnr)))
    return svg_chart(parts, height, "PSNR of each frame in dB")


def bits_chart(frames: Sequence[FrameRecord], colors: Mapping[str, int]) -> str:
    """Bits of each frame over the frame number: stacked bars from zero, a layer per attribute that has a colour."""
    high = max(max(frame.bits for frame in frames), 1) * 1.05
    height = 260
    plot_height = height - TOP - BOTTOM

    def y_of(bits: float) -> float:
        return TOP + plot_height * (1 - bits / high)

    parts = y_axis(nice_ticks(0, high, 5), y_of, "bits", thousands)
    parts += _frame_axis(frames, height)
    step = _PLOT_WIDTH / len(frames)
    bar = step if step < 3 else min(step * 0.78, 40)
    for index, frame in enumerate(frames):
        x = _x(index, frames) - bar / 2
        layers = []
        stacked = 0
        for attribute, color in colors.items():
            bits = frame.bits_by_attribute.get(attribute, 0)
            if bits:
                top, bottom = y_of(stacked + bits), y_of(stacked)
                layers.append(
                    f'<rect class="c{color}" x="{x:.2f}" y="{top:.2f}" width="{bar:.2f}" height="{bottom - top:.2f}"/>'
                )
                stacked += bits
        parts.append(f"<g>{_title(frame)}{''.join(layers)}</g>")
    return svg_chart(parts, height, "bits of each frame, stacked by attribute")


STATES: Final = {
    "done": ("c0", "done"),
    "skipped": ("c5", "left out, at least in part"),
    "off": ("c9", "switched off"),
}
"""The class and the meaning of the colour of what was decided."""


def choices_chart(frames: Sequence[FrameRecord]) -> str:
    """The decisions: a row for each effect, a column for each frame, the reason under the pointer."""
    effects = [choice.effect for choice in frames[0].choices]
    row = 20
    height = TOP + row * len(effects) + BOTTOM
    parts = _frame_axis(frames, height)
    step = _PLOT_WIDTH / len(frames)
    for number, effect in enumerate(effects):
        y = TOP + row * number
        parts.append(f'<text class="label" x="0" y="{y + 14}">{html.escape(effect)}</text>')
        for index, frame in enumerate(frames):
            choice = frame.choices[number]
            title = html.escape(f"frame {frame.number}, {effect}: {choice.reason}")
            parts.append(
                f'<rect class="{STATES[choice.state][0]}" x="{LEFT + step * index:.2f}" y="{y}" '
                f'width="{max(step - 1, step * 0.8):.2f}" height="{row - 3}"><title>{title}</title></rect>'
            )
    return svg_chart(parts, height, "what was decided about each effect of each frame")


def mark_symbol(frame_type: str) -> str:
    """The mark of a frame type for the legend of :func:`psnr_chart`."""
    return f'<svg class="symbol" viewBox="0 0 14 14" aria-hidden="true">{_shape(frame_type, 7, 7)}</svg>'


def _shape(frame_type: str, x: float, y: float) -> str:
    """Diamond, dot or hollow square."""
    if frame_type == "I":
        return f'<path class="mark-i" d="M{x:.1f} {y - 6:.1f}l6 6l-6 6l-6 -6z"/>'
    if frame_type == "P":
        return f'<circle class="mark-p" cx="{x:.1f}" cy="{y:.1f}" r="3"/>'
    return f'<rect class="mark-r" x="{x - 3.5:.1f}" y="{y - 3.5:.1f}" width="7" height="7"/>'


def _mark(frame: FrameRecord, x: float, y: float) -> str:
    return f"<g>{_title(frame)}{_shape(frame.type, x, y)}</g>"


def _title(frame: FrameRecord) -> str:
    """The text under the pointer over a frame."""
    return f"<title>frame {frame.number}, {frame.type}: {decibels(frame.psnr)}, {thousands(frame.bits)} bits</title>"


def _x(index: int, frames: Sequence[FrameRecord]) -> float:
    """Middle of a frame's band."""
    return LEFT + _PLOT_WIDTH * (index + 0.5) / len(frames)


def _frame_axis(frames: Sequence[FrameRecord], height: int) -> list[str]:
    """Frame numbers below the plot, and a dashed line at every I-frame."""
    bottom = height - BOTTOM
    parts = [f'<path class="axis" d="M{LEFT} {bottom}H{WIDTH - RIGHT}"/>']
    index_of = {frame.number: index for index, frame in enumerate(frames)}
    for tick in nice_ticks(frames[0].number, frames[-1].number, 12):
        if (index := index_of.get(round(tick))) is not None and abs(tick - round(tick)) < 1e-6:
            x = _x(index, frames)
            parts.append(f'<text class="tick" x="{x:.1f}" y="{bottom + 16}" text-anchor="middle">{round(tick)}</text>')
    parts.append(f'<text class="label" x="{WIDTH - RIGHT}" y="{height - 4}" text-anchor="end">frame number</text>')
    last_label = -math.inf
    for index, frame in enumerate(frames):
        if frame.type == "I":
            x = _x(index, frames)
            parts.append(f'<path class="key" d="M{x:.1f} {TOP - 6}V{bottom}"/>')
            if x - last_label >= _MIN_LABEL_GAP:
                parts.append(f'<text class="keytext" x="{x:.1f}" y="{TOP - 10}" text-anchor="middle">I</text>')
                last_label = x
    return parts
