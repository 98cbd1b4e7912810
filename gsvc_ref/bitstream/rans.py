"""The entropy coder: static rANS with integers only (spec.md section 7), as its plain definition and as fast kernels.

Both take the frequencies f(s) already scaled to 2^R, R = `entropy_precision`, for the symbols from `first_symbol` on.
Callers check the tables first (frequencies that add up to 2^R, states of at least 2¹⁶): the kernels rely on it.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gsvc_ref._jit import kernel

LOWEST_STATE: Final = 1 << 16
"""Where each lane of an encoder starts and of a decoder ends."""

U2 = NDArray[np.uint16]
U4 = NDArray[np.uint32]
I8 = NDArray[np.int64]


def decode_plain(
    frequencies: Sequence[int], first_symbol: int, precision: int, states: list[int], words: Sequence[int], count: int
) -> tuple[list[int], int]:
    """Decode `count` symbols by (7-1): the symbols, and how many words were taken (-1: a word is missing).

    `states` holds min(lane_count, count) states and is left as the final states.
    """
    cumulative = [0]
    for frequency in frequencies:
        cumulative.append(cumulative[-1] + frequency)
    symbols: list[int] = []
    taken = 0
    for i in range(count):
        lane = i % len(states)
        x = states[lane]
        slot = x % 2**precision
        s = next(s for s in range(len(frequencies)) if slot < cumulative[s + 1])
        x = frequencies[s] * (x >> precision) + slot - cumulative[s]
        if x < LOWEST_STATE:
            if taken == len(words):
                return symbols, -1
            x = x * 2**16 + words[taken]  # (7-1)
            taken += 1
        states[lane] = x
        symbols.append(first_symbol + s)
    return symbols, taken


def encode_plain(
    symbols: Sequence[int], frequencies: Sequence[int], first_symbol: int, precision: int, lanes: int
) -> tuple[list[int], list[int]]:
    """Encode symbols, backwards: the lanes' states and the list of words that a decoder begins with."""
    cumulative = [0]
    for frequency in frequencies:
        cumulative.append(cumulative[-1] + frequency)
    states = [LOWEST_STATE] * min(lanes, len(symbols))
    words: list[int] = []
    for i in reversed(range(len(symbols))):
        s = symbols[i] - first_symbol
        x = states[i % len(states)]
        while x >= frequencies[s] << (32 - precision):
            words.append(x % 2**16)
            x >>= 16
        states[i % len(states)] = ((x // frequencies[s]) << precision) + x % frequencies[s] + cumulative[s]  # (7-2)
    return states, words[::-1]


@kernel()
def decode_kernel(frequencies: I8, first_symbol: int, precision: int, states: I8, words: U2, symbols: U2) -> int:
    """Twin of `decode_plain`: fills `symbols` (count,) u2, updates `states` (lanes,) i8; returns the words taken."""
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
            s = np.int64(symbol_of_slot[slot])
            x = frequencies[s] * (x >> precision) + slot - cumulative[s]
            if x < LOWEST_STATE:
                if taken == len(words):
                    return -1
                x = (x << 16) | np.int64(words[taken])  # (7-1)
                taken += 1
            states[lane] = x
            symbols[base + lane] = first_symbol + s
    return taken


@kernel()
def encode_kernel(symbols: U2, frequencies: I8, first_symbol: int, precision: int, states: I8, words: U2) -> int:
    """Fast twin of `encode_plain`: fills the end of `words` (count,) u2, updates `states`, returns how many words."""
    cumulative = np.cumsum(frequencies) - frequencies
    lanes, first_word = len(states), len(words)
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
    """What a decoder begins with."""

    lane_states: U4
    """(min(lane_count, count),)"""
    words: U2
    """(word_count,)"""


def encode_plane(
    symbols: U2, frequencies: I8, entropy_precision: int, lane_count: int, first_symbol: int = 0
) -> EncodedPlane:
    """The states and words with which a decoder finds symbols (count,) u2 again (7-2); R-7-1."""
    states = np.full(min(lane_count, len(symbols)), LOWEST_STATE, np.int64)
    words = np.empty(len(symbols), np.uint16)
    used = encode_kernel(symbols, frequencies, first_symbol, entropy_precision, states, words)
    return EncodedPlane(states.astype(np.uint32), words[len(words) - used :].copy())
