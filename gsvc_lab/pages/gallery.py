"""The pictures of the page: the moving preview and the frames to look at."""

import html

import numpy as np

from gsvc_lab.pages.charts import decibels, thousands
from gsvc_lab.pages.data import FrameRecord, PictureRow, ReportData
from gsvc_lab.pages.pictures import (
    DIFFERENCE_GAIN,
    MAX_PREVIEW_FRAMES,
    animation_uri,
    difference_picture,
    png_uri,
    side_by_side,
    splat_centres_picture,
    to_eight_bits,
)


def preview_section(data: ReportData) -> str:
    """Original and decoded video, moving, side by side."""
    if not data.preview_original:
        return ""
    shown = min(len(data.preview_original), MAX_PREVIEW_FRAMES)
    pictures = [
        side_by_side(to_eight_bits(original, data.peak), to_eight_bits(decoded, data.peak))
        for original, decoded in zip(data.preview_original[:shown], data.preview_decoded[:shown], strict=True)
    ]
    still = png_uri(pictures[0])
    moving = animation_uri(pictures, data.frame_rate)
    alt = "The original video on the left, the decoded one on the right"
    caption = "This preview is squeezed once more to keep the page small; the still pictures further down are exact."
    if moving is None:
        moving, caption = still, "The first frame; this Pillow cannot write the moving preview (no WebP)."
    return (
        '<figure><div class="pair"><span>original</span><span>decoded</span></div>'
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
    original, decoded = to_eight_bits(row.original, peak), to_eight_bits(row.decoded, peak)
    largest = int(np.abs(row.decoded.astype(np.int64) - row.original.astype(np.int64)).max())
    quality = f", {decibels(record.psnr)}, {thousands(record.bits)} bits" if record else ""
    height, width = row.original.shape[:2]
    x, y = row.positions[:, 0], row.positions[:, 1]
    outside = int(((x < 0) | (x >= width) | (y < 0) | (y >= height)).sum())
    centres = f"Centres of the {len(row.positions):,} splats"
    centres += f" ({outside:,} of them outside the frame)" if outside else ""
    centres += "; outlines of a few, small to large, at one standard deviation" if row.cholesky is not None else ""
    cells = [
        (original, "Original"),
        (decoded, f"Decoded{quality}"),
        (
            difference_picture(row.original, row.decoded, peak),
            f"Decoded − original, {DIFFERENCE_GAIN} × amplified; grey is equal. "
            f"Largest difference: {largest} of {peak}",
        ),
        (splat_centres_picture(row.original, row.positions, row.cholesky, peak=peak), centres),
    ]
    figures = "".join(
        f'<figure><img src="{png_uri(picture)}" alt="{html.escape(text)}" width="{width}" height="{height}">'
        f"<figcaption>{html.escape(text)}</figcaption></figure>"
        for picture, text in cells
    )
    return f'<h3>Frame {row.number}{kind}{html.escape(reason)}</h3><div class="grid4">{figures}</div>'
