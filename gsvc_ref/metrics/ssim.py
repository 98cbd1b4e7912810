r"""Multi-scale structural similarity (Wang, Simoncelli, Bovik 2003) of integer frames; R-11.2-2.

With the means, variances and covariance of x and y under an 11 x 11 Gaussian window of standard deviation 1.5,

.. math::
    l = \frac{2 \mu_x \mu_y + C_1}{\mu_x^2 + \mu_y^2 + C_1}, \qquad
    cs = \frac{2 \sigma_{xy} + C_2}{\sigma_x^2 + \sigma_y^2 + C_2}, \qquad
    C_1 = (0.01 \cdot peak)^2,\; C_2 = (0.03 \cdot peak)^2

and over M scales, each half the size of the one before (means of 2 x 2 samples; the last row or column of an odd size
counts twice),

.. math:: \prod_{j<M} \overline{cs_j}^{\,w_j} \cdot \overline{l_M\, cs_M}^{\,w_M}

where a bar is the mean over all places at which the window lies inside the picture. What the paper of 2003 leaves open:

- **Colour**: each of R, G, B by itself, then the mean of the three, as papers on learned codecs do on RGB.
- **Negative means** (structure that is inverted on the whole) count as 0: their fractional power does not exist.
- **Small frames**: as many scales as leave at least 11 samples on the shorter side, with the first weights divided by
  their sum. Five scales need 161 samples. A value over fewer scales is not comparable with one over five:
  :func:`ms_ssim_scales` gives the number.
- **Frames with a side under 11** have one scale; the window shrinks to the side's length.

Moments are computed of p = x + y and m = x - y, because 2 cov = (var p - var m)/2 and var x + var y =
(var p + var m)/2: four filters instead of five, and exactly 1 for identical pictures.
"""

from typing import Final

import numpy as np

from gsvc_base.arrays import F8, Frame
from gsvc_ref._jit import kernel
from gsvc_ref.metrics.squared_error import check_pair

SCALE_WEIGHTS: Final = (0.0448, 0.2856, 0.3001, 0.2363, 0.1333)
"""Exponents of the five scales, from the finest to the coarsest; Wang et al. 2003, section 3.2."""

WINDOW_SIZE: Final = 11
"""Side of the Gaussian window in samples; Wang et al. 2004, section III-B."""

WINDOW_DEVIATION: Final = 1.5
"""Standard deviation of the window in samples; Wang et al. 2004, section III-B."""

LUMINANCE_K: Final = 0.01
"""C_1 = (LUMINANCE_K peak)^2; Wang et al. 2004, section III-B."""

STRUCTURE_K: Final = 0.03
"""C_2 = (STRUCTURE_K peak)^2; Wang et al. 2004, section III-B."""


def ms_ssim_scales(height: int, width: int) -> int:
    """The number of scales of a frame of this size, 1 to 5: each but the first has sides of at least 11 samples."""
    side = min(height, width)
    scales = 1
    while scales < len(SCALE_WEIGHTS) and (side := (side + 1) // 2) >= WINDOW_SIZE:
        scales += 1
    return scales


def ms_ssim(a: Frame, b: Frame, peak: int) -> float:
    """Multi-scale structural similarity in 0..1, the mean over R, G and B; 1 exactly for identical frames.

    Parameters
    ----------
    a, b
        (H, W, 3) u1 or u2 frames of one size; any size, see the module's text for small ones.
    peak
        Largest sample value, 2^bit_depth - 1.

    Raises
    ------
    UsageError
        The frames do not fit each other or the peak.
    """
    check_pair(a, b, peak)
    channels = (_ms_ssim_of_plane(a[..., c].astype(np.float64), b[..., c].astype(np.float64), peak) for c in range(3))
    return sum(channels) / 3


def _ms_ssim_of_plane(x: F8, y: F8, peak: int) -> float:
    """MS-SSIM of two (H, W) f8 planes."""
    scales = ms_ssim_scales(*x.shape)
    weights = np.array(SCALE_WEIGHTS[:scales]) / sum(SCALE_WEIGHTS[:scales])
    similarity = 1.0
    for scale, weight in enumerate(weights):
        vertical, horizontal = (gaussian_window(min(WINDOW_SIZE, side)) for side in x.shape)
        c1, c2 = (LUMINANCE_K * peak) ** 2, (STRUCTURE_K * peak) ** 2
        ssim, contrast_structure = mean_similarity(x, y, vertical, horizontal, c1, c2)
        last = scale == scales - 1
        similarity *= max(ssim if last else contrast_structure, 0.0) ** float(weight)  # (11-7)
        if not last:
            x, y = halve(x), halve(y)
    return similarity


def gaussian_window(size: int) -> F8:
    """(size,) f8 samples of a centred Gaussian of standard deviation 1.5 samples, with sum 1."""
    offsets = np.arange(size) - (size - 1) / 2
    window = np.exp(-(offsets**2) / (2 * WINDOW_DEVIATION**2))
    return np.asarray(window / window.sum())


def halve(plane: F8) -> F8:
    """Means of 2 x 2 samples of an (H, W) plane; the last row or column of an odd size counts twice."""
    height, width = plane.shape
    even = np.pad(plane, ((0, height % 2), (0, width % 2)), mode="edge")
    return np.asarray((even[0::2, 0::2] + even[1::2, 0::2] + even[0::2, 1::2] + even[1::2, 1::2]) / 4)


@kernel(contract=True)
def mean_similarity(x: F8, y: F8, vertical: F8, horizontal: F8, c1: float, c2: float) -> tuple[float, float]:
    """Means of l * cs and of cs over all places where the window lies inside two (H, W) f8 planes.

    Computed row by row, so that the moments stay in the processor's cache.
    """
    height, width = x.shape
    taps = len(horizontal)
    rows, columns = height - len(vertical) + 1, width - taps + 1
    moments = np.empty((4, width))  # (4, W) f8: p, m, p^2, m^2 filtered vertically
    filtered = np.empty((4, columns))  # (4, W - taps + 1) f8: filtered both ways
    sum_ssim, sum_contrast_structure = 0.0, 0.0
    for row in range(rows):
        moments[:] = 0.0
        for tap in range(len(vertical)):
            weight = vertical[tap]
            for column in range(width):
                plus = x[row + tap, column] + y[row + tap, column]
                minus = x[row + tap, column] - y[row + tap, column]
                moments[0, column] += weight * plus
                moments[1, column] += weight * minus
                moments[2, column] += weight * (plus * plus)
                moments[3, column] += weight * (minus * minus)
        filtered[:] = 0.0
        for moment in range(4):
            for tap in range(taps):
                weight = horizontal[tap]
                for column in range(columns):
                    filtered[moment, column] += weight * moments[moment, column + tap]
        for column in range(columns):
            # Of p = x + y and m = x - y: mu_x mu_y = (square_plus - square_minus) / 4, and so for the rest.
            square_plus = filtered[0, column] ** 2
            square_minus = filtered[1, column] ** 2
            variance_plus = filtered[2, column] - square_plus
            variance_minus = filtered[3, column] - square_minus
            luminance = ((square_plus - square_minus) / 2 + c1) / ((square_plus + square_minus) / 2 + c1)  # (11-6)
            structure = ((variance_plus - variance_minus) / 2 + c2) / ((variance_plus + variance_minus) / 2 + c2)
            sum_ssim += luminance * structure
            sum_contrast_structure += structure
    return sum_ssim / (rows * columns), sum_contrast_structure / (rows * columns)
