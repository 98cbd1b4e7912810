"""The page about one encoding: pictures, quality, bits and time."""

import html
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from gsvc_lab.pages.charts import color_classes, decibels, share_bar, thousands
from gsvc_lab.pages.data import FRAME_TYPES, Figure, FrameRecord, ReportData
from gsvc_lab.pages.frame_charts import STATES, bits_chart, choices_chart, mark_symbol, psnr_chart
from gsvc_lab.pages.gallery import pictures_section, preview_section
from gsvc_lab.pages.page import cards_section, document, notes_section
from gsvc_lab.pages.tables import Markup, html_table
from gsvc_ref.files import write_text

_TYPE_NAMES = {"I": "I, on its own", "P": "P, predicted from the frame before", "R": "R, repeats the frame before"}


def write_report(data: ReportData, path: str | Path) -> None:
    """Write the report as one HTML file that needs nothing else: no network, no scripts.

    Raises
    ------
    OSError
        The file cannot be written.
    """
    write_text(report_html(data), path)


def report_html(data: ReportData) -> str:
    """The whole page as text."""
    sections = [
        f"<h1>{html.escape(data.title)}</h1>",
        f"<p>{html.escape(data.introduction)}</p>" if data.introduction else "",
        f"<pre>{html.escape(data.command)}</pre>" if data.command else "",
        preview_section(data),
        _cards(data),
        _quality(data),
        _bits(data),
        _time(data),
        _choices(data),
        pictures_section(data),
        _frame_table(data),
        notes_section(data.notes, data.environment),
    ]
    return document(data.title, sections)


def _cards(data: ReportData) -> str:
    """The key numbers."""
    count = len(data.frames)
    types = Counter(frame.type for frame in data.frames)
    psnrs = [frame.psnr for frame in data.frames]
    splats = [frame.splats for frame in data.frames]
    seconds = sum(frame.seconds for frame in data.frames)
    size, size_unit = _bytes(data.file_bytes)
    mean, mean_unit = _decibels(data.mean_psnr)
    cards = [
        Figure("File", size, size_unit, f"{thousands(data.file_bytes)} bytes"),
        Figure(
            "Rate",
            f"{data.bits_per_pixel:.3f}",
            "bits/pixel",
            f"{data.bits_per_second / 1000:,.1f} kbit/s; 1 : {data.compression:,.0f} of raw R′G′B′",
        ),
        Figure("PSNR, mean", mean, mean_unit, f"{decibels(min(psnrs))} to {decibels(max(psnrs))}"),
    ]
    if data.ms_ssim is not None:
        cards.append(Figure("MS-SSIM, mean", f"{data.ms_ssim:.4f}", "", "identical frames: 1"))
    if data.vmaf is not None:
        cards.append(Figure("VMAF, mean", f"{data.vmaf:.1f}", "", "identical frames: 97 to 100"))
    cards += [
        Figure("Video", f"{data.width} × {data.height}", "", f"{data.bit_depth} bits, {_rate(data)} frames/s"),
        Figure(
            "Frames",
            str(count),
            "",
            f"{', '.join(f'{types[kind]} {kind}' for kind in FRAME_TYPES if types[kind])}; "
            f"{float(count / data.frame_rate):.2f} s",
        ),
        Figure("Splats per frame", thousands(sum(splats) / count), "", f"{min(splats):,} to {max(splats):,}"),
        Figure("Encoding", f"{seconds / count:.2f}", "s/frame", f"{seconds:.1f} s, preset {data.preset}"),
        *data.figures,
    ]
    return cards_section(cards)


def _quality(data: ReportData) -> str:
    """PSNR over time."""
    used = [kind for kind in _TYPE_NAMES if any(frame.type == kind for frame in data.frames)]
    legend = "".join(f"<span>{mark_symbol(kind)}{_TYPE_NAMES[kind]}</span>" for kind in used)
    identical = (
        " Frames identical to the original stand at the upper edge."
        if any(math.isinf(frame.psnr) for frame in data.frames)
        else ""
    )
    return (
        "<h2>Quality of each frame</h2>"
        f'<p class="caption">Peak signal-to-noise ratio of the decoded {data.bit_depth}-bit R′G′B′ frame against the '
        f"original, all channels together. The axis does not start at zero.{identical}</p>"
        f'{psnr_chart(data.frames, data.mean_psnr)}<div class="legend">{legend}</div>'
    )


