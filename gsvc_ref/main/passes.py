"""The run of the entropy coder through a frame, in passes (spec.md section 15.6).

A `Run` is handed a part of a pass, cumulative frequencies and symbols, and notes them; it makes symbols where there
are none yet, as the random streams of gsvc_ref.testing do. `gsvc_ref.main.fast` has the passes that read. Symbol i of a
pass belongs to lane i modulo the number of lanes, and each pass begins anew with lane 0 (R-15.6-1).
"""

from abc import ABC, abstractmethod
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_base.arrays import I8, U1, U2, U4
from gsvc_base.checks import door
from gsvc_base.errors import UsageError
from gsvc_base.portable import log2
from gsvc_ref._jit import kernel
from gsvc_ref.bitstream.rans import LOWEST_STATE

PRECISION: Final = 14
TOTAL: Final = 1 << PRECISION
"""The sum of the frequencies of a symbol's distribution."""

GROUP_LANES: Final = 32
"""The lanes of a group, which has a list of words of its own."""

PREDICTED_PASSES: Final = 6
"""The passes about the splats of the frame before: the field in x and in y, modes, and three components."""

LENGTH_UNIT: Final = 1 << 16
"""The parts of a bit that code lengths are counted in: sums of integers are the same on every machine."""

LENGTHS: Final[I8] = np.rint(LENGTH_UNIT * (PRECISION - log2(np.arange(1, TOTAL + 1)))).astype(np.int64)
"""The code length of a symbol by its frequency less 1."""

NONE: Final[I8] = np.zeros(0, np.int64)
"""No numbers, (0,)."""


