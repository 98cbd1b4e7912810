"""The run of the entropy coder through a frame, in passes (spec.md section 15.6).

A pass of a `Run` is handed the cumulative frequencies of its symbols and the symbols, and notes them; it makes symbols
where there are none yet, as the random streams of gsvc_ref.testing do. `gsvc_ref.main.fast.lanes` has the passes
that read. Symbol i of a pass belongs to lane i modulo the number of lanes, and each pass begins anew with lane 0
(R-15.6-1).
"""

from abc import ABC, abstractmethod
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gsvc_base.arrays import I8, U2, U4
from gsvc_base.checks import door
from gsvc_base.errors import UsageError
from gsvc_base.portable import log2
from gsvc_ref._jit import kernel
from gsvc_ref.bitstream.rans import LOWEST_STATE

PRECISION: Final = 14
TOTAL: Final = 1 << PRECISION
"""The sum of the frequencies of a symbol's distribution."""

LENGTH_UNIT: Final = 1 << 16
"""The parts of a bit that code lengths are counted in: sums of integers are the same on every machine."""

LENGTHS: Final[I8] = np.rint(LENGTH_UNIT * (PRECISION - log2(np.arange(1, TOTAL + 1)))).astype(np.int64)
"""The code length of a symbol by its frequency less 1."""


class Distributions(NamedTuple):
    """Cumulative frequencies of several distributions, one after the other."""

    cumulative: I8  # (M,); of a distribution of K symbols K + 1 numbers, from 0 to 2^14
    first: I8  # (n + 1,), where each distribution begins, and M

    @classmethod
    def of(cls, tables: Sequence[I8]) -> "Distributions":
        """The distributions of a list of tables."""
        first = np.cumsum([0, *map(len, tables)]).astype(np.int64)
        return cls(np.concatenate([*tables, np.zeros(0, np.int64)]).astype(np.int64), first)


class Run(ABC):
    """The symbols of a frame, in passes."""

    def __init__(self) -> None:
        self.lengths: defaultdict[str, float] = defaultdict(float)  # in bits, by part of the frame
        self._part = ""

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """Count the code lengths of a ``with`` block to a part of the frame."""
        outside, self._part = self._part, name
        try:
            yield
        finally:
            self._part = outside

    @abstractmethod
    def symbols(self, tables: Distributions, which: I8, symbols: I8 | None = None) -> I8:
        """A pass: symbol i has the distribution `which[i]`."""

    def magnitudes(self, tables: Distributions, which: I8, magnitudes: I8 | None = None) -> I8:
        """Passes of the classes of magnitudes below 2^20, class i with the distribution `which[i]`, and of low bits."""
        classes = self.symbols(tables, which, None if magnitudes is None else magnitude_classes(magnitudes))
        sizes = low_bits(classes)
        low = None if magnitudes is None else np.where(classes < 4, 0, magnitudes & ((1 << sizes) - 1))
        return np.where(classes < 4, classes, ((2 + (classes & 1)) << sizes) + self.raw_bits(sizes, low))

    def signs(self, magnitudes: I8, values: I8 | None = None) -> I8:
        """A pass of the signs of magnitudes that are not 0: the signed values."""
        negative = None if values is None else (values < 0).astype(np.int64)
        negative = self.raw_bits(np.minimum(magnitudes, 1), negative)
        return np.where(negative == 1, -magnitudes, magnitudes)

    @abstractmethod
    def _uniform(self, sizes: I8, values: I8 | None) -> I8:
        """A pass of symbols of 2^sizes[i] values each, sizes at most 14; those of size 0 are left out."""

    def raw_bits(self, sizes: I8, values: I8 | None = None) -> I8:
        """Values of the given numbers of raw bits, below 2^28."""
        lower = np.minimum(sizes, PRECISION)
        upper = sizes - lower
        if not upper.any():
            return self._uniform(lower, values)
        high = self._uniform(upper, None if values is None else values >> lower)
        return (high << lower) + self._uniform(lower, None if values is None else values & ((1 << lower) - 1))

    def _count(self, frequencies: I8) -> None:
        self.lengths[self._part] += int(LENGTHS[frequencies - 1].sum()) / LENGTH_UNIT


