"""Faults inside the payloads of frames: numbers, checksums, planes, tables, and what they stand for."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Final

import numpy as np

from gsvc_conformance.cases.building import quantizer_of
from gsvc_conformance.cases.faults import Broken, colored, each_of, overview, rich, room_behind, with_table
from gsvc_ref.bitstream.golomb import golomb_bits
from gsvc_ref.paper import FrameCodes, SplatBlock
from gsvc_ref.testing import OVERVIEW_HEADER, Lie, overview_frames, write_stream

CODED: Final = "cholesky_code[l11]"
"""A coded plane of the rich stream: 60 symbols of an alphabet of 32."""

EARLY: Final = np.arange(60, dtype=np.uint16) % 5
RARE: Final = np.zeros(60, np.uint16)
"""Symbols of a plane, of all of five kinds, and of one: with a table of two, no lane needs a word for these."""


def payload_faults() -> Iterator[Broken]:
    """All of them."""
    yield from _checksums()
    yield from _planes()
    yield from _tables()
    yield from _reconstruction()


def _checksums() -> Iterator[Broken]:
    yield from each_of("R-6.4-3", "invalid", "it is that of the parameters",
                     {"i_frame": ("parameter_checksum is 1", (Lie("parameter_checksum", 1),))}, _checked)  # fmt: skip
    for number, name in ((1, "p_frame"), (2, "r_frame")):
        lies = (Lie("parameter_checksum", lambda crc: crc ^ 1, number),)
        yield from each_of("R-6.4-3", "invalid", "it is that of the parameters",
                         {name: ("one bit of parameter_checksum is another", lies)}, _checked, number)  # fmt: skip


def _checked(*lies: Lie) -> bytes:
    return overview(*lies, parameter_checksum_flag=True)


def _planes() -> Iterator[Broken]:
    modes = {"plane_mode_3": ("plane_mode is 3", (Lie("plane_mode", 3),))}
    yield from each_of("R-6.6-1", "unsupported", "it is reserved", modes, overview)
    symbols: Any
    for what, step, said, symbols in (
        ("constant", 0, "the symbol is 5", 5),
        ("constant_highest", 0, "the symbol is 7", 7),
        ("raw", 1, "the last symbol is 7", [4, 7]),
        ("raw_first", 1, "the first symbol is 5", [5, 0]),
    ):
        yield Broken("R-6.6-2", "invalid", what, f"{said} in an alphabet of 5", "symbols are below it",
                     partial(colored, step, Lie("color_index[1].symbol", symbols)))  # fmt: skip
    first = {"first_symbol": ("first_symbol is 5 in an alphabet of 5", (Lie("color_index[1].first_symbol", 5),))}
    yield from each_of("R-6.6-2", "invalid", "symbols are below it", first, rich)
    yield Broken("R-6.6-2", "invalid", "last_symbol", "last_symbol is 5 in an alphabet of 5, and occurs nowhere",
                 "symbols are below it",
                 lambda: with_table("color_index[1]", EARLY, [2048, 1023, 512, 256, 256, 1]))  # fmt: skip
    fitting = room_behind(rich(), "word_count") // 2
    room = {"one_more": ("word_count is one more than fits", (Lie("word_count", fitting + 1),)),
            "most": ("word_count is 2^32 - 1", (Lie("word_count", 2**32 - 1),))}  # fmt: skip
    yield from each_of("R-6.6-6", "malformed", "it is at most half the bytes left", room, rich)
    yield Broken("R-6.6-6", "malformed", "two_to_the_31", "word_count is 2^31 in place of 0", "there is no word",
                 lambda: with_table(CODED, RARE, [4090, 6], Lie(f"{CODED}.word_count", 2**31)))  # fmt: skip


def _tables() -> Iterator[Broken]:
    bits: dict[str, tuple[str, tuple[Lie, ...]]] = {
        f"table_bits_{n}": (f"table_bits is {n}", (Lie("table_bits", n),)) for n in (0, 13, 31)
    }
    finer = (Lie("table_bits", 13), Lie("frequency", lambda f: f * (2**13 // f.sum())))
    bits["table_of_13_bits"] = ("table_bits is 13, and the frequencies add up to 2^13", finer)
    yield from each_of("R-6.6-3", "invalid", "it is 1..entropy_precision", bits, rich)
    tables: dict[str, tuple[str, tuple[Lie, ...]]] = {
        "ends_swapped": ("first_symbol exceeds last_symbol", (Lie("first_symbol", 4),)),
        "sum_too_large": ("the frequencies add up to one more", (Lie("frequency", first_plus(1)),)),
        "sum_too_small": ("the frequencies add up to one less", (Lie("frequency", first_plus(-1)),)),
        "last_zero": ("the last frequency is 0", (Lie("frequency", swapped_ends),)),
        "first_zero": ("the first frequency is 0", (Lie("frequency", lambda f: swapped_ends(f[::-1])[::-1]),)),
        "sum_beyond_16_bits": ("the frequencies add up to 2^16 more", (Lie("frequency", both_plus(2**15)),)),
        "frequency_beyond_16_bits": ("a frequency is 2^16 more", (Lie("frequency", first_plus(2**16)),)),
        "sum_beyond_32_bits": (
            "the frequencies add up to 2^32 more",
            (Lie("golomb_order", 15), Lie("frequency", lambda f: in_order_15(both_plus(2**31)(f)))),
        ),
    }
    yield from each_of(
        "R-6.6-4", "invalid", "ends are in order and not 0, and all add up to 2^table_bits", tables, rich
    )
    yield Broken("R-6.6-4", "invalid", "one_symbol", "last_symbol equals first_symbol, of frequency 2^table_bits",
                 "a plane of one symbol is never coded",
                 lambda: with_table(CODED, RARE, [4096]))  # fmt: skip
    states = {
        "second": ("the second lane_state is 65535", (Lie("lane_state", lambda x: [x[0], 65535]),)),
        "zero": ("the first lane_state is 0", (Lie("lane_state", lambda x: [0, x[1]]),)),
    }
    yield from each_of("R-6.6-5", "invalid", "states are at least 65536", states, rich)
    ending = {
        "state": ("a lane ends in another state", (Lie("lane_state", first_plus(1)),)),
        "word_left": ("a word is left over", (Lie("word_count", lambda n: n + 1), Lie("word", lambda w: [*w, 0]))),
        "word_missing": ("a word is missing", (Lie("word_count", lambda n: n - 1), Lie("word", lambda w: w[:-1]))),
        "last_word": ("the last word is another", (Lie("word", lambda w: [*w[:-1], int(w[-1]) ^ 1]),)),
        "word_changed": ("a word is another", (Lie("word", first_plus(1)),)),
    }
    yield from each_of("R-7-1", "malformed", "lanes end at 65536, and all words are taken", ending, rich)


def first_plus(amount: int) -> Callable[[Any], Any]:
    """A lie about the first of a run."""
    return lambda truth: [int(truth[0]) + amount, *truth[1:].tolist()]


def both_plus(amount: int) -> Callable[[Any], Any]:
    """A lie about the first two of a run."""
    return lambda truth: [int(truth[0]) + amount, int(truth[1]) + amount, *truth[2:].tolist()]


def in_order_15(values: list[int]) -> str:
    """The bits of exponential Golomb codes of order 15, which reach 2^31 with 16 zero bits."""
    return "".join(map(str, golomb_bits(np.array(values), 15)))


def swapped_ends(truth: Any) -> Any:
    """Frequencies whose sum is right and whose last one is 0."""
    return [int(truth[0] + truth[-1]), *truth[1:-1].tolist(), 0]


def _reconstruction() -> Iterator[Broken]:
    yield Broken("R-8-1", "invalid", "cholesky", "3e38 + 3e38 is infinite in binary32", "parameters are finite",
                 _overflowing, 1)  # fmt: skip
    yield Broken("R-8-1", "invalid", "intra_cholesky", "63 times 3e38 is infinite in binary32", "parameters are finite",
                 lambda: overview(Lie("cholesky_scale", [3e38]), Lie("cholesky_code[l11].symbol", 63)))  # fmt: skip
    yield Broken("R-8-1", "invalid", "infinity_minus_infinity", "an infinite product and -3e38", "no step is infinite",
                 lambda: overview(Lie("cholesky_scale", [3e38]), Lie("cholesky_offset", [-3e38]),
                                  Lie("cholesky_code[l11].symbol", 63)))  # fmt: skip


def _overflowing() -> bytes:
    """The Cholesky factors of an I-frame are 3e38, those of the difference too."""
    frames = overview_frames()
    moved = SplatBlock(cholesky=np.zeros((1, 3), np.uint16), quantizer=quantizer_of([1, 1, 1], [1, 1, 1]))
    frames[1] = FrameCodes.predicted_frame(np.ones(1, np.bool_), moved)
    lies = [Lie("cholesky_offset", [3e38], channel) for channel in (1, 4)]
    return write_stream(OVERVIEW_HEADER, frames, lies=lies)
