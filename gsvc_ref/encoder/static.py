"""Static splats: those of a P-frame that can stay as they are, since the source shows the same under them as before."""

import numpy as np
from numpy.typing import NDArray

from gsvc_ref.constants import SUPPORT_RADIUS
from gsvc_ref.splats import F4
from gsvc_ref.training.fit import MIN_FACTOR


def changed_pixels(before: F4, now: F4) -> NDArray[np.bool_]:
    """Whether two pictures (H, W, 3) f4 differ at each pixel, (H, W) bool."""
    return np.asarray((before != now).any(axis=2))


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
    table = np.zeros((height + 1, width + 1), np.int64)  # table[y, x]: changed pixels above y and left of x
    table[1:, 1:] = changed.cumsum(axis=0).cumsum(axis=1)
    x, y, l11, l21, l22 = parameters[:, :5].astype(np.float64).T
    left, right = _pixels(x, SUPPORT_RADIUS * l11, width)
    top, bottom = _pixels(y, SUPPORT_RADIUS * np.sqrt(l21 * l21 + l22 * l22), height)
    inside = table[bottom, right] - table[top, right] - table[bottom, left] + table[top, left]
    in_frame = (left < right) & (top < bottom)
    return np.asarray(in_frame & (inside == 0) & (l11 >= MIN_FACTOR) & (l22 >= MIN_FACTOR))


def _pixels(
    center: NDArray[np.float64], half_extent: NDArray[np.float64], size: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The first pixel of each interval and the one after the last, with one more on either side; of NaN all pixels."""
    with np.errstate(invalid="ignore"):
        left, right = np.floor(center - half_extent) - 1, np.ceil(center + half_extent) + 1
    first = np.fmin(np.fmax(left, 0), size).astype(np.int64)
    return first, np.fmax(np.fmin(right, size), first).astype(np.int64)
