"""Raw planes written as coded ones, with tables that no encoder would choose: so few symbols are never worth it."""

from collections.abc import Sequence
from random import Random
from typing import Final

import numpy as np

from gsvc_ref.bitstream.bit_writer import Writer
from gsvc_ref.bitstream.coder import U2, Element
from gsvc_ref.bitstream.frequencies import normalized_frequencies
from gsvc_ref.bitstream.plane_coding import CODED
from gsvc_ref.bitstream.rans import encode_plane

from .layout import elements, with_part_of_payload

MAX_SYMBOLS: Final = 64
"""Between the first and the last symbol of a plane that is recoded, lest its table make the stream long."""


def plane_recoded(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """One raw plane of a stream is coded, if there is one; what it stands for stays the same."""
    planes = [
        element
        for name, found in elements(data).items()
        for element in found
        if name.endswith(".symbol")
        and isinstance(element.value, np.ndarray)
        and 0 < np.ptp(element.value) < MAX_SYMBOLS
    ]
    if not planes:
        return data
    plane = rng.choice(planes)
    precision, lanes = (elements(data)[name][0].value for name in ("entropy_precision", "lane_count"))
    first, end = plane.bit // 8, (plane.bit + plane.bits + 7) // 8  # `plane_mode` is in the first byte
    return with_part_of_payload(data, first, end, coded(plane, rng, precision, lanes))


def coded(plane: Element, rng: Random, precision: int, lanes: int) -> bytes:
    """The bytes of a plane of mode 2 for the symbols of a raw one, with a table drawn from `rng`."""
    symbols: U2 = plane.value
    w = plane.bits // len(symbols)
    used = np.bincount(symbols)[int(symbols.min()) :] > 0
    counts = np.where(used, [rng.randrange(1, 99) for _ in used], [rng.randrange(2) for _ in used])
    fewest = int(np.count_nonzero(counts) - 1).bit_length()
    table_bits = rng.randrange(max(1, fewest), precision + 1)
    frequencies = normalized_frequencies(counts.astype(np.int64), table_bits)
    of_precision = frequencies << (precision - table_bits)
    states, words = encode_plane(symbols, of_precision, precision, lanes, first_symbol=int(symbols.min()))
    writer = Writer()
    writer.u("plane_mode", 2, CODED)
    writer.u("table_bits", 5, table_bits)
    order = writer.u("golomb_order", 4, rng.choice((0, 1, 2, 3, rng.randrange(16))))
    writer.u("first_symbol", w, int(symbols.min()))
    writer.u("last_symbol", w, int(symbols.max()))
    writer.golombs("frequency", len(frequencies), order, frequencies)
    writer.align()
    writer.uv("word_count", len(words))
    writer.array("lane_state", len(states), "u4", states)
    writer.array("word", len(words), "u2", words)
    return writer.getvalue()
