"""Errors of a frame, block by block of 16 x 16 pixels."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4, F8
from gsvc_ref._jit import kernel

BLOCK: Final = 16
"""Side of a block in pixels."""

MAX_ERROR: Final = 0.009486832980505138  # 3 * 10^-2.5
"""Maximum error per pixel, summed over the channels, that a block counts as left with: 25 dB. A block that is worse is
never good enough to be left alone, whatever it was before."""

MIN_ERROR: Final = 1e-6
"""Error per pixel, summed over the channels, that is too small to count: rounding to 8 bits leaves four times that."""


def block_errors(residual: F4) -> F8:
    """The sum of squares of a residual (H, W, 3) f4 over each block, (rows, columns) f8."""
    height, width = residual.shape[:2]
    errors = np.zeros((-(-height // BLOCK), -(-width // BLOCK)))
    _sum_squares(residual, errors)
    return errors


@kernel()
def _sum_squares(residual: F4, errors: F8) -> None:
    """Add the squares of each block to its error; a row of a block at a time, pixel by pixel."""
    height, width, channels = residual.shape
    for y in range(height):
        for column in range(errors.shape[1]):
            total = 0.0
            for x in range(column * BLOCK, min((column + 1) * BLOCK, width)):
                for c in range(channels):
                    value = np.float64(residual[y, x, c])
                    total += value * value
            errors[y // BLOCK, column] += total


def errors_left(errors: F8, height: int, width: int) -> F8:
    """Of the errors of a frame's blocks, what the next frames are compared with: at most MAX_ERROR a pixel."""
    rows, columns = (np.minimum(BLOCK, side - np.arange(0, side, BLOCK)) for side in (height, width))
    return np.minimum(errors, MAX_ERROR * np.outer(rows, columns))


def worse_blocks(now: F8, left: F8, ratio: float) -> NDArray[np.bool_]:
    """Whether the error of each block exceeds `ratio` times the error left, (rows, columns) bool."""
    return np.asarray(now > ratio * left + MIN_ERROR * BLOCK * BLOCK)


def block_pixels(blocks: NDArray[np.bool_], height: int, width: int) -> NDArray[np.bool_]:
    """The pixels of the blocks (rows, columns), (H, W) bool."""
    return np.asarray(blocks.repeat(BLOCK, axis=0)[:height].repeat(BLOCK, axis=1)[:, :width])
