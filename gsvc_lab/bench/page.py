"""The page of ``gsvc bench``: curves, BD-rates and seconds of several coders on one clip."""

import html
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from gsvc_base.cli.text import plural
from gsvc_base.files import write_text
from gsvc_base.pages.page import document, notes_section
from gsvc_base.pages.tables import html_table
from gsvc_lab import machine
from gsvc_lab.bench import ffmpeg
from gsvc_lab.bench.codecs import Codec
from gsvc_lab.bench.compare import WORDS, Comparison, compared
from gsvc_lab.bench.measure import METRICS, Curve
from gsvc_lab.bench.measure import Point as Coded
from gsvc_lab.bench.runner import Entry, Measured
from gsvc_lab.bench.tables import cell, common, reported
from gsvc_lab.pages.charts import Axis, Point, Series, plot
from gsvc_lab.pages.glossary import glossary

CHARTS: Final = ("psnr", "ms_ssim", "vmaf")
"""The metrics that have a chart."""

TERMS: Final = ("GSVC", "splat", "N", "bits/pixel", "PSNR", "MS-SSIM", "VMAF", "BD-rate", "x264", "CRF", "QP")


def write_page(measured: Measured, entries: Sequence[Entry], command: str, path: str | Path) -> None:
    """Write the page as one HTML file that needs nothing else."""
    write_text(bench_html(measured, entries, command), path)


def bench_html(measured: Measured, entries: Sequence[Entry], command: str) -> str:
    """The whole page as text."""
    clip, video = measured.clip, measured.clip.format
    title = f"{clip.title} against other codecs"
    seconds = clip.frame_count / float(video.frame_rate)
    introduction = (
        f"{clip.title}: {plural(clip.frame_count, 'frame')} of {video.width} × {video.height} pixels, {seconds:.2f} s; "
        f"{clip.note}. Every coder got the same 8-bit 4:2:0 planes, GSVC as the R′G′B′ that they stand for, and every "
        "size is that of a real file: of codecs the bare stream without what pictures do not need, of GSVC the whole "
        "file without its log."
    )
    colors = {entry.label: number for number, entry in enumerate(entries)}
    curves = measured.curves
    sections = [
        f"<h1>{html.escape(title)}</h1>",
        f"<p>{html.escape(introduction)}</p>",
        f"<pre>{html.escape(command)}</pre>",
        _interrupted(measured),
        glossary(TERMS),
        _rates(curves, entries),
        *(_quality(curves, metric, colors) for metric in CHARTS),
        _seconds(curves, colors),
        _points(curves, measured),
        notes_section(_notes(measured, entries), machine.named()),
    ]
    return document(title, sections)


def _interrupted(measured: Measured) -> str:
    if not measured.interrupted:
        return ""
    how = f"{measured.count} of {measured.planned} points were measured"
    return f'<div class="alert" role="alert"><strong>Interrupted:</strong> {how}.</div>'


def rates(curves: Sequence[Curve], entries: Sequence[Entry]) -> list[Comparison]:
    """The BD-rates of the first coder against each other one."""
    return compared(curves, entries[0].label)


def _rates(curves: Sequence[Curve], entries: Sequence[Entry]) -> str:
    rows = [
        (one.anchor, *(cell(one.rates[metric]) for metric in METRICS), common(one.rates["psnr"]))
        for one in rates(curves, entries)
    ]
    if not rows:
        return ""
    return (
        f"<h2>BD-rates of {html.escape(entries[0].label)}</h2>"
        '<p class="caption">Bits that it takes more (+) or fewer (−) than each other coder at equal quality, on '
        "average over the qualities that both reach. An asterisk marks a mean over less than half of its own range; "
        "“no overlap” means that no quality is reached by both, and nothing is extrapolated.</p>"
        + html_table(("against", *(WORDS[metric] for metric in METRICS), "common PSNR, dB"), rows, ("text",))
    )


def _series(
    curves: Sequence[Curve], colors: dict[str, int], x: Callable[[Coded], float], y: Callable[[Coded], float]
) -> list[Series]:
    """A series for each coder that has points."""
    series = []
    for curve in curves:
        points = tuple(
            Point(
                x(one), y(one),
                title=f"{curve.coder}, {one.setting}: {one.bits_per_pixel:.3f} bits/pixel, {one.psnr:.2f} dB",
            )
            for one in curve.points
            if math.isfinite(y(one))
        )  # fmt: skip
        if points:
            series.append(Series(curve.coder, points, colors[curve.coder]))
    return series


def _quality(curves: Sequence[Curve], metric: str, colors: dict[str, int]) -> str:
    """Quality over rate."""
    series = _series(curves, colors, lambda one: one.bits_per_pixel, lambda one: one.quality(metric))
    heading = f"<h2>{WORDS[metric]} over the rate</h2>"
    if not series:
        return f'{heading}<p class="caption">It could not be measured here.</p>'
    x, y = Axis("bits/pixel", _number, log=True), Axis(METRICS[metric], _number)
    text = "Left is smaller, higher is better; the axis of the rate is logarithmic."
    return f'{heading}<p class="caption">{text}</p>{plot(series, x, y, f"{WORDS[metric]} over bits per pixel")}'


def _seconds(curves: Sequence[Curve], colors: dict[str, int]) -> str:
    """PSNR over seconds."""
    series = _series(curves, colors, lambda one: one.encoding_seconds, lambda one: one.psnr)
    if not series:
        return ""
    x, y = Axis("encoding, s/frame", _number, log=True), Axis(METRICS["psnr"], _number)
    text = (
        "Wall time of an encode over its frames. That of codecs is the whole program from its start, that of GSVC is "
        "in a process that has started; kernels were compiled before."
    )
    return f'<h2>What it takes to encode</h2><p class="caption">{text}</p>{plot(series, x, y, "PSNR over seconds")}'


def _number(value: float) -> str:
    return f"{value:g}"


def _points(curves: Sequence[Curve], measured: Measured) -> str:
    """Every point in numbers."""
    rate = measured.clip.format.frame_rate
    rows = []
    for curve in curves:
        if curve.missing is not None:
            rows.append((curve.coder, f"not run: {curve.missing}", *[""] * 7))
        for one in curve.points:
            kilobits = float(8 * one.bytes * rate / measured.clip.frame_count / 1000)
            vmaf = "–" if one.vmaf is None else f"{one.vmaf:.1f}"
            rows.append(
                (
                    curve.coder, one.setting, f"{one.bits_per_pixel:.3f}", f"{kilobits:,.1f}", f"{one.psnr:.2f}",
                    f"{one.ms_ssim:.4f}", vmaf, f"{one.encoding_seconds:.4f}", f"{one.decoding_seconds:.4f}",
                )
            )  # fmt: skip
    columns = (
        "coder", "set by", "bits/pixel", "kbit/s", "PSNR, dB", "MS-SSIM", "VMAF", "encoding, s/frame",
        "decoding, s/frame",
    )  # fmt: skip
    return f"<h2>Every point in numbers</h2>{html_table(columns, rows, ('text', 'text'))}"


def _notes(measured: Measured, entries: Sequence[Entry]) -> list[str]:
    """How it was measured, and what the coders reported."""
    notes = reported(measured.curves)
    if any(isinstance(entry.coder, Codec) for entry in entries):
        program, start = ffmpeg.description()
        notes.append(f"{program}; it takes {start:.3f} s to start, which stands in its seconds")
    notes.append(
        "presets, options and what is counted are those of python -m gsvc_lab.experiments rate_distortion, which "
        "docs/experiments.md explains"
    )
    return notes
