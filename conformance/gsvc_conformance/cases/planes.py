"""Cases of planes: modes, alphabets, tables, lanes, and states where the coder takes or emits a word."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base import spec
from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases.building import Array, result
from gsvc_ref.bitstream.bit_writer import Writer
from gsvc_ref.bitstream.frequencies import normalized_frequencies
from gsvc_ref.bitstream.golomb import golomb_bits
from gsvc_ref.bitstream.plane_coding import best_golomb_order
from gsvc_ref.bitstream.rans import encode_plane

MIN_STATE: Final = 1 << 16


def plane(mode: int, symbols: Array, alphabet: int) -> Array:
    """The bytes of a constant (0) or raw (1) plane."""
    w = (alphabet - 1).bit_length()
    s = Writer()
    s.u("plane_mode", 2, mode)
    for symbol in symbols[:1] if mode == 0 else symbols:
        s.u("symbol", w, int(symbol))
    s.align()
    return np.frombuffer(s.getvalue(), np.uint8)


def coded(
    symbols: Array,
    alphabet: int,
    precision: int,
    lanes: int,
    *,
    table_bits: int | None = None,
    order: int | None = None,
    counts: Array | None = None,
) -> Array:
    """The bytes of a coded plane; the table is that of `counts` (alphabet,), else that of the symbols."""
    table_bits = precision if table_bits is None else table_bits
    counts = np.bincount(symbols, minlength=alphabet) if counts is None else counts
    occurring = np.flatnonzero(counts)
    first, last = int(occurring[0]), int(occurring[-1])
    frequencies = normalized_frequencies(counts[first : last + 1], table_bits)
    order = best_golomb_order(frequencies)[0] if order is None else order
    states, words = encode_plane(symbols, frequencies << (precision - table_bits), precision, lanes, first)
    w = (alphabet - 1).bit_length()
    s = Writer()
    for name, size, number in (("plane_mode", 2, 2), ("table_bits", 5, table_bits), ("golomb_order", 4, order)):
        s.u(name, size, number)
    s.u("first_symbol", w, first)
    s.u("last_symbol", w, last)
    s.golombs("frequency", len(frequencies), order, frequencies)
    s.align()
    s.uv("word_count", len(words))
    s.array("lane_state", len(states), "u4", states)
    s.array("word", len(words), "u2", words)
    return np.frombuffer(s.getvalue(), np.uint8)


def inputs(data: Array, count: int, alphabet: int, precision: int = 14, lanes: int = 1) -> dict[str, Any]:
    """The inputs of decode_plane."""
    return {
        "data": data,
        "count": count,
        "alphabet": alphabet,
        "entropy_precision": precision,
        "lane_count": lanes,
    }


def decoding(symbols: Array, alphabet: int, precision: int, lanes: int, **table: Any) -> Inputs:
    """A coded plane from which its symbols come back."""
    data = coded(symbols, alphabet, precision, lanes, **table)
    expected = yield inputs(data, len(symbols), alphabet, precision, lanes)
    assert np.array_equal(result(expected, "symbols"), symbols)


def peaked(rng: Draws, count: int, alphabet: int) -> NDArray[np.uint16]:
    """Symbols around the middle of the alphabet, the first two of which differ."""
    symbols = np.clip(np.rint(rng.normal(alphabet / 2, max(0.6, alphabet / 10), count)), 0, alphabet - 1)
    symbols[: 2 if count > 1 else 1] = (alphabet // 2, alphabet // 2 - 1)[: min(count, 2)]
    return np.asarray(symbols, np.uint16)


ALPHABETS: Final = {f"alphabet_{a}": f"an alphabet of {a}" for a in (1, 2, 5, 256, 1000, 4096)}
"""Words for keys in titles."""
CONSTANTS: Final = ((1, 0), (2, 1), (5, 4), (256, 200), (4096, 4095))


@case("core", "decode_plane",
      each={f"alphabet_{a}": (a, s) for a, s in CONSTANTS}, said=ALPHABETS)  # fmt: skip
def constant(value: tuple[int, int]) -> Inputs:
    """One symbol for the whole plane, of {key}.

    A constant symbol takes w bits and no more; with an alphabet of one symbol it takes none.
    """
    alphabet, symbol = value
    expected = yield inputs(plane(0, np.array([symbol]), alphabet), 11, alphabet)
    assert (expected["symbols"].value == symbol).all()


@case("core", "decode_plane",
      each={f"alphabet_{a}": a for a in (1, 2, 5, 256, 1000, 4096)}, said=ALPHABETS)  # fmt: skip
def raw(value: int, rng: Draws) -> Inputs:
    """Symbols as they are, of w bits each, of {key}.

    w is the least integer with 2^w at least the alphabet: 0 for 1, 3 for 5.
    """
    symbols = rng.integers(0, value, 13).astype(np.uint16)
    symbols[-1] = value - 1
    expected = yield inputs(plane(1, symbols, value), 13, value)
    assert np.array_equal(expected["symbols"].value, symbols)


@case("core", "decode_plane", flags=["table"], rules=["R-6.6-4"],
      each={f"alphabet_{a}": a for a in (2, 5, 256, 4096)}, said=ALPHABETS)  # fmt: skip
def coded_alphabet(value: int, rng: Draws) -> Inputs:
    """A coded plane with the first and the last symbol of {key}."""
    symbols = peaked(rng, 90, value)
    symbols[-2:] = 0, value - 1
    yield from decoding(symbols, value, 14, 2)


@case("core", "decode_plane", flags=["table"])
def last_two_symbols() -> Inputs:
    """A table of the last two symbols of an alphabet of 4096."""
    yield from decoding(np.array([4095, 4094, 4094, 4095, 4094], np.uint16), 4096, 12, 1)


LANES: Final = ((1, 1), (1, 7), (2, 1), (2, 2), (2, 7), (3, 2), (3, 3), (3, 10), (64, 5), (64, 64), (64, 150),
                (33, 1000), (64, 2000))  # fmt: skip


@case("core", "decode_plane", flags=["lanes"], rules=["R-7-1"],
      each={f"{l}_for_{n}_symbols": (l, n) for l, n in LANES},
      said={"1_for_1_symbols": "1 for 1 symbol", "2_for_1_symbols": "2 for 1 symbol"})  # fmt: skip
def lanes(value: tuple[int, int], rng: Draws) -> Inputs:
    """Lanes that take turns, {key}.

    There are min(lane_count, count) states, and one list of words for all lanes, in the order of symbols.
    """
    lanes, count = value
    counts = np.array([5, 9, 30, 9, 1])
    yield from decoding(peaked(rng, count, 5), 5, 13, lanes, counts=counts)


@case("core", "decode_plane", flags=["table"], each={str(bits): bits for bits in range(12, 17)})
def precision(value: int, rng: Draws) -> Inputs:
    """An entropy_precision of {key}, and a table of as many bits."""
    yield from decoding(peaked(rng, 120, 64), 64, value, 3)


SHORT: Final = ((16, 1), (16, 5), (12, 1), (12, 11), (14, 7))


@case("core", "decode_plane", flags=["table"], rules=["R-6.6-3"],
      each={f"{bits}_of_{precision}": (precision, bits) for precision, bits in SHORT})  # fmt: skip
def table_bits(value: tuple[int, int], rng: Draws) -> Inputs:
    """A table of fewer bits than entropy_precision, {key}: its frequencies are shifted up."""
    symbols = rng.integers(0, 2, 70).astype(np.uint16) * 3 + 1
    yield from decoding(symbols, 6, value[0], 2, table_bits=value[1])


@case("core", "decode_plane", flags=["table"], each={str(order): order for order in range(16)})
def golomb_order(value: int, rng: Draws) -> Inputs:
    """Frequencies in exponential Golomb codes of order {key}."""
    yield from decoding(peaked(rng, 40, 16), 16, 12, 1, order=value)


@case("core", "decode_plane", flags=["table"], rules=["R-6.6-4"])
def zeros_in_the_table(rng: Draws) -> Inputs:
    """Symbols between the first and the last that never occur: their frequency is 0."""
    symbols = rng.choice(np.array([3, 9, 31], np.uint16), 50)
    symbols[:3] = 3, 9, 31
    yield from decoding(symbols, 40, 12, 2)


@case("core", "decode_plane", flags=["table"], rules=["R-3.1-3"])
def longest_golomb_code() -> Inputs:
    """A frequency of 65535 in a code of order 0: 16 zero bits, a one bit, 16 more bits.

    The table is two symbols, 65535 and 1, of 2^16; a decoder that reads the code in 32 bits loses one.
    """
    symbols = np.array([0] * 60 + [1] + [0] * 9, np.uint16)
    assert golomb_bits(np.array([65535]), 0).tolist() == [0] * 16 + [1] + [0] * 16
    counts = np.array([10**9, 1])
    assert normalized_frequencies(counts, 16).tolist() == [65535, 1]
    yield from decoding(symbols, 2, 16, 2, order=0, counts=counts)


@case("core", "decode_plane")
def many_words(rng: Draws) -> Inputs:
    """More than 127 words: word_count takes two bytes."""
    symbols = rng.integers(0, 256, 700).astype(np.uint16)
    assert len(encode_plane(symbols, np.full(256, 16), 12, 4)[1]) > 127
    yield from decoding(symbols, 256, 12, 4, counts=np.ones(256, np.int64))


@case("core", "decode_plane", rules=["R-7-1"])
def no_words() -> Inputs:
    """A plane that fits into the states: there are no words."""
    symbols = np.array([0, 1, 0, 0, 0], np.uint16)
    counts = np.array([15, 1])
    assert len(encode_plane(symbols, normalized_frequencies(counts, 12), 12, 1)[1]) == 0
    yield from decoding(symbols, 2, 12, 1, counts=counts)


@case("core", "decode_plane", flags=["overflow"])
def states_of_32_bits(rng: Draws) -> Inputs:
    """States above 2^31, which are negative as signed integers of 32 bits."""
    symbols = rng.integers(0, 200, 130).astype(np.uint16)
    counts = np.ones(200, np.int64)
    states, _ = encode_plane(symbols, normalized_frequencies(counts, 16), 16, 64)
    assert (states >= 1 << 31).any()
    yield from decoding(symbols, 200, 16, 64, counts=counts)


@case("core", "decode_plane", flags=["ties"])
def state_falls_to_the_least() -> Inputs:
    """After a symbol the state is exactly 2^16, and no word is taken; only a state below 2^16 takes one."""
    frequencies = [1 << 11, 1 << 11]
    state = (MIN_STATE >> 11) << 12  # decoding symbol 0 gives 2^11 (state >> 12) + 0 = 2^16
    assert spec.decode_symbols(1, frequencies, 12, [state], [], 0) == (np.zeros(1), 0)
    data = coded(np.array([0], np.uint16), 2, 12, 1, counts=np.array([1, 1]))
    assert int.from_bytes(data[-4:].tobytes(), "little") == state
    expected = yield inputs(data, 1, 2, 12)
    assert expected["symbols"].value.tolist() == [0]


@case("core", "decode_plane", flags=["ties"], rules=["R-6.6-5"])
def least_state() -> Inputs:
    """A state of 2^16, the least there is, and a word of 0: x becomes 1, then 2^16 again."""
    data = coded(np.array([0], np.uint16), 2, 16, 1, counts=np.array([1, 10**9]))
    assert data[-6:].tobytes() == MIN_STATE.to_bytes(4, "little") + bytes(2)
    expected = yield inputs(data, 1, 2, 16)
    assert expected["symbols"].value.tolist() == [0]


LARGEST: Final = np.array([2, 1, 2], np.uint16)
LARGEST_TABLE: Final = np.array([65533, 2, 1])
"""Symbols that take the state from 2^16 to 131071, to 2^32 - 2, of which a word is emitted, and to 2^32 - 1."""


@case("core", "decode_plane", flags=["overflow"], rules=["R-6.6-5"])
def largest_state() -> Inputs:
    """A state of 2^32 - 1, the largest there is."""
    data = coded(LARGEST, 3, 16, 1, counts=LARGEST_TABLE)
    assert data[-8:-4].tobytes() == b"\xff" * 4
    expected = yield inputs(data, 3, 3, 16)
    assert np.array_equal(expected["symbols"].value, LARGEST)
