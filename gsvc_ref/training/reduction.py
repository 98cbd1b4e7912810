"""Frames reduced in size, on which key frames are looked for, motion is estimated and large splats are fitted."""

import numpy as np

from gsvc_base.arrays import F4
from gsvc_ref._jit import kernel


def reduced(picture: F4, longest_side: int | None) -> F4:
    """The picture (H, W, 3) f4 with its longer side brought to at most this many pixels by averaging blocks."""
    return block_means(picture, 1 if longest_side is None else -(-max(picture.shape[:2]) // longest_side))


def block_means(picture: F4, step: int) -> F4:
    """The means (h, w, 3) f4 of blocks of step by step pixels of a picture (H, W, 3) f4, itself if step is 1."""
    if step == 1:
        return picture
    height, width = (-(-side // step) for side in picture.shape[:2])
    means = np.empty((height, width, 3), np.float32)
    _block_means(np.ascontiguousarray(picture), step, means)
    return means


@kernel()
def _block_means(picture: F4, step: int, means: F4) -> None:
    """The mean of each block of step by step pixels, fewer at the right and lower edge, in binary64."""
    sums = np.empty((means.shape[1], 3))
    for row in range(means.shape[0]):
        sums[:] = 0
        top, bottom = row * step, min((row + 1) * step, picture.shape[0])
        for y in range(top, bottom):
            for column in range(means.shape[1]):
                red, green, blue = 0.0, 0.0, 0.0
                for x in range(column * step, min((column + 1) * step, picture.shape[1])):
                    red += np.float64(picture[y, x, 0])
                    green += np.float64(picture[y, x, 1])
                    blue += np.float64(picture[y, x, 2])
                sums[column, 0] += red
                sums[column, 1] += green
                sums[column, 2] += blue
        for column in range(means.shape[1]):
            pixels = (bottom - top) * (min((column + 1) * step, picture.shape[1]) - column * step)
            for c in range(3):
                means[row, column, c] = sums[column, c] / pixels
