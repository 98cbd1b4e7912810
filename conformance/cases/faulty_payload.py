"""Faults inside the payloads of frames: counts, flags, quantisers, codebooks, planes, and what they stand for."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any, Final

import numpy as np

from conformance.cases.building import quantizer_of
from conformance.cases.faults import Broken, colored, flat, overview, rich, room_behind, three, with_an_empty_frame
from gsvc_ref.bitstream import LEVELS
from gsvc_ref.bitstream.golomb import golomb_bits
from gsvc_ref.reconstruction import FrameCodes, SplatBlock
from gsvc_ref.testing import OVERVIEW_HEADER, Lie, overview_frames, write_stream

INFINITE_HIGH_BYTE: Final = 0x7C
"""position_high of infinities and of what is not a number."""


def payload_faults() -> Iterator[Broken]:
    """All of them."""
    yield from _descriptors()
    yield from _counts()
    yield from _blocks()
    yield from _planes()
    yield from _tables()
    yield from _reconstruction()


def _lies(
    rule: str, kind: str, truth: str, entries: Mapping[str, tuple[str, tuple[Lie, ...]]], of: Callable[..., bytes],
    complete: int = 0,
) -> Iterator[Broken]:  # fmt: skip
    """A stream per entry: what is special, the sentence, and the lies."""
    for what, (lie, lies) in entries.items():
        yield Broken(rule, kind, what, lie, truth, partial(of, *lies), complete)


def _descriptors() -> Iterator[Broken]:
    numbers = {
        "offset_infinite": ("cholesky_offset is infinite", (Lie("cholesky_offset", [np.inf]),)),
        "offset_not_a_number": ("cholesky_offset is NaN", (Lie("cholesky_offset", [np.nan], 2),)),
        "scale_infinite": ("cholesky_scale is infinite", (Lie("cholesky_scale", [np.inf], 1),)),
        "scale_not_a_number": ("cholesky_scale is NaN", (Lie("cholesky_scale", [np.nan]),)),
        "codeword_infinite": ("a codeword is -infinity", (Lie("codeword", [0, -np.inf, 0]),)),
        "codeword_not_a_number": ("a codeword is NaN", (Lie("codeword", [0, 0, np.nan]),)),
    }
    yield from _lies("R-3.1-2", "invalid", "numbers are finite", numbers, overview)
    for what, said, number in (("infinite", "infinite", np.inf), ("not_a_number", "NaN", np.nan)):
        lie = Lie("codeword", lambda words, number=number: [*words[:-1], number])
        yield Broken("R-3.1-2", "invalid", f"unused_codeword_{what}", f"a codeword that no splat uses is {said}",
                     "numbers are finite", partial(colored, 1, lie))  # fmt: skip
    codes = {"17_zeros": ("a frequency begins with 17 zero bits", (Lie("frequency", "0" * 17 + "1" * 40),))}
    yield from _lies("R-3.1-3", "malformed", "there are at most 16", codes, rich)
    skipped = {"constant": ("a bit that align() skips is 1", (Lie("align", 1),))}
    yield from _lies("R-3.1-4", "invalid", "skipped bits are 0", skipped, overview)
    yield from _lies("R-3.1-4", "invalid", "skipped bits are 0",
                     {"in_a_coded_plane": ("a bit skipped after a table is 1", (Lie("align", 1, 5),))},
                     rich)  # fmt: skip


def _counts() -> Iterator[Broken]:
    most = LEVELS[1].splats
    counts = {"one_more": most + 1, "four_billion": 2**32 - 1}
    yield from _lies("R-5-2", "limit", f"level 1 allows {most}",
                     {f"splats_{k}": (f"splat_count is {n}", (Lie("splat_count", n),)) for k, n in counts.items()},
                     overview)  # fmt: skip
    yield from _lies("R-5-2", "limit", f"level 1 allows {most}",
                     {f"new_splats_{k}": (f"new_splat_count is {n}", (Lie("new_splat_count", n),))
                      for k, n in counts.items()},
                     overview, 1)  # fmt: skip
    together = {"survivors_and_new": (f"one splat stays and {most} come", (Lie("new_splat_count", most),))}
    yield from _lies("R-5-2", "limit", f"level 1 allows {most}", together, overview, 1)
    for level in range(2, 6):
        splats = LEVELS[level].splats
        yield Broken("R-5-2", "limit", f"splats_of_level_{level}", f"splat_count is {splats + 1}",
                     f"level {level} allows {splats}",
                     partial(overview, Lie("splat_count", splats + 1), level=level))  # fmt: skip
    yield from _lies("R-6.4-3", "invalid", "it is that of the parameters",
                     {"i_frame": ("parameter_checksum is 1", (Lie("parameter_checksum", 1),))}, _checked)  # fmt: skip
    for number, name in ((1, "p_frame"), (2, "r_frame")):
        lies = (Lie("parameter_checksum", lambda crc: crc ^ 1, number),)
        yield from _lies("R-6.4-3", "invalid", "it is that of the parameters",
                         {name: ("one bit of parameter_checksum is another", lies)}, _checked, number)  # fmt: skip


def _checked(*lies: Lie) -> bytes:
    return overview(*lies, parameter_checksum_flag=True)


def _blocks() -> Iterator[Broken]:
    reserved = {f"bits_{bits:03b}": (f"block_reserved is {bits}", (Lie("block_reserved", bits),)) for bits in (1, 2, 4)}
    yield from _lies("R-6.5-1", "unsupported", "it is reserved and 0", reserved, overview)
    absent = {n: (f"{n}_present is 0 in an intra block", (Lie(f"{n}_present", 0),))
              for n in ("positions", "cholesky", "colors")}  # fmt: skip
    yield from _lies("R-6.5-2", "invalid", "an intra block has all attributes", absent, overview)
    alone = {n: (f"{n}_present is 1 without the attribute", (Lie(f"{n}_present", 1, 1),))
             for n in ("quantizer", "codebooks")}  # fmt: skip
    yield from _lies("R-6.5-3", "invalid", "it is 0 where the attribute is not present", alone, overview, 1)
    what_there_is = {
        0: ("first_block", "there are none to use", 0, (0, 1)),
        1: ("inter", "what intra blocks have is not for inter blocks", 1, (2,)),
        2: ("second_i_frame", "an I-frame forgets", 2, (3, 4)),
    }
    for block, (name, truth, complete, stages) in what_there_is.items():
        for n, lies in (("quantizer", _no_quantizer(block)), ("codebooks", _no_codebooks(block, stages))):
            entry = {f"{name}_{n}": (f"block {block} has no {n} of its own", lies)}
            yield from _lies("R-6.5-4", "invalid", truth, entry, three, complete)
    for n, lies in (("quantizer", _no_quantizer(1)), ("codebooks", _no_codebooks(1, (2, 3)))):
        entry = {f"empty_i_frame_{n}": (f"behind an I-frame without splats, a block has no {n} of its own", lies)}
        yield from _lies("R-6.5-4", "invalid", "every I-frame forgets", entry, with_an_empty_frame, 2)
    scales = {"zero": 0.0, "minus_zero": -0.0, "negative": -1.0, "subnormal": 2.0**-126 - 2.0**-149, "least": 2.0**-149}
    yield from _lies("R-6.5-5", "invalid", "it is a positive normal number",
                     {f"scale_{k}": (f"cholesky_scale is {v:.7g}", (Lie("cholesky_scale", [v], 1),))
                      for k, v in scales.items()}, overview)  # fmt: skip
    for element in ("stage_count", "codeword_count"):
        yield from _lies("R-6.5-6", "invalid", "it is 1, as the header has it",
                         {f"{element}_{n or 'zero'}": (f"{element} is {n}", (Lie(element, n),))
                          for n in (0, 2, 255)}, overview)  # fmt: skip
    positions = {
        "x_infinite": ("a position is infinite", (Lie("symbol", INFINITE_HIGH_BYTE),)),
        "y_infinite": ("a position is -infinity", (Lie("position_high[y].symbol", INFINITE_HIGH_BYTE | 0x80),)),
        "x_not_a_number": ("a position is NaN", (Lie("symbol", 0x7F), Lie("symbol", 0xFF, 1))),
    }
    yield from _lies("R-6.5-7", "invalid", "positions are finite", positions, overview)
    difference = {"difference": ("a difference is NaN", (Lie("symbol", INFINITE_HIGH_BYTE | 0x83, 9),))}
    yield from _lies("R-6.5-7", "invalid", "positions are finite", difference, overview, 1)


def _no_quantizer(block: int) -> tuple[Lie, ...]:
    """Lies that take the quantiser out of a block, where all have one; else the stream is whole."""
    channels = range(3 * block, 3 * block + 3)
    parts = (Lie(element, [], k) for element in ("cholesky_scale", "cholesky_offset") for k in channels)
    return Lie("quantizer_present", 0, block), *parts


def _no_codebooks(block: int, stages: tuple[int, ...]) -> tuple[Lie, ...]:
    """Lies that take the codebooks out of a block, where all have them; `stages` are its own in the stream."""
    parts = (Lie(element, "", k) for element in ("codeword_count", "codeword") for k in stages)
    return Lie("codebooks_present", 0, block), Lie("stage_count", "", block), *parts


def _planes() -> Iterator[Broken]:
    modes = {"plane_mode_3": ("plane_mode is 3", (Lie("plane_mode", 3),))}
    yield from _lies("R-6.6-1", "unsupported", "it is reserved", modes, overview)
    symbols: Any
    for what, step, said, symbols in (
        ("constant", 0, "the symbol is 5", 5),
        ("constant_highest", 0, "the symbol is 7", 7),
        ("raw", 1, "the last symbol is 7", [4, 7]),
        ("raw_first", 1, "the first symbol is 5", [5, 0]),
    ):
        yield Broken("R-6.6-2", "invalid", what, f"{said} in an alphabet of 5", "symbols are below it",
                     partial(colored, step, Lie("color_index[1].symbol", symbols)))  # fmt: skip
    ends = {k: (f"{k} is {n} in an alphabet of 5", (Lie(f"color_index[1].{k}", n),))
            for k, n in (("first_symbol", 5), ("last_symbol", 7))}  # fmt: skip
    yield from _lies("R-6.6-2", "invalid", "symbols are below it", ends, rich)
    fitting = room_behind(rich(), "word_count") // 2
    room = {"one_more": ("word_count is one more than fits", (Lie("word_count", fitting + 1),)),
            "most": ("word_count is 2^32 - 1", (Lie("word_count", 2**32 - 1),))}  # fmt: skip
    yield from _lies("R-6.6-6", "malformed", "it is at most half the bytes left", room, rich)


def _tables() -> Iterator[Broken]:
    bits: dict[str, tuple[str, tuple[Lie, ...]]] = {
        f"table_bits_{n}": (f"table_bits is {n}", (Lie("table_bits", n),)) for n in (0, 13, 31)
    }
    finer = (Lie("table_bits", 13), Lie("frequency", lambda f: f * (2**13 // f.sum())))
    bits["table_of_13_bits"] = ("table_bits is 13, and the frequencies add up to 2^13", finer)
    yield from _lies("R-6.6-3", "invalid", "it is 1..entropy_precision", bits, rich)
    tables: dict[str, tuple[str, tuple[Lie, ...]]] = {
        "ends_swapped": ("first_symbol exceeds last_symbol", (Lie("first_symbol", 4),)),
        "one_symbol": ("last_symbol equals first_symbol", (Lie("last_symbol", 0),)),
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
    yield from _lies("R-6.6-4", "invalid", "ends are in order and not 0, and all add up to 2^table_bits", tables, rich)
    states = {
        "second": ("the second lane_state is 65535", (Lie("lane_state", lambda x: [x[0], 65535]),)),
        "zero": ("the first lane_state is 0", (Lie("lane_state", lambda x: [0, x[1]]),)),
    }
    yield from _lies("R-6.6-5", "invalid", "states are at least 65536", states, rich)
    ending = {
        "state": ("a lane ends in another state", (Lie("lane_state", first_plus(1)),)),
        "word_left": ("a word is left over", (Lie("word_count", lambda n: n + 1), Lie("word", lambda w: [*w, 0]))),
        "word_missing": ("a word is missing", (Lie("word_count", lambda n: n - 1), Lie("word", lambda w: w[:-1]))),
        "last_word": ("the last word is another", (Lie("word", lambda w: [*w[:-1], int(w[-1]) ^ 1]),)),
        "word_changed": ("a word is another", (Lie("word", first_plus(1)),)),
    }
    yield from _lies("R-7-1", "malformed", "lanes end at 65536, and all words are taken", ending, rich)


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
    yield Broken("R-5-4", "limit", "one_splat_more", "513 splats cover 256x256 pixels: 2^25 + 2^16 pairs",
                 "level 1 allows 2^25", lambda: _work(513, 256, 256))  # fmt: skip
    yield Broken("R-5-4", "limit", "one_pixel_more", "a splat covers one pixel, 512 cover 256x256: 2^25 + 1 pairs",
                 "level 1 allows 2^25", _one_pair_more)  # fmt: skip


def _work(count: int, width: int, height: int) -> bytes:
    lies = (Lie("cholesky_offset", [1e30]), Lie("cholesky_offset", [1e30], 2))
    return flat(count, *lies, width=width, height=height)


def _one_pair_more() -> bytes:
    """512 splats that cover the frame and one of 0.01 pixels; with its own step the code of the small one is 0."""
    codes = np.zeros((513, 3), np.uint16)
    codes[:512] = 1, 0, 1
    quantizer = quantizer_of([1, 1, 1], [0.01, 0, 0.01])
    zeros = np.zeros((513, 2), np.uint16)
    zeros[512] = np.array([2.0**-9, 2.0**-9], np.float16).view(np.uint16)
    block = SplatBlock(zeros, codes, np.zeros((513, 1), np.uint16), quantizer, (np.zeros((1, 3), np.float16),))
    lies = [Lie("cholesky_scale", [1e30]), Lie("cholesky_scale", [1e30], 2)]
    header = replace(OVERVIEW_HEADER, width=256, height=256)
    return write_stream(header, [FrameCodes.intra_frame(block)], lies=lies)


def _overflowing() -> bytes:
    """The Cholesky factors of an I-frame are 3e38, those of the difference too."""
    frames = overview_frames()
    moved = SplatBlock(cholesky=np.zeros((1, 3), np.uint16), quantizer=quantizer_of([1, 1, 1], [1, 1, 1]))
    frames[1] = FrameCodes.predicted_frame(np.ones(1, np.bool_), moved)
    lies = [Lie("cholesky_offset", [3e38], channel) for channel in (1, 4)]
    return write_stream(OVERVIEW_HEADER, frames, lies=lies)
