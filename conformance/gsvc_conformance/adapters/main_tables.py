"""The tables of profile `main` (spec.md 15.3), for adapters that have kernels for it."""

import math
from functools import cache
from typing import Final

OCTAVE: Final = 1024
ALPHAS: Final = (1, 2, 3, 4, 6, 10, 20, 100)
"""α by `halving_code`."""
MAX_TABLED: Final = 15
HALF_TABLE: Final = 17
"""Splats of the largest part that has a table, and the numbers of a table."""


def _nearest_exp2(i: int) -> int:
    """The integer nearest to 2^(15 + i/1024)."""
    power = 1 << (16 * OCTAVE + i)
    for _ in range(10):
        power = math.isqrt(power)
    return (power + 1) >> 1


@cache
def exp2_table() -> tuple[int, ...]:
    """EXP2."""
    return tuple(_nearest_exp2(i) for i in range(OCTAVE))


def step_of(quantizer: int) -> int:
    """D in 1/16 (15-4)."""
    return exp2_table()[128 * (quantizer % 8)] << (quantizer // 8) >> 12


@cache
def families() -> tuple[tuple[int, ...], tuple[int, ...]]:
    """LOGISTIC and LAPLACE, (15-3)."""
    falling = [96 * (128 - i) for i in range(1, 129)]
    tail = [exp2_table()[v % OCTAVE] << v // OCTAVE for v in falling]
    logistic, laplace = [2**31 // (2**15 + t) for t in tail], [2**30 // t for t in tail]
    return _distribution(logistic), _distribution(laplace)


def _distribution(lower: list[int]) -> tuple[int, ...]:
    """257 values from those at 1 to 128."""
    return (0, *lower, *(2**16 - value for value in lower[-2::-1]), 2**16)


@cache
def halves() -> tuple[int, ...]:
    """C of (15-8) for each α and each n up to 15, 17 numbers each, of which those after C[n + 1] are 0."""
    return tuple(number for alpha in ALPHAS for n in range(1, MAX_TABLED + 1) for number in _half_table(n, alpha))


def _half_table(n: int, alpha: int) -> list[int]:
    w = [2**16]
    for i in range(n // 2):
        w.append(w[i] * (n - i) * (i + alpha) // ((i + 1) * (n - i - 1 + alpha)))
    w = [w[min(i, n - i)] for i in range(n + 1)]
    inner = [i + (2**14 - n - 1) * sum(w[:i]) // sum(w) for i in range(n + 1)]
    return [*inner, 2**14, *[0] * (HALF_TABLE - n - 2)]
