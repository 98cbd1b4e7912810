"""Kernels that read the passes and the raw bits of a frame (spec.md section 15.6).

Each kernel that reads symbols returns whether the words sufficed; where they did not (R-7-1), nothing that was read
is of use. intra.py, predicted.py and run.py read what `code_intra`, `code_predicted` and `code_run` of
gsvc_ref.main.frames write and make.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from gsvc_base.arrays import I8, U2, U4
from gsvc_ref._jit import kernel
from gsvc_ref.bitstream.coder import RUN_PARTS
from gsvc_ref.bitstream.rans import LOWEST_STATE
from gsvc_ref.main.passes import GROUP_LANES, LENGTH_UNIT, LENGTHS, PRECISION, TOTAL, Distributions

CELLS: Final = RUN_PARTS.index("cells")
LUMA: Final = RUN_PARTS.index("luma")
CHROMA: Final = RUN_PARTS.index("chroma")
SIZE: Final = RUN_PARTS.index("size")
SHEAR_PART: Final = RUN_PARTS.index("shear")
PLACE: Final = RUN_PARTS.index("place")
MOTION: Final = RUN_PARTS.index("motion")
MODES: Final = RUN_PARTS.index("modes")
POSITION: Final = RUN_PARTS.index("position")
"""Parts of a frame by their place in `RUN_PARTS`; aspect and shear follow size, and shape and color position."""

UNIT: Final = 32
"""Raw bits stand in units of so many, of which two fit into an integer."""


class Lanes(NamedTuple):
    """The lanes of a run that is read, its raw bits, and how much of both is used so far."""

    states: I8  # (lanes,), a power of two of them
    words: U2  # all that may be words: up to the end of the payload
    taken: I8  # (G,), the next word of each group of lanes
    ends: I8  # (G,), where the words of each group end
    place: I8  # (1,), the next symbol of the pass
    raw: I8  # the raw string in units, and two units of 0 after it
    bit: I8  # (1,), the next bit of it
    size: int  # bytes of words and raw bits together
    spent: I8  # (12,), the code length of each of `RUN_PARTS` so far, in parts of a bit (`LENGTH_UNIT`)
    lengths: I8  # `LENGTHS`

    @classmethod
    def begun(cls, lane_states: U4, word_counts: Sequence[int], rest: memoryview) -> "Lanes":
        """The lanes of a run before its first symbol; `word_counts` are those of all groups but the last."""
        words = np.frombuffer(rest[: len(rest) // 2 * 2], "<u2").astype(np.uint16)
        ends = np.cumsum([0, *word_counts, 0]).astype(np.int64)
        taken, ends = ends[:-1].copy(), ends[1:].copy()
        ends[-1] = len(words)
        units = np.zeros(-(-len(rest) // (UNIT // 8)) * (UNIT // 8) + 2 * UNIT // 8, np.uint8)
        units[: len(rest)] = np.frombuffer(rest, np.uint8)[::-1]
        place, bit, spent = (np.zeros(size, np.int64) for size in (1, 1, len(RUN_PARTS)))
        raw = units.view("<u4").astype(np.int64)
        return cls(lane_states.astype(np.int64), words, taken, ends, place, raw, bit, len(rest), spent, LENGTHS)

    @property
    def words_taken(self) -> int:
        """How many words all groups have taken, if each has taken all of its own."""
        return int(self.taken[-1])

    @property
    def lengths_of_parts(self) -> dict[str, float]:
        """The code lengths in bits of the parts that have some."""
        spent = dict(zip(RUN_PARTS, self.spent.tolist(), strict=True))
        return {part: length / LENGTH_UNIT for part, length in spent.items() if length}


@kernel(inline=True)
def take_symbol(lanes: Lanes, lane: int, x: int, start: int, frequency: int) -> bool:
    """Put the lane's state after a symbol in the place of x (7-1); whether the word that it needs is there."""
    x = frequency * (x >> PRECISION) + (x & (TOTAL - 1)) - start
    if x < LOWEST_STATE:
        group = lane // GROUP_LANES
        word = lanes.taken[group]
        if word == lanes.ends[group]:
            return False
        x = (x << 16) | int(lanes.words[word])
        lanes.taken[group] = word + 1
    lanes.states[lane] = x
    return True


