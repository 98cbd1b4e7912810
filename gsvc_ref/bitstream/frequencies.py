"""Frequencies of a plane's symbols: integers that add up to a power of two and cost the fewest bits.

With counts n(s), a table f of 2^t units costs the sum of n(s) (t - log2 f(s)) bits. Every term is convex, so the units
after each symbol's first go one by one to where the next one saves most, n(s) log2((f(s) + 1) / f(s)), the lowest
symbol on a tie. The table of 2^(t+1) units goes on where that of 2^t stopped: one run gives the tables of all sizes.
"""

from collections.abc import Iterator
from functools import cache
from heapq import heapify, heapreplace
from typing import Final

import numpy as np

from gsvc_base.arrays import F8, I8
from gsvc_base.errors import UsageError
from gsvc_ref._jit import kernel

MAX_UNITS: Final = 1 << 16
"""Units of the largest table (`entropy_precision` is at most 16)."""

LN_2: Final = 0.6931471805599453
"""The binary64 nearest to ln 2."""

SERIES: Final = 24
"""Terms of the logarithms; the last one adds less than 1e-24 of the first."""


@cache
def savings() -> F8:
    """log2((f + 1) / f) for f = 1..MAX_UNITS as (MAX_UNITS + 1,) f8, infinite for f = 0.

    From ln((f + 1) / f) = 2 (z + z^3 / 3 + z^5 / 5 + ...) with z = 1 / (2 f + 1): sums, products and quotients have the
    same bits on every machine, which those of a library's logarithm need not have.
    """
    z = 1 / (2 * np.arange(1, MAX_UNITS + 1) + 1.0)
    total = np.zeros_like(z)
    for k in reversed(range(SERIES)):
        total = total * (z * z) + 1 / (2 * k + 1)  # smallest terms first
    return np.concatenate([[np.inf], total * z * (2 / LN_2)])


@cache
def log2_table() -> F8:
    """log2 f for f = 0..MAX_UNITS, (MAX_UNITS + 1,) f8: sums of savings."""
    return np.concatenate([[-np.inf], [0.0], np.cumsum(savings()[1:-1])])


def normalized_frequencies(counts: I8, table_bits: int) -> I8:
    """The definition: integers (n,) i8 that add up to 2^table_bits, at least 1 where a symbol occurs, of least cost.

    A UsageError says that more symbols occur than there are units.
    """
    frequencies = (counts > 0).astype(np.int64)
    units = (1 << table_bits) - int(frequencies.sum())
    if units < 0:
        raise UsageError(f"{frequencies.sum()} symbols occur; a table of {1 << table_bits} has no room for them")

    saved = savings()

    def entry(symbol: int) -> tuple[float, int]:
        return -float(counts[symbol]) * float(saved[frequencies[symbol]]), symbol

    heap = [entry(int(symbol)) for symbol in np.flatnonzero(counts)]
    heapify(heap)
    for _ in range(units):
        symbol = heap[0][1]
        frequencies[symbol] += 1
        heapreplace(heap, entry(symbol))
    return frequencies


def all_frequencies(counts: I8, most_bits: int) -> Iterator[tuple[int, I8]]:
    """Every table_bits from the least possible, at least 1, to `most_bits`, with its `normalized_frequencies`."""
    occurring = np.flatnonzero(counts)
    n, f = counts[occurring], np.ones(len(occurring), np.int64)
    saves = n * savings()[1]  # (symbols,) f8: what the next unit of each saves
    heap = np.argsort(-saves, kind="stable")  # sorted, so it is a heap
    units = len(n)
    for table_bits in range(max(1, (len(n) - 1).bit_length()), most_bits + 1):
        _give_units(n, f, (1 << table_bits) - units, savings(), saves, heap)
        units = 1 << table_bits
        frequencies = np.zeros(len(counts), np.int64)
        frequencies[occurring] = f
        yield table_bits, frequencies


@kernel()
def _give_units(n: I8, f: I8, units: int, saved: F8, saves: F8, heap: I8) -> None:
    """Give units to the frequencies f of symbols that occur n times; the heap is a list of symbols, (symbols,) i8."""
    for _ in range(units):
        symbol = heap[0]
        f[symbol] += 1
        saves[symbol] = n[symbol] * saved[f[symbol]]
        # Sift down: only the saving of the symbol at the top has changed.
        place = 0
        while True:
            child = 2 * place + 1
            if child >= heap.size:
                break
            if child + 1 < heap.size and comes_before(heap[child + 1], heap[child], saves):
                child += 1
            if not comes_before(heap[child], symbol, saves):
                break
            heap[place] = heap[child]
            place = child
        heap[place] = symbol


@kernel(inline=True)
def comes_before(a: int, b: int, saves: F8) -> bool:
    """Whether symbol a gets the next unit rather than b."""
    return bool(saves[a] > saves[b] or (saves[a] == saves[b] and a < b))
