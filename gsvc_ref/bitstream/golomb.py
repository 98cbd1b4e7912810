"""Exponential Golomb codes `eg(k)` in bulk: sizes, bits, and the reading kernel (spec.md section 3.1).

The code of v is the binary form of v + 2^k, with z zeros before it when that form has z + k + 1 bits.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_base.arrays import I8
from gsvc_ref._jit import kernel

GOLOMB_ORDERS: Final = 16
"""Orders 0..15: `golomb_order` is a `u(4)`."""

GOLOMB_LONGEST: Final = 16
"""Largest z of an `eg(k)` (R-3.1-3)."""

UNDERFLOW: Final = -1
TOO_LONG: Final = -2


def golomb_sizes(values: I8, order: ArrayLike) -> I8:
    """The bits that the codes of `values` take, 2z + 1 + k each; values and orders broadcast."""
    k = np.asarray(order, np.int64)
    _, z_k_1 = np.frexp((values + (1 << k)).astype(np.float64))  # the exponent of an exact integer is its bit length
    sizes: I8 = 2 * z_k_1.astype(np.int64) - 1 - k
    return sizes


@kernel()
def golomb_totals(values: I8) -> I8:
    """`golomb_sizes` summed over the values, for the orders 0..15: (16,) i8."""
    totals = np.zeros(GOLOMB_ORDERS, np.int64)
    for value in values:
        for k in range(GOLOMB_ORDERS):
            _, z_k_1 = math.frexp(np.float64(value + (1 << k)))
            totals[k] += 2 * z_k_1 - 1 - k
    return totals


def golomb_bits(values: I8, order: int) -> NDArray[np.uint8]:
    """The codes of `values`, one after the other, as an array of bits (u1, 0 or 1)."""
    sizes = golomb_sizes(values, order)
    ends = np.cumsum(sizes)
    place = np.repeat(ends, sizes) - 1 - np.arange(ends[-1] if len(ends) else 0)  # weight of each bit, as a power of 2
    bits: NDArray[np.uint8] = (np.repeat(values + (1 << order), sizes) >> place & 1).astype(np.uint8)
    return bits


@kernel()
def decode_golombs(data: NDArray[np.uint8], first_bit: int, order: int, values: I8) -> tuple[int, int]:
    """Read len(values) codes from `first_bit` of `data` on.

    Returns the number of codes read and the bit after the last one; or, for a code that is wrong, `UNDERFLOW` or
    `TOO_LONG` and the bit at which it starts.
    """
    bit = first_bit
    end = 8 * len(data)
    for i in range(len(values)):
        start = bit
        z = 0
        while bit < end and (data[bit >> 3] >> (7 - (bit & 7))) & 1 == 0:
            z += 1
            bit += 1
            if z > GOLOMB_LONGEST:
                return TOO_LONG, start
        if bit + 1 + z + order > end:
            return UNDERFLOW, start
        value: int | np.int64 = 0
        for _ in range(1 + z + order):
            # The bits after the z zeros are those of the value + 2^order.
            value = (value << 1) | ((np.int64(data[bit >> 3]) >> (7 - (bit & 7))) & 1)
            bit += 1
        values[i] = value - (1 << order)
    return len(values), bit
