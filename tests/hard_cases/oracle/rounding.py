"""Rounding in 60 digits: to whole numbers, to binary32 and to binary16, a tie going to the even one."""

from typing import Any

from mpmath import floor, frexp, ldexp


def nearest(value: Any) -> Any:
    """The nearest integer."""
    below = floor(value)
    twice = 2 * (value - below)
    if twice == 1:
        return below + below % 2
    return below + (twice > 1)


def fl(value: Any) -> Any:
    """The nearest binary32 number of a value within its range: 24 bits, or multiples of 2^-149."""
    step = max(int(frexp(value)[1]) - 24, -149)
    return ldexp(nearest(ldexp(value, -step)), step)
