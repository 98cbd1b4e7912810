"""The loss of a picture, and the residual that it hands to the splats."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gsvc_base.arrays import F4, F8
from gsvc_base.checks import door
from gsvc_base.errors import UsageError
from gsvc_ref.rendering.fast.tile_pictures import subtract_target, to_tiles, write_picture
from gsvc_ref.rendering.fast.tiles import TILE_WIDTH


class Loss(NamedTuple):
    """The loss of a picture, and its derivative by the sum C of every pixel and channel."""

    loss: float
    residual: F4
    """(H, W, 3), e of (10-2)."""


# twin of spec.loss
@door
def loss(picture: ArrayLike, target: ArrayLike) -> Loss:
    """The loss of a picture against its target (10-1), and dL/dC (10-2); R-10.2-1.

    These are the numbers that `Objective` finds tile by tile: squares of a pixel are added in binary32, their sums in
    binary64 in a fixed order. `Objective` multiplies by 2 / (H W) only at the end, in the gradients.

    Parameters
    ----------
    picture
        (H, W, 3) f4, the sum C before clamping, with 1.0 = full scale; what is not a number counts as 0.
    target
        (H, W, 3) f4, R'G'B'.

    Returns
    -------
    Loss
        `loss`, and `residual` (H, W, 3) f4.

    Raises
    ------
    UsageError
        The shapes differ, or are not (H, W, 3) with at least one pixel.
    """
    C, wanted = np.ascontiguousarray(picture, np.float32), np.ascontiguousarray(target, np.float32)
    if C.shape != wanted.shape or C.ndim != 3 or C.shape[2] != 3 or C.size == 0:
        raise UsageError(f"the picture has shape {C.shape} and the target {wanted.shape}; both must be (H, W, 3)")
    height, width, _ = C.shape
    tiles, targets = to_tiles(C), to_tiles(wanted)  # (tiles, H * ROW) f4 each
    squares, losses = np.empty(TILE_WIDTH), np.empty(len(tiles))
    residual = np.empty_like(C)
    for t, tile in enumerate(tiles):
        losses[t] = subtract_target(tile, targets[t], height, min(TILE_WIDTH, width - t * TILE_WIDTH), squares)
        write_picture(tile, t, 0, height, residual.reshape(height, -1), False)
    scale = 2 / (height * width)
    return Loss(total_loss(losses, height * width), np.multiply(residual, scale, dtype=np.float64).astype(np.float32))


def total_loss(losses: F8, pixels: int) -> float:
    """The loss of a picture from the squares of its tiles: their sum, rounded once, over the number of pixels."""
    return math.fsum(losses) / pixels  # (10-1)
