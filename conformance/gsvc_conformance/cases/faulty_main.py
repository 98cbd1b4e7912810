"""Faults of streams of profile `main` (spec.md sections 15.2, 15.5 and 15.6)."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any, Final

from gsvc_base.draws import Draws
from gsvc_conformance.cases.faults import Broken
from gsvc_conformance.cases.main_streams import MAIN_HEADER, Plan, codes_of, crowd
from gsvc_ref.bitstream.chunks import PREFIX_SIZE
from gsvc_ref.bitstream.coder import encode_uv
from gsvc_ref.bitstream.rules import kind_of
from gsvc_ref.testing import Lie, split_chunks, write_stream

PLANS: Final = (Plan("I", 9, lane_exponent=1), Plan("P", 2, lane_exponent=2, motion_cell=3), Plan("R"),
                Plan("P", motion_cell=1))  # fmt: skip
"""The frames of most streams."""
EMPTY: Final = (Plan("I"), Plan("P", 3), Plan("P", 2, own=False))
"""A P-frame with new splats and densities, behind an I-frame without splats."""


def streams(plans: tuple[Plan, ...], *lies: Lie, **header: Any) -> bytes:
    """A stream of frames with lies."""
    made = replace(MAIN_HEADER, **header)
    return write_stream(made, codes_of(made, plans, Draws(15)), index=False, lies=lies)


def _short(words: Any) -> Any:
    return words[:-1]


def _long(words: Any) -> list[int]:
    return [*words, 0]


def _odd(words: Any) -> bytes:
    return bytes(words.tobytes() + b"\0")


def _other(words: Any) -> list[int]:
    return [*words[:-1], int(words[-1]) ^ 1]


def _lowest(states: Any) -> Any:
    return states * 0 + 65535


def _zero(states: Any) -> Any:
    return states * 0


ELEMENTS: Final[tuple[tuple[str, str, str, str, Lie, int], ...]] = (
    ("R-3.2-1", "quantizer_80", "quantizer is 80", "79 is the highest", Lie("quantizer", 80), 0),
    ("R-3.2-1", "quantizer_255", "quantizer of a P-frame is 255", "79 is the highest", Lie("quantizer", 255, 1), 1),
    ("R-3.2-1", "frame_reserved_1", "frame_reserved is 1", "0", Lie("frame_reserved", 1), 0),
    ("R-3.2-1", "frame_reserved_2", "frame_reserved of a P-frame is 2", "0", Lie("frame_reserved", 2, 1), 1),
    (
        "R-15.5-1",
        "eight_lanes",
        "lane_exponent is 3, so that there are 8 lanes",
        "lane_count is 4",
        Lie("lane_exponent", 3),
        0,
    ),
    ("R-15.5-1", "most_lanes", "lane_exponent of a P-frame is 7", "lane_count is 4", Lie("lane_exponent", 7, 1), 1),
    (
        "R-15.5-2",
        "field_of_an_i_frame",
        "an I-frame has a motion field",
        "there is nothing that moves",
        Lie("motion_cell", 1),
        0,
    ),
    (
        "R-15.5-3",
        "no_densities",
        "an I-frame with splats has no densities",
        "it must have its own",
        Lie("densities_present", 0),
        0,
    ),
    (
        "R-15.5-3",
        "densities_of_nothing",
        "a P-frame without new splats has densities",
        "no plane has a code",
        Lie("densities_present", 1, 2),
        3,
    ),
    ("R-5-2", "splats_of_main", "splat_count is 16385", "level 1 allows 16384", Lie("splat_count", 16385), 0),
    (
        "R-5-2",
        "new_splats_of_main",
        "9 splats and 16384 new ones",
        "level 1 allows 16384 together",
        Lie("new_splat_count", 16384),
        1,
    ),
    ("R-6.6-5", "lane_state_65535", "lane states are 65535", "2^16 is the lowest", Lie("lane_state", _lowest), 0),
    ("R-6.6-5", "lane_state_0", "lane states of a P-frame are 0", "2^16 is the lowest", Lie("lane_state", _zero, 1), 1),
    (
        "R-7-1",
        "main_word_too_few",
        "the last word of an I-frame is missing",
        "its symbols need it",
        Lie("word", _short),
        0,
    ),
    ("R-7-1", "main_word_too_many", "a word is left over", "all words are taken", Lie("word", _long), 0),
    (
        "R-7-1",
        "main_other_word",
        "the last word of a P-frame has another bit",
        "every lane ends at 2^16",
        Lie("word", _other, 1),
        1,
    ),
    ("R-6.2-3", "main_odd_byte", "a byte stands behind the last word", "words fill the payload", Lie("word", _odd), 0),
    ("R-6.4-1", "main_frame_number", "the second frame has the number 2", "it is 1", Lie("frame_number", 2, 1), 1),
    ("R-6.3-1", "layer_count_0", "layer_count is 0", "1 to 4", Lie("layer_count", 0), 0),
    ("R-6.3-1", "layer_count_5", "layer_count is 5", "1 to 4", Lie("layer_count", 5), 0),
    ("R-6.3-1", "main_lane_count_65", "lane_count is 65", "1 to 64", Lie("lane_count", 65), 0),
)
"""Rule, slug, lie, truth, the lie as it is told, and how many frames precede the fault."""


def main_faults() -> Iterator[Broken]:
    """All of them."""
    yield Broken("R-5-4", "limit", "work_of_states", "1899 boxes of 139 x 128 pixels, 138 x 128 by the parameters",
                 "level 1 allows 2^25 pairs", _one_column_more)  # fmt: skip
    for rule, what, lie, truth, told, complete in ELEMENTS:
        also = ("R-15.6-2",) if rule == "R-7-1" else ()
        yield Broken(rule, kind_of(rule), what, lie, truth, partial(streams, PLANS, told), complete, also)
    yield Broken("R-15.5-2", kind_of("R-15.5-2"), "field_behind_nothing",
                 "a P-frame behind a frame without splats has a motion field", "there is nothing that moves",
                 partial(streams, EMPTY, Lie("motion_cell", 3, 1)), 1)  # fmt: skip
    yield Broken("R-3.1-4", kind_of("R-3.1-4"), "behind_densities", "a bit behind densities() is 1",
                 "align() skips zeros", partial(streams, PLANS, Lie("align", 1), width=70))  # fmt: skip
    yield Broken("R-15.5-4", kind_of("R-15.5-4"), "no_densities_yet",
                 "new splats, and no frame since the I-frame has densities", "they need some",
                 partial(streams, EMPTY, Lie("densities_present", 0, 1)), 1)  # fmt: skip
    yield Broken("R-15.5-4", kind_of("R-15.5-4"), "densities_before_the_i_frame",
                 "new splats, and only the frames before the I-frame have densities", "an I-frame forgets them",
                 partial(streams, (Plan("I", 4), *EMPTY), Lie("densities_present", 0, 2)), 2)  # fmt: skip
    yield Broken("R-6.4-3", kind_of("R-6.4-3"), "main_checksum", "the checksum of an I-frame is 0",
                 "it is that of its parameters",
                 partial(streams, PLANS, Lie("parameter_checksum", 0), parameter_checksum_flag=True))  # fmt: skip
    yield from _truncations()


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
    """Boxes that end just behind a column of pixels, by states alone (5-2)."""
    header = replace(MAIN_HEADER, level=2, width=1024, height=128)
    return write_stream(header, [crowd(header, (239, 0), 1899, 64)], lies=[Lie("level", 1)])
