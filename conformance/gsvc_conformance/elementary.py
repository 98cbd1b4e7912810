"""Exponentials, logarithms and powers of `expansions`, by series whose remainders are part of the radius."""

from fractions import Fraction
from functools import cache
from math import factorial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.exact.expansions import Expansion, exact, rational

F8 = NDArray[np.float64]

STEPS: Final = 256
"""Steps per unit of the table of exponentials."""
CONSTANT_BITS: Final = 600
"""Bits of constants, more than PRECISIONS need."""


def exp(x: Expansion) -> Expansion:
    """e^x: x = n ln 2 + j / STEPS + r, a table of e^(j / STEPS), and a Taylor series of r."""
    n = np.rint(x.near / float(_ln2()))
    r = x.to(x.most + 1) - rational(_ln2(), x.most + 1) * exact(n, x.most + 1)
    j = np.rint(r.near * STEPS)
    r = (r - exact(j / STEPS)).to(x.most)
    terms = _terms_of_exp(x.most)
    p = rational(Fraction(1, factorial(terms)), 1)
    for k in range(terms - 1, -1, -1):
        most = x.most - min(9 * k // 53, x.most - 1)  # what is multiplied by r^k needs fewer bits, since |r| <= 2^-9
        p = p.to(most) * r.to(most) + rational(Fraction(1, factorial(k)), most)
    p = Expansion(p.parts, p.radius + 2.0 ** (-53 * x.most - 2), x.most)
    parts, radius = _exponentials(x.most)
    at = (j + STEPS // 2).astype(np.int64)
    return (p * Expansion(parts[:, at], radius[at], x.most)).scaled(n.astype(np.int64))


def log(x: Expansion) -> Expansion:
    """The natural logarithm of numbers above 0: x = 2^n m, and log m = 2 atanh((m - 1) / (m + 1)) by its series."""
    n = np.frexp(x.near * 1.5)[1] - 1  # 2/3 <= m < 4/3
    m, one = x.scaled(-n), exact(1.0, x.most)
    z = (m - one) / (m + one)  # at most 1/5
    square = z * z
    terms = x.most * 53 // 4 + 1
    p = rational(Fraction(1, 2 * terms + 1), x.most)
    for k in range(terms - 1, -1, -1):
        p = p * square + rational(Fraction(1, 2 * k + 1), x.most)
    p = Expansion(p.parts, p.radius + 2.0 ** (-4 * terms), x.most)
    return (z * p).scaled(1) + rational(_ln2(), x.most) * exact(n.astype(np.float64))


def power(x: Expansion, exponent: Expansion) -> Expansion:
    """x^exponent for numbers above 0."""
    return exp(exponent * log(x))


@cache
def _ln2() -> Fraction:
    """Ln 2 = the sum of 1 / (k 2^k), to CONSTANT_BITS bits."""
    return Fraction(sum((1 << CONSTANT_BITS) // (k << k) for k in range(1, CONSTANT_BITS)), 1 << CONSTANT_BITS)


@cache
def _terms_of_exp(most: int) -> int:
    """The last power of r, |r| <= 2^-9, that the Taylor series needs for a remainder below 2^(-53 most - 2)."""
    terms = 1
    while (factorial(terms + 1) << 9 * (terms + 1)).bit_length() < 53 * most + 4:
        terms += 1
    return terms


@cache
def _exponentials(most: int) -> tuple[F8, F8]:
    """The components and radii of e^(j / STEPS) for j = -STEPS/2 .. STEPS/2, from the Taylor series in integers."""
    parts, radii = [], []
    for j in range(-STEPS // 2, STEPS // 2 + 1):
        term = total = 1 << CONSTANT_BITS
        k = 0
        while term not in (0, -1):
            k += 1
            term = term * j // (k * STEPS)
            total += term
        number = rational(Fraction(total, 1 << CONSTANT_BITS), most)
        parts.append(number.parts)
        radii.append(number.radius)
    return np.stack(parts, axis=1), np.array(radii) + 2.0 ** (12 - CONSTANT_BITS)
