"""The operation of metrics."""

from collections.abc import Mapping
from fractions import Fraction
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.exact.expansions import certain, exact, rational
from gsvc_base.exact.running_error import COMPONENTS
from gsvc_base.rendering.error_models import EPS, additions, gamma
from gsvc_conformance.elementary import log
from gsvc_conformance.expectations import Bounded, Expectation
from gsvc_conformance.operation import Values, operation
from gsvc_conformance.operations.exact_ssim import ms_ssim_and_condition

Frame = NDArray[np.unsignedinteger[Any]]

MS_SSIM_LIMIT: Final = (1e-5, 4 * EPS)
"""Maximum error of MS-SSIM, in all and per unit of its condition: a quality limit, measured, not derived (13.6).

The variances are differences of moments, whose errors (11-6) divides by var x + var y + C2. The *condition* of a scale
is the mean of (E[x^2] + E[y^2]) / (var x + var y + C2); that of MS-SSIM is the sum of w condition / factor over the
scales, times MS-SSIM. A derived bound would have gamma of 121 terms times it, where roundings mostly cancel. Four
binary32 variants, with moments of x and y or of their sum and difference, on 0..peak or 0..1, windows in one pass or
two, stay within a sixth of this limit in all vectors (`tests/conformance/test_metrics_oracles.py`).
"""


LN_10: Final = 2.302585092994046
LOG10_2: Final = 0.3010299956639812
"""In bounds."""


def metrics_oracle(a: Frame, b: Frame, bit_depth: int) -> Mapping[str, Expectation]:
    """The exact MSE, and its error in binary32 carried into the logarithm; equal frames have an infinite PSNR.

    A term of the MSE has two roundings, four more where samples are brought to 0..1 and back, the sum of n any sane
    order (13-4), the mean 3.5 eps: gamma of D + 11. PSNR may be off by 10 / ln 10 times that, and by the logarithms of
    the peak and the MSE, each of which may lose 4 eps of its value and, near 1, 4 eps of an octave. For MS-SSIM see
    `MS_SSIM_LIMIT`.
    """
    peak = 2**bit_depth - 1
    differences, counts = np.unique(abs(a.astype(np.int64) - b.astype(np.int64)), return_counts=True)
    squares = sum(d * d * n for d, n in zip(differences.tolist(), counts.tolist(), strict=True))  # of integers
    mse = Fraction(squares, a.size)
    relative = float(gamma(additions(a.size, *a.shape[:2]) + 11))
    similarity, condition = ms_ssim_and_condition(a, b, peak)
    return {
        "mse": Bounded(np.array(float(mse)), np.array(relative * float(mse)), "<f8"),
        "psnr": _psnr(mse, peak, relative),
        "ms_ssim": Bounded(np.array(similarity), np.array(MS_SSIM_LIMIT[0] + MS_SSIM_LIMIT[1] * condition), "<f8"),
    }


def _psnr(mse: Fraction, peak: int, relative: float) -> Bounded:
    if mse == 0:
        return Bounded(np.array(np.inf), np.array(0.0), "<f8")
    ten = exact(10.0, COMPONENTS)
    of_peak, of_mse = (ten * log(rational(number, COMPONENTS)) / log(ten) for number in (Fraction(peak**2), mse))
    of_logarithms = 4 * EPS * (abs(of_peak.near) + abs(of_mse.near) + 2 * 10 * LOG10_2)
    bound = 10 / LN_10 * 1.01 * relative + of_logarithms
    return Bounded(np.asarray(certain(of_peak - of_mse)), np.asarray(bound), "<f8")


@operation(
    "metrics",
    inputs="a: u1|u2 (H, W, 3); b: u1|u2 (H, W, 3); bit_depth: int",
    outputs="mse: f8 (); psnr: f8 (); ms_ssim: f8 ()",
    equations=("11-5", "11-6", "11-7"),
    rules=("R-11.2-1", "R-11.2-2"),
    oracle=metrics_oracle,
)
def metrics(a: Frame, b: Frame, bit_depth: int) -> Values:
    """How far two frames are apart: mean squared error, PSNR and MS-SSIM."""
    from gsvc_ref import metrics as gsvc_metrics

    peak = 2**bit_depth - 1
    return {
        "mse": np.array(gsvc_metrics.mse(a, b, peak)),
        "psnr": np.array(gsvc_metrics.psnr(a, b, peak)),
        "ms_ssim": np.array(gsvc_metrics.ms_ssim(a, b, peak)),
    }
