"""MSE, PSNR and MS-SSIM in 60 digits, from (11-5) to (11-7); variances are means of squared deviations."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from mpmath import exp, inf, log10, mpf
from numpy.typing import NDArray

from tests.hard_cases.measuring import Objects, Truth, exactly, precise

Frame = NDArray[np.unsignedinteger[Any]]


@precise
def metrics(a: Frame, b: Frame, bit_depth: int) -> Mapping[str, Truth]:
    """All three."""
    peak = 2**bit_depth - 1
    squares = sum((int(p) - int(q)) ** 2 for p, q in zip(a.flat, b.flat, strict=True))
    mse = mpf(squares) / a.size
    psnr = 10 * log10(peak**2 / mse) if squares else inf
    wide_a, wide_b = exactly(a), exactly(b)
    similarity = sum(_ms_ssim(wide_a[..., c], wide_b[..., c], peak) for c in range(3)) / 3
    values = {"mse": mse, "psnr": psnr, "ms_ssim": similarity}
    return {name: Truth(np.array(value, object)) for name, value in values.items()}


def _ms_ssim(x: Objects, y: Objects, peak: int) -> mpf:
    scales = _scale_count(min(x.shape))
    weights = [mpf(w) for w in ("0.0448", "0.2856", "0.3001", "0.2363", "0.1333")[:scales]]
    product = mpf(1)
    for scale, weight in enumerate(weights, 1):
        luminance, structure = _similarities(x, y, (mpf(peak) / 100) ** 2, (3 * mpf(peak) / 100) ** 2)
        places = luminance * structure if scale == scales else structure
        mean = np.sum(places) / places.size
        product *= max(mean, mpf(0)) ** (weight / sum(weights))
        x, y = _halved(x), _halved(y)
    return product


def _scale_count(side: int) -> int:
    """M: as many scales, at most 5, as leave the shorter side 11 samples; at least one."""
    count = 1
    while count < 5 and -(-side // 2**count) >= 11:
        count += 1
    return count


def _taps(side: int) -> list[mpf]:
    n = min(side, 11)
    weights = [exp(-((i - mpf(n - 1) / 2) ** 2) / mpf("4.5")) for i in range(n)]
    return [w / sum(weights) for w in weights]


def _similarities(x: Objects, y: Objects, c1: mpf, c2: mpf) -> tuple[Objects, Objects]:
    """l and cs at all places of the window, (11-6)."""
    window = np.multiply.outer(np.array(_taps(x.shape[0]), object), np.array(_taps(x.shape[1]), object))
    rows, columns = (side - taps + 1 for side, taps in zip(x.shape, window.shape, strict=True))
    luminance, structure = np.empty((2, rows, columns), object)
    for j, i in np.ndindex(rows, columns):
        at_x, at_y = (plane[j : j + window.shape[0], i : i + window.shape[1]] for plane in (x, y))
        mean_x, mean_y = np.sum(window * at_x), np.sum(window * at_y)
        of_x, of_y = at_x - mean_x, at_y - mean_y
        covariance, variances = np.sum(window * of_x * of_y), np.sum(window * (of_x**2 + of_y**2))
        luminance[j, i] = (2 * mean_x * mean_y + c1) / (mean_x**2 + mean_y**2 + c1)
        structure[j, i] = (2 * covariance + c2) / (variances + c2)
    return luminance, structure


def _halved(plane: Objects) -> Objects:
    """Means of 2 x 2 samples; the last row and column of an odd size count twice."""
    rows, columns = (np.minimum(np.arange(2 * -(-side // 2)), side - 1) for side in plane.shape)
    even = plane[np.ix_(rows, columns)]
    return (even[::2, ::2] + even[1::2, ::2] + even[::2, 1::2] + even[1::2, 1::2]) / 4
