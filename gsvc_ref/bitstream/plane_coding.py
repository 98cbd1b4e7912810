"""The writer's choices of mode, frequencies and their order that make a plane small. A decoder needs none of this."""

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import I8, U2, U4
from gsvc_base.errors import UsageError
from gsvc_base.portable import log2
from gsvc_ref.bitstream.coder import encode_uv
from gsvc_ref.bitstream.frequencies import all_frequencies, log2_table
from gsvc_ref.bitstream.golomb import golomb_sizes, golomb_totals
from gsvc_ref.bitstream.header import SequenceHeader
from gsvc_ref.bitstream.rans import encode_plane

CONSTANT: Final = 0
RAW: Final = 1
CODED: Final = 2

TABLES_TRIED: Final = 3
"""Tables, of those with the least estimated size, for which the plane is truly encoded."""

TABLE_HEAD_BITS: Final = 2 + 5 + 4
"""`plane_mode`, `table_bits` and `golomb_order`; each frequency takes one bit at least, each lane four bytes."""


@dataclass(frozen=True, eq=False)
class PlaneCode:
    """The elements of a plane with the names of spec.md section 6.6."""

    plane_mode: int = CONSTANT
    symbols: U2 = field(default_factory=lambda: np.empty(0, np.uint16))  # (count,)
    # The table of a coded plane; `first_symbol` is also the symbol of a constant one.
    table_bits: int = 0
    golomb_order: int = 0
    first_symbol: int = 0
    last_symbol: int = 0
    frequencies: I8 = field(default_factory=lambda: np.empty(0, np.int64))  # from first to last; sum 2^table_bits
    states: U4 = field(default_factory=lambda: np.empty(0, np.uint32))  # (lanes,)
    words: U2 = field(default_factory=lambda: np.empty(0, np.uint16))  # (word_count,)

    def size(self, alphabet: int) -> int:
        """The bytes that the plane takes."""
        w = (alphabet - 1).bit_length()
        if self.plane_mode == CONSTANT:
            return (2 + w + 7) // 8
        if self.plane_mode == RAW:
            return (2 + w * len(self.symbols) + 7) // 8
        table = 2 + 5 + 4 + 2 * w + int(golomb_sizes(self.frequencies, self.golomb_order).sum())
        return (table + 7) // 8 + len(encode_uv(len(self.words))) + 4 * len(self.states) + 2 * len(self.words)


def best_golomb_order(frequencies: I8) -> tuple[int, int]:
    """The order with which a table of frequencies below 2^16 takes the fewest bits, and those bits."""
    totals = golomb_totals(frequencies)
    order = int(np.argmin(totals))
    return order, int(totals[order])


def choose_plane_code(symbols: NDArray[np.integer], alphabet: int, header: SequenceHeader) -> PlaneCode:
    """The smallest code for symbols (count,), count > 0, that was found among constant, raw and coded ones.

    A symbol that is not below `alphabet` raises a UsageError (R-6.6-2).
    """
    row: U2 = np.array(symbols, np.uint16)
    first, last = int(row.min()), int(row.max())
    if last >= alphabet:
        raise UsageError(f"a symbol is {last}; it must be below {alphabet} (R-6.6-2)")
    if first == last:
        return PlaneCode(CONSTANT, row, first_symbol=first)
    best = PlaneCode(RAW, row)
    w = (alphabet - 1).bit_length()
    # No table of these symbols is smaller: one bit for each frequency, four bytes for each lane.
    if best.size(alphabet) <= (TABLE_HEAD_BITS + 2 * w + last - first + 1) // 8 + 4 * min(header.lane_count, len(row)):
        return best
    counts = np.bincount(row, minlength=last + 1)[first:].astype(np.int64)
    for table_bits, order, frequencies, least in _tables(counts, header.entropy_precision):
        if least >= 8 * best.size(alphabet):  # not even the estimate, which has no states, is smaller
            continue
        scaled = frequencies << (header.entropy_precision - table_bits)
        states, words = encode_plane(row, scaled, header.entropy_precision, header.lane_count, first)
        code = PlaneCode(CODED, row, table_bits, order, first, last, frequencies, states, words)
        if code.size(alphabet) < best.size(alphabet):
            best = code
    return best


def _tables(counts: I8, precision: int) -> list[tuple[int, int, I8, float]]:
    """Tables (table_bits, golomb_order, frequencies, least bits of table and symbols), the TABLES_TRIED most promising.

    The more table_bits, the larger is every frequency and with it the table's size, and no table takes the symbols
    below their entropy: once these two together exceed what the best tables need, larger ones need not be made.
    """
    used = counts > 0
    n = counts[used]
    entropy = float(n.sum() * log2(n.sum()) - np.sum(n * log2(n)))
    best: list[tuple[int, int, I8, float]] = []
    for table_bits, frequencies in all_frequencies(counts, precision):
        order, table_size = best_golomb_order(frequencies)
        if len(best) == TABLES_TRIED and table_size + (1 - 1e-9) * entropy > best[-1][3]:
            break
        data_size = float(np.sum(n * (table_bits - log2_table()[frequencies[used]])))
        best.append((table_bits, order, frequencies, table_size + data_size))
        best = sorted(best, key=lambda table: table[3])[:TABLES_TRIED]
    return best
