"""The pictures of a report as arrays, and their way into the page as data URIs."""

import base64
import io
from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image, features

from gsvc_base.arrays import F8, U1, Frame
from gsvc_base.splats import Splats

DIFFERENCE_GAIN: Final = 8
"""Factor by which the difference picture amplifies."""

MAX_PREVIEW_BYTES: Final = 1_200_000
"""Size of the animation before base64 adds a third of it."""

MAX_PREVIEW_FRAMES: Final = 120

_PREVIEW_QUALITIES: Final = (85, 70, 50, 30)
_PREVIEW_GAP: Final = 2
_ELLIPSES: Final = 24
_PAPER: Final = np.array([250, 250, 248])
_DOT: Final = np.array([23, 66, 140])
_ELLIPSE: Final = np.array([214, 92, 20])


def to_eight_bits(frame: Frame, peak: int) -> U1:
    """An (H, W, 3) frame of any depth as u1 for the screen, rounded to nearest."""
    if peak == 255:
        return frame.astype(np.uint8)
    return np.asarray((frame.astype(np.uint32) * 255 + peak // 2) // peak, np.uint8)


def difference_picture(original: Frame, decoded: Frame, peak: int = 255, gain: int = DIFFERENCE_GAIN) -> U1:
    """128 + gain * (decoded - original) in steps of 8 bits, clipped, as (H, W, 3) u1: mid-grey where nothing differs.

    `original` and `decoded`: (H, W, 3) u1 or u2 frames of one size. `peak`: their largest sample value. `gain`: the
    amplification.
    """
    difference = (decoded.astype(np.float64) - original.astype(np.float64)) * (255 / peak)
    return np.clip(np.rint(128 + gain * difference), 0, 255).astype(np.uint8)


def splat_centres_picture(
    frame: Frame,  # (H, W, 3) u1 or u2, the ghost in the background
    positions: NDArray[np.floating[Any]],  # (N, 2) centres in pixels; those outside the frame are not drawn
    # (N, 3) factors (l11, l21, l22) in pixels; None draws no outlines
    cholesky: NDArray[np.floating[Any]] | None = None,
    *,
    peak: int = 255,  # largest sample value of the frame
    scale: int = 4,  # size of the picture as a multiple of the frame's
    ellipses: int = _ELLIPSES,  # number of outlines (one standard deviation) to draw, at evenly spaced ranks of size
) -> U1:
    """Places of the splats: a dot per centre over the paled frame, and the outline of a few; figure 3 of the paper.

    Returns (scale H, scale W, 3) u1.
    """
    height, width = frame.shape[:2]
    grey = Image.fromarray(to_eight_bits(frame, peak)).convert("L")
    ghost = np.asarray(grey.resize((scale * width, scale * height), Image.Resampling.BICUBIC), np.float64)[..., None]
    canvas = _PAPER - 0.30 * (255 - ghost)  # (sH, sW, 3) f8
    centres = np.asarray(positions, np.float64) * scale  # (N, 2) f8
    if cholesky is not None and len(centres):
        outline = _outlines(centres, np.asarray(cholesky, np.float64) * scale, ellipses)
        canvas = _ink(canvas, outline, 0.9, _ELLIPSE)
    spacing = float(np.sqrt(scale**2 * width * height / max(len(centres), 1)))
    canvas = _ink(canvas, centres, min(max(0.12 * spacing, 0.9), 2.2), _DOT)
    return np.clip(np.rint(canvas), 0, 255).astype(np.uint8)


def splat_outlines_picture(frame: U1, splats: Splats, *, scale: int = 2) -> U1:
    """The outline of each splat at one standard deviation, over the paled frame: (scale H, scale W, 3) u1."""
    height, width = frame.shape[:2]
    large = Image.fromarray(frame).resize((scale * width, scale * height), Image.Resampling.BICUBIC)
    paled = _PAPER - 0.30 * (255 - np.asarray(large, np.float64))
    parameters = splats.to_array().astype(np.float64) * scale
    outlines = _outlines(parameters[:, :2], parameters[:, 2:5], len(parameters))
    return np.clip(np.rint(_ink(paled, outlines, 0.6, _DOT)), 0, 255).astype(np.uint8)


def _outlines(centres: F8, cholesky: F8, count: int) -> F8:
    """(M, 2) f8 points along the one-sigma ellipses mu + L (cos t, sin t) of splats at evenly spaced ranks of area."""
    by_area = np.argsort(np.abs(cholesky[:, 0] * cholesky[:, 2]), kind="stable")
    ranks = np.unique(np.linspace(0, len(centres) - 1, min(count, len(centres))).round().astype(np.int64))
    points = []
    for splat in by_area[ranks]:
        l11, l21, l22 = cholesky[splat]
        reach = min(max(abs(l11), abs(l21) + abs(l22), 1.0), 4000.0)
        angle = np.linspace(0, 2 * np.pi, int(4 * np.pi * reach), endpoint=False)
        x, y = l11 * np.cos(angle), l21 * np.cos(angle) + l22 * np.sin(angle)
        points.append(centres[splat] + np.stack([x, y], axis=1))
    return np.concatenate(points)


def _ink(canvas: F8, points: F8, radius: float, color: NDArray[np.int_]) -> F8:
    """The (H, W, 3) canvas with an antialiased disc of one colour at each of (M, 2) points; overlaps do not darken."""
    height, width = canvas.shape[:2]
    coverage = np.zeros((height, width))
    reach = int(np.ceil(radius + 0.5))
    # Also keeps points out that are too far away for an integer.
    near = np.all((points > -reach) & (points < (width + reach, height + reach)), axis=1)
    points = points[near]
    corner = np.floor(points).astype(np.int64)  # (M, 2) i8, x and y of the pixel under each point
    for dy in range(-reach, reach + 1):
        for dx in range(-reach, reach + 1):
            x, y = corner[:, 0] + dx, corner[:, 1] + dy
            distance = np.hypot(x + 0.5 - points[:, 0], y + 0.5 - points[:, 1])
            part = np.clip(radius + 0.5 - distance, 0, 1)
            inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
            np.maximum.at(coverage, (y[inside], x[inside]), part[inside])
    return np.asarray(canvas + coverage[..., None] * (color - canvas))


def png_uri(picture: U1) -> str:
    """An (H, W, 3) u1 picture as the data URI of a PNG: exact."""
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, "PNG", optimize=True)
    return _uri("png", buffer.getvalue())


def exact_uri(picture: U1) -> str:
    """An (H, W, 3) u1 picture as the data URI of a WebP without loss, which is smaller, or of a PNG: exact."""
    if not features.check("webp"):
        return png_uri(picture)
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, "WEBP", lossless=True, quality=60, method=4)
    return _uri("webp", buffer.getvalue())


