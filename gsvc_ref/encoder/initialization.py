"""Splats drawn from a picture, with which fits of the encoder begin, and when others are added (ours, not the paper's).

Pictures are (H, W, 3) f4 with 1 for full scale; positions and sizes are in pixels.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from gsvc_base.arrays import F4, F8
from gsvc_base.checks import check_types
from gsvc_base.errors import UsageError
from gsvc_base.splats import Splats
from gsvc_ref._jit import kernel

GRADIENT_SHARE: Final = 0.7
"""Fraction of the splats of `image_start` that are drawn by gradient magnitude, the others uniformly."""

SIZE_FACTOR: Final = 0.5
"""Deviation of a splat of `image_start` in units of 1 / sqrt(splats per pixel around it)."""

COLOR_SHARE: Final = 0.5
"""Fraction of the residual that a splat of `residual_splats` takes as its colour."""

DENSITY_PASSES: Final = 4
"""Passes that cut a density off at its limit and spread the excess over the rest in proportion."""


@dataclass(frozen=True)
class Growth:
    """Beginning with a part of the splats, and adding the others where the residual is."""

    first: float = 0.1  # fraction of the splats that the first iteration has
    additions: int = 15  # in equal numbers
    # Fractions of the iterations at which the first and the last addition come.
    begin: float = 0.04
    end: float = 0.6

    def __post_init__(self) -> None:
        check_types(self)
        if not (0 < self.first <= 1 and 1 <= self.additions <= 1000 and 0 <= self.begin <= self.end < 1):
            raise UsageError(f"{self}: it must have 0 < first <= 1, additions in 1..1000 and 0 <= begin <= end < 1")

    def counts(self, total: int, iterations: int) -> dict[int, int]:
        """Iteration (from 0) -> number of splats after its addition; the last entry is the total."""
        start = self.start(total)
        plan = {}
        for j in range(self.additions):
            at = self.begin + (self.end - self.begin) * j / max(1, self.additions - 1)
            plan[int(iterations * at)] = start + round((total - start) * (j + 1) / self.additions)
        return plan

    def start(self, total: int) -> int:
        """The number of splats at the beginning, at least 1."""
        return max(1, round(total * self.first))


def draw_from_density(density: NDArray[np.floating], count: int, rng: Generator) -> F4:
    """Positions (count, 2) f4 in proportion to a density (H, W), which is at least 0; if it is all 0, uniformly.

    A pixel is drawn by the inverse distribution function, and then a place in the pixel.
    """
    reach = np.cumsum(density, dtype=np.float64)  # (H W,) f8, the distribution function times the total
    if reach[-1] == 0:
        reach = np.arange(1.0, density.size + 1)
    # A product that rounds up to the total would pass the last pixel, and pixels of density 0 must not be drawn.
    last = np.searchsorted(reach, reach[-1])
    pixel = np.minimum(np.searchsorted(reach, rng.random(count) * reach[-1], side="right"), last)
    y, x = np.divmod(pixel, density.shape[1])
    return (np.stack([x, y], axis=1) + rng.random((count, 2))).astype(np.float32)


def image_start(picture: F4, count: int, rng: Generator) -> Splats:
    """A start for an I-frame that resembles its picture: many small splats on detail, few large ones elsewhere.

    With splats drawn at rho per pixel, partly in proportion to the gradient magnitude and partly uniformly, a splat is
    round with the deviation s = SIZE_FACTOR / sqrt(rho around it). Where rho is even, such splats add up to
    2 pi SIZE_FACTOR^2 times one splat's colour, so each takes the picture's colour at its centre divided by that.
    """
    height, width = picture.shape[:2]
    magnitude = np.empty((height, width), np.float32)
    total = _gradient_magnitude(np.ascontiguousarray(picture), magnitude)
    share = GRADIENT_SHARE if total > 0 else 0.0
    rho = magnitude * np.float32(share * count / max(total, 1e-30)) + np.float32((1 - share) * count / (height * width))
    positions = draw_from_density(rho, count, rng)
    radius = max(1, round(0.5 * math.sqrt(height * width / max(count, 1))))
    size = (SIZE_FACTOR / np.sqrt(_box_means(rho, positions, radius))).astype(np.float32)
    colors = picture[_pixels(positions, width, height)] / np.float32(2 * math.pi * SIZE_FACTOR * SIZE_FACTOR)
    return Splats(positions, np.stack([size, np.zeros_like(size), size], axis=1), colors)


def residual_splats(
    residual: F4, count: int, size: float, rng: Generator, *, max_per_square: float = math.inf
) -> Splats:
    """Round splats of deviation `size` in pixels where a picture is worst, coloured with a part of the residual.

    The residual (H, W, 3) is target minus picture. A pixel is drawn in proportion to the cube of its residual's length:
    on three photographs with 1000 to 2000 splats the cube gave 0.2 to 0.3 dB more than the square after 50 and 150
    iterations, and smoothing took as much away. At most `max_per_square` splats are expected in a square of `size`,
    as far as the picture has room for them: many at one place add up to more than the residual.
    """
    height, width = residual.shape[:2]
    cubes = np.empty((height, width), np.float32)
    _cubed_lengths(residual, cubes)
    density = cubes if math.isinf(max_per_square) else _limited_density(cubes, count, max_per_square / (size * size))
    positions = draw_from_density(density, count, rng)
    cholesky = np.tile(np.array([size, 0, size], np.float32), (count, 1))
    colors = np.float32(COLOR_SHARE) * residual[_pixels(positions, width, height)]  # (count, 3) f4
    return Splats(positions, cholesky, colors)


@kernel()
def _limited_density(density: F4, count: int, most: float) -> F8:
    """A density (H, W) by which at most about `most` of `count` splats are drawn in a pixel."""
    height, width = density.shape
    limited, total = np.empty((height, width)), 0.0
    for y in range(height):
        for x in range(width):
            limited[y, x] = density[y, x]
            total += limited[y, x]
    # Each pass scales the sum to `count` splats and cuts at `most`; the next one spreads what was cut.
    for _ in range(DENSITY_PASSES):
        if total == 0:
            break
        share, total = count / total, 0.0
        for y in range(height):
            for x in range(width):
                limited[y, x] = min(limited[y, x] * share, most)
                total += limited[y, x]
    return limited


@kernel()
def _cubed_lengths(residual: F4, cubes: F4) -> None:
    """|residual|^3 of each pixel."""
    height, width, channels = residual.shape
    for y in range(height):
        for x in range(width):
            square = np.float32(0)  # the cube of the length is square * sqrt(square): no power of a library
            for c in range(channels):
                square += residual[y, x, c] * residual[y, x, c]
            cubes[y, x] = square * np.sqrt(square)


@kernel()
def _gradient_magnitude(picture: F4, magnitude: F4) -> float:
    """Root of the summed squares of all channels' central differences, one-sided at the edges; returns its sum."""
    height, width, channels = picture.shape
    total = 0.0
    for y in range(height):
        above, below = max(y - 1, 0), min(y + 1, height - 1)
        for x in range(width):
            left, right = max(x - 1, 0), min(x + 1, width - 1)
            square = np.float32(0)
            for c in range(channels):
                dx = (picture[y, right, c] - picture[y, left, c]) / np.float32(max(right - left, 1))
                dy = (picture[below, x, c] - picture[above, x, c]) / np.float32(max(below - above, 1))
                square += dx * dx + dy * dy
            magnitude[y, x] = np.sqrt(square)
            total += np.float64(magnitude[y, x])
    return total


def _box_means(density: F4, positions: F4, radius: int) -> F8:
    """Mean density over the pixels within `radius` rows and columns of each position and inside the frame, (N,) f8."""
    height, width = density.shape
    sums = np.zeros((height + 1, width + 1))  # sums[y, x]: over all rows before y and columns before x
    np.cumsum(density, axis=0, dtype=np.float64, out=sums[1:, 1:])
    np.cumsum(sums[1:, 1:], axis=1, out=sums[1:, 1:])
    y, x = _pixels(positions, width, height)
    top, bottom = np.maximum(y - radius, 0), np.minimum(y + radius + 1, height)
    left, right = np.maximum(x - radius, 0), np.minimum(x + radius + 1, width)
    inside = sums[bottom, right] - sums[top, right] - sums[bottom, left] + sums[top, left]
    return np.asarray(inside / ((bottom - top) * (right - left)))


def _pixels(positions: F4, width: int, height: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Row and column of the pixel that each position lies in; a position on the far edge lies in the last pixel."""
    x = np.minimum(positions[:, 0].astype(np.int64), width - 1)
    y = np.minimum(positions[:, 1].astype(np.int64), height - 1)
    return y, x
