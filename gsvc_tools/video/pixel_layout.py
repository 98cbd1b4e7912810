"""The places of the samples of a pixel format in memory, by FFmpeg's name: PyAV knows planes and depths, no offsets."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from gsvc_ref.video.format import ChromaFormat

SamplePlace = tuple[int, int, int]
"""Plane, distance between samples and first sample, both counted in samples."""

PLANAR: Final[tuple[SamplePlace, ...]] = ((0, 1, 0), (1, 1, 0), (2, 1, 0))
PACKED_422: Final[dict[str, tuple[SamplePlace, ...]]] = {
    "yuyv422": ((0, 2, 0), (0, 4, 1), (0, 4, 3)),
    "uyvy422": ((0, 2, 1), (0, 4, 0), (0, 4, 2)),
    "yvyu422": ((0, 2, 0), (0, 4, 3), (0, 4, 1)),
}
NV_FORMATS: Final[dict[str, tuple[ChromaFormat, bool]]] = {
    "nv12": ("420", False),
    "nv21": ("420", True),
    "nv16": ("422", False),
    "nv24": ("444", False),
    "nv42": ("444", True),
}
"""Chroma format, and whether Cr comes before Cb."""


@dataclass(frozen=True)
class PixelLayout:
    """The places of the samples of a pixel format in memory."""

    places: tuple[SamplePlace, ...]  # one for grey, three for (Y', Cb, Cr) or (R', G', B')
    alpha: SamplePlace | None
    chroma_format: ChromaFormat  # 420 for grey
    bit_depth: int  # 8 to 16
    dtype: str  # of the samples in memory: u1, <u2 or >u2
    shift: int = 0  # unused bits below each sample


def _dtype(depth: int, endianness: str | None) -> str:
    return "u1" if depth == 8 else (">u2" if endianness == "be" else "<u2")


def _planar(name: str) -> PixelLayout | None:
    match = re.fullmatch(r"(yuv|yuvj|yuva|gbr|gbra)(420|422|444)?p(\d+)?(le|be)?", name)
    depth = int(match[3] or 8) if match else 0
    if match is None or not 8 <= depth <= 16 or (match[2] is None) != match[1].startswith("gbr"):
        return None
    rgb = match[2] is None
    return PixelLayout(
        ((2, 1, 0), (0, 1, 0), (1, 1, 0)) if rgb else PLANAR,
        (3, 1, 0) if match[1].endswith("a") else None,
        "rgb" if rgb else cast(ChromaFormat, match[2]),
        depth,
        _dtype(depth, match[4]),
    )


def _semi_planar(name: str) -> PixelLayout | None:
    match = re.fullmatch(r"p([024])(10|12|16)(le|be)", name)
    if match:
        chroma: ChromaFormat = {"0": "420", "2": "422", "4": "444"}[match[1]]  # type: ignore[assignment]
        depth, swapped, shift = int(match[2]), False, 16 - int(match[2])
        dtype = _dtype(16, match[3])
    elif name in NV_FORMATS:
        (chroma, swapped), depth, shift, dtype = NV_FORMATS[name], 8, 0, "u1"
    else:
        return None
    return PixelLayout(((0, 1, 0), (1, 2, int(swapped)), (1, 2, int(not swapped))), None, chroma, depth, dtype, shift)


def _packed(name: str) -> PixelLayout | None:
    if name in PACKED_422:
        return PixelLayout(PACKED_422[name], None, "422", 8, "u1")
    match = re.fullmatch(r"(?P<order>rgb|bgr)(?P<bits>24|48(le|be))|(?P<wide>rgba|bgra)64(le|be)|([rgba0]{4})", name)
    if match is None:
        return None
    order = match["order"] or match["wide"] or name
    if sorted(order.replace("0", "").replace("a", "")) != ["b", "g", "r"]:
        return None
    depth = 16 if "48" in name or "64" in name else 8
    places = tuple((0, len(order), order.index(letter)) for letter in "rgb")
    alpha = (0, len(order), order.index("a")) if "a" in order else None
    return PixelLayout(places, alpha, "rgb", depth, _dtype(depth, name[-2:]))


def _grey(name: str) -> PixelLayout | None:
    match = re.fullmatch(r"(gray|ya)(\d+)?(le|be)?", name)
    depth = int(match[2] or 8) if match else 0
    if match is None or not 8 <= depth <= 16:
        return None
    stride = 2 if match[1] == "ya" else 1
    return PixelLayout(((0, stride, 0),), (0, 2, 1) if stride == 2 else None, "420", depth, _dtype(depth, match[3]))


@cache
def layout(name: str) -> PixelLayout | None:
    """The layout of a pixel format by FFmpeg's name, or None where it is none of the plain ones."""
    return _planar(name) or _semi_planar(name) or _packed(name) or _grey(name)


def stand_in(*, rgb: bool, alpha: bool, deep: bool) -> str:
    """The planar format without loss of resolution that is nearest to one that `layout` does not know."""
    return ("gbr" if rgb else "yuv") + ("a" if alpha else "") + ("p" if rgb else "444p") + ("16le" if deep else "")


def take(
    place: SamplePlace, buffers: Sequence[NDArray[Any]], shape: tuple[int, int], pixels: PixelLayout
) -> NDArray[np.unsignedinteger[Any]]:
    """Copy the samples of one component, `shape` (rows, columns), out of planes (rows, bytes of a line) u1 each.

    The result is u1 for 8 bits, else u2, contiguous.
    """
    plane, stride, first = place
    rows, columns = shape
    dtype = np.dtype(pixels.dtype)
    lines = buffers[plane][:rows]
    samples = lines[:, : lines.shape[1] // dtype.itemsize * dtype.itemsize].view(dtype)
    used = samples[:, first::stride][:, :columns] >> pixels.shift
    return used.astype(np.uint8 if pixels.bit_depth == 8 else np.uint16)


def plain_name(picture: Any) -> str:
    """The pixel format of a picture of PyAV, or that of its stand-in where it has no plain layout."""
    pixel_format = picture.format
    if layout(pixel_format.name):
        return str(pixel_format.name)
    components = pixel_format.components
    palette = pixel_format.has_palette
    return stand_in(
        rgb=pixel_format.is_rgb or palette or pixel_format.name.startswith(("xyz", "mono")),
        alpha=palette or any(component.is_alpha for component in components),
        deep=not palette and max(component.bits for component in components) > 8,
    )


def plain_layout(name: str) -> PixelLayout:
    """The layout of a pixel format that `plain_name` gives."""
    pixels = layout(name)
    assert pixels is not None, "a plain name has a layout"
    return pixels
