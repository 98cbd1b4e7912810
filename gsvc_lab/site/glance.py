"""The syntax as pictures: boxes of what stands in what, drawn from the tables of spec.md."""

import html
import re
from collections.abc import Mapping
from typing import Final

from gsvc_lab.site.syntax import Group, Item, Table

CAPTIONS: Final = {
    "stream": "A prefix of ten bytes, and chunks. The end chunk is what tells a whole stream from a cut one.",
    "chunk": "Each chunk names its type and its length and has a checksum, so one can hop from chunk to chunk.",
    "sequence_header": "The payload of the first chunk: the size, the level, and how codes are stored.",
    "frame": "The payload of a frame of profile paper. An I-frame has all splats, a P-frame what changed.",
    "splat_block": "The codes of several splats, one plane after the other. An inter block has differences.",
    "plane": "One kind of code of all splats of a block: one symbol for all, raw bits, or entropy coding.",
    "index": "Where I-frames begin, for those who seek.",
    "end": "The last chunk: 14 bytes, so a decoder finds it from the end of the file.",
    "main_header": "What the sequence header of profile main ends with.",
    "main_frame": "The payload of a frame of profile main.",
    "frame_body": "The step of all codes, the shape of their distributions, and one run of the entropy coder.",
    "densities": "Six distribution functions, and how evenly splats are spread at each halving of the frame.",
    "layer": "The payload of a chunk n: splats that are added to the frame before it and raise its quality.",
}


def dependencies() -> str:
    """The picture of frames that are predicted from each other."""
    frames = (
        ("I", "0", ("a", "b", "c", "d"), ""),
        ("P", "1", ("a′", "b′", "d′"), "map 1 1 0 1 · Δa Δb Δd"),
        ("R", "2", ("a′", "b′", "d′"), "nothing"),
        ("P", "3", ("a″", "b″", "d″", "e"), "map 1 1 1 · Δa Δb Δd · new e"),
        ("I", "4", ("f", "g", "h"), ""),
    )
    parts = []
    for place, (kind, number, splats, brings) in enumerate(frames):
        left = 12 + 176 * place
        parts.append(f'<g class="frame {kind}"><rect x="{left}" y="44" width="116" height="96" rx="10"/>')
        parts.append(
            f'<text class="kind" x="{left + 12}" y="34">{kind}</text><text x="{left + 32}" y="34">frame {number}</text>'
        )
        for at, splat in enumerate(splats):
            x, y = left + 32 + 52 * (at % 2), 70 + 44 * (at // 2)
            color = "abcdefgh".index(splat[0]) % 8
            parts.append(
                f'<ellipse class="c{color}" cx="{x}" cy="{y}" rx="22" ry="14" transform="rotate(-24 {x} {y})"/>'
            )
            parts.append(f'<text class="splat" x="{x}" y="{y + 5}">{splat}</text>')
        parts.append("</g>")
        if kind != "I":
            parts.append(
                f'<path class="arrow" d="M{left - 56} 92H{left - 10}"/>'
                f'<path class="tip" d="M{left - 3} 92l-10 -5v10z"/>'
            )
        elif place:
            parts.append(
                f'<path class="cut" d="M{left - 30} 44V140"/>'
                f'<text class="middle" x="{left - 30}" y="164">forgets all</text>'
            )
        words = brings.split(" · ") if brings else (["all splats"] if not place else [])
        parts += [
            f'<text class="middle" x="{left + 58}" y="{164 + 18 * at}">{word}</text>' for at, word in enumerate(words)
        ]
    label = (
        "Five frames: I has four splats; P changes three and drops one; R repeats; P changes three and adds one; "
        "I begins anew."
    )
    svg = f'<svg class="frames" viewBox="0 0 856 206" role="img" aria-label="{label}">{"".join(parts)}</svg>'
    return f'<div class="scroll" tabindex="0">{svg}</div>'


def figure(table: Table, elements: Mapping[str, str], tables: Mapping[str, Table]) -> str:
    """One table as boxes.

    `table`: the table. `elements`: from the name of an element to its URL. `tables`: all tables, for links from one
    picture to the other.
    """
    arguments = f"({html.escape(table.arguments)})"
    caption = CAPTIONS.get(table.name, "")
    return (
        f'<section class="layout"><h3 id="layout-{table.name}"><code>{table.name}{arguments}</code></h3>\n'
        f"<p>{caption}</p>\n{_boxes(table.group, elements, tables, offsets=True)}</section>\n"
    )


def _boxes(group: Group, elements: Mapping[str, str], tables: Mapping[str, Table], *, offsets: bool = False) -> str:
    """What stands in a group, in order; with the offset of each element as long as all before have a fixed size."""
    parts, at = [], 0 if offsets else None
    for one in group.content:
        if isinstance(one, Group):
            condition = _inline(one.condition, {}, {})
            parts.append(
                f'<div class="group"><span class="condition">{condition}</span>{_boxes(one, elements, tables)}</div>'
            )
            at = None
            continue
        parts.append(_box(one, at, elements, tables))
        at = at + one.bits if at is not None and one.bits is not None else None
    return f'<div class="boxes">{"".join(parts)}</div>'


def _box(item: Item, at: int | None, elements: Mapping[str, str], tables: Mapping[str, Table]) -> str:
    bits = item.bits
    kind = "open" if bits is None else "bits" if bits % 8 else "bytes"
    size = 5.0 if bits is None else bits / 8 if bits % 8 == 0 else bits / 2
    corner = (
        "" if at is None else f'<span class="at">{at // 8 if at % 8 == 0 and kind != "bits" else f"bit {at}"}</span>'
    )
    descriptor = _inline(item.descriptor, {}, tables)
    if not descriptor and (called := re.match(r"(\w+)\(", item.label)) and called[1] not in tables:
        descriptor = "to the next byte" if called[1] == "align" else ""
    label = _inline(item.label.partition(" = ")[0], elements, tables)
    return f'<div class="box {kind}" style="--size: {size:g}">{corner}<b>{label}</b><small>{descriptor}</small></div>'


def _inline(text: str, elements: Mapping[str, str], tables: Mapping[str, Table]) -> str:
    """Markdown of a cell: names in code, links to elements and tables, places where a long name may break."""

    def code(found: re.Match[str]) -> str:
        name = found[1].replace("_", "_<wbr>")
        return f'<a href="{elements[found[1]]}">{name}</a>' if found[1] in elements else name

    def call(found: re.Match[str]) -> str:
        return (
            f'<a href="#layout-{found[1]}">{found[1].replace("_", "_<wbr>")}</a>(' if found[1] in tables else found[0]
        )

    return re.sub(r"\b(\w+)\((?!n\b)", call, re.sub(r"`([^`]*)`", code, html.escape(text, quote=False)))