class RunWriter(Run):
    """The symbols of a frame, to be written."""

    def __init__(self) -> None:
        super().__init__()
        self._passes: list[tuple[I8, I8]] = []

    def symbols(self, tables: Distributions, which: I8, symbols: I8 | None = None) -> I8:
        """A pass: symbol i has the distribution `which[i]`."""
        assert symbols is not None
        if len(symbols) == 0:
            return symbols
        if symbols.min() < 0 or (symbols >= np.diff(tables.first)[which] - 1).any():
            raise UsageError(f"a symbol of the pass `{self._part}` is outside of its distribution")
        at = tables.first[which] + symbols
        starts = tables.cumulative[at]
        frequencies = tables.cumulative[at + 1] - starts
        self._passes.append((starts, frequencies))
        self._count(frequencies)
        return symbols

    def _uniform(self, sizes: I8, values: I8 | None) -> I8:
        assert values is not None
        if ((values < 0) | (values >> sizes > 0)).any():
            raise UsageError(f"a value of the pass `{self._part}` does not fit into its raw bits")
        there = sizes > 0
        frequencies = TOTAL >> sizes[there]
        self._passes.append((values[there] * frequencies, frequencies))
        self.lengths[self._part] += int(sizes.sum())
        return values

    def finish(self, lane_count: int) -> "EncodedRun":
        """The lane states and words of all passes (R-15.6-3)."""
        starts = np.concatenate([np.zeros(0, np.int64), *(part[0] for part in self._passes)])
        frequencies = np.concatenate([np.zeros(0, np.int64), *(part[1] for part in self._passes)])
        lanes = np.concatenate([np.zeros(0, np.int64), *(np.arange(len(s)) % lane_count for s, _ in self._passes)])
        return encode_run(starts, frequencies, lanes, lane_count)


class EncodedRun(NamedTuple):
    """The states and words that a decoder begins with."""

    lane_states: U4
    """(lane_count,)"""
    words: U2
    """(count,)"""


# twin of spec.encode_run
@door
def encode_run(starts: ArrayLike, frequencies: ArrayLike, lanes: ArrayLike, lane_count: int) -> EncodedRun:
    """The states and words with which a decoder finds the symbols of a frame again (R-15.6-3).

    Parameters
    ----------
    starts, frequencies
        (K,) i8, c(s) and f(s) of each symbol in the order in which they are decoded; f(s) is above 0, c(s) + f(s) at
        most 2^14.
    lanes
        (K,) i8, the lane of each, below `lane_count`.
    lane_count
        The number of lanes.

    Returns
    -------
    EncodedRun
        `lane_states` and `words`.
    """
    c, f, j = (np.ascontiguousarray(values, np.int64) for values in (starts, frequencies, lanes))
    states = np.full((lane_count,), LOWEST_STATE, np.int64)
    words = np.empty(len(c), np.uint16)
    used = _encode(c, f, j, states, words)
    return EncodedRun(states.astype(np.uint32), words[len(words) - used :].copy())


def magnitude_classes(magnitudes: I8) -> I8:
    """The class of each magnitude below 2^20: 0, 1, 2, 3, then two classes an octave (spec.md section 15.7)."""
    exponent = np.frexp(magnitudes.astype(np.float64))[1] - 1  # exact
    low = np.maximum(exponent - 1, 0)
    return np.where(magnitudes < 4, magnitudes, 2 * exponent + (magnitudes >> low & 1)).astype(np.int64)


def low_bits(classes: I8) -> I8:
    """How many low bits a class of magnitudes has."""
    return np.where(classes < 4, 0, classes // 2 - 1)


@kernel()
def _encode(starts: I8, frequencies: I8, lanes: I8, states: I8, words: U2) -> int:
    """Encode backwards, to the end of `words`, update `states`, and return the number of words."""
    first_word = len(words)
    for i in range(len(starts) - 1, -1, -1):
        frequency = frequencies[i]
        x = states[lanes[i]]
        if x >= frequency << (32 - PRECISION):  # one word at most: x < 2**32 and f << 18 >= 2**18
            first_word -= 1
            words[first_word] = x & 0xFFFF
            x >>= 16
        states[lanes[i]] = ((x // frequency) << PRECISION) + x % frequency + starts[i]  # (7-2)
    return len(words) - first_word
