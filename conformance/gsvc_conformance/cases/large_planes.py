"""Planes of more symbols, bytes and words than 16 bits count."""

from typing import Final

import numpy as np

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases import CAPACITY
from gsvc_conformance.cases.building import Array, result
from gsvc_conformance.cases.large_rows import PERIOD, repeated
from gsvc_conformance.cases.planes import decoding, inputs, plane

SYMBOLS: Final = 90_001
ALPHABET: Final = 4096
"""The alphabet of 12-bit codes, the largest of any plane."""
LANES: Final = 3
EQUAL: Final = np.full(ALPHABET, 16)
"""Frequencies of 2^16: twelve bits a symbol, so that 90,001 symbols take 67,500 words."""


def symbols_of_large_planes(rng: Draws) -> Array:
    """90,001 symbols with a period of 251, but for the last, which is the last of the alphabet."""
    symbols = repeated(rng.integers(1, ALPHABET - 1, PERIOD).astype(np.uint16), SYMBOLS)
    symbols[-1] = ALPHABET - 1
    return symbols


@case("stress", "decode_plane", flags=[CAPACITY, "lanes"])
def many_symbols_and_words(rng: Draws) -> Inputs:
    """90,001 symbols in three lanes, which take some 67,500 words."""
    yield from decoding(symbols_of_large_planes(rng), ALPHABET, 16, LANES, counts=EQUAL)


@case("stress", "decode_plane", flags=[CAPACITY])
def many_raw_symbols(rng: Draws) -> Inputs:
    """A raw plane of 90,001 symbols of one byte."""
    symbols = symbols_of_large_planes(rng) % 255 + 1
    expected = yield inputs(plane(1, symbols, 256), SYMBOLS, 256)
    assert np.array_equal(result(expected, "symbols"), symbols)


@case("stress", "encode_plane", flags=[CAPACITY, "lanes"])
def many_symbols_and_words_encoded(rng: Draws) -> Inputs:
    """90,001 symbols in three lanes, which take some 67,500 words: an encoder goes through them from the last."""
    expected = yield {"symbols": symbols_of_large_planes(rng), "frequencies": EQUAL, "entropy_precision": 16,
                      "lane_count": LANES}  # fmt: skip
    assert len(result(expected, "words")) > 2**16
