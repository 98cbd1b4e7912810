"""Planes in whole numbers, bit by bit: sections 6.6 and 7."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from tests.hard_cases.measuring import Truth, exactly

U1 = NDArray[np.uint8]
U2 = NDArray[np.uint16]
I8 = NDArray[np.int64]


class Bits:
    """Bytes as a text of 0 and 1, most significant bits first."""

    def __init__(self, data: U1) -> None:
        self.rest = "".join(f"{byte:08b}" for byte in data.tolist())

    def take(self, count: int) -> int:
        """The next bits as a number."""
        taken, self.rest = self.rest[:count], self.rest[count:]
        return int(taken or "0", 2)

    def golomb(self, order: int) -> int:
        """An exponential Golomb code."""
        zeros = len(self.rest) - len(self.rest.lstrip("0"))
        return self.take(zeros) + self.take(order + 1 + zeros) - (1 << order)

    def align(self) -> None:
        """To the next byte."""
        self.rest = self.rest[len(self.rest) % 8 :]

    def little(self, size: int) -> int:
        """A number of `size` bytes, the least significant first."""
        return sum(self.take(8) << (8 * k) for k in range(size))

    def uv(self) -> int:
        """A number in bytes of seven bits, the least significant first."""
        value, shift = 0, 0
        while True:
            more, low = divmod(self.take(8), 128)
            value |= low << shift
            shift += 7
            if not more:
                return value


def decode_plane(data: U1, count: int, alphabet: int, entropy_precision: int, lane_count: int) -> Mapping[str, Truth]:
    """The symbols of a plane."""
    bits, w = Bits(data), (alphabet - 1).bit_length()
    mode = bits.take(2)
    if mode == 0:
        symbols = [bits.take(w)] * count
    elif mode == 1:
        symbols = [bits.take(w) for _ in range(count)]
    else:
        symbols = _coded(bits, count, w, entropy_precision, lane_count)
    return {"symbols": Truth(exactly(np.array(symbols)))}


def _coded(bits: Bits, count: int, w: int, R: int, lane_count: int) -> list[int]:
    table_bits, order = bits.take(5), bits.take(4)
    first, last = bits.take(w), bits.take(w)
    f = [bits.golomb(order) << (R - table_bits) for _ in range(last - first + 1)]
    bits.align()
    word_count = bits.uv()
    states = [bits.little(4) for _ in range(min(lane_count, count))]
    words = iter([bits.little(2) for _ in range(word_count)])
    symbols = []
    for i in range(count):
        x = states[i % len(states)]
        slot = x % 2**R
        s = next(s for s in range(len(f)) if sum(f[: s + 1]) > slot)
        x = f[s] * (x >> R) + slot - sum(f[:s])
        states[i % len(states)] = x if x >= 2**16 else x * 2**16 + next(words)
        symbols.append(first + s)
    return symbols


def encode_plane(symbols: U2, frequencies: I8, entropy_precision: int, lane_count: int) -> Mapping[str, Truth]:
    """The states that an encoder ends with, by (7-2)."""
    f, R = [int(frequency) for frequency in frequencies], entropy_precision
    states = [2**16] * min(lane_count, len(symbols))
    for i in range(len(symbols) - 1, -1, -1):
        s, j = int(symbols[i]), i % len(states)
        while states[j] >= f[s] * 2 ** (32 - R):
            states[j] //= 2**16
        quotient, rest = divmod(states[j], f[s])
        states[j] = quotient * 2**R + rest + sum(f[:s])
    return {"lane_states": Truth(exactly(np.array(states)))}
