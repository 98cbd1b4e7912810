"""The sources of splats: Gaussian Splat Augmentation and the paper's random start, and our draws from the picture.

Pictures are (H, W, 3) f4 with 1 for full scale; positions and sizes are in pixels.
"""

import math
from typing import Final

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from gsvc_base.arrays import F4, F8
from gsvc_base.checks import door
from gsvc_base.errors import UsageError
from gsvc_base.splats import PARAMETERS_PER_SPLAT, Splats
from gsvc_ref._jit import kernel

NEW_WEIGHT: Final = float(np.float32(0.01))
"""Initial w of random splats, of I-frames and of GSA (10-27); the authors' value. The paper has "close to zero"."""

KEPT_WEIGHT: Final = 1.0
"""Initial w of the splats that a P-frame takes over (paper section 3.5)."""

RANDOM_CHOLESKY_OFFSET: Final = np.array([0.5, 0.0, 0.5], np.float32)
"""Added to uniform numbers in [0, 1) for (l11, l21, l22) in pixels; the authors' value. The paper is silent."""

GRADIENT_SHARE: Final = 0.7
"""Fraction of the splats of `image_start` that are drawn by gradient magnitude, the others uniformly."""

SIZE_FACTOR: Final = 0.5
"""Deviation of a splat of `image_start` in units of 1 / sqrt(splats per pixel around it)."""

COLOR_SHARE: Final = 0.5
"""Fraction of the residual that a splat of `residual_splats` takes as its colour."""

LEVELLINGS: Final = 4
"""Passes that cut a density off at its limit and spread the excess over the rest in proportion."""


# twin of spec.augment
@door
def augment(values: F4, uniforms: F4, width: int, height: int) -> F4:
    """New splats of small weight after the old ones, uniformly over the frame (R-10.8-1).

    Parameters
    ----------
    values
        (N, 9) f4, the splats in training.
    uniforms
        (n, 8) f4 in [0, 1), eight numbers for each new splat, such as `uniform_numbers` draws.
    width, height
        The frame's size in pixels.

    Returns
    -------
    F4
        (N + n, 9).

    Raises
    ------
    UsageError
        As for `random_splats`.
    """
    new = random_splats(uniforms, width, height).to_array()
    weights = np.full((len(new), 1), NEW_WEIGHT, np.float32)
    return np.concatenate([values, np.concatenate([new, weights], axis=1)])


def uniform_numbers(count: int, rng: Generator) -> F4:
    """Uniform numbers (count, 8) f4: all positions are drawn first, then all Cholesky factors, then all colours."""
    if count < 0:
        raise UsageError(f"cannot place {count} splats; give at least 0")
    return np.concatenate([rng.random((count, columns), np.float32) for columns in (2, 3, 3)], axis=1)


def random_splats(
    uniforms: F4,  # (n, 8) f4 in [0, 1), in the columns of `Splats.to_array`
    width: int,
    height: int,
) -> Splats:
    """Splats uniformly over the frame, from uniform numbers: the start of an I-frame, and what GSA adds (10-26).

    The caller chooses their weight (`NEW_WEIGHT`).
    """
    if uniforms.ndim != 2 or uniforms.shape[1] != PARAMETERS_PER_SPLAT:
        raise UsageError(f"the uniform numbers have shape {uniforms.shape}; give (n, {PARAMETERS_PER_SPLAT})")
    if width < 1 or height < 1:
        raise UsageError(f"cannot place splats on {width}x{height} pixels; give at least 1x1")
    positions = uniforms[:, :2] * np.array([width, height], np.float32)
    cholesky = uniforms[:, 2:5] + RANDOM_CHOLESKY_OFFSET  # (10-26)
    return Splats(positions, cholesky, uniforms[:, 5:])  # (10-27)


def draw_from_density(density: NDArray[np.floating], count: int, rng: Generator) -> F4:
    """Positions (count, 2) f4 in proportion to a density (H, W), which is at least 0; if it is all 0, uniformly.

    A pixel is drawn by the inverse distribution function, and then a place in the pixel.
    """
    if density.ndim != 2 or density.size == 0:
        raise UsageError(f"the density has shape {density.shape}; it must be (H, W) with at least one pixel")
    reach = np.cumsum(
        density, dtype=np.float64
    )  # (H W,) f8, the distribution function before its division by the total
    if not np.isfinite(reach[-1]) or density.min() < 0:
        raise UsageError("a density is negative or not finite; all must be at least 0")
    if reach[-1] == 0:
        reach = np.arange(1.0, density.size + 1)
    # A product that rounds up to the total would pass the last pixel, and pixels of density 0 must not be drawn.
    last = np.searchsorted(reach, reach[-1])
    pixel = np.minimum(np.searchsorted(reach, rng.random(count) * reach[-1], side="right"), last)
    y, x = np.divmod(pixel, density.shape[1])
    return (np.stack([x, y], axis=1) + rng.random((count, 2))).astype(np.float32)


