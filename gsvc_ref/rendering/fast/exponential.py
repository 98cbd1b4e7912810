"""exp(-m/2) on the covered range, as a polynomial and three squarings: no branch and no bit trick, so it vectorises."""

from typing import Final

import numpy as np

from gsvc_base.constants import ONE
from gsvc_ref._jit import kernel, without_contraction

K1: Final = np.float32(float.fromhex("-0x1.ffffc8p-5"))
K2: Final = np.float32(float.fromhex("0x1.fff2fp-10"))
K3: Final = np.float32(float.fromhex("-0x1.547a8p-15"))
K4: Final = np.float32(float.fromhex("0x1.498f3ep-21"))
K5: Final = np.float32(float.fromhex("-0x1.908c68p-28"))
"""p(m) ~ exp(-m/16) on 0 <= m <= 2 ln 255: the quintic with p(0) = 1 whose relative error after three squarings, over
0.3 + m/2, has the smallest maximum; found by linear programming on 4001 Chebyshev points, then rounded to binary32.
They are k1 to k5 of (9-5)."""


@kernel(contract=True, inline=True)
def exp_minus_half(m: np.float32) -> np.float32:
    """Evaluate exp(-m/2) in binary32 for 0 <= m <= 2 ln 255, with exp_minus_half(0) = 1: the weight g of (9-5).

    p(m)^8 with p(m) ~ exp(-m/16). With m/2 = sigma, the relative error is below 2^-23 (4.5 + 2.2 m), with or without
    fused multiply-adds (every binary32 m from 2^-14 to the edge was tried). That is more than the 2^-23 (3 + m) that
    the error model of `bounds` gives to exp, and less than what rounding to nearest, 2^-24, leaves over of its other
    terms: at least half of n + 3 for the sum and half of 6 m for sigma, in all 2^-23 (5 + 4 m).

    The powers inside the bracket are summed two by two (Estrin), since a shorter chain of dependent operations is worth
    one more multiplication; the last step is Horner's, so that p, near 1, is rounded only once.
    """
    t = m * m
    p = ((K5 * t + (K4 * m + K3)) * t + (K2 * m + K1)) * m + ONE  # Estrin up to K2, then Horner
    h = p * p
    q = h * h
    return q * q


exp_minus_half_strict = without_contraction(exp_minus_half)
"""The same with every operation rounded, in the order as written: that of spec.md (9-5)."""
