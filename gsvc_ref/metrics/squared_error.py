"""Mean squared error and PSNR of integer frames (R-11.2-1), exact up to the last division and logarithm."""

import math
from typing import Final

import numpy as np

from gsvc_base.arrays import Frame
from gsvc_base.checks import check_unmasked
from gsvc_base.errors import UsageError
from gsvc_base.portable import log10

MAX_PEAK: Final = 2**16 - 1


def check_pair(a: Frame, b: Frame, peak: int) -> None:
    """Refuse two frames that are not (H, W, 3) u1 or u2 of one size with values up to `peak`, 1..65535."""
    if not 1 <= peak <= MAX_PEAK:
        raise UsageError(f"peak is {peak}; it must be the largest sample value, 1..{MAX_PEAK} (8 bits: 255)")
    for name, frame in (("first", a), ("second", b)):
        check_unmasked(f"the {name} frame", frame)
        if frame.ndim != 3 or frame.shape[2] != 3 or frame.size == 0 or frame.dtype not in (np.uint8, np.uint16):
            raise UsageError(
                f"the {name} frame has shape {frame.shape} and type {frame.dtype}; "
                "it must be (H, W, 3), uint8 or uint16, not empty"
            )
        if (largest := int(frame.max())) > peak:
            raise UsageError(f"the {name} frame holds the value {largest}, above the stated peak {peak}")
    if a.shape != b.shape:
        raise UsageError(f"the frames have shapes {a.shape} and {b.shape}; they must be of one size")


def mse(a: Frame, b: Frame, peak: int) -> float:
    """Mean over all pixels and the three channels of (a - b)^2, in squared sample steps; the sum is exact."""
    check_pair(a, b, peak)
    difference = np.subtract(a, b, dtype=np.int32 if peak <= 0xFF else np.int64)  # (H, W, 3) i4 or i8
    np.square(difference, out=difference)
    return float(difference.sum(dtype=np.int64)) / difference.size  # (11-5)


def psnr_from_mse(mean_squared_error: float, peak: int) -> float:
    """10 log10(peak^2 / MSE) in dB; infinite for an error of zero."""
    if not mean_squared_error >= 0:
        raise UsageError(f"the mean squared error is {mean_squared_error}; it must be 0 or more")
    if mean_squared_error == 0:
        return math.inf
    return float(20 * log10(float(peak)) - 10 * log10(mean_squared_error))  # (11-5)


def psnr(a: Frame, b: Frame, peak: int) -> float:
    """Peak signal-to-noise ratio in dB over all pixels and channels together; infinite when the frames are identical.

    One error over R, G and B (not a mean of three ratios), on the samples that a viewer gets; paper section 4.1.

    Parameters
    ----------
    a, b
        (H, W, 3) u1 or u2 frames of one size.
    peak
        Largest sample value, 2^bit_depth - 1.

    Raises
    ------
    UsageError
        The frames do not fit each other or the peak.
    """
    return psnr_from_mse(mse(a, b, peak), peak)
