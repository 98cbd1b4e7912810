"""Errors of a frame, block by block of 16 x 16 pixels."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_ref.splats import F4

F8 = NDArray[np.float64]

BLOCK: Final = 16
"""Side of a block in pixels."""

MAX_ERROR: Final = 0.009486832980505138  # 3 * 10^-2.5
"""Maximum error per pixel, summed over the channels, that a block counts as left with: 25 dB. A block that is worse is
never good enough to be left alone, whatever it was before."""

MIN_ERROR: Final = 1e-6
"""Error per pixel, summed over the channels, that is too small to count: rounding to 8 bits leaves four times that."""


def block_errors(residual: F4) -> F8:
    """The sum of squares of a residual (H, W, 3) f4 over each block, (rows, columns) f8."""
    squares = np.square(residual, dtype=np.float64).sum(axis=2)
    rows = np.add.reduceat(squares, np.arange(0, squares.shape[0], BLOCK), axis=0)
    return np.asarray(np.add.reduceat(rows, np.arange(0, squares.shape[1], BLOCK), axis=1))


def errors_left(residual: F4) -> F8:
    """The errors of the blocks that a frame leaves for the next ones to be compared with, (rows, columns) f8."""
    height, width = residual.shape[:2]
    rows, columns = (np.minimum(BLOCK, side - np.arange(0, side, BLOCK)) for side in (height, width))
    return np.minimum(block_errors(residual), MAX_ERROR * np.outer(rows, columns))


def worse_blocks(now: F8, left: F8, ratio: float) -> NDArray[np.bool_]:
    """Whether the error of each block exceeds `ratio` times the error left, (rows, columns) bool."""
    return np.asarray(now > ratio * left + MIN_ERROR * BLOCK * BLOCK)


def block_pixels(blocks: NDArray[np.bool_], height: int, width: int) -> NDArray[np.bool_]:
    """The pixels of the blocks (rows, columns), (H, W) bool."""
    return np.asarray(blocks.repeat(BLOCK, axis=0)[:height].repeat(BLOCK, axis=1)[:, :width])
