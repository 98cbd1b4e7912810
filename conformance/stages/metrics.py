"""The stage of metrics."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from conformance.expectations import Bounded, Expectation
from conformance.stage import Values, stage
from gsvc_ref import metrics as gsvc_metrics
from gsvc_ref.rendering.bounds import EPS, gamma

F8 = NDArray[np.float64]
Frame = NDArray[np.unsignedinteger[Any]]

SCALE_WEIGHTS: Final = (0.0448, 0.2856, 0.3001, 0.2363, 0.1333)

MS_SSIM_LIMIT: Final = (1e-5, 4 * EPS)
"""How far MS-SSIM may be off, in all and per unit of its condition: a quality limit, measured and not derived (13.6).

The variances are differences of moments, whose errors (11-6) divides by var x + var y + C2. The *condition* of a scale
is the mean of (E[x^2] + E[y^2]) / (var x + var y + C2); that of MS-SSIM is the sum of w condition / factor over the
scales, times MS-SSIM. A derived bound would have gamma of 121 terms times it, where roundings mostly cancel. Four
binary32 variants, with moments of x and y or of their sum and difference, on 0..peak or 0..1, windows in one pass or
two, stay within an eighth of this limit in all vectors (`tests/conformance/test_metrics_oracles.py`).
"""


def metrics_oracle(a: Frame, b: Frame, bit_depth: int) -> Mapping[str, Expectation]:
    """The exact MSE, and its error in binary32 carried into the logarithm; equal frames have an infinite PSNR.

    A term of the MSE has two roundings, four more where samples are brought to 0..1 and back, the sum of n any order,
    the mean 3.5 eps: gamma of n + 10. PSNR may be off by 10 / ln 10 times that, and by the logarithms of the peak and
    the MSE, each of which may lose 4 eps of its value and, near 1, 4 eps of an octave. For MS-SSIM see `MS_SSIM_LIMIT`.
    """
    peak = 2**bit_depth - 1
    difference = a.astype(np.int64) - b.astype(np.int64)
    mse = int(np.sum(difference**2)) / difference.size
    relative = float(gamma(difference.size + 10))
    channels = [_ms_ssim(a[..., c].astype(np.float64), b[..., c].astype(np.float64), peak) for c in range(3)]
    similarity, condition = np.mean(channels, axis=0)
    return {
        "mse": Bounded(np.array(mse), np.array(relative * mse), "<f8"),
        "psnr": _psnr(mse, peak, relative),
        "ms_ssim": Bounded(np.array(similarity), np.array(MS_SSIM_LIMIT[0] + MS_SSIM_LIMIT[1] * condition), "<f8"),
    }


def _psnr(mse: float, peak: int, relative: float) -> Bounded:
    if mse == 0:
        return Bounded(np.array(np.inf), np.array(0.0), "<f8")
    parts = np.array([20 * np.log10(peak), -10 * np.log10(mse)])
    of_logarithms = 4 * EPS * (np.sum(abs(parts)) + 2 * 10 * np.log10(2))
    return Bounded(np.array(parts.sum()), np.array(10 / np.log(10) * 1.01 * relative + of_logarithms), "<f8")


def _ms_ssim(x: F8, y: F8, peak: int) -> tuple[float, float]:
    """MS-SSIM of two channels (H, W) f8, and its condition; variances from deviations, without a cancellation."""
    side, scales = min(x.shape), 1
    while scales < len(SCALE_WEIGHTS) and (side := -(-side // 2)) >= 11:
        scales += 1
    weights = np.array(SCALE_WEIGHTS[:scales]) / sum(SCALE_WEIGHTS[:scales])
    product, relative = 1.0, 0.0
    for scale, weight in enumerate(weights.tolist()):
        if scale:
            x, y = _halved(x), _halved(y)
        luminance, structure, condition = _similarities(x, y, (0.01 * peak) ** 2, (0.03 * peak) ** 2)
        factor = max(float((luminance * structure if scale == scales - 1 else structure).mean()), 0.0)
        if factor == 0:
            return 0.0, 0.0
        product *= factor**weight
        relative += weight * float(condition.mean()) / factor
    return product, relative * product


def _similarities(x: F8, y: F8, c1: float, c2: float) -> tuple[F8, F8, F8]:
    """The terms l and cs of all places of the window, and the condition of cs."""
    window = np.multiply.outer(*(_gaussian(min(11, size)) for size in x.shape))
    views = [sliding_window_view(plane, window.shape) for plane in (x, y)]  # (rows, columns, taps, taps) f8
    mean_x, mean_y = (np.einsum("ijkl,kl->ij", view, window) for view in views)
    of_x, of_y = (view - mean[..., None, None] for view, mean in zip(views, (mean_x, mean_y), strict=True))
    covariance = np.einsum("ijkl,ijkl,kl->ij", of_x, of_y, window)
    variances = sum(np.einsum("ijkl,kl->ij", of**2, window) for of in (of_x, of_y))
    squares = mean_x**2 + mean_y**2
    luminance = (2 * mean_x * mean_y + c1) / (squares + c1)
    return luminance, (2 * covariance + c2) / (variances + c2), (variances + squares) / (variances + c2)


def _gaussian(taps: int) -> F8:
    weights = np.exp(-((np.arange(taps) - (taps - 1) / 2) ** 2) / 4.5)
    return np.asarray(weights / weights.sum())


def _halved(plane: F8) -> F8:
    rows, columns = (np.minimum(np.arange(size + size % 2), size - 1) for size in plane.shape)
    even = plane[np.ix_(rows, columns)]
    return np.asarray(even.reshape(len(rows) // 2, 2, len(columns) // 2, 2).mean(axis=(1, 3)))


@stage(
    "metrics",
    inputs="a: u1|u2 (H, W, 3); b: u1|u2 (H, W, 3); bit_depth: int",
    outputs="mse: f8 (); psnr: f8 (); ms_ssim: f8 ()",
    equations=("11-5", "11-6", "11-7"),
    rules=("R-11.2-1", "R-11.2-2"),
    oracle=metrics_oracle,
)
def metrics(a: Frame, b: Frame, bit_depth: int) -> Values:
    """How far two frames are apart: mean squared error, PSNR and MS-SSIM."""
    peak = 2**bit_depth - 1
    return {
        "mse": np.array(gsvc_metrics.mse(a, b, peak)),
        "psnr": np.array(gsvc_metrics.psnr(a, b, peak)),
        "ms_ssim": np.array(gsvc_metrics.ms_ssim(a, b, peak)),
    }
