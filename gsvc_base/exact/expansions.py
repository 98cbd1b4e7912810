"""Real numbers to hundreds of bits, by operations that have the same result on every machine.

An `Expansion` is a number as the exact sum of up to `most` binary64 components, the largest first, with a radius that
covers all that was dropped: 2 components hold about 106 bits, 4 hold 212. Only IEEE 754's + - * / and sqrt of arrays,
comparisons, frexp, ldexp, nextafter and integers are used; NumPy's arrays never fuse two operations, so no bit depends
on the processor, on libm or on the number of threads.

Sums and products are split without error into a number and what it lacks (Knuth's two-sum; Dekker's product, with
Veltkamp's splitting). Components that do not fit are added to the radius, and the radius of a quotient or a root is
that of its remainder. So a number with radius 0 is exact, and what it rounds to is certain where both ends of the
interval round alike (Ziv's test). Binary32 inputs are meant: where components came near 2^996 the splitting would
overflow; what is below 2^-800 gets a radius for the underflow of its error terms.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_base.arrays import F8

COMPONENT_COUNTS: Final = (2, 4, 8)
"""Numbers of components that are tried, one after the other, until a result is certain."""

SPLITTER: Final = 2.0**27 + 1
SAFELY: Final = 1 + 2.0**-40
"""Covers the roundings of a radius."""
SMALLEST_PRODUCT: Final = 2.0**-800
ERROR_OF_UNDERFLOW: Final = 2.0**-900
"""At least what error terms of products below SMALLEST_PRODUCT may lose."""


def two_sum(a: F8, b: F8) -> tuple[F8, F8]:
    """The rounded a + b, and its error."""
    total = a + b
    # Knuth: exact in binary64 for any a and b.
    of_b = total - a
    return total, (a - (total - of_b)) + (b - of_b)


def two_product(a: F8, b: F8) -> tuple[F8, F8]:
    """The rounded a b, and its error."""
    product = a * b
    (a_high, a_low), (b_high, b_low) = _split(a), _split(b)
    return product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low


def _split(a: F8) -> tuple[F8, F8]:
    wide = SPLITTER * a
    high = wide - (wide - a)
    return high, a - high


@dataclass(frozen=True, eq=False)
class Expansion:
    """Real numbers, each within `radius` of the sum of its components."""

    parts: F8  # (k, ...) with k <= most, the largest first
    radius: F8  # (...)
    most: int  # components that results keep; of two operands the smaller number

    __array_ufunc__ = None  # so that array * Expansion asks Expansion

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of the numbers."""
        return self.radius.shape

    @property
    def near(self) -> F8:
        """The numbers to about 53 bits; see `rounded`."""
        return np.asarray(self.parts[0])

    @property
    def is_exact(self) -> NDArray[np.bool_]:
        """Where the number is its first component."""
        return np.asarray((self.radius == 0) & np.all(self.parts[1:] == 0, axis=0))

    def __getitem__(self, place: Any) -> "Expansion":
        within = place if isinstance(place, tuple) else (place,)
        return Expansion(self.parts[(slice(None), *within)], self.radius[place], self.most)

    def __neg__(self) -> "Expansion":
        return Expansion(-self.parts, self.radius, self.most)

    def __abs__(self) -> "Expansion":
        return Expansion(np.where(self.near < 0, -self.parts, self.parts), self.radius, self.most)

    def __add__(self, other: "Expansion") -> "Expansion":
        a, b = _alike(self, other)
        parts = np.concatenate([np.broadcast_to(n.parts, (len(n.parts), *_shape(a, b))) for n in (a, b)])
        return _collected(parts, a.radius + b.radius, min(a.most, b.most))

    def __sub__(self, other: "Expansion") -> "Expansion":
        return self + -other

    def __mul__(self, other: "Expansion") -> "Expansion":
        a, b = _alike(self, other)
        most = min(a.most, b.most)
        whole, last, left = _pairs(len(a.parts), len(b.parts), most)  # with their errors; without; in the radius alone
        high, low = two_product(a.parts[whole[0]], b.parts[whole[1]])
        last_parts = a.parts[last[0]] * b.parts[last[1]]
        radius = (_size(a) * b.radius + _size(b) * a.radius) + a.radius * b.radius
        radius = radius + 2.0**-52 * _summed(abs(last_parts)) + _summed(abs(a.parts[left[0]] * b.parts[left[1]]))
        tiny = (abs(high[0]) < SMALLEST_PRODUCT) & (a.parts[0] != 0) & (b.parts[0] != 0)
        radius = SAFELY * radius + np.where(tiny, ERROR_OF_UNDERFLOW, 0.0)
        return _collected(np.concatenate([high, low, last_parts]), radius, most)

    def __truediv__(self, other: "Expansion") -> "Expansion":
        """A quotient digit by digit; division by 0 has an infinite radius."""
        most = min(self.most, other.most)
        zero = other.near == 0
        by = Expansion(np.where(zero, 1.0, other.parts), other.radius, most)
        rest, digits = self.to(most), []
        for _ in range(most):
            digits.append(rest.near / by.near)
            rest = rest - by * exact(digits[-1])
        least = np.maximum(_least(other), 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            radius = np.where(least > 0, SAFELY * _most(rest) / least, np.inf)
        return _collected(np.stack(digits), radius, most)

    def sqrt(self) -> "Expansion":
        """The root of numbers that are at least 0."""
        first = np.sqrt(self.near)
        twice = np.where(first > 0, 2 * first, 1.0)
        root = exact(first, self.most)
        for _ in range(self.most - 1):
            root = root + exact((self - root * root).near / twice)
        radius = SAFELY * SAFELY * _most(self - root * root) * 2 / twice  # |a - r^2| = |sqrt(a) - r| (sqrt(a) + r)
        return Expansion(root.parts, np.where(first > 0, radius, SAFELY * np.sqrt(_most(self))), self.most)

    def to(self, most: int) -> "Expansion":
        """These numbers with another number of components."""
        return Expansion(self.parts[:most], SAFELY * (self.radius + _summed(abs(self.parts[most:]))), most)

    def scaled(self, exponent: ArrayLike) -> "Expansion":
        """These numbers times 2^exponent."""
        return Expansion(np.ldexp(self.parts, exponent), np.ldexp(self.radius, exponent), self.most)

    def moved(self, axis: int) -> "Expansion":
        """These numbers with an axis (0, 1, ..) as the first."""
        return Expansion(np.moveaxis(self.parts, axis + 1, 1), np.moveaxis(self.radius, axis, 0), self.most)

    def reshape(self, *shape: int) -> "Expansion":
        """These numbers in another shape."""
        return Expansion(self.parts.reshape(len(self.parts), *shape), self.radius.reshape(*shape), self.most)

    def broadcast(self, shape: tuple[int, ...]) -> "Expansion":
        """These numbers repeated to a shape."""
        parts = _alike(self, exact(np.zeros(shape)))[0].parts
        return Expansion(np.broadcast_to(parts, (len(parts), *shape)), np.broadcast_to(self.radius, shape), self.most)

    def total(self, axis: int = 0) -> "Expansion":
        """The sum along an axis, by halves."""
        number = self.moved(axis)
        while (count := number.shape[0]) > 1:
            half = count // 2
            folded = number[:half] + number[half : 2 * half]
            number = joined(folded, number[2 * half :]) if count % 2 else folded
        return number[0] if count else exact(np.zeros(number.shape[1:]), self.most)

    def totals(self, keys: NDArray[np.int64], count: int) -> "Expansion":
        """The sums (count, ...) of the rows whose ascending key is 0, 1, .. count - 1, by pairs of neighbours."""
        number = self
        while True:
            rank = np.arange(len(keys)) - np.searchsorted(keys, keys)
            odd = np.flatnonzero(rank % 2)
            if not odd.size:
                break
            even = np.flatnonzero(rank % 2 == 0)
            alone = number[even]
            at = np.searchsorted(even, odd - 1)
            pairs = number[odd - 1] + number[odd]
            parts = np.zeros((max(len(alone.parts), len(pairs.parts)), *alone.shape))
            parts[: len(alone.parts)] = alone.parts
            parts[:, at] = 0
            parts[: len(pairs.parts), at] = pairs.parts
            radius = alone.radius.copy()
            radius[at] = pairs.radius
            number, keys = Expansion(parts, radius, self.most), keys[even]
        parts, radius = np.zeros((len(number.parts), count, *self.shape[1:])), np.zeros((count, *self.shape[1:]))
        parts[:, keys], radius[keys] = number.parts, number.radius
        return Expansion(parts, radius, self.most)

    def raised(self, exponents: NDArray[np.int64]) -> "Expansion":
        """Integer powers >= 0, by squaring."""
        result, square, left = exact(np.ones(self.shape), self.most), self, np.asarray(exponents)
        while left.any():
            result = where(left % 2 == 1, result * square, result)
            left = left // 2
            square = square * square
        return result

    def sign(self) -> F8:
        """1, 0 or -1, and NaN where the radius leaves that open."""
        value = self.near
        return np.where(abs(value) > 2 * self.radius, np.sign(value), np.where(self.radius == 0, 0.0, np.nan))

    def rint(self) -> F8:
        """The nearest integers below 2^52, ties to even; NaN where the radius leaves that open."""
        below = np.floor(self.near)
        side = (self - exact(below + 0.5)).sign()
        return np.where(side == 0, np.rint(below + 0.5), np.where(np.isnan(side), np.nan, below + (side > 0)))

    def odd(self) -> F8:
        """The numbers rounded to odd, so that rounding them again to fewer bits is rounding once."""
        rest = np.zeros(self.shape)
        for part in self.parts[::-1]:
            rest = _odd_sum(part, rest)
        return rest

    def rounded(self) -> tuple[F8, NDArray[np.bool_]]:
        """The numbers rounded once to binary64, and where that is certain."""
        ends = []
        for end in (-self.radius, self.radius):
            rest = end
            for part in self.parts[:0:-1]:
                rest = _odd_sum(part, rest)
            ends.append(self.near + rest)
        return ends[0], np.asarray(ends[0] == ends[1])

    def is_noise(self) -> NDArray[np.bool_]:
        """Where the number may be 0."""
        return np.asarray(abs(self.near) <= 2 * self.radius)


def exact(values: ArrayLike, most: int = COMPONENT_COUNTS[-1]) -> Expansion:
    """Numbers of binary64 as they are; `most` limits what is computed of them."""
    wide = np.asarray(values, np.float64)
    return Expansion(wide[None], np.zeros(wide.shape), most)


def rational(values: Fraction, most: int) -> Expansion:
    """A rational number; a float of a fraction is rounded correctly."""
    parts = []
    for _ in range(most):
        parts.append(float(values))
        values -= Fraction(parts[-1])
    return Expansion(np.array(parts), np.array(abs(float(values)) * SAFELY), most)


def where(condition: NDArray[np.bool_], a: Expansion, b: Expansion) -> Expansion:
    """The numbers of `a` where the condition holds, else those of `b`."""
    a, b = _alike(a, b)
    count = max(len(a.parts), len(b.parts))
    parts = np.where(condition, _padded(a.parts, count), _padded(b.parts, count))
    return Expansion(parts, np.where(condition, a.radius, b.radius), min(a.most, b.most))


def joined(*numbers: Expansion, axis: int = 0) -> Expansion:
    """Numbers one after the other along an axis."""
    count = max(len(number.parts) for number in numbers)
    parts = np.concatenate([_padded(number.parts, count) for number in numbers], axis=axis + 1)
    return Expansion(parts, np.concatenate([n.radius for n in numbers], axis=axis), min(n.most for n in numbers))


def settled(evaluate: Callable[[int, NDArray[np.int64]], tuple[Expansion, ...]], rows: int) -> tuple[F8, ...]:
    """Results rounded once to binary64: rows of which one is not certain are evaluated again with more components.

    `evaluate` returns results (n, ...) for a number of components and n of the rows. A number that even the most
    components cannot tell from 0 is 0: the terms of its sum cancel to more than 400 bits of the largest one, as those
    of symmetric inputs do. Another one that is not certain then is an ArithmeticError.
    """
    at = np.arange(rows)
    results: list[F8] = []
    for most in COMPONENT_COUNTS:
        uncertain = np.zeros(len(at), np.bool_)
        for place, number in enumerate(evaluate(most, at)):
            value, certain = number.rounded()
            if most == COMPONENT_COUNTS[-1]:
                value, certain = np.where(number.is_noise(), 0.0, value), certain | number.is_noise()
            if len(results) == place:
                results.append(np.zeros((rows, *number.shape[1:])))
            results[place][at] = value
            uncertain |= ~certain.reshape(len(at), -1).all(axis=1)
        at = at[uncertain]
        if not at.size:
            return tuple(results)
    raise ArithmeticError(f"{len(at)} results are not certain with {COMPONENT_COUNTS[-1]} components")


def certain(number: Expansion) -> F8:
    """A number rounded once to binary64; 0 where it cannot be told from 0.

    Too few components for the rounding are an ArithmeticError.
    """
    value, sure = number.rounded()
    noise = number.is_noise()
    if not (sure | noise).all():
        raise ArithmeticError(f"a result is not certain with {number.most} components")
    return np.where(noise, 0.0, value)


def sums_of(terms: Callable[[slice], Expansion], keys: NDArray[np.int64], count: int) -> Expansion:
    """The sums (count, ...) of terms by their ascending keys 0, 1, .. count - 1; terms are asked for chunk by chunk."""
    sums, own = [], []
    for chunk in chunks(len(keys)):
        of_chunk, ranks = np.unique(keys[chunk], return_inverse=True)
        sums.append(terms(chunk).totals(ranks, len(of_chunk)))
        own.append(of_chunk)
    return joined(*sums).totals(np.concatenate(own), count)


def chunks(count: int, size: int = 8192) -> Iterator[slice]:
    """Slices of at most `size` that make up `count`: arrays that stay in a processor's cache."""
    return (slice(first, first + size) for first in range(0, count, size))


def _collected(parts: F8, radius: F8, most: int) -> Expansion:
    """The sum of parts in at most `most` components."""
    kept: list[F8] = []
    while len(parts) and len(kept) < most:
        errors = []
        while (count := len(parts)) > 1:
            half = count // 2
            total, error = two_sum(parts[:half], parts[half : 2 * half])
            errors.append(error)
            parts = np.concatenate([total, parts[2 * half :]]) if count % 2 else total
        kept.append(parts[0])
        parts = np.concatenate(errors) if errors else parts[:0]
        if not parts.any():
            parts = parts[:0]
    for _ in kept[1:]:  # until no component overlaps the next one
        before = list(kept)
        for i in range(len(kept) - 1, 0, -1):
            kept[i - 1], kept[i] = two_sum(kept[i - 1], kept[i])
        if all(np.array_equal(old, new) for old, new in zip(before, kept, strict=True)):
            break
    while len(kept) > 1 and not kept[-1].any():
        kept.pop()
    dropped = _summed(abs(parts)) if len(parts) else 0.0
    return Expansion(np.stack(kept), SAFELY * (radius + dropped), most)


def _odd_sum(a: F8, b: F8) -> F8:
    """A + b rounded to odd: inexact sums get a last bit of 1, so that rounding again is rounding once."""
    total, error = two_sum(a, b)
    even = total.view(np.int64) & 1 == 0
    return np.where((error != 0) & even, np.nextafter(total, np.copysign(np.inf, error)), total)


@cache
def _pairs(a: int, b: int, most: int) -> tuple[tuple[list[int], list[int]], ...]:
    """Places of components whose products are needed with their errors; without; and only as part of the radius."""
    order = sorted(((i, j) for i in range(a) for j in range(b)), key=lambda pair: (sum(pair), pair))
    groups = (
        [pair for pair in order if sum(pair) < most],
        [pair for pair in order if sum(pair) == most],
        [pair for pair in order if sum(pair) > most],
    )
    return tuple(([i for i, _ in group], [j for _, j in group]) for group in groups)


def _alike(a: Expansion, b: Expansion) -> tuple[Expansion, Expansion]:
    """Two numbers whose arrays broadcast: the one with fewer dimensions gets more."""
    dimensions = max(a.radius.ndim, b.radius.ndim)

    def lifted(n: Expansion) -> Expansion:
        ones = (1,) * (dimensions - n.radius.ndim)
        return Expansion(n.parts.reshape(len(n.parts), *ones, *n.shape), n.radius, n.most) if ones else n

    return lifted(a), lifted(b)


def _shape(a: Expansion, b: Expansion) -> tuple[int, ...]:
    return np.broadcast_shapes(a.shape, b.shape)


def _padded(parts: F8, count: int) -> F8:
    return np.concatenate([parts, np.zeros((count - len(parts), *parts.shape[1:]))]) if count > len(parts) else parts


def _summed(parts: F8) -> F8:
    """The sum of components, one after the other."""
    total = np.zeros(parts.shape[1:])
    for part in parts:
        total = total + part
    return total


def _size(number: Expansion) -> F8:
    return SAFELY * abs(number.near)


def _most(number: Expansion) -> F8:
    """At least the magnitude."""
    return _size(number) + number.radius


def _least(number: Expansion) -> F8:
    """At most the magnitude."""
    return abs(number.near) / SAFELY - number.radius
