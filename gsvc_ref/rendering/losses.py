"""The loss of a picture, and the residual that it hands to the splats."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gsvc_ref.errors import UsageError
from gsvc_ref.rendering.fast.strip_pictures import read_strip, subtract_target, write_picture
from gsvc_ref.rendering.fast.strips import F4, F8, ROW, STRIP_WIDTH, aligned, strip_count


class Loss(NamedTuple):
    """The loss of a picture, and its derivative by the sum C of every pixel and channel."""

    loss: float
    residual: F4
    """(H, W, 3), e of (10-2)."""


def loss(picture: ArrayLike, target: ArrayLike) -> Loss:
    """The loss of a picture against its target (10-1), and dL/dC (10-2); R-10.2-1.

    These are the numbers that `Objective` finds strip by strip: squares of a pixel are added in binary32, their sums in
    binary64 in a fixed order. `Objective` multiplies by 2 / (H W) only at the end, in the gradients.

    Parameters
    ----------
    picture
        (H, W, 3) f4, the sum C before clamping, with 1.0 = full scale; what is not a number counts as 0.
    target
        (H, W, 3) f4, R'G'B'.

    Raises
    ------
    UsageError
        The shapes differ, or are not (H, W, 3) with at least one pixel.
    """
    C, wanted = np.ascontiguousarray(picture, np.float32), np.ascontiguousarray(target, np.float32)
    if C.shape != wanted.shape or C.ndim != 3 or C.shape[2] != 3 or C.size == 0:
        raise UsageError(f"the picture has shape {C.shape} and the target {wanted.shape}; both must be (H, W, 3)")
    height, width, _ = C.shape
    strip, of_target = aligned((2, height * ROW))
    squares, losses = np.empty(STRIP_WIDTH), np.empty(strip_count(width))
    residual = np.empty_like(C)
    for s in range(len(losses)):
        read_strip(C.reshape(height, -1), s, strip)
        read_strip(wanted.reshape(height, -1), s, of_target)
        losses[s] = subtract_target(strip, of_target, height, min(STRIP_WIDTH, width - s * STRIP_WIDTH), squares)
        write_picture(strip, s, 0, height, residual.reshape(height, -1), False)
    scale = 2 / (height * width)
    return Loss(total_loss(losses, height * width), np.multiply(residual, scale, dtype=np.float64).astype(np.float32))


def total_loss(losses: F8, pixels: int) -> float:
    """The loss of a picture from the squares of its strips: their sum, rounded once, over the number of pixels."""
    return math.fsum(losses) / pixels  # (10-1)
