"""The charts of a report about one encoding, over its frames."""

import html
import math
from collections.abc import Mapping, Sequence
from typing import Final

from gsvc_lab.pages.charts import (
    BOTTOM,
    LEFT,
    RIGHT,
    TOP,
    decibels,
    for_both,
    nice_ticks,
    svg_chart,
    thousands,
    tick_count,
    y_axis,
)
from gsvc_lab.pages.data import FrameRecord

_MIN_LABEL_GAP: Final = 14
_MIN_MARK_GAP: Final = 5


class _Band:
    """The frames side by side, each in a band of equal width."""

    def __init__(self, frames: Sequence[FrameRecord], width: int) -> None:
        self.frames, self.width, self.right = frames, width, width - RIGHT
        self.step = (self.right - LEFT) / len(frames)

    def middle(self, index: int) -> float:
        """Middle of a frame's band."""
        return LEFT + self.step * (index + 0.5)

    def axis(self, height: int) -> list[str]:
        """Frame numbers below the plot, and a dashed line at every I-frame."""
        bottom = height - BOTTOM
        parts = [f'<path class="axis" d="M{LEFT} {bottom}H{self.right}"/>']
        index_of = {
            number: index for index, frame in enumerate(self.frames) for number in range(frame.number, frame.last + 1)
        }
        for tick in nice_ticks(self.frames[0].number, self.frames[-1].last, tick_count(self.width) + 3):
            if (index := index_of.get(round(tick))) is not None and abs(tick - round(tick)) < 1e-6:
                x = self.middle(index)
                parts.append(
                    f'<text class="tick" x="{x:.1f}" y="{bottom + 16}" text-anchor="middle">{round(tick)}</text>'
                )
        parts.append(f'<text class="label" x="{self.right}" y="{height - 4}" text-anchor="end">frame number</text>')
        last_label = -math.inf
        for index, frame in enumerate(self.frames):
            if frame.type == "I":
                x = self.middle(index)
                parts.append(f'<path class="key" d="M{x:.1f} {TOP - 6}V{bottom}"/>')
                if x - last_label >= _MIN_LABEL_GAP:
                    parts.append(f'<text class="keytext" x="{x:.1f}" y="{TOP - 10}" text-anchor="middle">I</text>')
                    last_label = x
        return parts


def psnr_chart(frames: Sequence[FrameRecord], mean: float) -> str:
    """PSNR in dB over the frame number: a line with a mark per frame (I, P, R), and the mean.

    Frames without a PSNR are left out; at least one has it.
    """
    known = [frame for frame in frames if frame.psnr is not None]
    return for_both(lambda width: _psnr_chart(known, mean, width))


def _psnr_chart(frames: Sequence[FrameRecord], mean: float, width: int) -> str:
    levels = [math.inf if frame.psnr is None else frame.psnr for frame in frames]
    finite = [level for level in levels if math.isfinite(level)] or [40.0]
    low, high = math.floor(min(finite) - 0.5), math.ceil(max(finite) + 0.5)
    height = 240
    plot_height = height - TOP - BOTTOM
    band = _Band(frames, width)

    def y_of(psnr: float) -> float:
        return TOP + plot_height * (1 - (min(psnr, high) - low) / (high - low))

    parts = y_axis(nice_ticks(low, high, 5), y_of, "PSNR, dB", lambda value: f"{value:g}", width)
    parts += band.axis(height)
    if math.isfinite(mean):
        parts.append(f'<path class="mean" d="M{LEFT} {y_of(mean):.1f}H{band.right}"/>')
        parts.append(f'<text class="meantext" x="{band.right}" y="{y_of(mean) - 5:.1f}">mean {mean:.2f} dB</text>')
    points = " ".join(f"{band.middle(index):.1f},{y_of(level):.1f}" for index, level in enumerate(levels))
    parts.append(f'<polyline class="line" points="{points}"/>')
    crowded = band.step < _MIN_MARK_GAP
    for index, (frame, level) in enumerate(zip(frames, levels, strict=True)):
        if not crowded or frame.type != "P":
            parts.append(f"<g>{_title(frame)}{_shape(frame.type, band.middle(index), y_of(level))}</g>")
    return svg_chart(parts, height, "PSNR of each frame in dB", width)


def bits_chart(frames: Sequence[FrameRecord], colors: Mapping[str, int]) -> str:
    """Bits of each frame over the frame number: stacked bars from zero, a layer per attribute that has a colour."""
    return for_both(lambda width: _bits_chart(frames, colors, width))


def _bits_chart(frames: Sequence[FrameRecord], colors: Mapping[str, int], width: int) -> str:
    high = max(max(frame.bits for frame in frames), 1) * 1.05
    height = 260
    plot_height = height - TOP - BOTTOM
    band = _Band(frames, width)

    def y_of(bits: float) -> float:
        return TOP + plot_height * (1 - bits / high)

    parts = y_axis(nice_ticks(0, high, 5), y_of, "bits", thousands, width)
    parts += band.axis(height)
    bar = band.step if band.step < 3 else min(band.step * 0.78, 40)
    for index, frame in enumerate(frames):
        x = band.middle(index) - bar / 2
        layers = []
        stacked = 0.0
        for attribute, color in colors.items():
            bits = frame.bits_by_attribute.get(attribute, 0)
            if bits:
                top, bottom = y_of(stacked + bits), y_of(stacked)
                layers.append(
                    f'<rect class="c{color}" x="{x:.2f}" y="{top:.2f}" width="{bar:.2f}" height="{bottom - top:.2f}"/>'
                )
                stacked += bits
        parts.append(f"<g>{_title(frame)}{''.join(layers)}</g>")
    return svg_chart(parts, height, "bits of each frame, stacked by attribute", width)


STATES: Final = {
    "done": ("c0", "done"),
    "skipped": ("c5", "left out, at least in part"),
    "off": ("c9", "switched off"),
}
"""The class and the meaning of the colour of what was decided."""


def choices_chart(frames: Sequence[FrameRecord]) -> str:
    """The decisions: a row for each effect, a column for each frame, the reason under the pointer."""
    return for_both(lambda width: _choices_chart(frames, width))


def _choices_chart(frames: Sequence[FrameRecord], width: int) -> str:
    effects = [choice.effect for choice in frames[0].choices]
    row = 20
    height = TOP + row * len(effects) + BOTTOM
    band = _Band(frames, width)
    parts = band.axis(height)
    for number, effect in enumerate(effects):
        y = TOP + row * number
        parts.append(f'<text class="label" x="0" y="{y + 14}">{html.escape(effect)}</text>')
        for index, frame in enumerate(frames):
            choice = frame.choices[number]
            title = html.escape(f"{_name(frame)}, {effect}: {choice.reason}")
            parts.append(
                f'<rect class="{STATES[choice.state][0]}" x="{LEFT + band.step * index:.2f}" y="{y}" '
                f'width="{max(band.step - 1, band.step * 0.8):.2f}" height="{row - 3}"><title>{title}</title></rect>'
            )
    return svg_chart(parts, height, "what was decided about each effect of each frame", width)


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


def _name(frame: FrameRecord) -> str:
    """A frame, or the frames that a record is the mean of."""
    return f"frame {frame.number}" if frame.last == frame.number else f"frames {frame.number} to {frame.last}"


def _title(frame: FrameRecord) -> str:
    """The text under the pointer over a frame."""
    quality = f"{decibels(frame.psnr)}, " if frame.psnr is not None else ""
    mean = " on average" if frame.last != frame.number else ""
    return f"<title>{_name(frame)}, {frame.type}: {quality}{thousands(frame.bits)} bits{mean}</title>"
