"""The pictures of the page: the moving preview and the frames to look at."""

import html
import math
from typing import Final

import numpy as np

from gsvc_base.arrays import U1, Frame
from gsvc_lab.pages.charts import decibels, thousands
from gsvc_lab.pages.data import Detail, FrameRecord, PictureRow, ReportData
from gsvc_lab.pages.pictures import (
    DIFFERENCE_GAIN,
    MAX_PREVIEW_FRAMES,
    animation_uri,
    difference_picture,
    exact_uri,
    png_uri,
    side_by_side,
    splat_centres_picture,
    to_eight_bits,
)

MAX_CENTRES_PIXELS: Final = 700_000
"""Pixels of a picture of splat centres, about; it has 1 to 4 times as many on a side as the frame."""

MAX_ENLARGED: Final = 3
"""How many times larger than it is the preview may be shown."""


def preview_section(data: ReportData) -> str:
    """Original and decoded video, moving, side by side."""
    if not data.preview_decoded:
        return ""
    pictures = [to_eight_bits(decoded, data.peak) for decoded in data.preview_decoded[:MAX_PREVIEW_FRAMES]]
    if data.preview_original:
        originals = (to_eight_bits(original, data.peak) for original in data.preview_original)
        pictures = [side_by_side(*pair) for pair in zip(originals, pictures, strict=False)]
    still = png_uri(pictures[0])
    moving = animation_uri(pictures, data.frame_rate)
    alt = (
        "The original video on the left, the decoded one on the right" if data.preview_original else "The decoded video"
    )
    caption = "This preview is squeezed once more to keep the page small; the still pictures further down are not."
    caption += f" {data.preview_note}" if data.preview_note else ""
    if moving is None:
        moving, caption = still, "The first frame; this Pillow cannot write the moving preview (no WebP)."
    names = '<div class="pair"><span>original</span><span>decoded</span></div>' if data.preview_original else ""
    wide = min(pictures[0].shape[1] * MAX_ENLARGED, 1080)
    return (
        f'<figure style="max-width:{wide}px">{names}'
        f'<picture><source media="(prefers-reduced-motion: reduce)" srcset="{still}">'
        f'<img src="{moving}" alt="{alt}" width="{pictures[0].shape[1]}" height="{pictures[0].shape[0]}"></picture>'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def pictures_section(data: ReportData) -> str:
    """Rows of frames to look at."""
    if not data.pictures:
        return ""
    records = {frame.number: frame for frame in data.frames}
    rows = "".join(_picture_row(row, records.get(row.number), data.peak) for row in data.pictures)
    return f"<h2>Frames to look at</h2>{rows}"


def _picture_row(row: PictureRow, record: FrameRecord | None, peak: int) -> str:
    """Original, decoded, difference and splat centres of one frame."""
    kind = f", {record.type}-frame" if record else ""
    reason = f": {row.caption}" if row.caption else ""
    quality = f", {decibels(record.psnr)}" if record and record.psnr is not None else ""
    quality += f", {thousands(record.bits)} bits" if record else ""
    height, width = row.decoded.shape[:2]
    x, y = row.positions[:, 0], row.positions[:, 1]
    outside = int(((x < 0) | (x >= width) | (y < 0) | (y >= height)).sum())
    centres = f"Centres of the {len(row.positions):,} splats"
    centres += f" ({outside:,} of them outside the frame)" if outside else ""
    centres += "; outlines of a few, small to large, at one standard deviation" if row.cholesky is not None else ""
    scale = min(4, max(1, round(math.sqrt(MAX_CENTRES_PIXELS / (width * height)))))
    ghost = row.decoded if row.original is None else row.original
    dots = splat_centres_picture(ghost, row.positions, row.cholesky, peak=peak, scale=scale)
    cells = [*_compared(row.original, row.decoded, quality, peak), (dots, centres)]
    figures = "".join(_figure(picture, text, width, height) for picture, text in cells)
    heading = f"<h3>Frame {row.number}{kind}{html.escape(reason)}</h3>"
    return f'{heading}<div class="grid4">{figures}</div>{_detail(row.detail, peak) if row.detail else ""}'


def _detail(part: Detail, peak: int) -> str:
    """A part of a frame pixel for pixel."""
    height, width = part.decoded.shape[:2]
    figures = "".join(
        _figure(picture, text, width, height) for picture, text in _compared(part.original, part.decoded, "", peak)
    )
    return (
        f'<p class="caption">The frame has {part.width} × {part.height} pixels and is shown smaller above. Below is a '
        f"part of it, pixel for pixel, {width} × {height} from column {part.left} and row {part.top} on.</p>"
        f'<div class="grid4">{figures}</div>'
    )


def _compared(original: Frame | None, decoded: Frame, quality: str, peak: int) -> list[tuple[U1, str]]:
    """Original, decoded and difference with captions; the decoded picture alone where there is no original."""
    shown = (to_eight_bits(decoded, peak), f"Decoded{quality}")
    if original is None:
        return [shown]
    largest = int(np.abs(decoded.astype(np.int64) - original.astype(np.int64)).max())
    text = f"Decoded − original, {DIFFERENCE_GAIN} × amplified; grey is equal. Largest difference: {largest} of {peak}"
    return [(to_eight_bits(original, peak), "Original"), shown, (difference_picture(original, decoded, peak), text)]


def _figure(picture: U1, text: str, width: int, height: int) -> str:
    caption = html.escape(text)
    return (
        f'<figure><img src="{exact_uri(picture)}" alt="{caption}" width="{width}" height="{height}">'
        f"<figcaption>{caption}</figcaption></figure>"
    )
