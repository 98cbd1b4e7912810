"""Planes: a row of symbols, written as a constant, as raw bits or entropy coded (spec.md sections 6.6 and 7)."""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_base.arrays import I8, U2
from gsvc_base.checks import door
from gsvc_ref.bitstream.bit_reader import Reader
from gsvc_ref.bitstream.coder import Coder
from gsvc_ref.bitstream.header import SequenceHeader
from gsvc_ref.bitstream.plane_coding import CODED, CONSTANT, RAW, PlaneCode, choose_plane_code
from gsvc_ref.bitstream.rans import LOWEST_STATE, decode_kernel

NO_PLANE_CODE: Final = PlaneCode()
"""The elements that a Reader, which ignores values, is given."""


def plane(
    s: Coder,
    header: SequenceHeader,
    category: str,
    name: str,
    count: int,
    alphabet: int,
    symbols: NDArray[np.integer] | None = None,
) -> U2:
    """plane(count, alphabet) of spec.md section 6.6: `count` symbols 0..alphabet - 1 as (count,) u2.

    A Writer chooses the mode, the table and its order so that the plane takes as few bytes as it can find.
    """
    code = NO_PLANE_CODE if symbols is None else choose_plane_code(symbols, alphabet, header)
    with s.part(category, name):
        w = (alphabet - 1).bit_length()
        plane_mode = s.u("plane_mode", 2, code.plane_mode)
        if plane_mode == CONSTANT:
            symbol = s.u("symbol", w, code.first_symbol)
            _check_symbol(s, symbol, alphabet)
            read: U2 = np.full(count, symbol, np.uint16)
        elif plane_mode == RAW:
            read = s.fixed("symbol", count, w, code.symbols)
            if read.max() >= alphabet:
                first = int(np.argmax(read >= alphabet))
                _check_symbol(s, int(read[first]), alphabet, bit=s.element_bit + w * first)
        elif plane_mode == CODED:
            read = _coded_plane(s, header, count, alphabet, w, code)
        else:
            s.fail("R-6.6-1", "`plane_mode` is 3, which is reserved")
        s.align()
    return read


# twin of spec.decode_plane
@door
def decode_plane(data: ArrayLike, count: int, alphabet: int, entropy_precision: int, lane_count: int) -> U2:
    """The symbols of one plane, by (7-1).

    Parameters
    ----------
    data
        (n,) u1, the bytes of a plane(); bytes that follow it are ignored.
    count, alphabet
        Number of symbols, and the number above all of them.
    entropy_precision, lane_count
        As in the sequence header.

    Returns
    -------
    U2
        (count,) u2, each below `alphabet`.

    Raises
    ------
    GsvcError
        The bytes break a rule of sections 6.6 or 7.
    """
    header = SequenceHeader(level=1, width=1, height=1, entropy_precision=entropy_precision, lane_count=lane_count)
    return plane(Reader(np.asarray(data, np.uint8).tobytes()), header, "colors", "plane", count, alphabet)


def _check_symbol(s: Coder, symbol: int, alphabet: int, bit: int | None = None) -> None:
    if symbol >= alphabet:
        s.fail("R-6.6-2", f"a symbol is {symbol}; it must be below {alphabet}", bit=bit)


def _coded_plane(s: Coder, header: SequenceHeader, count: int, alphabet: int, w: int, code: PlaneCode) -> U2:
    """The part of a plane that belongs to `plane_mode` 2."""
    table_bits = s.u("table_bits", 5, code.table_bits)
    if not 1 <= table_bits <= header.entropy_precision:
        s.fail("R-6.6-3", f"`table_bits` is {table_bits}; it must be in 1..{header.entropy_precision}")
    golomb_order = s.u("golomb_order", 4, code.golomb_order)
    first_symbol = s.u("first_symbol", w, code.first_symbol)
    _check_symbol(s, first_symbol, alphabet)
    last_symbol = s.u("last_symbol", w, code.last_symbol)
    _check_symbol(s, last_symbol, alphabet)
    if first_symbol >= last_symbol:
        s.fail(
            "R-6.6-4", f"`first_symbol` is {first_symbol} and `last_symbol` {last_symbol}; it must be the greater one"
        )
    frequencies = s.golombs("frequency", last_symbol - first_symbol + 1, golomb_order, code.frequencies)
    _check_frequencies(s, frequencies, table_bits)
    s.align()
    word_count = s.uv("word_count", len(code.words))
    _check_room(s, 2 * word_count)
    states = s.array("lane_state", min(header.lane_count, count), "u4", code.states)
    if states.min() < LOWEST_STATE:
        first = int(np.argmax(states < LOWEST_STATE))
        s.fail("R-6.6-5", f"`lane_state` is {states[first]}; it must be at least 65536", bit=s.element_bit + 32 * first)
    state_bit = s.element_bit
    words = s.array("word", word_count, "u2", code.words)

    symbols = np.empty(count, np.uint16)
    final = states.astype(np.int64)
    scaled = frequencies << (header.entropy_precision - table_bits)
    read = decode_kernel(scaled, first_symbol, header.entropy_precision, final, words, symbols)
    if read != word_count:
        lack = "a word is missing" if read < 0 else f"{word_count - read} of {word_count} words are left over"
        s.fail("R-7-1", f"after the last symbol of a plane {lack}", bit=s.element_bit + (16 * read if read > 0 else 0))
    if (final != LOWEST_STATE).any():
        lane = int(np.argmax(final != LOWEST_STATE))
        s.fail("R-7-1", f"lane {lane} ends in state {final[lane]}, not 65536", bit=state_bit + 32 * lane)
    return symbols


def _check_frequencies(s: Coder, frequencies: I8, table_bits: int) -> None:
    total = int(frequencies.sum())
    if frequencies[0] == 0 or frequencies[-1] == 0:
        s.fail("R-6.6-4", "the frequencies of `first_symbol` and `last_symbol` must not be 0")
    if total != 1 << table_bits:
        s.fail("R-6.6-4", f"the frequencies add up to {total}; `table_bits` {table_bits} demands {1 << table_bits}")


def _check_room(s: Coder, size: int) -> None:
    if size > s.bytes_left:
        s.fail("R-6.6-6", f"the words of a plane take {size} bytes; the payload has {s.bytes_left} left")
