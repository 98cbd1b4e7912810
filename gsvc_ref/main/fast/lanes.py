"""Kernels that read the passes of a frame, lane by lane (spec.md section 15.6).

Each returns whether the words sufficed; where they did not (R-7-1), nothing that was read is of use. A kernel `read_X`
of this folder is the twin of `code_X` in gsvc_ref.main, which writes and makes what it reads.
"""

from typing import Final, NamedTuple

import numpy as np

from gsvc_base.arrays import I8, U2, U4
from gsvc_ref._jit import kernel
from gsvc_ref.bitstream.coder import RUN_PARTS
from gsvc_ref.bitstream.rans import LOWEST_STATE
from gsvc_ref.main.passes import LENGTH_UNIT, LENGTHS, PRECISION, TOTAL, Distributions

CELLS: Final = RUN_PARTS.index("cells")
LUMA: Final = RUN_PARTS.index("luma")
CHROMA: Final = RUN_PARTS.index("chroma")
SIZE: Final = RUN_PARTS.index("size")
PLACE: Final = RUN_PARTS.index("place")
MOTION: Final = RUN_PARTS.index("motion")
MODES: Final = RUN_PARTS.index("modes")
POSITION: Final = RUN_PARTS.index("position")
"""Parts of a frame by their place in `RUN_PARTS`; aspect and shear follow size, and shape and color position."""

MISSING_WORD: Final = -1


class MissingWordError(Exception):
    """A word is missing (R-7-1); whoever knows where the words stand says where."""


class Lanes(NamedTuple):
    """The lanes of a run that is read, and what they have used so far."""

    states: I8  # (lanes,), a power of two of them
    words: U2  # (count,)
    taken: I8  # (1,), the number of words taken
    spent: I8  # (1,), the code length so far in parts of a bit (`LENGTH_UNIT`)
    spent_after: I8  # (12,), `spent` after each of `RUN_PARTS`, 0 where a part has not been read
    lengths: I8  # `LENGTHS`

    @classmethod
    def begun(cls, lane_states: U4, words: U2) -> "Lanes":
        """The lanes of a run before its first symbol."""
        taken, spent, parts = (np.zeros(size, np.int64) for size in (1, 1, len(RUN_PARTS)))
        return cls(lane_states.astype(np.int64), words, taken, spent, parts, LENGTHS)


@kernel(inline=True)
def _renewed(x: int, words: U2, taken: int) -> tuple[int, int]:
    """A state after a symbol, with a word if it needs one, and how many words are taken, or `MISSING_WORD`."""
    if x >= LOWEST_STATE:
        return x, taken
    if taken == len(words):
        return x, MISSING_WORD
    return (x << 16) | int(words[taken]), taken + 1


@kernel(inline=True)
def take_symbol(x: int, start: int, frequency: int, words: U2, taken: int) -> tuple[int, int]:
    """The state after a symbol (7-1), and how many words are taken, or `MISSING_WORD`."""
    return _renewed(frequency * (x >> PRECISION) + (x & (TOTAL - 1)) - start, words, taken)


@kernel()
def read_symbols(lanes: Lanes, tables: Distributions, which: I8, symbols: I8) -> bool:
    """A pass: symbol i has the distribution `which[i]`."""
    states, words, taken, mask = lanes.states, lanes.words, lanes.taken[0], len(lanes.states) - 1
    cumulative, length = tables.cumulative, 0
    for i in range(len(which)):  # symbol i belongs to lane i modulo their number
        x = states[i & mask]
        slot = x & (TOTAL - 1)
        begin = tables.first[which[i]]
        low, bins = begin, tables.first[which[i] + 1] - 1 - begin
        while bins > 1:  # cumulative[low] <= slot < cumulative[low + bins]
            half = bins >> 1
            if cumulative[low + half] <= slot:
                low += half
            bins -= half
        frequency = cumulative[low + 1] - cumulative[low]
        x, taken = take_symbol(x, cumulative[low], frequency, words, taken)
        if taken == MISSING_WORD:
            return False
        states[i & mask] = x
        symbols[i] = low - begin
        length += lanes.lengths[frequency - 1]
    lanes.taken[0] = taken
    lanes.spent[0] += length
    return True


@kernel()
def read_raw(lanes: Lanes, sizes: I8, values: I8) -> bool:
    """Values of the given numbers of raw bits, at most 28: the upper bits of long ones in a separate pass."""
    states, words, taken, mask = lanes.states, lanes.words, lanes.taken[0], len(lanes.states) - 1
    most = length = 0
    for i in range(len(sizes)):
        most = max(most, sizes[i])
        values[i] = 0
    for least in range(PRECISION, -1, -PRECISION):  # a pass of the bits above `least`, and one of the others
        if most <= least:
            continue
        place = 0
        for i in range(len(sizes)):
            bits = min(sizes[i] - least, PRECISION)
            if bits <= 0:
                continue
            x = states[place & mask]
            rest = PRECISION - bits
            value = (x & (TOTAL - 1)) >> rest
            x, taken = take_symbol(x, value << rest, 1 << rest, words, taken)
            if taken == MISSING_WORD:
                return False
            states[place & mask] = x
            values[i] = (values[i] << bits) | value
            place += 1
            length += bits
    lanes.taken[0] = taken
    lanes.spent[0] += length * LENGTH_UNIT
    return True


@kernel()
def read_low_bits(lanes: Lanes, magnitudes: I8) -> bool:
    """The passes of the low bits of magnitudes; in `magnitudes` are their classes before, and they themselves then."""
    sizes, low = np.empty(len(magnitudes), np.int64), np.empty(len(magnitudes), np.int64)
    for i in range(len(magnitudes)):
        sizes[i] = max(magnitudes[i] // 2 - 1, 0) if magnitudes[i] >= 4 else 0
    if not read_raw(lanes, sizes, low):
        return False
    for i in range(len(magnitudes)):
        if magnitudes[i] >= 4:
            magnitudes[i] = ((2 + (magnitudes[i] & 1)) << sizes[i]) + low[i]
    return True


@kernel()
def read_signs(lanes: Lanes, magnitudes: I8) -> bool:
    """The pass of the signs of magnitudes that are not 0, which become the signed values."""
    sizes, negative = np.empty(len(magnitudes), np.int64), np.empty(len(magnitudes), np.int64)
    for i in range(len(magnitudes)):
        sizes[i] = min(magnitudes[i], 1)
    if not read_raw(lanes, sizes, negative):
        return False
    for i in range(len(magnitudes)):
        magnitudes[i] = -magnitudes[i] if negative[i] else magnitudes[i]
    return True


@kernel(inline=True)
def magnitude_class(magnitude: int) -> int:
    """The class of a magnitude: 0, 1, 2, 3, then two classes an octave (spec.md section 15.7)."""
    if magnitude < 4:
        return magnitude
    exponent = 2
    while magnitude >> (exponent + 1):
        exponent += 1
    return 2 * exponent + (magnitude >> (exponent - 1) & 1)