def image_start(
    picture: F4,  # (H, W, 3) f4
    count: int,
    rng: Generator,
    *,
    gradient_share: float = GRADIENT_SHARE,  # 0..1, fraction drawn by gradient magnitude
    size_factor: float = SIZE_FACTOR,  # deviation in units of the distance between splats
) -> Splats:
    """A start for an I-frame that resembles its picture: many small splats on detail, few large ones elsewhere; ours.

    With splats drawn at rho per pixel, partly in proportion to the gradient magnitude and partly uniformly, a splat is
    round with the deviation s = size_factor / sqrt(rho around it). Where rho is even, such splats add up to
    2 pi size_factor^2 times one splat's colour, so each takes the picture's colour at its centre divided by that.
    """
    _check_picture(picture)
    if not 0 <= gradient_share <= 1 or not size_factor > 0:
        raise UsageError(f"gradient_share {gradient_share} must be in 0..1 and size_factor {size_factor} above 0")
    height, width = picture.shape[:2]
    magnitude = np.empty((height, width), np.float32)
    total = _gradient_magnitude(np.ascontiguousarray(picture), magnitude)
    share = gradient_share if total > 0 else 0.0
    rho = magnitude * np.float32(share * count / max(total, 1e-30)) + np.float32((1 - share) * count / (height * width))
    positions = draw_from_density(rho, count, rng)
    radius = max(1, round(0.5 * math.sqrt(height * width / max(count, 1))))
    size = (size_factor / np.sqrt(_box_means(rho, positions, radius))).astype(np.float32)
    colors = picture[_pixels(positions, width, height)] / np.float32(2 * math.pi * size_factor * size_factor)
    return Splats(positions, np.stack([size, np.zeros_like(size), size], axis=1), colors)


def residual_splats(
    residual: F4,
    count: int,
    size: float,
    rng: Generator,
    *,
    color_share: float = COLOR_SHARE,
    most_per_square: float = math.inf,
) -> Splats:
    """Round splats of deviation `size` in pixels where a picture is worst, coloured with a part of the residual; ours.

    The residual (H, W, 3) is target minus picture. A pixel is drawn in proportion to the cube of its residual's length:
    on three photographs with 1000 to 2000 splats the cube gave 0.2 to 0.3 dB more than the square after 50 and 150
    iterations, and smoothing took as much away. At most `most_per_square` splats are expected in a square of `size`,
    as far as the picture has room for them: many at one place add up to more than the residual.
    """
    _check_picture(residual)
    if not size > 0:
        raise UsageError(f"size is {size} pixels; it must be above 0")
    height, width = residual.shape[:2]
    cubes = np.empty((height, width), np.float32)
    _cubed_lengths(residual, cubes)
    density = cubes if math.isinf(most_per_square) else _levelled(cubes, count, most_per_square / (size * size))
    positions = draw_from_density(density, count, rng)
    cholesky = np.tile(np.array([size, 0, size], np.float32), (count, 1))
    colors = np.float32(color_share) * residual[_pixels(positions, width, height)]  # (count, 3) f4
    return Splats(positions, cholesky, colors)


@kernel()
def _levelled(density: F4, count: int, most: float) -> F8:
    """A density (H, W) by which at most about `most` of `count` splats are drawn in a pixel."""
    height, width = density.shape
    levelled, total = np.empty((height, width)), 0.0
    for y in range(height):
        for x in range(width):
            levelled[y, x] = density[y, x]
            total += levelled[y, x]
    # Each pass scales the sum to `count` splats and cuts at `most`; the next one spreads what was cut.
    for _ in range(LEVELLINGS):
        if total == 0:
            break
        share, total = count / total, 0.0
        for y in range(height):
            for x in range(width):
                levelled[y, x] = min(levelled[y, x] * share, most)
                total += levelled[y, x]
    return levelled


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


def _check_picture(picture: F4) -> None:
    if picture.ndim != 3 or picture.shape[2] != 3 or picture.size == 0:
        raise UsageError(f"the picture has shape {picture.shape}; it must be (H, W, 3) with at least one pixel")
