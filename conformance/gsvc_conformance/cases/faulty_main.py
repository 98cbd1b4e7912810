"""Faults of streams of profile `main` (spec.md sections 15.2, 15.5 and 15.6)."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any, Final

import numpy as np

from gsvc_base import spec
from gsvc_base.draws import Draws
from gsvc_conformance.cases.faults import Broken
from gsvc_conformance.cases.main_streams import MAIN_HEADER, Plan, codes_of, crowd
from gsvc_ref.bitstream.chunks import PREFIX_SIZE
from gsvc_ref.bitstream.coder import encode_uv
from gsvc_ref.bitstream.rules import kind_of
from gsvc_ref.main.cells import halving_count
from gsvc_ref.main.codes import MainCodes
from gsvc_ref.main.densities import SLOPED
from gsvc_ref.testing import Lie, split_chunks, write_stream

PLANS: Final = (Plan("I", 9, lane_exponent=1), Plan("P", 2, lane_exponent=2, motion_cell=3), Plan("R"),
                Plan("P", motion_cell=1))  # fmt: skip
"""The frames of most streams."""
EMPTY: Final = (Plan("I"), Plan("P", 3), Plan("P", 2, own=False))
"""A P-frame with new splats and densities, after an I-frame without splats."""


def streams(plans: tuple[Plan, ...], *lies: Lie, **header: Any) -> bytes:
    """A stream of frames with lies."""
    made = replace(MAIN_HEADER, **header)
    return write_stream(made, codes_of(made, plans, Draws(15)), index=False, lies=lies)


def _other(words: Any) -> list[int]:
    return [int(words[0]) ^ 0x4000, *words[1:]]


def _lowest(states: Any) -> Any:
    return states * 0 + 65535


def _zero(states: Any) -> Any:
    return states * 0


def _last_and_one(states: Any) -> Any:
    return [*states[:-1], states[-1] + 1]


def _flag_cleared(number: Any) -> Any:
    """`splat_number`, which is odd in frames with densities, in one without."""
    return number - 1


def _no_densities() -> list[Lie]:
    """The second frame, of the size of `MAIN_HEADER`, has no densities, and is sound but for that."""
    counts = {"density_family": 6, "scale_code": 6, "centre": 6, "slope": len(SLOPED),
              "halving_code": halving_count(MAIN_HEADER.width, MAIN_HEADER.height)}  # fmt: skip
    gone = [Lie(name, "", count + n) for name, count in counts.items() for n in range(count)]
    return [Lie("splat_number", _flag_cleared, 1), *gone]


def _word_left() -> list[Lie]:
    """The first group of the first frame has a word more, of which `word_count` knows, and is sound but for that."""
    counts: list[int] = []

    def more(count: int) -> int:
        counts.append(count)
        return count + 1

    return [
        Lie("word_count", more),
        Lie("word", lambda words: [*words[: counts[-1]], 0, *words[counts[-1] :]]),
    ]


TWO: Final = Plan("I", 9), Plan("I", 9)
"""Two I-frames with the same quantizer and densities."""

MANY: Final = (Plan("I", 30, lane_exponent=6), Plan("P", lane_exponent=6, kind="any"))
"""Frames whose lanes are two groups."""

FEW: Final = (Plan("I", 1, lane_exponent=6),)
"""A frame whose last lanes have neither symbols nor late bits."""

ELEMENTS: Final[tuple[tuple[str, str, str, str, Lie, int], ...]] = (
    ("R-3.2-1", "quantizer_80", "quantizer is 80", "79 is the highest", Lie("quantizer", 80), 0),
    ("R-3.2-1", "quantizer_255", "quantizer of a P-frame is 255", "79 is the highest", Lie("quantizer", 255, 1), 1),
    ("R-15.5-1", "eight_lanes", "lane_exponent is 3", "max_lane_exponent is 2", Lie("lane_exponent", 3), 0),
    ("R-15.5-1", "most_lanes", "lane_exponent of a P-frame is 12", "max_lane_exponent is 2",
     Lie("lane_exponent", 12, 1), 1),
    ("R-3.2-1", "lane_exponent_13", "lane_exponent is 13", "12 is the highest", Lie("lane_exponent", 13), 0),
    ("R-3.2-1", "lane_exponent_15", "lane_exponent of a P-frame is 15", "12 is the highest",
     Lie("lane_exponent", 15, 1), 1),
    ("R-15.5-2", "field_of_an_i_frame", "an I-frame has a motion field", "there is nothing that moves",
     Lie("motion_cell", 1), 0),
    ("R-5-2", "splats_of_main", "an I-frame has 16385 splats", "level 1 allows 16384",
     Lie("splat_number", 2 * 16384 + 1), 0),
    ("R-5-2", "splats_of_main_without_densities", "an I-frame has 16385 splats and no densities",
     "level 1 allows 16384", Lie("splat_number", 2 * 16384), 0),
    ("R-5-2", "new_splats_of_main", "9 splats and 16376 new ones", "level 1 allows 16384 together",
     Lie("splat_number", 2 * 16375 + 1, 1), 1),
    ("R-6.6-5", "lane_state_65535", "lane states are 65535", "2^16 is the lowest", Lie("lane_state", _lowest), 0),
    ("R-6.6-5", "lane_state_0", "lane states of a P-frame are 0", "2^16 is the lowest", Lie("lane_state", _zero, 1), 1),
    ("R-7-1", "main_word_too_few", "the last word of an I-frame is missing", "its symbols need it",
     Lie("word", lambda words: words[:-1]), 0),
    ("R-7-1", "main_word_too_many", "a word too many stands in front of the raw bits", "all words are taken",
     Lie("word", lambda words: [*words, 0]), 0),
    ("R-7-1", "main_other_word", "the first word of a P-frame has another bit", "lanes end at 2^16 and late bits",
     Lie("word", _other, 1), 1),
    ("R-7-1", "raw_byte_too_many", "a byte of zeros stands between words and raw bits", "they meet",
     Lie("raw_byte", lambda data: b"\0" + data), 0),
    ("R-7-1", "raw_byte_too_few", "the last byte of the raw string is missing", "its values need it",
     Lie("raw_byte", lambda data: data[1:]), 0),
    ("R-7-1", "raw_bits_left", "a bit after the last raw one is 1", "what is left of its byte is 0",
     Lie("raw_byte", lambda data: bytes([data[0] | 0x80]) + data[1:]), 0),
    ("R-6.4-1", "main_frame_number", "the second frame has the number 2", "it is 1", Lie("frame_number", 2, 1), 1),
    ("R-3.2-1", "layer_count_0", "layer_count is 0", "1 to 4", Lie("layer_count", 0), 0),
    ("R-3.2-1", "layer_count_5", "layer_count is 5", "1 to 4", Lie("layer_count", 5), 0),
    *(("R-3.2-1", f"main_tools_{1 << bit}", f"main_tools is {1 << bit}", "all its bits are reserved",
       Lie("main_tools", 1 << bit), 0) for bit in range(8)),
    ("R-5-11", "max_lane_exponent_7", "max_lane_exponent is 7", "level 1 allows 6", Lie("max_lane_exponent", 7), 0),
    ("R-6.3-1", "max_lane_exponent_13", "max_lane_exponent is 13", "0 to 12", Lie("max_lane_exponent", 13), 0),
)  # fmt: skip
"""Rule, slug, lie, truth, the lie as it is told, and how many frames precede the fault."""

OF_LANES: Final[tuple[tuple[str, str, str, str, tuple[Plan, ...], Lie], ...]] = (
    ("R-15.6-5", "word_count_beyond_the_payload", "the first group has 2^31 words", "the payload has fewer", MANY,
     Lie("word_count", 2**31)),
    ("R-15.6-5", "word_count_one_too_many", "the first group has a word more than the payload has room for",
     "the payload has fewer", MANY, Lie("word_count", 2**10)),
    ("R-7-1", "word_of_a_group_missing", "the first group has a word fewer than it takes", "its symbols need it", MANY,
     Lie("word_count", lambda count: count - 1)),
    ("R-7-1", "unused_lane", "the last of 64 lanes begins at 2^16 + 1, and has no symbol", "it must be at 2^16", FEW,
     Lie("lane_state", _last_and_one)),
)  # fmt: skip
"""Rule, slug, lie, truth, frames, and the lie as it is told of the first frame."""

_MANY_SPLATS: Final = Lie("splat_number", 2 * 16384 + 1)
ORDERS: Final[tuple[tuple[str, str, str, str, tuple[Lie, ...]], ...]] = (
    ("R-5-11", "R-3.2-1", "layer_count", "max_lane_exponent is 7, and layer_count 0",
     (Lie("max_lane_exponent", 7), Lie("layer_count", 0))),
    ("R-6.3-1", "R-3.2-1", "main_tools", "max_lane_exponent is 13, and main_tools 1",
     (Lie("max_lane_exponent", 13), Lie("main_tools", 1))),
    ("R-6.4-1", "R-5-2", "splat_number", "frame_number is 7, and there are 16385 splats",
     (Lie("frame_number", 7), _MANY_SPLATS)),
    ("R-3.2-1", "R-15.5-2", "motion_cell", "lane_exponent is 13, and an I-frame has a motion field",
     (Lie("lane_exponent", 13), Lie("motion_cell", 1))),
    ("R-15.5-1", "R-3.2-1", "quantizer", "lane_exponent is 3, and quantizer 80",
     (Lie("lane_exponent", 3), Lie("quantizer", 80))),
    ("R-15.5-2", "R-3.2-1", "quantizer", "an I-frame has a motion field, and quantizer is 80",
     (Lie("motion_cell", 1), Lie("quantizer", 80))),
    ("R-3.2-1", "R-5-2", "splat_number", "quantizer is 80, and there are 16385 splats",
     (Lie("quantizer", 80), _MANY_SPLATS)),
    ("R-15.5-5", "R-5-2", "splat_number", "an I-frame has no quantizer, and 16385 splats",
     (Lie("quantizer_present", 0), Lie("quantizer", ""), _MANY_SPLATS)),
    ("R-3.1-4", "R-7-1", "words", "a bit after densities() is 1, and the last word is missing",
     (Lie("align", 1), Lie("word", lambda words: words[:-1]))),
    ("R-6.6-5", "R-7-1", "words", "lane states are 65535, and the last word is missing",
     (Lie("lane_state", _lowest), Lie("word", lambda words: words[:-1]))),
    ("R-7-1", "R-6.4-3", "checksum", "the last word is missing, and the checksum wrong",
     (Lie("word", lambda words: words[:-1]), Lie("parameter_checksum", 0))),
)  # fmt: skip
"""Rule that is reported, rule that is not, the end of the slug, the lie, and the lies as they are told."""


def main_faults() -> Iterator[Broken]:
    """All of them."""
    for rule, other, what, lie, lies in ORDERS:
        make = partial(streams, PLANS, *lies, parameter_checksum_flag=other == "R-6.4-3", width=70)
        yield Broken(rule, kind_of(rule), f"main_before_{what}", lie, "the first of two faults counts", make, 0,
                     (other,))  # fmt: skip
    yield Broken("R-5-4", "limit", "work_of_states", "1899 boxes of 139 x 128 pixels, 138 x 128 by the parameters",
                 "level 1 allows 2^25 pairs", _one_column_more)  # fmt: skip
    for rule, what, lie, truth, told, complete in ELEMENTS:
        also = ("R-15.6-2",) if rule == "R-7-1" else ()
        yield Broken(rule, kind_of(rule), what, lie, truth, partial(streams, PLANS, told), complete, also)
    for rule, what, lie, truth, plans, told in OF_LANES:
        also = ("R-15.6-2",) if rule == "R-7-1" else ()
        yield Broken(rule, kind_of(rule), what, lie, truth, partial(streams, plans, told, max_lane_exponent=6), 0, also)
    yield Broken("R-7-1", "malformed", "word_of_a_group_left", "the first group has a word more than it takes",
                 "it takes all of them", partial(streams, MANY, *_word_left(), max_lane_exponent=6), 0,
                 ("R-15.6-2",))  # fmt: skip
    yield Broken("R-15.5-5", kind_of("R-15.5-5"), "no_quantizer", "an I-frame has no quantizer", "it must say it",
                 partial(streams, TWO, Lie("quantizer_present", 0, 1), Lie("quantizer", "", 1)), 1)  # fmt: skip
    yield Broken("R-15.5-3", kind_of("R-15.5-3"), "no_densities", "an I-frame with splats has no densities",
                 "it must have its own", partial(streams, TWO, *_no_densities()), 1)  # fmt: skip
    yield Broken("R-7-1", "malformed", "no_words", "no byte follows the lane states", "symbols need words",
                 partial(streams, PLANS, Lie("word", []), Lie("raw_byte", b"")), 0, ("R-15.6-2",))  # fmt: skip
    yield Broken("R-7-1", "malformed", "late_lane_of_17_bits", "lane 10 ends at 2^17 or more, with late bits",
                 "it must be below", _late_lane, 1, ("R-15.6-2",))  # fmt: skip
    yield Broken("R-6.6-5", kind_of("R-6.6-5"), "low_second_lane", "the state of the second lane is below 2^16",
                 "a word fewer and a state above it say the same", _low_lane)  # fmt: skip
    yield Broken("R-15.5-2", kind_of("R-15.5-2"), "field_behind_nothing",
                 "a P-frame after a frame without splats has a motion field", "there is nothing that moves",
                 partial(streams, EMPTY, Lie("motion_cell", 3, 1)), 1)  # fmt: skip
    yield Broken("R-3.1-4", kind_of("R-3.1-4"), "behind_densities", "a bit after densities() is 1",
                 "align() skips zeros", partial(streams, PLANS, Lie("align", 1), width=70))  # fmt: skip
    yield Broken("R-15.5-4", kind_of("R-15.5-4"), "no_densities_yet",
                 "new splats, and no frame since the I-frame has densities", "they need some",
                 partial(streams, EMPTY, Lie("splat_number", _flag_cleared)), 1)  # fmt: skip
    yield Broken("R-15.5-4", kind_of("R-15.5-4"), "densities_before_the_i_frame",
                 "new splats, and only the frames before the I-frame have densities", "an I-frame forgets them",
                 partial(streams, (Plan("I", 4), *EMPTY), Lie("splat_number", _flag_cleared, 1)), 2)  # fmt: skip
    yield Broken("R-15.5-4", kind_of("R-15.5-4"), "densities_of_a_p_frame_before_the_i_frame",
                 "new splats, and the P-frame before the I-frame has the last densities", "an I-frame forgets them",
                 partial(streams, (Plan("I", 4), Plan("P", 2), *EMPTY), Lie("splat_number", _flag_cleared, 2)),
                 3)  # fmt: skip
    yield Broken("R-15.5-4", kind_of("R-15.5-4"), "densities_before_the_i_frame_that_is_repeated",
                 "new splats after an I-frame without splats and an R-frame", "an I-frame forgets the densities",
                 partial(streams, (Plan("I", 4), Plan("I"), Plan("R"), Plan("P", 3)),
                         Lie("splat_number", _flag_cleared, 1)), 3)  # fmt: skip
    yield Broken("R-6.4-3", kind_of("R-6.4-3"), "main_checksum", "the checksum of an I-frame is 0",
                 "it is that of its parameters",
                 partial(streams, PLANS, Lie("parameter_checksum", 0), parameter_checksum_flag=True))  # fmt: skip
    yield from _truncations()


def _late_lane() -> bytes:
    """3 splats with differences of 11 late bits each: 16 lanes end with some, of which 9 have symbols."""
    header = replace(MAIN_HEADER, max_lane_exponent=6)
    (intra,) = codes_of(header, [Plan("I", 3)], Draws(17))
    large = np.full((3, 8), 1500, np.int64)
    inter = MainCodes(type="P", quantizer=24, lane_exponent=6, modes=np.full(3, 7, np.int64), differences=large)

    def higher(states: Any) -> Any:
        return [*states[:10], states[10] + 2**16, *states[11:]]

    return write_stream(header, [intra, inter], index=False, lies=[Lie("lane_state", higher, 1)])


def _low_lane() -> bytes:
    """The second lane begins as if it had to take a word after its first symbol, and that word is there."""
    (intra,) = codes_of(MAIN_HEADER, [Plan("I", 9, lane_exponent=1)], Draws(15))
    written: dict[str, list[int]] = {}

    def noted(name: str) -> Lie:
        return Lie(name, lambda values: written.setdefault(name, [int(value) for value in values]))

    sound = write_stream(MAIN_HEADER, [intra], index=False, lies=[noted("lane_state"), noted("word")])
    (x, other), words = written["lane_state"], written["word"]
    place = 0  # of the next word
    for start, frequency, _, lane in spec.read_main_stream(sound)["symbols"].tolist():
        if lane == 1:
            break
        x = frequency * (x >> 14) + x % 2**14 - start
        if x < 2**16:
            x, place = x << 16 | words[place], place + 1
    after = frequency * (other >> 14) + other % 2**14 - start
    low = (after >> 16) // frequency << 14
    states = [written["lane_state"][0], low + (after >> 16) % frequency + start]
    words = [*words[:place], after % 2**16, *words[place:]]
    return write_stream(MAIN_HEADER, [intra], index=False, lies=[Lie("lane_state", states), Lie("word", words)])


def _truncations() -> Iterator[Broken]:
    """A stream cut in each of its chunks."""
    data = streams(PLANS)
    at, names = PREFIX_SIZE, ("header", "i_frame", "p_frame", "r_frame", "second_p_frame", "end")
    for number, ((_, payload), name) in enumerate(zip(split_chunks(data), names, strict=True)):
        size = 1 + len(encode_uv(len(payload))) + len(payload) + 4
        yield Broken("R-6.2-4", "malformed", f"main_cut_in_{name}", f"the stream ends after {at + size // 2} bytes",
                     f"it has {len(data)}", partial(_cut, data, at + size // 2), max(0, number - 1))  # fmt: skip
        at += size


def _cut(data: bytes, size: int) -> bytes:
    return data[:size]


def _one_column_more() -> bytes:
    """Boxes that end just after a column of pixels, by states alone (5-2)."""
    header = replace(MAIN_HEADER, level=2, width=1024, height=128)
    return write_stream(header, [crowd(header, (239, 0), 1899, 64)], lies=[Lie("level", 1)])
