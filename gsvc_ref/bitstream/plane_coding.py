"""How the writer spends few bits on a plane: mode, frequencies and their order. A decoder needs none of this."""

from dataclasses import dataclass, field
from heapq import heapify, heapreplace
from math import log2
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_ref.bitstream.coder import I8, U2, U4, encode_uv
from gsvc_ref.bitstream.golomb import GOLOMB_ORDERS, golomb_sizes
from gsvc_ref.bitstream.header import SequenceHeader
from gsvc_ref.bitstream.rans import encode
from gsvc_ref.errors import UsageError

CONSTANT: Final = 0
RAW: Final = 1
CODED: Final = 2

TABLES_TRIED: Final = 3
"""Tables, of those with the least estimated size, for which the plane is truly encoded."""

TABLE_HEAD_BITS: Final = 2 + 5 + 4
"""`plane_mode`, `table_bits` and `golomb_order`; each frequency takes one bit at least, each lane four bytes."""

BISECTIONS: Final = 60
LEFT_TO_HEAP: Final = 16
"""Units of a table that are given one by one once bisection has come close; it would take longer for so few."""

F8 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PlaneCode:
    """The elements of a plane with the names of spec.md section 6.6.

    Attributes
    ----------
    plane_mode
        `CONSTANT`, `RAW` or `CODED`.
    symbols
        (count,) u2.
    table_bits, golomb_order, first_symbol, last_symbol
        The table of a coded plane; `first_symbol` is also the symbol of a constant one.
    frequencies
        (last_symbol - first_symbol + 1,) i8, adding up to 2^table_bits.
    states, words
        (lanes,) u4 and (word_count,) u2 of a coded plane.
    """

    plane_mode: int = CONSTANT
    symbols: U2 = field(default_factory=lambda: np.empty(0, np.uint16))
    table_bits: int = 0
    golomb_order: int = 0
    first_symbol: int = 0
    last_symbol: int = 0
    frequencies: I8 = field(default_factory=lambda: np.empty(0, np.int64))
    states: U4 = field(default_factory=lambda: np.empty(0, np.uint32))
    words: U2 = field(default_factory=lambda: np.empty(0, np.uint16))

    def size(self, alphabet: int) -> int:
        """The bytes that the plane takes."""
        w = (alphabet - 1).bit_length()
        if self.plane_mode == CONSTANT:
            return (2 + w + 7) // 8
        if self.plane_mode == RAW:
            return (2 + w * len(self.symbols) + 7) // 8
        table = 2 + 5 + 4 + 2 * w + int(golomb_sizes(self.frequencies, self.golomb_order).sum())
        return (table + 7) // 8 + len(encode_uv(len(self.words))) + 4 * len(self.states) + 2 * len(self.words)


def normalized_frequencies(counts: I8, table_bits: int) -> I8:
    """Integers (n,) i8 that add up to 2^table_bits, at least 1 where a symbol occurs, and cost the fewest bits.

    They minimise Σ counts(s) · (table_bits − log2 f(s)). Every term is convex, so the units after each symbol's first
    go one by one to where the next saves most; those that save at least λ bits go at once, with λ found by bisection.

    Raises
    ------
    UsageError
        More symbols occur than a table of 2^table_bits can hold.
    """
    occurs = counts > 0
    n = counts[occurs].astype(np.float64)
    total = 1 << table_bits
    if len(n) > total:
        raise UsageError(f"{len(n)} symbols occur; a table of {total} has no room for them")
    low, high = 0.0, float(n.max()) + 1  # a saving of n bits is the most that any unit offers
    f = np.ones(len(n), np.int64)
    least = n.sum() / (total * np.log(2))  # the answer, if frequencies were real numbers
    for _ in range(BISECTIONS):
        tried = 1 + np.floor(1 / np.expm1(np.minimum(least / n, 1.5) * np.log(2)))  # (j + 1)/j >= 2^(λ/n) for j < f
        if tried.sum() > total:
            low = least
        else:
            high, f = least, tried.astype(np.int64)
            if total - f.sum() <= LEFT_TO_HEAP:
                break
        least = (low + high) / 2 if low > 0 else high / 2
    _give_units(n, f, total - int(f.sum()))
    frequencies = np.zeros(len(counts), np.int64)
    frequencies[occurs] = f
    return frequencies


def _give_units(n: F8, f: I8, units: int) -> None:
    """Add `units` to `f` in place, each where it saves most; the lower symbol on a tie."""

    def entry(symbol: int) -> tuple[float, int]:
        return -float(n[symbol]) * log2((f[symbol] + 1) / f[symbol]), symbol

    heap = [entry(symbol) for symbol in range(len(n))] if units else []
    heapify(heap)
    for _ in range(units):
        symbol = heap[0][1]
        f[symbol] += 1
        heapreplace(heap, entry(symbol))


def best_golomb_order(frequencies: I8) -> tuple[int, int]:
    """The order with which a table of frequencies below 2^16 takes the fewest bits, and those bits."""
    orders = np.arange(GOLOMB_ORDERS, dtype=np.int64)[:, None]  # (16, 1)
    totals = golomb_sizes(frequencies, orders).sum(axis=1)  # (16,) bits
    order = int(np.argmin(totals))
    return order, int(totals[order])


def choose_plane_code(symbols: NDArray[np.integer], alphabet: int, header: SequenceHeader) -> PlaneCode:
    """The smallest code for symbols (count,), count > 0, that was found among constant, raw and coded ones.

    Raises
    ------
    UsageError
        A symbol is not below `alphabet` (R-6.6-2).
    """
    row: U2 = np.array(symbols, np.uint16)
    first, last = int(row.min()), int(row.max())
    if last >= alphabet:
        raise UsageError(f"a symbol is {last}; it must be below {alphabet} (R-6.6-2)")
    if first == last:
        return PlaneCode(CONSTANT, row, first_symbol=first)
    best = PlaneCode(RAW, row)
    w = (alphabet - 1).bit_length()
    if best.size(alphabet) <= (TABLE_HEAD_BITS + 2 * w + last - first + 1) // 8 + 4 * min(header.lane_count, len(row)):
        return best
    counts = np.bincount(row, minlength=last + 1)[first:].astype(np.int64)
    for table_bits, order, frequencies, least in _tables(counts, header.entropy_precision)[:TABLES_TRIED]:
        if least >= 8 * best.size(alphabet):
            continue
        scaled = frequencies << (header.entropy_precision - table_bits)
        states, words = encode(row, scaled, first, header.entropy_precision, header.lane_count)
        code = PlaneCode(CODED, row, table_bits, order, first, last, frequencies, states, words)
        if code.size(alphabet) < best.size(alphabet):
            best = code
    return best


def _tables(counts: I8, precision: int) -> list[tuple[int, int, I8, float]]:
    """Tables (table_bits, golomb_order, frequencies, least bits of table and symbols), the most promising first."""
    occurring = int(np.count_nonzero(counts))
    tables = []
    for table_bits in range(max(1, (occurring - 1).bit_length()), precision + 1):
        frequencies = normalized_frequencies(counts, table_bits)
        order, table_size = best_golomb_order(frequencies)
        used = counts > 0
        data_size = float(np.sum(counts[used] * (table_bits - np.log2(frequencies[used]))))
        tables.append((table_bits, order, frequencies, table_size + data_size))
    return sorted(tables, key=lambda table: table[3])
