"""The run of the entropy coder through a frame, in passes (spec.md section 15.6).

A pass is handed the cumulative frequencies of its symbols, and the symbols themselves where a frame is written; it
returns the symbols. So each structure of a frame stands once, and is read and written by the same lines. Symbol i of a
pass belongs to lane i modulo the number of lanes, and each pass begins anew with lane 0 (R-15.6-1).
"""

from abc import ABC, abstractmethod
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gsvc_ref._jit import kernel
from gsvc_ref.arrays import I8, U2, U4
from gsvc_ref.bitstream.rans import LOWEST_STATE
from gsvc_ref.checks import door
from gsvc_ref.errors import UsageError

PRECISION: Final = 14
ONE: Final = 1 << PRECISION
"""The sum of the frequencies of a symbol's distribution."""

MISSING_WORD: Final = -1


class Distributions(NamedTuple):
    """Cumulative frequencies of several distributions, one behind the other.

    Attributes
    ----------
    cumulative
        (M,) i8; those of a distribution of K symbols are K + 1 numbers, from 0 to 2^14.
    first
        (n + 1,) i8, where each distribution begins, and M.
    """

    cumulative: I8
    first: I8

    @classmethod
    def of(cls, tables: Sequence[I8]) -> "Distributions":
        """The distributions of a list of tables."""
        first = np.cumsum([0, *map(len, tables)]).astype(np.int64)
        return cls(np.concatenate([*tables, np.zeros(0, np.int64)]).astype(np.int64), first)


class Run(ABC):
    """The symbols of a frame, read or written.

    Attributes
    ----------
    lengths
        Code lengths in bits by part of the frame.
    """

    def __init__(self) -> None:
        self.lengths: defaultdict[str, float] = defaultdict(float)
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

    @abstractmethod
    def _uniform(self, sizes: I8, values: I8 | None) -> I8:
        """A pass of symbols of 2^sizes[i] values each, sizes at most 14; those of size 0 are left out."""

    def raw_bits(self, sizes: I8, values: I8 | None = None) -> I8:
        """Values of so many raw bits each, below 2^28."""
        lower = np.minimum(sizes, PRECISION)
        upper = sizes - lower
        if not upper.any():
            return self._uniform(lower, values)
        high = self._uniform(upper, None if values is None else values >> lower)
        return (high << lower) + self._uniform(lower, None if values is None else values & ((1 << lower) - 1))

    def _count(self, frequencies: I8) -> None:
        if len(frequencies):
            self.lengths[self._part] += PRECISION * len(frequencies) - float(np.log2(frequencies).sum())


class RunReader(Run):
    """The symbols of a frame out of its lane states and words.

    Parameters
    ----------
    lane_states
        (lanes,) u4, each at least 2^16.
    words
        (count,) u2.

    Attributes
    ----------
    states
        (lanes,) i8, the states now.
    taken
        The number of words taken.
    """

    def __init__(self, lane_states: U4, words: U2) -> None:
        super().__init__()
        self.states = lane_states.astype(np.int64)
        self.taken = 0
        self._words = words

    def symbols(self, tables: Distributions, which: I8, symbols: I8 | None = None) -> I8:
        """A pass: symbol i has the distribution `which[i]`."""
        found, frequencies = np.empty(len(which), np.int64), np.empty(len(which), np.int64)
        self._take(_read_symbols(*tables, which, self.states, self._words, self.taken, found, frequencies))
        self._count(frequencies)
        return found

    def _uniform(self, sizes: I8, values: I8 | None) -> I8:
        found = np.zeros(len(sizes), np.int64)
        self._take(_read_uniform(sizes, self.states, self._words, self.taken, found))
        self.lengths[self._part] += int(sizes.sum())
        return found

    def _take(self, taken: int) -> None:
        if taken == MISSING_WORD:
            raise MissingWordError
        self.taken = taken


class MissingWordError(Exception):
    """A word is missing (R-7-1); whoever knows where the words stand says where."""


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
        frequencies = ONE >> sizes[there]
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
    states = np.full(lane_count, LOWEST_STATE, np.int64)
    words = np.empty(len(c), np.uint16)
    used = _encode(c, f, j, states, words)
    return EncodedRun(states.astype(np.uint32), words[len(words) - used :].copy())


@kernel()
def _read_symbols(
    cumulative: I8, first: I8, which: I8, states: I8, words: U2, taken: int, symbols: I8, frequencies: I8
) -> int:
    lanes = len(states)
    for i in range(len(which)):
        lane = i % lanes
        x = states[lane]
        slot = x & (ONE - 1)
        low, high = first[which[i]], first[which[i] + 1] - 1  # cumulative[low] <= slot < cumulative[high]
        begin = low
        while high - low > 1:
            middle = (low + high) // 2
            if cumulative[middle] <= slot:
                low = middle
            else:
                high = middle
        frequency = cumulative[low + 1] - cumulative[low]
        x = frequency * (x >> PRECISION) + slot - cumulative[low]  # (7-1)
        if x < LOWEST_STATE:
            if taken == len(words):
                return MISSING_WORD
            x = (x << 16) | np.int64(words[taken])
            taken += 1
        states[lane] = x
        symbols[i] = low - begin
        frequencies[i] = frequency
    return taken


@kernel()
def _read_uniform(sizes: I8, states: I8, words: U2, taken: int, values: I8) -> int:
    lanes = len(states)
    place = 0
    for i in range(len(sizes)):
        if sizes[i] == 0:
            continue
        lane = place % lanes
        place += 1
        x = states[lane]
        slot = x & (ONE - 1)
        bits = PRECISION - sizes[i]
        values[i] = slot >> bits
        x = ((x >> PRECISION) << bits) + (slot & ((1 << bits) - 1))
        if x < LOWEST_STATE:
            if taken == len(words):
                return MISSING_WORD
            x = (x << 16) | np.int64(words[taken])
            taken += 1
        states[lane] = x
    return taken


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