def group_count(lane_exponent: int) -> int:
    """The groups that 2^lane_exponent lanes form."""
    return max((1 << lane_exponent) // GROUP_LANES, 1)


class Distributions(NamedTuple):
    """Cumulative frequencies of several distributions, one after the other."""

    cumulative: I8  # (M,); of a distribution of K symbols K + 1 numbers, from 0 to 2^14
    first: I8  # (n + 1,), where each distribution begins, and M

    @classmethod
    def joined(cls, parts: Sequence["Distributions"]) -> "Distributions":
        """Those of several parts one after the other."""
        begins = np.cumsum([0, *(len(part.cumulative) for part in parts)])
        first = [part.first[:-1] + begin for part, begin in zip(parts, begins[:-1], strict=True)]
        return cls(np.concatenate([part.cumulative for part in parts]), np.concatenate([*first, begins[-1:]]))


class Run(ABC):
    """The symbols of a frame, in passes, and its raw bits.

    Raw values are *early* after the pass of a number `at`, counted from 1, or *late*, `at` being None. The parts of a
    pass, and the late values, are handed over in their order; passes in any.
    """

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
    def symbols(self, at: int, tables: Distributions, which: I8, symbols: I8 | None = None) -> I8:
        """A part of the pass `at`: symbol i has the distribution `which[i]`."""

    @abstractmethod
    def raw_bits(self, at: int | None, sizes: I8, values: I8 | None = None) -> I8:
        """Values of the given numbers of raw bits, at most 28."""

    def low_bits(self, at: int | None, classes: I8, magnitudes: I8 | None = None) -> I8:
        """The low bits of magnitudes of these classes: the magnitudes, which are below 2^20."""
        sizes = low_bits(classes)
        low = None if magnitudes is None else np.where(classes < 4, 0, magnitudes & ((1 << sizes) - 1))
        return magnitudes_of(classes, self.raw_bits(at, sizes, low))

    def signs(self, at: int | None, magnitudes: I8, values: I8 | None = None) -> I8:
        """The signs of magnitudes that are not 0: the signed values."""
        negative = None if values is None else (values < 0).astype(np.int64)
        return signed(magnitudes, self.raw_bits(at, np.minimum(magnitudes, 1), negative))

    def _count(self, frequencies: I8) -> None:
        self.lengths[self._part] += int(LENGTHS[frequencies - 1].sum()) / LENGTH_UNIT


class RunSymbols(NamedTuple):
    """The symbols of a frame in the order in which they are decoded, (K,) each."""

    starts: I8  # c(s)
    frequencies: I8  # f(s)
    passes: I8  # from 1
    lanes: I8


class RunWriter(Run):
    """The symbols of a frame, to be written."""

    def __init__(self) -> None:
        super().__init__()
        self._symbols: list[tuple[int, I8, I8]] = []  # pass, starts and frequencies
        self._early: list[tuple[int, I8, I8]] = []  # pass, values and sizes
        self._late: list[tuple[I8, I8]] = []

    def symbols(self, at: int, tables: Distributions, which: I8, symbols: I8 | None = None) -> I8:
        """A part of the pass `at`: symbol i has the distribution `which[i]`."""
        assert symbols is not None
        if len(symbols) == 0:
            return symbols
        if symbols.min() < 0 or (symbols >= np.diff(tables.first)[which] - 1).any():
            raise UsageError(f"a symbol of the part `{self._part}` is outside of its distribution")
        place = tables.first[which] + symbols
        starts = tables.cumulative[place]
        frequencies = tables.cumulative[place + 1] - starts
        self._symbols.append((at, starts, frequencies))
        self._count(frequencies)
        return symbols

    def raw_bits(self, at: int | None, sizes: I8, values: I8 | None = None) -> I8:
        """Values of the given numbers of raw bits, at most 28."""
        assert values is not None
        if ((values < 0) | (values >> sizes > 0)).any():
            raise UsageError(f"a value of the part `{self._part}` does not fit into its raw bits")
        if at is None:
            self._late.append((values, sizes))
        else:
            self._early.append((at, values, sizes))
        self.lengths[self._part] += int(sizes.sum())
        return values

    @property
    def count(self) -> int:
        """How many symbols there are."""
        return sum(len(starts) for _, starts, _ in self._symbols)

    def in_order(self, lane_exponent: int) -> RunSymbols:
        """The symbols in the order of their passes, in 2^lane_exponent lanes (R-15.6-1)."""
        parts = sorted(self._symbols, key=lambda part: part[0])  # stable: the parts of a pass stay in their order
        passes = np.repeat([at for at, *_ in parts], [len(starts) for _, starts, _ in parts]).astype(np.int64)
        index = np.arange(len(passes)) - np.searchsorted(passes, passes)
        starts, frequencies = (
            np.concatenate([NONE, *column]) for column in ([p[1] for p in parts], [p[2] for p in parts])
        )
        return RunSymbols(starts, frequencies, passes, index & ((1 << lane_exponent) - 1))

    def finish(self, lane_exponent: int) -> "EncodedRun":
        """What a decoder finds all of it again from (R-15.6-3)."""
        starts, frequencies, _, lanes = self.in_order(lane_exponent)
        early = [part[1:] for part in sorted(self._early, key=lambda part: part[0])]
        raw = [np.concatenate([NONE, *(part[k] for part in parts)]) for parts in (early, self._late) for k in range(2)]
        return encode_run(starts, frequencies, lanes, 1 << lane_exponent, *raw)


class EncodedRun(NamedTuple):
    """What a decoder begins with."""

    lane_states: U4
    """(lane_count,)"""
    word_counts: I8
    """(G,) i8, the words of each group of 32 lanes."""
    words: U2
    """(count,), those of the first group, then those of the next."""
    tail: U1
    """(T,), the bytes of the raw bits as they stand in the stream."""


# twin of spec.encode_run
@door
def encode_run(
    starts: ArrayLike,
    frequencies: ArrayLike,
    lanes: ArrayLike,
    lane_count: int,
    early: ArrayLike,
    early_sizes: ArrayLike,
    late: ArrayLike,
    late_sizes: ArrayLike,
) -> EncodedRun:
    """The run in which a decoder finds the symbols and the raw bits of a frame again (R-15.6-3).

    Parameters
    ----------
    starts, frequencies
        (K,) i8, c(s) and f(s) of each symbol in the order in which they are decoded; f(s) is above 0, c(s) + f(s) at
        most 2^14.
    lanes
        (K,) i8, the lane of each, below `lane_count`.
    lane_count
        The number of lanes.
    early, early_sizes
        (E,) i8, the early raw values and how many bits each has, at most 28.
    late, late_sizes
        (F,) i8, the late ones.

    Returns
    -------
    EncodedRun
        `lane_states`, `word_counts`, `words` and `tail`.
    """
    c, f, j = (np.ascontiguousarray(values, np.int64) for values in (starts, frequencies, lanes))
    first, last = _bits(early, early_sizes), _bits(late, late_sizes)
    carried = min(16 * lane_count, len(last) // 16 * 16)  # bits in the lower halves of the final states
    states = np.full((lane_count,), LOWEST_STATE, np.int64)
    states[: carried // 16] += np.packbits(last[:carried], bitorder="little").view("<u2")
    words, groups = np.empty(len(c), np.uint16), np.empty(len(c), np.int64)
    used = len(words) - _encode(c, f, j, states, words, groups)
    group_of_word = groups[used:]
    order = np.argsort(group_of_word, kind="stable")
    counts = np.bincount(group_of_word, minlength=max(lane_count // GROUP_LANES, 1)).astype(np.int64)
    tail = np.packbits(np.concatenate([first, last[carried:]]), bitorder="little")[::-1]
    return EncodedRun(states.astype(np.uint32), counts, words[used:][order], tail.copy())


def _bits(values: ArrayLike, sizes: ArrayLike) -> U1:
    """The bits of raw values one after the other, of each the least one first."""
    count = np.asarray(sizes, np.int64)
    place = np.arange(int(count.sum())) - np.repeat(np.cumsum(count) - count, count)
    bits: NDArray[np.int64] = np.repeat(np.asarray(values, np.int64), count) >> place & 1
    return bits.astype(np.uint8)


def magnitude_classes(magnitudes: I8) -> I8:
    """The class of each magnitude below 2^20: 0, 1, 2, 3, then two classes an octave (spec.md section 15.7)."""
    exponent = np.frexp(magnitudes.astype(np.float64))[1] - 1  # exact
    low = np.maximum(exponent - 1, 0)
    return np.where(magnitudes < 4, magnitudes, 2 * exponent + (magnitudes >> low & 1)).astype(np.int64)


def low_bits(classes: I8) -> I8:
    """How many low bits a class of magnitudes has."""
    return np.where(classes < 4, 0, classes // 2 - 1)


def magnitudes_of(classes: I8, low: I8) -> I8:
    """The magnitudes of classes, by their low bits."""
    return np.where(classes < 4, classes, ((2 + (classes & 1)) << low_bits(classes)) + low)


def signed(magnitudes: I8, negative: I8) -> I8:
    """Magnitudes with signs, of which 1 is negative."""
    return np.where(negative == 1, -magnitudes, magnitudes)


@kernel()
def _encode(starts: I8, frequencies: I8, lanes: I8, states: I8, words: U2, groups: I8) -> int:
    """Encode backwards, to the ends of `words` and their `groups`, update `states`, and return the number of words."""
    first_word = len(words)
    for i in range(len(starts) - 1, -1, -1):
        frequency, lane = frequencies[i], lanes[i]
        x = states[lane]
        if x >= frequency << (32 - PRECISION):  # one word at most: x < 2**32 and f << 18 >= 2**18
            first_word -= 1
            words[first_word] = x & 0xFFFF
            groups[first_word] = lane // GROUP_LANES
            x >>= 16
        states[lane] = ((x // frequency) << PRECISION) + x % frequency + starts[i]  # (7-2)
    return len(words) - first_word