def _attributes(data: ReportData) -> dict[str, int]:
    """Every attribute that a frame has bits of, in the order of the totals, with its colour."""
    used = {name for frame in data.frames for name, bits in frame.bits_by_attribute.items() if bits}
    return {name: color for name, color in color_classes(data.bits_by_attribute).items() if name in used}


def _bits(data: ReportData) -> str:
    """Bits over time and in total, by attribute."""
    legend = "".join(
        f'<span><span class="swatch c{color}"></span>{html.escape(name)}</span>'
        for name, color in _attributes(data).items()
    )
    return (
        "<h2>Where the bits went</h2>"
        '<p class="caption">Bits of each frame’s unit in the file, stacked by what they describe.</p>'
        f'{bits_chart(data.frames, _attributes(data))}<div class="legend">{legend}</div>'
        "<h3>The whole file</h3>"
        f'<p class="caption">Every bit of the {thousands(data.file_bytes)} bytes, headers and checksums included.</p>'
        + share_bar(data.bits_by_attribute, "bits of the file by attribute")
        + _share_table(data.bits_by_attribute, "bits", thousands)
    )


def _time(data: ReportData) -> str:
    """Seconds by stage."""
    if not data.stages:
        return ""
    return (
        "<h2>Where the time went</h2>"
        '<p class="caption">Wall time, stage by stage.</p>'
        + share_bar(data.stages, "seconds by stage")
        + _share_table(data.stages, "seconds", lambda seconds: f"{seconds:.2f}")
    )


def _choices(data: ReportData) -> str:
    """The steps that the encoder took and left out, frame by frame."""
    if not data.frames[0].choices:
        return ""
    used = {choice.state for frame in data.frames for choice in frame.choices}
    legend = "".join(
        f'<span><span class="swatch {color}"></span>{meaning}</span>'
        for state, (color, meaning) in STATES.items()
        if state in used
    )
    return (
        "<h2>What the scene called for</h2>"
        f'<p class="caption">Each step of the encoder, frame by frame; point at a cell for its reason. '
        f"{html.escape(data.savings)}</p>"
        f'{choices_chart(data.frames)}<div class="legend">{legend}</div>'
    )


def _share_table(shares: Mapping[str, float], unit: str, text: Callable[[float], str]) -> str:
    """Name, amount and share of each part, and the total."""
    total = sum(shares.values())
    colors = color_classes(shares)
    rows = [
        (
            Markup(f'<span class="swatch c{colors[name]}"></span>{html.escape(name)}'),
            text(value),
            f"{100 * value / total if total else 0:.1f} %",
        )
        for name, value in shares.items()
    ]
    return html_table(("", unit, "share"), rows, ("text",), foot=("total", text(total), ""))


def _frame_table(data: ReportData) -> str:
    """Every number of every frame."""
    attributes = list(_attributes(data))
    header = ["frame", "type", "PSNR, dB", "splats", "steps", "seconds", "bits", *attributes, "reason"]
    table = html_table(
        header,
        [_frame_row(frame, attributes) for frame in data.frames],
        [*[""] * (len(header) - 1), "text long"],
        key_rows=[index for index, frame in enumerate(data.frames) if frame.type == "I"],
    )
    return (
        "<h2>Every frame in numbers</h2>"
        f"<details><summary>Table of {len(data.frames)} frames</summary>"
        f'<p class="caption">The columns after “bits” are its parts.</p>{table}</details>'
    )


def _frame_row(frame: FrameRecord, attributes: Sequence[str]) -> list[str]:
    psnr = f"{frame.psnr:.2f}" if math.isfinite(frame.psnr) else "identical"
    cells = [str(frame.number), frame.type, psnr, f"{frame.splats:,}", f"{frame.iterations:,}", f"{frame.seconds:.3f}"]
    cells += [thousands(frame.bits), *(thousands(frame.bits_by_attribute.get(name, 0)) for name in attributes)]
    return [*cells, frame.reason]


def _rate(data: ReportData) -> str:
    """Frames per second, exact where two decimals suffice."""
    return f"{float(data.frame_rate):.5g}"


def _decibels(psnr: float) -> tuple[str, str]:
    """A PSNR and its unit."""
    return (f"{psnr:.2f}", "dB") if math.isfinite(psnr) else ("∞", "dB")


def _bytes(count: int) -> tuple[str, str]:
    """A size and the largest decimal unit that fits."""
    for unit, size in (("MB", 1_000_000), ("kB", 1000)):
        if count >= size:
            return f"{count / size:.1f}", unit
    return str(count), "B"
