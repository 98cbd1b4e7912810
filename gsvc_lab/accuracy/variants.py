"""A renderer with the choices of `gsvc_ref.rendering` left open: exp, support cut-off, tile size and arithmetic.

It has the design of the reference (tiles as lanes, rows by the closed form of the ellipse, coverage as a select) on
one thread, and nothing that only speed or extreme splats need, so that one choice can be changed with all others fixed.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from gsvc_lab.accuracy.exponential import coefficients, squarings
from gsvc_ref._jit import kernel
from gsvc_ref.constants import LN_255, SMALLEST_NORMAL
from gsvc_ref.errors import UsageError
from gsvc_ref.splats import Splats

F8 = NDArray[np.float64]
Picture = NDArray[np.float32] | NDArray[np.float64]

ROWS: Final = 3
"""Rows that the inner loop handles at once, as in the reference."""

BUCKET: Final = 8
"""Splats are drawn by rows of this height, as in the reference."""

SMALLEST_WEIGHT_SIGMA: Final = 126 * math.log(2)
"""Without a cut-off a splat ends where its weight is no normal binary32 any more."""


@dataclass(frozen=True)
class Variant:
    """A renderer; the defaults are the choices of the reference, precision ``fast``.

    Attributes
    ----------
    degree
        Of the polynomial for exp; None calls the C library.
    cutoff
        The least weight exp(-sigma) that counts; 0 for none.
    tile
        Width and height of a tile in pixels; the height None is that of the frame.
    bits
        32 or 64, of the arithmetic.
    """

    degree: int | None = 5
    cutoff: float = 1 / 255
    tile: tuple[int, int | None] = (16, None)
    bits: Literal[32, 64] = 32

    def __post_init__(self) -> None:
        width, height = self.tile
        if self.bits not in (32, 64) or not 0 <= self.cutoff < 1 or width < 1 or (height is not None and height < 1):
            raise UsageError(f"{self}: bits must be 32 or 64, the cut-off in [0, 1) and a tile at least 1x1")
        if self.degree is not None and not 1 <= self.degree <= 12:
            raise UsageError(f"the degree of the exponential is {self.degree}; it must be 1 to 12, or None")

    @property
    def support_sigma(self) -> float:
        """The largest sigma that is covered."""
        if self.cutoff == 1 / 255:
            return LN_255
        return -math.log(self.cutoff) if self.cutoff else SMALLEST_WEIGHT_SIGMA


def render_variant(splats: Splats, width: int, height: int, variant: Variant) -> Picture:
    """The sum (9-2) of spec.md as the variant computes it: (H, W, 3) f4 or f8, not clamped.

    The first call of a variant compiles it; overflow, as extreme splats cause it, is not taken care of.
    """
    draw, real = _compiled(variant)
    parameters = splats.to_array()
    order = np.argsort((parameters[:, 1].clip(0, height - 1) // BUCKET).astype(np.int16), kind="stable")
    picture = np.empty((height, width, 3), real)
    with np.errstate(over="ignore"):  # of the polynomial beyond the support, where it is not used
        draw(parameters[order].astype(np.float64), variant.tile[1] or height, picture)
    return picture


@kernel(inline=True)
def first_and_end(center: float, half_extent: float, size: int) -> tuple[int, int]:
    """The pixels of an axis, first and one after the last, whose centres are within half_extent of the centre."""
    first = min(max(np.ceil(center - half_extent - 0.5), 0.0), float(size))
    end = max(min(np.floor(center + half_extent + 0.5), float(size)), first)
    return int(first), int(end)


@kernel(inline=True)
def covered_rows(splat: F8, radius: float, left: float, right: float) -> tuple[float, float]:
    """The lowest and highest y of the ellipse |u| = radius between two columns; `lists.row_range` derives it."""
    l11, l21, l22 = splat[2], splat[3], splat[4]
    t = radius * l21 / math.sqrt(l21 * l21 + l22 * l22)
    low_end = max((left - splat[0]) / l11, -radius)
    high_end = min((right - splat[0]) / l11, radius)
    low = min(max(t, low_end), high_end)
    high = min(max(-t, low_end), high_end)
    bottom = splat[1] + l21 * low + l22 * math.sqrt(max(radius * radius - low * low, 0.0))
    top = splat[1] + l21 * high - l22 * math.sqrt(max(radius * radius - high * high, 0.0))
    return top, bottom


@kernel(contract=True, inline=True)
def power_of_polynomial(s: Any, c: Any, squared: int) -> Any:
    """((c_0 + c_1 s + ...) ^ 2) ^ 2 ..., by Horner's rule."""
    p = c[len(c) - 1]
    for k in range(len(c) - 2, -1, -1):
        p = p * s + c[k]
    for _ in range(squared):
        p = p * p
    return p


