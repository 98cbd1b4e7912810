"""Static splats: those of a P-frame that can stay as they are, since the source shows the same under them as before."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4
from gsvc_base.constants import SUPPORT_RADIUS
from gsvc_ref._jit import kernel
from gsvc_ref.training import MIN_FACTOR


def changed_pixels(before: NDArray[Any], now: NDArray[Any]) -> NDArray[np.bool_]:
    """Whether two pictures or frames (H, W, 3) differ at each pixel, (H, W) bool."""
    changed = np.empty(now.shape[:2], np.bool_)
    _compare(before, now, changed)
    return changed


def static_splats(parameters: F4, changed: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether each splat has pixels of the frame in its bounding box and no changed one among them, (N,) bool.

    A splat outside the frame is not static, so that it may make room for another; nor is one that training would not
    leave as it is (a factor below MIN_FACTOR).

    Parameters
    ----------
    parameters
        (N, 8) f4 in the columns of `Splats.to_array`.
    changed
        (H, W) bool.
    """
    height, width = changed.shape
    table = np.zeros((height + 1, width + 1), np.int32)
    _count(changed, table)
    x, y, l11, l21, l22 = parameters[:, :5].astype(np.float64).T
    left, right = _pixels(x, SUPPORT_RADIUS * l11, width)
    top, bottom = _pixels(y, SUPPORT_RADIUS * np.sqrt(l21 * l21 + l22 * l22), height)
    inside = table[bottom, right] - table[top, right] - table[bottom, left] + table[top, left]
    in_frame = (left < right) & (top < bottom)
    return np.asarray(in_frame & (inside == 0) & (l11 >= MIN_FACTOR) & (l22 >= MIN_FACTOR))


@kernel()
def _compare(before: NDArray[Any], now: NDArray[Any], changed: NDArray[np.bool_]) -> None:
    """Whether two pictures differ at each pixel, (H, W) bool."""
    height, width, channels = now.shape
    for y in range(height):
        for x in range(width):
            differs = False
            for c in range(channels):
                differs |= before[y, x, c] != now[y, x, c]
            changed[y, x] = differs


@kernel()
def _count(changed: NDArray[np.bool_], table: NDArray[np.int32]) -> None:
    """table[y, x]: the changed pixels above y and left of x; its row 0 and its column 0 are 0 already."""
    height, width = changed.shape
    for y in range(height):
        row = 0
        for x in range(width):
            row += int(changed[y, x])
            table[y + 1, x + 1] = table[y, x + 1] + row


def _pixels(
    center: NDArray[np.float64], half_extent: NDArray[np.float64], size: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The first pixel of each interval and the one after the last, with one more on either side; of NaN all pixels."""
    with np.errstate(invalid="ignore"):
        left, right = np.floor(center - half_extent) - 1, np.ceil(center + half_extent) + 1
    first = np.fmin(np.fmax(left, 0), size).astype(np.int64)
    return first, np.fmax(np.fmin(right, size), first).astype(np.int64)
