"""exp, log, sin and their like with the same results on every machine, of arrays or numbers, in binary64.

A machine's mathematical library and NumPy's vector functions round the last bit each in a way of their own. Here stand
additions, multiplications, divisions and square roots of IEEE 754, rounded one by one in a stated order. Results that
must be the same everywhere, such as scenes and random draws, come from them. An array gives an array, a number a
float, NaN gives NaN.
"""

import math
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

LN2_PARTS: Final = (0.6931471803691238, 1.9082149292705877e-10)
"""ln 2 in two pieces; the product of the first by an exponent is exact."""

_HALF_PI: Final = (1.570796325802803, 9.920935739593517e-10, 5.721188726109832e-18)
"""pi / 2 in three pieces; the products of the first two by whole numbers up to 2^26 are exact."""

_EXP_SERIES: Final = tuple(1 / math.factorial(n) for n in range(14))
_SIN: Final = tuple((1, -1)[n % 2] / math.factorial(2 * n + 1) for n in range(9))
_COS: Final = tuple((1, -1)[n % 2] / math.factorial(2 * n) for n in range(9))
_LOG_SERIES: Final = tuple(2 / (2 * n + 1) for n in range(12))
_ARCTAN: Final = tuple((1, -1)[n % 2] / (2 * n + 1) for n in range(13))
_ARCTAN_STEPS: Final = 8
"""The arc tangent is a polynomial around the multiples of an eighth, whose arc tangents are known."""

_ARCTAN_OF_STEPS: Final = (
    0.0, 0.12435499454676144, 0.24497866312686414, 0.35877067027057225, 0.4636476090008061, 0.5585993153435624,
    0.6435011087932844, 0.7188299996216245, 0.7853981633974483,
)  # fmt: skip


def exp(x: ArrayLike) -> Any:
    """e^x for x < 709, within 2 units in the last place of normal numbers; 0 far below."""
    values = np.clip(np.asarray(x, np.float64), -1e4, 1e4)
    whole = np.rint(values * (1 / math.log(2)))
    rest = (values - whole * LN2_PARTS[0]) - whole * LN2_PARTS[1]
    return _as_given(np.ldexp(_polynomial(_EXP_SERIES, rest), _integers(whole).astype(np.int32)))


def log(x: ArrayLike) -> Any:
    """The natural logarithm of normal numbers x > 0, within 2^-51 or 2 units in the last place."""
    part, exponent = np.frexp(np.asarray(x, np.float64))
    low = part < math.sqrt(0.5)
    part, exponent = np.where(low, 2 * part, part), exponent - low
    ratio = (part - 1) / (part + 1)
    return _as_given(
        exponent * LN2_PARTS[0] + (ratio * _polynomial(_LOG_SERIES, ratio * ratio) + exponent * LN2_PARTS[1])
    )


def log2(x: ArrayLike) -> Any:
    """The logarithm to base 2 of normal numbers x > 0, within 2^-50 or 3 units in the last place."""
    return _as_given(np.asarray(log(x)) * (1 / math.log(2)))


def log10(x: ArrayLike) -> Any:
    """The logarithm to base 10 of normal numbers x > 0, within 2^-50 or 3 units in the last place."""
    return _as_given(np.asarray(log(x)) * (1 / math.log(10)))


def power(base: ArrayLike, exponent: ArrayLike) -> Any:
    """base^exponent = exp(exponent log(base)) for base > 0: the error grows with the logarithm of the result."""
    return exp(np.asarray(exponent, np.float64) * log(base))


def whole_power(base: float, exponent: int) -> float:
    """base^exponent for exponents from 0, by squares: exact where all of its products are."""
    result = 1.0
    while exponent:
        if exponent & 1:
            result *= base
        base, exponent = base * base, exponent >> 1
    return result


def sin(x: ArrayLike) -> Any:
    """The sine for |x| < 10^8, within 2^-51."""
    return _turned(x, 0)


def cos(x: ArrayLike) -> Any:
    """The cosine for |x| < 10^8, within 2^-51."""
    return _turned(x, 1)


def arctan2(y: ArrayLike, x: ArrayLike) -> Any:
    """The angle of the point (x, y) from the x axis, -pi to pi, within 2^-51; 0 of the point (0, 0)."""
    below, right = np.broadcast_arrays(np.asarray(y, np.float64), np.asarray(x, np.float64))
    high, wide = abs(below), abs(right)
    most = np.maximum(high, wide)
    share = np.minimum(high, wide) / np.where(most == 0, 1, most)  # 0 to 1
    step = np.rint(share * _ARCTAN_STEPS)
    near = step / _ARCTAN_STEPS
    rest = (share - near) / (1 + share * near)
    angle = np.take(_ARCTAN_OF_STEPS, _integers(step)) + rest * _polynomial(_ARCTAN, rest * rest)
    angle = np.where(high > wide, math.pi / 2 - angle, angle)
    angle = np.where(right < 0, math.pi - angle, angle)
    return _as_given(np.where(below < 0, -angle, angle))


def hypot(x: ArrayLike, y: ArrayLike) -> Any:
    """sqrt(x^2 + y^2), within 2 units in the last place where the squares neither overflow nor vanish."""
    across, down = np.asarray(x, np.float64), np.asarray(y, np.float64)
    return _as_given(np.sqrt(across * across + down * down))


def total(values: ArrayLike) -> float:
    """The sum of an array: its second half is added to its first until one number is left."""
    rest = np.asarray(values, np.float64).ravel()
    while rest.size > 1:
        half = rest.size // 2
        rest = np.concatenate([rest[:half] + rest[half : 2 * half], rest[2 * half :]])
    return float(rest[0]) if rest.size else 0.0


def _turned(x: ArrayLike, quarters: int) -> Any:
    """The sine of x plus a number of quarter turns."""
    values = np.asarray(x, np.float64)
    whole = np.rint(values * (2 / math.pi))
    rest = ((values - whole * _HALF_PI[0]) - whole * _HALF_PI[1]) - whole * _HALF_PI[2]
    quarter = (_integers(whole) + quarters) & 3
    square = rest * rest
    value = np.where(quarter & 1, _polynomial(_COS, square), rest * _polynomial(_SIN, square))
    return _as_given(np.where(quarter & 2, -value, value))


def _integers(whole: Any) -> Any:
    """Whole numbers as i8; 0 for what is none, which a machine casts as it likes."""
    return np.where(np.isfinite(whole), whole, 0).astype(np.int64)


def _polynomial(coefficients: tuple[float, ...], x: Any) -> Any:
    """The sum of c_n x^n, from the last term to the first."""
    total = np.full_like(x, coefficients[-1])
    for coefficient in coefficients[-2::-1]:
        total = total * x + coefficient
    return total


def _as_given(value: Any) -> Any:
    """A float for a number, an array as it is."""
    return float(value) if np.ndim(value) == 0 else value