@kernel()
def list_tiles(splats: F8, radius: float, size: tuple[int, int], tile: tuple[int, int]) -> Any:
    """Which splats touch which tile: offsets (tiles + 1,) i8 and entries i8, by tile and then in the given order."""
    across, down = -(-size[0] // tile[0]), -(-size[1] // tile[1])
    ranges = np.zeros((len(splats), 4), np.int64)  # tiles: first and end across, first and end down
    offsets = np.zeros(across * down + 1, np.int64)
    for n in range(len(splats)):
        if splats[n, 2] >= SMALLEST_NORMAL and splats[n, 4] >= SMALLEST_NORMAL:
            half_height = radius * math.sqrt(splats[n, 3] ** 2 + splats[n, 4] ** 2)
            left, right = first_and_end(splats[n, 0], radius * splats[n, 2], size[0])
            top, bottom = first_and_end(splats[n, 1], half_height, size[1])
            if left < right and top < bottom:
                ranges[n, 0], ranges[n, 1] = left // tile[0], (right - 1) // tile[0] + 1
                ranges[n, 2], ranges[n, 3] = top // tile[1], (bottom - 1) // tile[1] + 1
        for row in range(ranges[n, 2], ranges[n, 3]):
            for column in range(ranges[n, 0], ranges[n, 1]):
                offsets[row * across + column + 1] += 1
    offsets = np.cumsum(offsets)
    entries = np.empty(offsets[-1], np.int64)
    at = offsets[:-1].copy()
    for n in range(len(splats)):
        for row in range(ranges[n, 2], ranges[n, 3]):
            for column in range(ranges[n, 0], ranges[n, 1]):
                entries[at[row * across + column]] = n
                at[row * across + column] += 1
    return offsets, entries


@cache
def _compiled(variant: Variant) -> tuple[Callable[[F8, int, Any], None], Any]:
    """The kernel (splats in drawing order, tile height, picture to fill) of a variant, and its type of numbers.

    The closure holds numbers only, so that Numba's cache on disk recognises it in the next process.
    """
    real: Any = np.float32 if variant.bits == 32 else np.float64
    width = variant.tile[0]
    sigma = variant.support_sigma
    radius, support = math.sqrt(2 * sigma), real(2 * sigma)
    library = variant.degree is None
    squared = squarings(sigma, variant.bits)
    c = tuple(real(value) for value in coefficients(variant.degree or 1, sigma, variant.bits))
    lanes = np.arange(width, dtype=real)
    zero, half = real(0), real(0.5)

    @kernel(contract=True)
    def draw(splats: F8, tile_height: int, picture: Any) -> None:
        size = picture.shape[1], picture.shape[0]
        across = -(-size[0] // width)
        offsets, entries = list_tiles(splats, radius, size, (width, tile_height))
        tile = np.empty((tile_height + ROWS - 1) * 3 * width, real)
        for t in range(len(offsets) - 1):
            x0, y0 = t % across * width, t // across * tile_height
            rows = min(tile_height, size[1] - y0)
            tile[:] = zero
            x = real(x0) + half
            for i in range(offsets[t], offsets[t + 1]):
                splat = splats[entries[i]]
                top, bottom = covered_rows(splat, radius, x0 + 0.5, x0 + width - 0.5)
                first = int(min(max(np.ceil(top - 0.5) - y0, 0.0), float(rows)))
                end = int(min(max(np.floor(bottom + 0.5) - y0, 0.0), float(rows)))
                mu_x, mu_y, l21 = real(splat[0]), real(splat[1]), real(splat[3])
                inverse_l11, inverse_l22 = real(1 / splat[2]), real(1 / splat[4])
                red, green, blue = real(splat[5]), real(splat[6]), real(splat[7])
                for y_first in range(first, end, ROWS):
                    y = real(y0 + y_first) + half
                    part = tile[y_first * 3 * width : (y_first + ROWS) * 3 * width]
                    for k in range(width):
                        u = ((x + lanes[k]) - mu_x) * inverse_l11
                        shear = (l21 * u) * inverse_l22
                        for row in range(ROWS):
                            v = ((y + real(row)) - mu_y) * inverse_l22 - shear
                            s = u * u + v * v
                            e = np.exp(-half * s) if library else power_of_polynomial(s, c, squared)
                            g = e if s <= support else zero
                            part[row * 3 * width + k] += g * red
                            part[row * 3 * width + width + k] += g * green
                            part[row * 3 * width + 2 * width + k] += g * blue
            for row in range(rows):
                for channel in range(3):
                    for k in range(min(width, size[0] - x0)):
                        picture[y0 + row, x0 + k, channel] = tile[(row * 3 + channel) * width + k]

    return draw, real
