"""The entropy coder in words that are too short."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gsvc_conformance.operation import Values
from tests.hard_cases.oracle.coding import Bits

U2 = NDArray[np.uint16]


def encode_in_32_bits(symbols: U2, frequencies: NDArray[np.int64], entropy_precision: int, lane_count: int) -> Values:
    """f(s) 2^(32 - R) in 32 bits; a state of 0 would be shifted forever."""
    f, R = [int(frequency) for frequency in frequencies], entropy_precision
    states = [2**16] * min(lane_count, len(symbols))
    for i in reversed(range(len(symbols))):
        s, j = int(symbols[i]), i % len(states)
        while states[j] > 0 and states[j] >= (f[s] << (32 - R)) % 2**32:
            states[j] //= 2**16
        states[j] = (((states[j] // f[s]) << R) + states[j] % f[s] + sum(f[:s])) % 2**32
    return {"lane_states": np.array(states, np.uint32)}


def decode_in_signed_words(
    data: NDArray[np.uint8], count: int, alphabet: int, entropy_precision: int, lane_count: int
) -> Values:
    """States in signed words of 32 bits, in a coded plane."""
    bits, w, R = Bits(data), (alphabet - 1).bit_length(), entropy_precision
    bits.take(2)
    table_bits, order, first, last = bits.take(5), bits.take(4), bits.take(w), bits.take(w)
    f = np.array([bits.golomb(order) << (R - table_bits) for _ in range(last - first + 1)])
    bits.align()
    word_count = bits.uv()
    states: Any = np.array([bits.little(4) for _ in range(min(lane_count, count))], np.uint32).view(np.int32)
    words = iter([bits.little(2) for _ in range(word_count)])
    ends, symbols = np.cumsum(f), []
    for i in range(count):
        x = int(states[i % len(states)])
        slot = x % 2**R
        s = int(np.searchsorted(ends, slot, side="right"))
        x = int(f[s]) * (x >> R) + slot - int(ends[s] - f[s])
        states[i % len(states)] = np.int64(x * 2**16 + next(words, 0) if x < 2**16 else x).astype(np.int32)
        symbols.append(first + s)
    return {"symbols": np.array(symbols, np.uint16)}
