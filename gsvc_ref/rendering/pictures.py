"""Sums and pictures of floats to frames of integers."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_base.arrays import frame_type
from gsvc_base.checks import door
from gsvc_base.errors import UsageError
from gsvc_ref._jit import kernel
from gsvc_ref.rendering.fast.tile_pictures import rounded


# twin of spec.to_frame
@door
def to_frame(sum: ArrayLike, bit_depth: int) -> NDArray[Any]:
    """The frame of a sum: clamp to [0, 1], times the peak 2^bit_depth - 1, round half to even (R-9.1-1).

    The product is rounded to the type of the sum first, binary32 or binary64.

    Parameters
    ----------
    sum
        (H, W, 3) f4 or f8, R'G'B' with 1.0 = full scale.
    bit_depth
        8 to 16.

    Returns
    -------
    (H, W, 3) u1 for 8 bits, else u2.

    Raises
    ------
    UsageError
        The shape or the bit depth is outside these limits, or a value is NaN.
    """
    integer = frame_type(bit_depth)
    values = np.asarray(sum)
    _check_shape(values)
    if values.dtype not in (np.float32, np.float64):
        raise UsageError(f"the picture is {values.dtype}; it must be float32 or float64 with 1.0 = full scale")
    if np.isnan(values).any():
        raise UsageError("the picture has a NaN; every value must be a number")
    peak = values.dtype.type(2**bit_depth - 1)
    frame: NDArray[Any] = np.rint(np.clip(values, 0, 1) * peak).astype(integer)
    return frame


# twin of spec.to_frame_deterministic
@door
def to_frame_deterministic(sum: ArrayLike, bit_depth: int) -> NDArray[Any]:
    """The frame of a sum by (9-7), operation by operation, as decoders make it: what is not a number is black.

    Parameters
    ----------
    sum
        (H, W, 3) f4, R'G'B' with 1.0 = full scale.
    bit_depth
        8 to 16.

    Returns
    -------
    (H, W, 3) u1 for 8 bits, else u2.

    Raises
    ------
    UsageError
        The shape or the bit depth is outside these limits.
    """
    values = np.ascontiguousarray(sum, np.float32)
    _check_shape(values)
    frame: NDArray[Any] = np.empty(values.shape, frame_type(bit_depth))
    _round(values.ravel(), np.float32(2**bit_depth - 1), frame.reshape(-1))
    return frame


@kernel()
def _round(values: NDArray[np.float32], peak: np.float32, frame: Any) -> None:
    """`rounded` of each value."""
    for k in range(values.size):
        frame[k] = rounded(values[k], peak)


def _check_shape(values: NDArray[Any]) -> None:
    if values.ndim != 3 or values.shape[2] != 3:
        raise UsageError(f"the picture has shape {values.shape}; it must be (H, W, 3)")
