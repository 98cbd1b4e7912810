"""The page about one encoding: pictures, quality, bits and time."""

import html
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final

from gsvc_base.files import write_text
from gsvc_base.pages.page import Figure, cards_section, document, notes_section
from gsvc_base.pages.tables import Markup, html_table
from gsvc_lab.pages.charts import color_classes, decibels, share_bar, thousands
from gsvc_lab.pages.data import FRAME_TYPES, MAX_MARKS, ReportData, condensed
from gsvc_lab.pages.frame_charts import STATES, bits_chart, choices_chart, mark_symbol, psnr_chart
from gsvc_lab.pages.gallery import pictures_section, preview_section
from gsvc_lab.pages.glossary import WORDS, glossary

MAX_ROWS: Final = 500
"""Frames in the table of all frames, so that the page of a film stays small."""

_TYPE_NAMES = {"I": "I, on its own", "P": "P, predicted from the frame before", "R": "R, repeats the frame before"}


def write_report(data: ReportData, path: str | Path) -> None:
    """Write the report as one HTML file that needs nothing else: no network, no scripts.

    An OSError says that the file cannot be written.
    """
    write_text(report_html(data), path)


def report_html(data: ReportData) -> str:
    """The whole page as text."""
    sections = [
        f"<h1>{html.escape(data.title)}</h1>",
        f"<p>{html.escape(data.introduction)}</p>" if data.introduction else "",
        f"<pre>{html.escape(data.command)}</pre>" if data.command else "",
        _alert(data.damage),
        preview_section(data),
        _cards(data),
        glossary(_words(data)),
        _quality(data),
        _bits(data),
        _layers(data),
        _peers(data),
        _time(data),
        _choices(data),
        pictures_section(data),
        _frame_table(data),
        notes_section(data.notes, data.environment),
        _hint(data),
    ]
    return document(data.title, sections)


def write_damaged(name: str, command: str, damage: Sequence[str], bits: Mapping[str, int], path: str | Path) -> None:
    """Write the page of a file of which no frame is left: what is wrong, and where its bits are."""
    used = {part: count for part, count in bits.items() if count}
    sections = [
        f"<h1>{html.escape(name)}</h1>",
        f"<pre>{html.escape(command)}</pre>" if command else "",
        _alert(damage),
        "<h2>Where the bits are</h2>",
        share_bar(used, "bits of the file by attribute"),
        _share_table(used, "bits", thousands),
    ]
    write_text(document(name, sections), path)


def _alert(damage: Sequence[str]) -> str:
    """What is wrong with the file, where nobody can overlook it."""
    lines = "".join(f"<p>{html.escape(sentence)}</p>" for sentence in damage)
    return f'<div class="alert" role="alert"><strong>This file is damaged.</strong>{lines}</div>' if lines else ""


def _words(data: ReportData) -> list[str]:
    """The words of the glossary that stand on this page."""
    attributes = {name for name, bits in data.bits_by_attribute.items() if bits}
    types = {frame.type for frame in data.frames}
    words = ["GSVC", "splat", *(f"{kind}-frame" for kind in FRAME_TYPES if kind in types), "GOP", "bits/pixel"]
    words += ["PSNR"] * bool(data.levels) + ["MS-SSIM"] * (data.ms_ssim is not None)
    words += ["VMAF"] * (data.vmaf is not None) + ["layer"] * bool(data.layers)
    words += ["steps"] * any(frame.iterations is not None for frame in data.frames)
    words += ["x264", "CRF"] * (data.peers is not None)
    effects = {"frames": "frames (effect)", "gsa": "GSA", "gsp": "GSP", "dks": "DKS"}
    words += [effects.get(choice.effect, choice.effect) for choice in data.frames[0].choices]
    words += [word for word in WORDS if "," in word and attributes & {*word.split(", ")}]
    words += [word for word in ("checksums", "ancillary", "motion") if word in attributes]
    return list(dict.fromkeys(word for word in words if word in WORDS))


def _hint(data: ReportData) -> str:
    """Command lines to go on with."""
    lines = "".join(f"<pre>{html.escape(line)}</pre>" for line in data.hint)
    return f"<h2>Look further</h2>{lines}" if lines else ""


def _layers(data: ReportData) -> str:
    """The bits and the quality of each layer."""
    if not data.layers:
        return ""
    total = 8 * data.file_bytes
    rows, before = [], 0
    for layer in data.layers:
        before += layer.bits
        least, most = layer.splats
        quality = decibels(layer.psnr) if layer.psnr is not None else "–"
        splats = f"{most:,}" if least == most else f"{least:,} to {most:,}"
        rows.append(
            (layer.name, thousands(layer.bits), f"{100 * layer.bits / total:.1f} %", thousands(before), splats, quality)
        )
    return (
        "<h2>Layers</h2>"
        '<p class="caption">Each row is what a decoder shows that takes this layer and those above it in the table.</p>'
        + html_table(
            ("", "bits", "share of the file", "bits so far", "splats of a frame", "mean PSNR"), rows, ("text",)
        )
    )


