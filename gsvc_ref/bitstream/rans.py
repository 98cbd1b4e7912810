"""The entropy coder: static rANS with integers only (spec.md section 7).

The frequencies f(s) are scaled to 2^R already, R = `entropy_precision`, and begin with that of `first_symbol`. Callers
check the tables first (frequencies that add up to 2^R, states of at least 2¹⁶): the kernels rely on it.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gsvc_base.arrays import I8, U2, U4
from gsvc_base.checks import door
from gsvc_ref._jit import kernel

LOWEST_STATE: Final = 1 << 16
"""The state in which each lane of an encoder starts, and in which that of a decoder ends."""


@kernel()
def decode_kernel(frequencies: I8, first_symbol: int, precision: int, states: I8, words: U2, symbols: U2) -> int:
    """Decode `symbols` (count,) u2: (7-1), R-7-2. Update `states` (lanes,) i8; the words taken, or -1 if one lacks."""
    symbol_of_slot = np.empty(1 << precision, np.uint16)
    cumulative = np.empty(len(frequencies), np.int64)
    total: int | np.int64 = 0
    for i in range(len(frequencies)):
        cumulative[i] = total
        symbol_of_slot[total : total + frequencies[i]] = i
        total += frequencies[i]
    mask = (1 << precision) - 1
    lanes, count = len(states), len(symbols)
    taken = 0
    for base in range(0, count, lanes):
        for lane in range(min(lanes, count - base)):
            x = states[lane]
            slot = x & mask
            s = np.int64(symbol_of_slot[slot])  # less `first_symbol`
            x = frequencies[s] * (x >> precision) + slot - cumulative[s]
            if x < LOWEST_STATE:  # one word is enough: x >= f (x >> R) >= 1
                if taken == len(words):
                    return -1
                x = (x << 16) | np.int64(words[taken])  # (7-1)
                taken += 1
            states[lane] = x
            symbols[base + lane] = first_symbol + s
    return taken


@kernel()
def encode_kernel(symbols: U2, frequencies: I8, first_symbol: int, precision: int, states: I8, words: U2) -> int:
    """Encode symbols backwards, to the end of `words` (count,) u2, update `states`, and return the number of words."""
    cumulative = np.cumsum(frequencies) - frequencies
    lanes, first_word = len(states), len(words)
    # From the last symbol to the first: what is put in last comes out first.
    for i in range(len(symbols) - 1, -1, -1):
        s = np.int64(symbols[i]) - first_symbol
        frequency = frequencies[s]
        x = states[i % lanes]
        # One word at most: x < 2**32 and f << (32 - R) >= 2**16.
        if x >= frequency << (32 - precision):
            first_word -= 1
            words[first_word] = x & 0xFFFF
            x >>= 16
        states[i % lanes] = ((x // frequency) << precision) + x % frequency + cumulative[s]  # (7-2)
    return len(words) - first_word


class EncodedPlane(NamedTuple):
    """The states and words that a decoder begins with."""

    lane_states: U4
    """(min(lane_count, count),)"""
    words: U2
    """(word_count,)"""


# twin of spec.encode_plane
@door
def encode_plane(
    symbols: ArrayLike, frequencies: ArrayLike, entropy_precision: int, lane_count: int, first_symbol: int = 0
) -> EncodedPlane:
    """The states and words with which a decoder finds symbols again (7-2); R-7-1, R-7-3.

    Parameters
    ----------
    symbols
        (count,) u2, each with a frequency above 0.
    frequencies
        (alphabet,) i8, those of the symbols from `first_symbol` on; they add up to 2^entropy_precision.
    entropy_precision, lane_count
        As in the sequence header.
    first_symbol
        The symbol that the first frequency is that of.

    Returns
    -------
    EncodedPlane
        `lane_states` and `words`.
    """
    values = np.ascontiguousarray(symbols, np.uint16)
    states = np.full(min(lane_count, len(values)), LOWEST_STATE, np.int64)
    words = np.empty(len(values), np.uint16)
    f = np.ascontiguousarray(frequencies, np.int64)
    used = encode_kernel(values, f, first_symbol, entropy_precision, states, words)
    return EncodedPlane(states.astype(np.uint32), words[len(words) - used :].copy())
