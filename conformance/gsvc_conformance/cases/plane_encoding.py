"""Cases of the entropy encoder: lanes, tables, and states where a word is emitted."""

import numpy as np

from gsvc_base import spec
from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases.building import Array, result
from gsvc_conformance.cases.planes import LANES, LARGEST, LARGEST_TABLE, MIN_STATE, peaked
from gsvc_ref.bitstream.frequencies import normalized_frequencies


@case("core", "encode_plane", flags=["overflow"])
def largest_state_encoded() -> Inputs:
    """Three symbols that end in a state of 2^32 - 1."""
    expected = yield {"symbols": LARGEST, "frequencies": LARGEST_TABLE, "entropy_precision": 16, "lane_count": 1}
    assert expected["lane_states"].value.tolist() == [2**32 - 1]


@case("core", "encode_plane", flags=["ties"])
def state_at_the_bound() -> Inputs:
    """The state equals f(s) 2^(32-R): a word is emitted, before anything else is done.

    With R = 16 and f(s) = 1 the bound is 2^16, where every lane starts.
    """
    frequencies = np.array([65535, 1])
    expected = yield {"symbols": np.array([1, 0], np.uint16), "frequencies": frequencies, "entropy_precision": 16,
                      "lane_count": 2}  # fmt: skip
    assert expected["words"].value.tolist() == [0]


@case("core", "encode_plane", flags=["lanes"], each={f"{l}_for_{n}_symbols": (l, n) for l, n in LANES},
      said={"1_for_1_symbols": "1 for 1 symbol", "2_for_1_symbols": "2 for 1 symbol"})  # fmt: skip
def encoded_lanes(value: tuple[int, int], rng: Draws) -> Inputs:
    """Lanes, {key}: backwards through the symbols, each in its lane; the words are reversed at the end."""
    lanes, count = value
    symbols = peaked(rng, count, 5)
    frequencies = normalized_frequencies(np.array([5, 9, 30, 9, 1]), 13)
    yield from encoding(symbols, frequencies, 13, lanes)


@case("core", "encode_plane", each={str(bits): bits for bits in (12, 14, 16)})
def encoded_precision(value: int, rng: Draws) -> Inputs:
    """Planes with an entropy_precision of {key}."""
    symbols = peaked(rng, 150, 64)
    yield from encoding(symbols, normalized_frequencies(np.bincount(symbols, minlength=64), value), value, 3)


@case("core", "encode_plane", flags=["table"])
def symbols_that_do_not_occur(rng: Draws) -> Inputs:
    """Frequencies of 0 at both ends and in the middle."""
    symbols = rng.choice(np.array([3, 9, 31], np.uint16), 50)
    yield from encoding(symbols, normalized_frequencies(np.bincount(symbols, minlength=40), 12), 12, 2)


def encoding(symbols: Array, frequencies: Array, precision: int, lanes: int) -> Inputs:
    """States and words from which the decoder of section 7 gets the symbols back."""
    expected = yield {"symbols": symbols, "frequencies": frequencies, "entropy_precision": precision,
                      "lane_count": lanes}  # fmt: skip
    states, words = result(expected, "lane_states").tolist(), result(expected, "words").tolist()
    decoded, taken = spec.decode_symbols(len(symbols), frequencies.tolist(), precision, states, words, 0)
    assert (decoded.tolist(), taken) == (symbols.tolist(), len(words))
    assert states == [MIN_STATE] * len(states)