def side_by_side(original: U1, decoded: U1) -> U1:
    """Two (H, W, 3) u1 pictures beside each other, with a gap of a few black columns."""
    gap = np.zeros((original.shape[0], _PREVIEW_GAP, 3), np.uint8)
    return np.concatenate([original, gap, decoded], axis=1)


def animation_uri(pictures: Sequence[U1], frame_rate: Fraction, most_bytes: int | None = None) -> str | None:
    """(H, W, 3) u1 pictures as the data URI of an endless animated WebP; None when Pillow cannot write WebP.

    Lossy, at the best of a few qualities that stays within `most_bytes` (None: `MAX_PREVIEW_BYTES`); of longer clips
    only the first `MAX_PREVIEW_FRAMES` pictures, and fewer where the lowest quality is still too large.
    """
    most_bytes = MAX_PREVIEW_BYTES if most_bytes is None else most_bytes
    if not features.check("webp"):
        return None
    images = [Image.fromarray(picture) for picture in pictures[:MAX_PREVIEW_FRAMES]]
    # Whole milliseconds, each rounded from the exact time of the frame, so that the clip keeps its length.
    times = [round(1000 * number / frame_rate) for number in range(len(images) + 1)]
    durations = [after - before for before, after in pairwise(times)]
    while True:
        for quality in _PREVIEW_QUALITIES:
            buffer = io.BytesIO()
            images[0].save(
                buffer,
                "WEBP",
                save_all=True,
                append_images=images[1:],
                duration=durations[: len(images)],
                loop=0,
                quality=quality,
            )
            if buffer.tell() <= most_bytes or (len(images) == 1 and quality == _PREVIEW_QUALITIES[-1]):
                return _uri("webp", buffer.getvalue())
        images = images[: len(images) // 2]


def _uri(kind: str, content: bytes) -> str:
    return f"data:image/{kind};base64,{base64.b64encode(content).decode('ascii')}"