@kernel()
def read_symbols(lanes: Lanes, part: int, tables: Distributions, which: I8, symbols: I8) -> bool:
    """Symbols of the pass that go on in it, symbol i with the distribution `which[i]`."""
    states, place, mask = lanes.states, lanes.place[0], len(lanes.states) - 1
    cumulative, length = tables.cumulative, 0
    for i in range(len(which)):  # each symbol of a pass belongs to the next lane
        lane = (place + i) & mask
        x = states[lane]
        slot = x & (TOTAL - 1)
        begin = tables.first[which[i]]
        low, bins = begin, tables.first[which[i] + 1] - 1 - begin
        while bins > 1:  # cumulative[low] <= slot < cumulative[low + bins]
            half = bins >> 1
            if cumulative[low + half] <= slot:
                low += half
            bins -= half
        frequency = cumulative[low + 1] - cumulative[low]
        if not take_symbol(lanes, lane, x, cumulative[low], frequency):
            return False
        symbols[i] = low - begin
        length += lanes.lengths[frequency - 1]
    lanes.place[0] = place + len(which)
    lanes.spent[part] += length
    return True


@kernel(inline=True)
def raw_value(raw: I8, bit: int, size: int) -> int:
    """The value of `size` raw bits, at most 28, from a bit of the raw string on; after its end there are zeros."""
    unit = bit // UNIT
    if unit >= len(raw) - 1:
        return 0
    return int((raw[unit] | raw[unit + 1] << UNIT) >> (bit % UNIT) & ((1 << size) - 1))


@kernel()
def read_raw(lanes: Lanes, part: int, sizes: I8, values: I8) -> None:
    """Values of the given numbers of raw bits, at most 28."""
    raw, first = lanes.raw, lanes.bit[0]
    bit = first
    for i in range(len(sizes)):
        values[i] = raw_value(raw, bit, sizes[i])
        bit += sizes[i]
    lanes.bit[0] = bit
    lanes.spent[part] += (bit - first) * LENGTH_UNIT


@kernel(inline=True)
def low_bits_of(magnitude_class: int) -> int:
    """How many low bits a class of magnitudes has."""
    return (magnitude_class >> 1) - 1 if magnitude_class >= 4 else 0


@kernel()
def read_low_bits(lanes: Lanes, part: int, magnitudes: I8) -> None:
    """The low bits of magnitudes; in `magnitudes` are their classes before, and they themselves then."""
    raw, first = lanes.raw, lanes.bit[0]
    bit = first
    for i in range(len(magnitudes)):
        if magnitudes[i] >= 4:
            size = low_bits_of(magnitudes[i])
            magnitudes[i] = ((2 + (magnitudes[i] & 1)) << size) + raw_value(raw, bit, size)
            bit += size
    lanes.bit[0] = bit
    lanes.spent[part] += (bit - first) * LENGTH_UNIT


@kernel()
def read_signs(lanes: Lanes, part: int, magnitudes: I8) -> None:
    """The signs of magnitudes that are not 0, which become the signed values."""
    raw, first = lanes.raw, lanes.bit[0]
    bit = first
    for i in range(len(magnitudes)):
        if magnitudes[i]:
            if raw_value(raw, bit, 1):
                magnitudes[i] = -magnitudes[i]
            bit += 1
    lanes.bit[0] = bit
    lanes.spent[part] += (bit - first) * LENGTH_UNIT


@kernel()
def late_bits(lanes: Lanes, count: int) -> Lanes:
    """The lanes with the string of the `count` late bits in the place of the raw string (R-15.6-4)."""
    carried = min(len(lanes.states), count // 16)  # the lanes whose final states have bits of it
    late = np.zeros(count // UNIT + 3, np.int64)
    for k in range((count + 15) // 16):
        at = lanes.bit[0] + 16 * (k - carried)
        half = lanes.states[k] & 0xFFFF if k < carried else raw_value(lanes.raw, at, 16)
        late[k >> 1] |= half << (16 * (k & 1))
    bit = np.zeros(1, np.int64)
    states, words, taken, ends, place, _, _, size, spent, lengths = lanes
    return Lanes(states, words, taken, ends, place, late, bit, size, spent, lengths)
