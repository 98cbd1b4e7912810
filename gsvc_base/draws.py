"""Random numbers that are the same on every machine and with every version of NumPy.

NumPy may change what its `Generator` draws from one version to the next, and its normal numbers ask the machine's
mathematical library for their tails. Data that travels by its seed (scenes, the conformance kit's cases, the random
streams of `gsvc_ref.testing`) draws from `Draws`: SplitMix64, an integer generator of four lines, and IEEE 754 binary64
operations, one at a time.
"""

import math
from collections.abc import Sequence
from typing import Any, Final, overload

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from gsvc_base.portable import exp

Size = int | tuple[int, ...]
"""The shape of what is drawn."""

_GAMMA: Final = 0x9E3779B97F4A7C15
_MIX_1: Final = 0xBF58476D1CE4E5B9
_MIX_2: Final = 0x94D049BB133111EB
_MASK: Final = (1 << 64) - 1
_MIDDLE: Final = 6 * ((1 << 32) - 1)  # of the sum of twelve numbers of 32 bits
_NORMALS_AT_ONCE: Final = 1 << 13  # normal numbers at once, whose words stay in the cache


class Draws:
    """Random numbers of a seed; the methods have the names and arguments of `numpy.random.Generator`'s.

    Word i (i = 1, 2, ...) is mix(state + i * 0x9E3779B97F4A7C15) modulo 2^64, mix being SplitMix64's; an array is
    filled in C order, so that numbers drawn at once are those drawn one by one. Of a seed of several integers from 0
    each counts, and so does their order.
    """

    def __init__(self, seed: int | Sequence[int]) -> None:
        numbers = [seed] if isinstance(seed, int) else list(seed)
        if any(number < 0 for number in numbers):
            raise ValueError(f"a seed is {min(numbers)}; it must not be negative")
        self._state = 0
        for number in numbers:
            words = [number >> shift & _MASK for shift in range(0, max(number.bit_length(), 1), 64)]
            for word in (len(words), *words):
                self._state = int(_mix(np.array([(self._state + _GAMMA ^ word) & _MASK], np.uint64))[0])

    def words(self, count: int) -> NDArray[np.uint64]:
        """The next words, (count,) u8."""
        steps = np.arange(1, count + 1, dtype=np.uint64) * np.uint64(_GAMMA)
        words = _mix(steps + np.uint64(self._state))
        self._state = (self._state + count * _GAMMA) & _MASK
        return words

    def random(self, size: Size, dtype: DTypeLike = np.float64) -> NDArray[Any]:
        """Numbers from 0 to below 1: the 53 highest bits of a word times 2^-53 (f8), or the 24 highest (f4)."""
        bits = 24 if np.dtype(dtype) == np.float32 else 53
        words = self.words(_count(size)) >> np.uint64(64 - bits)
        return np.asarray(np.ldexp(words.astype(dtype), -bits)).reshape(size)

    @overload
    def uniform(self, low: float = 0.0, high: float = 1.0, size: None = None) -> float: ...
    @overload
    def uniform(self, low: ArrayLike = 0.0, high: ArrayLike = 1.0, size: Size | None = None) -> NDArray[Any]: ...
    def uniform(self, low: Any = 0.0, high: Any = 1.0, size: Size | None = None) -> Any:
        """Numbers low + (high - low) * random(), f8; without a size one, or one for each of the limits."""
        least, most = np.asarray(low, np.float64), np.asarray(high, np.float64)
        shape = np.broadcast_shapes(least.shape, most.shape) if size is None else size
        drawn = least + (most - least) * self.random(shape)
        return drawn if np.ndim(drawn) else float(drawn)

    @overload
    def integers(self, low: int, high: int | None = ..., size: None = ..., dtype: DTypeLike = ...) -> int: ...
    @overload
    def integers(
        self, low: ArrayLike, high: ArrayLike | None = ..., size: Size | None = ..., dtype: DTypeLike = ...
    ) -> NDArray[Any]: ...
    def integers(self, low: Any, high: Any = None, size: Size | None = None, dtype: DTypeLike = np.int64) -> Any:
        """Integers from low to below high, or from 0 to below low: low + floor(w n / 2^32), w a word's 32 highest bits.

        n, how many there are to choose from, is at most 2^32; none is likelier than another by more than n / 2^32.
        """
        first, end = (0, low) if high is None else (low, high)
        least, most = np.asarray(first, np.int64), np.asarray(end, np.int64)
        many = most - least
        if np.any(many < 1) or np.any(many > 1 << 32):
            raise ValueError(f"from {least} to {most}: there must be from 1 to 2^32 integers to choose from")
        shape = np.broadcast_shapes(least.shape, most.shape) if size is None else size
        words = (self.words(_count(shape)) >> np.uint64(32)).reshape(shape)
        drawn = least + (words * many.astype(np.uint64) >> np.uint64(32)).astype(np.int64)
        return drawn.astype(dtype) if np.ndim(drawn) else int(drawn)

    def standard_normal(self, size: Size, dtype: DTypeLike = np.float64) -> NDArray[Any]:
        """Numbers of mean 0 and variance 1, nearly normal: the sum of twelve uniform ones, the halves of six words.

        The integer that the halves add up to, less 6 (2^32 - 1), times 2^-32, rounded to f4 if asked for. No number is
        beyond 6, and those beyond 3 are rarer than normal ones (0.20 % instead of 0.27 %).
        """
        drawn = np.empty(_count(size), dtype)
        for begin in range(0, len(drawn), _NORMALS_AT_ONCE):
            block = drawn[begin : begin + _NORMALS_AT_ONCE]
            words = self.words(6 * len(block))
            total = np.zeros(len(block), np.uint64)
            for half in (words >> np.uint64(32), words & np.uint64(0xFFFFFFFF)):
                for k in range(6):
                    total += half[k::6]
            block[:] = np.ldexp((total.astype(np.int64) - _MIDDLE).astype(np.float64), -32)
        return drawn.reshape(size)

    def normal(self, loc: ArrayLike = 0.0, scale: ArrayLike = 1.0, size: Size = 1) -> NDArray[Any]:
        """Numbers loc + scale * standard_normal(), f8."""
        return np.asarray(loc + np.asarray(scale, np.float64) * self.standard_normal(size))

    def lognormal(self, mean: float = 0.0, sigma: float = 1.0, size: Size = 1) -> NDArray[Any]:
        """Numbers exp(mean + sigma * standard_normal()), f8."""
        return np.asarray(exp(self.normal(mean, sigma, size)))

    def choice(self, options: ArrayLike, size: Size) -> NDArray[Any]:
        """Some of the options, each as likely; one may be drawn again."""
        values = np.asarray(options)
        return np.asarray(values[self.integers(0, len(values), size)])

    def permutation(self, count: int) -> NDArray[np.int64]:
        """0 to count - 1, sorted by as many words."""
        return np.argsort(self.words(count), kind="stable")


def _mix(words: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """SplitMix64's output of its states."""
    words = words ^ (words >> np.uint64(30))
    words *= np.uint64(_MIX_1)
    words ^= words >> np.uint64(27)
    words *= np.uint64(_MIX_2)
    words ^= words >> np.uint64(31)
    return words


def _count(size: Size) -> int:
    """The number of elements of an array of a shape."""
    return size if isinstance(size, int) else math.prod(size)
