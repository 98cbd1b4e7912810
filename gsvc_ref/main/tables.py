"""The integer tables of profile `main` (spec.md section 15.3), and the step of a quantiser."""

import math
from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_base.arrays import I8
from gsvc_base.errors import UsageError
from gsvc_ref._jit import kernel

OCTAVE: Final = 1024
"""Steps of an exponent in one octave."""

QUANTIZERS: Final = 80
"""`quantizer` is below this."""


_GUARD: Final = 128
"""Bits after the binary point with which the powers of EXP2 are found: no rounding of theirs is in doubt."""


def _nearest_exp2() -> Iterator[int]:
    """The integers nearest to 2^(15 + i/1024), i = 0 .. 1023."""
    root = 2 << _GUARD
    for _ in range(10):  # ten square roots are the root of order 1024
        root = math.isqrt(root << _GUARD)
    power = 1 << _GUARD
    for _ in range(OCTAVE):
        yield ((power << 16 >> _GUARD) + 1) >> 1
        power = power * root >> _GUARD


EXP2: Final[I8] = np.array([*_nearest_exp2()], np.int64)
"""2^(i/1024) with 15 bits after the binary point, (1024,)."""


def exp2(v: ArrayLike, bits: int) -> Any:
    """2^(v/1024) with that many bits after the binary point, rounded down (15-2); integers of any shape, |v| < 2^15."""
    exponent = np.asarray(v, np.int64)
    shift = (exponent >> 10) - 15 + bits
    mantissa = EXP2[exponent & (OCTAVE - 1)]
    return (mantissa << np.maximum(shift, 0)) >> np.minimum(np.maximum(-shift, 0), 62)


@kernel(inline=True)
def power_of_two(v: int) -> float:
    """2^(v/1024) by the table, |v| < 2^15: 16 bits, so that it is exact in binary32 as well."""
    return math.ldexp(np.float64(EXP2[v & (OCTAVE - 1)]), int(v >> 10) - 15)


def _distribution(lower: NDArray[np.int64]) -> I8:
    return np.concatenate([[0], lower, 2**16 - lower[-2::-1], [2**16]]).astype(np.int64)


TAIL: Final[I8] = exp2(96 * (128 - np.arange(1, 129)), 15)
"""2^(x log2 e) for x = 8 to 1/16 in sixteenths, with 15 bits after the binary point: e^x of (15-3)."""

LOGISTIC: Final[I8] = _distribution(2**31 // (2**15 + TAIL))
LAPLACE: Final[I8] = _distribution(2**30 // TAIL)
"""The logistic and the Laplace distribution function in 2^-16, (257,) each, a sixteenth of a scale apart (15-3)."""

STEPS: Final = tuple(int(EXP2[128 * (q % 8)] << (q // 8)) >> 12 for q in range(QUANTIZERS))


def step_of(quantizer: int) -> int:
    """D in 1/16 of a unit of n (15-4), of a quantizer in 0..79."""
    if not 0 <= quantizer < QUANTIZERS:
        raise UsageError(f"quantizer is {quantizer}; it must be in 0..{QUANTIZERS - 1}")
    return STEPS[quantizer]
