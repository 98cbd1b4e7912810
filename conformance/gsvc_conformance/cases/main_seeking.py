"""Cases of seeking in streams of profile `main`, with layers and without; those of profile `paper` are in `seeking`."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from typing import Final

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases import CAPACITY
from gsvc_conformance.cases.building import Chunks, operated, result
from gsvc_conformance.cases.container import INDICES_IN_WORDS, entries_of, indices, with_index
from gsvc_conformance.cases.faults import end_of
from gsvc_conformance.cases.main_layers import LayerPlan, with_layers
from gsvc_conformance.cases.main_sizes import REPEATED
from gsvc_conformance.cases.main_streams import MAIN_HEADER, Plan, codes_of, main_stream
from gsvc_conformance.cases.pace import LARGEST, MAIN, group
from gsvc_conformance.cases.seeking import RANGES, check_slice, damaged
from gsvc_ref.bitstream.chunks import PREFIX_SIZE
from gsvc_ref.bitstream.coder import encode_uv
from gsvc_ref.testing import Lie, join_chunks, split_chunks, write_stream

PLANS: Final = (
    Plan("I", 7), Plan("P", 2, motion_cell=3, kind="any"), Plan("P", 1, None, own=False),
    Plan("I", 6, 30), Plan("R"), Plan("P", 2, None, motion_cell=2, kind="any", own=False),
    Plan("I", 5, 20), Plan("P", 1, None, motion_cell=3, kind="any", own=False),
)  # fmt: skip
"""Frames I P P I R P I P, as `seeking.RANGES` has them; P-frames use quantizer, densities and models that are kept."""
LAYERS: Final = (
    LayerPlan(0, 1, Plan("I", 5)), LayerPlan(1, 1, Plan("P", 1)), LayerPlan(2, 2, Plan("I", 3)),
    LayerPlan(3, 1, Plan("I", 4)), LayerPlan(3, 2, Plan("I", 2)), LayerPlan(4, 1, Plan("R")),
    LayerPlan(5, 1, Plan("P", 2)), LayerPlan(6, 2, Plan("I", 6)), LayerPlan(7, 2, Plan("P")),
)  # fmt: skip
"""Layers of these frames, whose chunks a decoder of the base hops over."""


@cache
def stream(*, index: bool = True) -> bytes:
    """The stream of `PLANS`, whose header does not tell the number of frames."""
    codes = codes_of(MAIN_HEADER, PLANS, Draws(101))
    return write_stream(MAIN_HEADER, codes, index=index, lies=[Lie("frame_count", 0)])


@cache
def layered() -> bytes:
    """The stream of `PLANS` with `LAYERS`: chunks H I n P n P n I n n R n P n I n P n E."""
    return with_layers(Draws(101), PLANS, LAYERS)


def edited(edit: Callable[[Chunks], Chunks]) -> bytes:
    """The stream without index after an operation on its chunks H I P P I R P I P E."""
    return operated(edit, stream(index=False))


def with_chunk(place: int, *chunk: tuple[bytes, bytes]) -> bytes:
    """The stream without index with further chunks before the frame of a number."""
    return edited(lambda c: [*c[: place + 1], *chunk, *c[place + 1 :]])


@case("core", "seek", flags=["kept"], each={name: name for name in RANGES})
def main_range_of(value: str) -> Inputs:
    """Frames I P P I R P I P: {key}."""
    first, last = RANGES[value]
    expected = yield {"stream": stream(), "first": first, "last": last}
    check_slice(expected, stream(), first, last)


@case("core", "seek", flags=["index"], each={name: name for name in INDICES_IN_WORDS},
      said=INDICES_IN_WORDS)  # fmt: skip
def main_seek_with_index(value: str) -> Inputs:
    """{key}: an index is a help and never an authority, so the frames are the same."""
    bare = stream(index=False)
    entries = indices(bare)[value]
    data = bare if entries is None else with_index(entries, bare)
    expected = yield {"stream": data, "first": 4, "last": 6}
    check_slice(expected, bare, 4, 6)


def forged() -> bytes:
    """I, an ancillary chunk that holds a whole I-frame 1, I, R, and an index that names the hidden one."""
    first, hidden, second = codes_of(MAIN_HEADER, [Plan("I", 3), Plan("I", 4), Plan("I", 5)], Draws(103))
    data = write_stream(MAIN_HEADER, [first, second, REPEATED], index=False)
    whole = join_chunks([split_chunks(write_stream(MAIN_HEADER, [first, hidden], index=False))[2]], prefix=b"")
    before = join_chunks(split_chunks(data)[:2], prefix=data[:PREFIX_SIZE])
    inside = len(before) + 1 + len(encode_uv(len(whole)))
    (_, start), *_ = entries_of(data)
    steps = encode_uv(2) + b"".join(encode_uv(n) for n in (0, start, 1, inside - start))
    return operated(lambda c: [*c[:2], (b"q", whole), *c[2:-1], (b"x", steps), end_of(3, steps)], data)


@case("core", "seek", flags=["index"], each={"itself": (1, 1), "behind": (2, 2), "beyond": (3, 3)},
      said={"itself": "the frame that it names", "behind": "the one behind",
            "beyond": "what is beyond the end"})  # fmt: skip
def main_forged_index(value: tuple[int, int]) -> Inputs:
    """A legal stream whose index names a whole I-frame inside of another payload; asked for: {key}."""
    expected = yield {"stream": forged(), "first": value[0], "last": value[1]}
    check_slice(expected, forged(), *value)


@case("core", "seek", flags=["unknown"], each={"i_frame": (3, 3), "behind": (4, 5), "first_i_frame": (1, 1)},
      said={"i_frame": "an I-frame", "behind": "frames after it",
            "first_i_frame": "a frame of the first group"})  # fmt: skip
def main_ancillary_chunks(value: tuple[int, int]) -> Inputs:
    """Chunks of unknown types, and of layers that the stream has not, stand between all others; asked for: {key}."""
    extra: Chunks = [(b"i", b"\0"), (b"z", bytes(300)), (b"n", b"\x50"), (b"x", b"\0"), (b"p", b"")]
    data = edited(lambda c: [c[0], *(part for chunk in c[1:-1] for part in (*extra, chunk)), c[-1]])
    expected = yield {"stream": data, "first": value[0], "last": value[1]}
    check_slice(expected, data, *value)


@case("core", "seek", flags=["empty"],
    each={"empty_i_frame": (2, 2), "p_frame_behind": (3, 4), "new_splats_behind": (5, 6), "r_frame": (7, 7)},
    said={"empty_i_frame": "an I-frame without splats", "p_frame_behind": "the P-frame behind it",
          "new_splats_behind": "P-frames that have splats again", "r_frame": "an R-frame"})  # fmt: skip
def main_seek_empty_frames(value: tuple[int, int]) -> Inputs:
    """Frames I P I P P P P R I, of which the third to fifth have no splats; asked for: {key}."""
    p = Plan("P", 3, kind="any")
    plans = Plan("I", 5), p, Plan("I"), Plan("P"), Plan("P"), p, replace(p, count=0), Plan("R"), Plan("I", 1)
    data = main_stream(Draws(107), *plans, index=True)
    expected = yield {"stream": data, "first": value[0], "last": value[1]}
    check_slice(expected, data, *value)


LAYERED: Final = ("first_frame", "from_the_first", "in_a_group", "i_frame", "r_frame", "behind_an_r_frame",
                  "across_two_i_frames", "last_frame", "beyond_the_end")  # fmt: skip
"""Those of `RANGES` that are asked for of a stream with layers."""


@case("core", "seek", rules=["R-6.2-5", "R-12.6-5"], flags=["unknown"], each={name: RANGES[name] for name in LAYERED})
def main_base_of_layers(value: tuple[int, int]) -> Inputs:
    """Frames I P P I R P I P with layers, of which those of the base are sought: {key}."""
    expected = yield {"stream": layered(), "first": value[0], "last": value[1]}
    check_slice(expected, layered(), *value)


@case("core", "seek", rules=["R-15.13-6"], flags=["unknown"])
def main_base_of_lost_layers() -> Inputs:
    """The chunks of all layers are lost, and masks name them: the base is decoded all the same."""
    data = operated(lambda c: [chunk for chunk in c if chunk[0] != b"n"], layered())
    expected = yield {"stream": data, "first": 4, "last": 5}
    check_slice(expected, layered(), 4, 5)


@case("core", "seek", flags=["lanes"], rules=["R-5-11"])
def main_seek_by_256_lanes() -> Inputs:
    """A stream of level 2 whose frames have 256 lanes, in groups of 32."""
    p = Plan("P", 3, lane_exponent=8, motion_cell=3)
    first = replace(p, type="I", count=60, motion_cell=0)
    data = main_stream(Draws(109), first, p, first, p, p, level=2, max_lane_exponent=8)
    expected = yield {"stream": data, "first": 3, "last": 4}
    check_slice(expected, data, 3, 4)


@case("core", "seek", flags=["odd-size", "large-frame"], rules=["R-12.6-3"])
def main_seek_in_a_large_frame() -> Inputs:
    """Frames I P I P of 8192x2160 pixels, of level 5."""
    p = Plan("P", 1, motion_cell=1)
    data = main_stream(Draws(113), Plan("I", 20), p, Plan("I", 20), p, width=8192, height=2160, level=5)
    expected = yield {"stream": data, "first": 3, "last": 3}
    check_slice(expected, data, 3, 3)


@case("core", "seek", flags=[CAPACITY], rules=["R-6.4-1"],
    each={"behind_the_last_i_frame": (298, 299), "all_but_the_first": (1, 299)})  # fmt: skip
def main_frames_beyond_8_bits(value: tuple[int, int]) -> Inputs:
    """A group of 290 frames and one of ten; asked for: {key}."""
    first, other, last = codes_of(MAIN_HEADER, [Plan("I", 1), Plan("I", 2), Plan("P", 1)], Draws(127))
    data = write_stream(MAIN_HEADER, [*group(first, 290), *group(other, 9), last], index=True)
    expected = yield {"stream": data, "first": value[0], "last": value[1]}
    check_slice(expected, data, *value)


@case("core", "seek", rules=["R-5-7", "R-5-8", "R-12.6-4"], each={"group_of_the_first_frame": 1, "later_group": 3})
def main_pace_is_not_judged(value: int) -> Inputs:
    """In a paced stream an I-frame is due; who seeks frames of the {key} does not judge the pace."""
    data = MAIN.paced([*[MAIN.empty] * value, *[REPEATED] * 5], frame_rate_numerator=1)
    expected = yield {"stream": data, "first": value, "last": value + 4}
    assert (result(expected, "error"), len(result(expected, "counts"))) == ("", 5)


@case("core", "seek", rules=["R-5-7", "R-12.6-4"])
def main_sums_of_a_second_are_not_judged() -> Inputs:
    """A second of a paced stream has 65 of the largest frames, and who seeks to its last ones does not judge that."""
    data = MAIN.paced(group(MAIN.empty, 65), **LARGEST, frame_rate_numerator=65)
    expected = yield {"stream": data, "first": 1, "last": 64}
    assert (result(expected, "error"), len(result(expected, "counts"))) == ("", 64)


@case("core", "seek", rules=["R-6.8-2", "R-12.6-6"], each={"without_index": False, "with_index": True})
def main_beyond_the_end(value: bool) -> Inputs:
    """A frame beyond the end is asked for of a stream {key}."""
    expected = yield {"stream": stream(index=value), "first": 8, "last": 8}
    assert (result(expected, "error"), len(result(expected, "counts"))) == ("", 0)


UNSEEN: Final[dict[str, tuple[str, Callable[[], bytes], int, int]]] = {
    "p_frame_before": ("a P-frame before the I-frame is damaged", lambda: damaged(2, stream()), 4, 5),
    "i_frame_before": ("an I-frame of an earlier group is damaged", lambda: damaged(1, stream()), 3, 3),
    "group_before": ("the I-frame before the last one is damaged", lambda: damaged(4, stream()), 6, 7),
    "behind": ("the frame after the last one asked for is damaged", lambda: damaged(6, stream()), 3, 4),
    "end": ("the end chunk is damaged", lambda: damaged(9, stream(index=False)), 6, 7),
    "byte_behind": ("a byte follows the end chunk", lambda: stream() + b"\0", 7, 7),
    "elements_before": ("a P-frame before the I-frame has one byte as payload, and the right checksum",
                        lambda: edited(lambda c: [*c[:2], (b"P", b"?"), *c[3:]]), 3, 5),
    "number_before": ("a frame before the I-frame has a wrong number",
                      lambda: edited(lambda c: [*c[:2], (b"P", b"\x09" + c[2][1][1:]), *c[3:]]), 3, 3),
    "index_before": ("an index before the I-frame breaks R-6.7-1",
                     partial(with_chunk, 2, (b"x", encode_uv(2) + bytes([1, 1, 0, 0]))), 4, 4),
}  # fmt: skip
"""Faults that neither a hop nor the decoder meets: the sentence, the stream, and the frames asked for."""


@case("core", "seek", rules=["R-12.6-1"], each=UNSEEN,
      said={name: sentence for name, (sentence, *_) in UNSEEN.items()})  # fmt: skip
def main_unseen_fault(value: tuple[str, Callable[[], bytes], int, int]) -> Inputs:
    """The frames are handed out although {key}."""
    _, make, first, last = value
    expected = yield {"stream": make(), "first": first, "last": last}
    check_slice(expected, stream(), first, last)


@case("core", "seek", rules=["R-12.6-1", "R-6.2-5"], each={"before": (2, 4, 5), "of_the_group_before": (8, 6, 7)},
      said={"before": "before the I-frame", "of_the_group_before": "of the group before"})  # fmt: skip
def main_unseen_layer(value: tuple[int, int, int]) -> Inputs:
    """The frames are handed out although a chunk of a layer {key} is damaged."""
    chunk, first, last = value
    assert split_chunks(layered())[chunk][0] == b"n"
    expected = yield {"stream": damaged(chunk, layered()), "first": first, "last": last}
    check_slice(expected, layered(), first, last)
