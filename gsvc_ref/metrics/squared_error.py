"""Mean squared error and PSNR of integer frames (R-11.2-1), exact up to the last division and logarithm."""

import math

import numpy as np

from gsvc_ref.errors import UsageError
from gsvc_ref.metrics.frames import Frame, check_pair


def mse(a: Frame, b: Frame, peak: int) -> float:
    """Mean over all pixels and the three channels of (a - b)^2, in squared sample steps; the sum is exact.

    Parameters
    ----------
    a, b
        (H, W, 3) u1 or u2 frames of one size.
    peak
        Largest sample value, 2^bit_depth - 1; only checked here.

    Raises
    ------
    UsageError
        The frames do not fit each other or the peak.
    """
    check_pair(a, b, peak)
    difference = np.subtract(a, b, dtype=np.int32 if peak <= 0xFF else np.int64)  # (H, W, 3) i4 or i8
    np.square(difference, out=difference)
    return float(difference.sum(dtype=np.int64)) / difference.size  # (11-5)


def psnr_from_mse(mean_squared_error: float, peak: int) -> float:
    """10 log10(peak^2 / MSE) in dB; infinite for an error of zero.

    Raises
    ------
    UsageError
        The error is negative or not a number.
    """
    if not mean_squared_error >= 0:
        raise UsageError(f"the mean squared error is {mean_squared_error}; it must be 0 or more")
    if mean_squared_error == 0:
        return math.inf
    return 20 * math.log10(peak) - 10 * math.log10(mean_squared_error)  # (11-5)


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
