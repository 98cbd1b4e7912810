"""Polynomials for exp(-s/2) of any degree and range, fitted when they are asked for."""

import math
from functools import cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_ref.constants import LN_255

RANGE: Final = {32: LN_255 / 8, 64: LN_255 / 32}
"""Largest argument of the polynomial by the bits of the arithmetic; squarings bring sigma into it.

In binary32 three squarings reach ln 255, as in `gsvc_ref.rendering.fast.exponential`; in binary64 five let a
polynomial of degree 9 be exact to the last bits."""

POINTS: Final = 400
LAWSON_STEPS: Final = 200


def squarings(support_sigma: float, bits: int) -> int:
    """How often the polynomial is squared, so that its argument stays within RANGE."""
    return max(0, math.ceil(math.log2(support_sigma / RANGE[bits]) - 1e-9))


@cache
def coefficients(degree: int, support_sigma: float, bits: int) -> tuple[float, ...]:
    """The coefficients c_0 = 1, c_1, ... of p, with p(s)^m ~ exp(-s/2) for 0 <= s <= 2 support_sigma, m = 2^squarings.

    Among those with p(0) = 1 it has the smallest largest error of p^m, since that is what a picture shows. With
    x = s / (2 m) in 0..b, the error of p^m is, to first order, m exp(-(m - 1) x) times that of p = 1 - x + x r(x). The
    polynomial r comes from Lawson's iteration: least squares whose weights are multiplied by the errors they leave.

    Parameters
    ----------
    degree
        Of p, at least 1.
    support_sigma
        The largest sigma = s/2.
    bits
        32 or 64, of the arithmetic that will evaluate it.
    """
    m = 2.0 ** squarings(support_sigma, bits)
    b = support_sigma / m
    x = b / 2 * (1 - np.cos(np.pi * (np.arange(POINTS) + 0.5) / POINTS))  # (POINTS,) f8, Chebyshev points
    seen = x * np.exp(-(m - 1) * x)
    wanted = (np.expm1(-x) + x) / x
    basis = (x[:, None] / b) ** np.arange(degree)  # (POINTS, degree) f8
    weights = np.ones(POINTS)
    smallest = math.inf
    for _ in range(LAWSON_STEPS):
        root = np.sqrt(weights)[:, None]
        trial = np.linalg.lstsq(root * seen[:, None] * basis, root[:, 0] * seen * wanted, rcond=None)[0]
        errors = seen * np.abs(basis @ trial - wanted)
        if errors.max() < smallest:
            r: NDArray[np.floating[Any]] = trial
            smallest = errors.max()
        weights *= errors
        weights /= weights.sum()
    powers = r / b ** np.arange(degree)
    powers[0] -= 1
    return (1.0, *(float(c) / (2 * m) ** (k + 1) for k, c in enumerate(powers)))