def _peers(data: ReportData) -> str:
    """What other codecs need at equal PSNR."""
    if data.peers is None:
        return ""
    table = html_table(data.peers.columns, data.peers.rows, ("text", "", "", "", "text long"))
    title, note = html.escape(data.peers.title), html.escape(data.peers_note)
    return f'<h2>{title}</h2><p class="caption">{note}</p>{table}'


def _cards(data: ReportData) -> str:
    """The key numbers."""
    count = len(data.frames)
    types = Counter(frame.type for frame in data.frames)
    psnrs = data.levels
    splats = [frame.splats for frame in data.frames]
    seconds = [frame.seconds for frame in data.frames if frame.seconds is not None]
    size, size_unit = _bytes(data.file_bytes)
    cards = [
        Figure("File", size, size_unit, f"{thousands(data.file_bytes)} bytes"),
        Figure(
            "Rate",
            f"{data.bits_per_pixel:.3f}",
            "bits/pixel",
            f"{data.bits_per_second / 1000:,.1f} kbit/s; 1 : {data.compression:,.0f} of raw R′G′B′",
        ),
    ]
    if data.mean_psnr is not None:
        span = f"{decibels(min(psnrs))} to {decibels(max(psnrs))}"
        some = f"; {len(psnrs)} of {count} frames" if len(psnrs) < count else ""
        cards.append(Figure("PSNR, mean", *_decibels(data.mean_psnr), span + some))
    if data.ms_ssim is not None:
        cards.append(Figure("MS-SSIM, mean", f"{data.ms_ssim:.4f}", "", "1 for identical frames"))
    if data.vmaf is not None:
        cards.append(Figure("VMAF, mean", f"{data.vmaf:.1f}", "", "97 to 100 for identical frames"))
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
    ]
    if seconds:
        preset = f", preset {data.preset}" if data.preset else ""
        cards.append(Figure("Encoding", f"{sum(seconds) / count:.2f}", "s/frame", f"{sum(seconds):.1f} s{preset}"))
    return cards_section([*cards, *data.figures])


def _quality(data: ReportData) -> str:
    """PSNR over time."""
    if data.mean_psnr is None:
        return ""
    used = [kind for kind in _TYPE_NAMES if any(frame.type == kind for frame in data.frames)]
    legend = "".join(f"<span>{mark_symbol(kind)}{_TYPE_NAMES[kind]}</span>" for kind in used)
    identical = (
        " Frames identical to the original stand at the upper edge."
        if any(math.isinf(level) for level in data.levels)
        else ""
    )
    return (
        "<h2>Quality of each frame</h2>"
        f'<p class="caption">Peak signal-to-noise ratio of the decoded {data.bit_depth}-bit R′G′B′ frame against the '
        f"original, all channels together. The axis does not start at zero.{identical}{_means(data)}</p>"
        f'{psnr_chart(condensed(data.frames), data.mean_psnr)}<div class="legend">{legend}</div>'
    )


def _means(data: ReportData) -> str:
    """A sentence on marks that stand for several frames; nothing where each stands for one."""
    count = -(-len(data.frames) // MAX_MARKS)
    return f" Each mark is the mean of {count} frames." if count > 1 else ""


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
        '<p class="caption">Bits of each frame’s unit in the file, stacked by what they describe.'
        f"{_means(data)}</p>"
        f'{bits_chart(condensed(data.frames), _attributes(data))}<div class="legend">{legend}</div>'
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
        f'{choices_chart(condensed(data.frames))}<div class="legend">{legend}</div>'
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
    shown = data.frames[:MAX_ROWS]
    columns: list[tuple[str, list[str]]] = [
        ("frame", [str(frame.number) for frame in shown]),
        ("type", [frame.type for frame in shown]),
        ("PSNR, dB", [_level(frame.psnr) for frame in shown]),
        ("splats", [f"{frame.splats:,}" for frame in shown]),
        ("steps", ["" if frame.iterations is None else f"{frame.iterations:,}" for frame in shown]),
        ("seconds", ["" if frame.seconds is None else f"{frame.seconds:.3f}" for frame in shown]),
        ("bits", [thousands(frame.bits) for frame in shown]),
        *((name, [thousands(frame.bits_by_attribute.get(name, 0)) for frame in shown]) for name in attributes),
        ("reason", [frame.reason for frame in shown]),
    ]
    known = [(name, cells) for name, cells in columns if any(cells)]
    header = [name for name, _ in known]
    table = html_table(
        header,
        list(zip(*(cells for _, cells in known), strict=True)),
        ["text long" if name == "reason" else "" for name in header],
        key_rows=[index for index, frame in enumerate(shown) if frame.type == "I"],
    )
    first = f"the first {len(shown)} of " if len(shown) < len(data.frames) else ""
    rest = " gsvc info --json FILE has all frames." if first else ""
    return (
        "<h2>Every frame in numbers</h2>"
        f"<details><summary>Table of {first}{len(data.frames)} frames</summary>"
        f'<p class="caption">The columns after “bits” are its parts.{rest}</p>{table}</details>'
    )


def _level(psnr: float | None) -> str:
    """A PSNR in a column of them."""
    return "" if psnr is None else f"{psnr:.2f}" if math.isfinite(psnr) else "identical"


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
