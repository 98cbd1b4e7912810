"""Streams that break two rules, so that the order of checks (section "Errors") decides which one is reported."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Final

from gsvc_conformance.cases.building import BOOKS, HEADER, intra_block, operated
from gsvc_conformance.cases.faults import PAPER, Broken, Sound, count_unknown, end_of, flat, overview, rich, room_behind
from gsvc_ref.bitstream.coder import encode_uv
from gsvc_ref.paper import FrameCodes
from gsvc_ref.testing import RICH_HEADER, Lie, rich_frames, write_stream

Make = Callable[[], bytes]
END_SIZE: Final = 14
CRC: Final = Lie("chunk_crc", lambda crc: crc ^ 1)
"""The header's checksum is wrong."""


def order_faults() -> Iterator[Broken]:
    """All of profile `paper`, and those of streams whose profile cannot be read."""
    yield _first("R-6.1-1", "R-6.1-2", "malformed", "version", "the magic number and the version are others",
                 lambda: overview(Lie("magic", b"GSVC\r\n\x1a\n"), Lie("version_major", 2)))  # fmt: skip
    yield from container_orders(PAPER)
    yield from _frames()
    yield from _covered()
    yield from _planes()


def container_orders(of: Sound) -> Iterator[Broken]:
    """Those that a stream of any profile can have."""
    yield from _chunks(of)
    yield from _headers(of)
    yield from _ends(of)


def _first(rule: str, other: str, kind: str, what: str, lie: str, make: Make, complete: int = 0) -> Broken:
    """`rule` is reported, `other` is not."""
    return Broken(rule, kind, f"before_{what}", lie, "the first of two faults counts", make, complete, (other,))


def _chunks(of: Sound) -> Iterator[Broken]:
    def ending(tail: bytes) -> Make:
        return lambda: of.overview(index=False)[:-END_SIZE] + tail

    def wrong_crc(chunk_type: bytes, payload: bytes = b"") -> Make:
        return ending(chunk_type + encode_uv(len(payload)) + payload + bytes(4))

    endless = encode_uv(2**32 - 1)
    yield _first("R-6.2-1", "R-5-3", "malformed", "length", "a chunk of type 1 claims 2^32 - 1 bytes",
                 ending(b"1" + endless), 3)  # fmt: skip
    yield _first("R-5-3", "R-6.2-4", "limit", "completeness", "a chunk P claims 2^32 - 1 bytes, which do not follow",
                 ending(b"P" + endless), 3)  # fmt: skip
    yield _first("R-5-3", "R-3.2-1", "limit", "known_type", "a chunk of the reserved type B claims 2^32 - 1 bytes",
                 ending(b"B" + endless), 3)  # fmt: skip
    yield _first("R-6.2-4", "R-3.2-1", "malformed", "known_type", "a chunk of the reserved type B is cut",
                 ending(b"B" + encode_uv(9) + bytes(8)), 3)  # fmt: skip
    yield _first("R-6.2-2", "R-3.2-1", "malformed", "known_type", "a chunk of the reserved type B, its checksum wrong",
                 wrong_crc(b"B"), 3)  # fmt: skip
    yield _first("R-6.2-2", "R-6.1-3", "malformed", "second_header", "a second header, its checksum wrong",
                 wrong_crc(b"H", bytes(9)), 3)  # fmt: skip
    yield _first("R-6.2-2", "R-6.3-1", "malformed", "elements", "width is 0 and the header's checksum wrong",
                 lambda: of.overview(Lie("width", 0), CRC))  # fmt: skip
    yield _first("R-6.1-3", "R-6.3-1", "invalid", "elements", "a second header, with a width of 0",
                 partial(of.with_chunk, b"H", bytes(9)), 1)  # fmt: skip
    yield _first("R-6.1-5", "R-6.8-1", "invalid", "frame_count", "there is no frame, and the end chunk says 3",
                 lambda: of.edited(lambda c: [(b"H", count_unknown(c[0][1])), end_of(3)]))  # fmt: skip
    yield _first("R-6.4-2", "R-6.4-1", "invalid", "frame_number", "the first frame is an R-frame of number 5",
                 lambda: of.edited(lambda c: [c[0], (b"R", b"\5"), end_of(1)]))  # fmt: skip


def _headers(of: Sound) -> Iterator[Broken]:
    yield _first("R-6.1-2", "R-6.2-2", "unsupported", "first_chunk", "the version is 2, the header's checksum is wrong",
                 lambda: of.overview(Lie("version_major", 2), CRC))  # fmt: skip
    yield _first("R-3.2-1", "R-6.3-1", "unsupported", "width", "level is 6 and width 0",
                 lambda: of.overview(Lie("level", 6), Lie("width", 0)))  # fmt: skip
    large = Lie("width", 65535), Lie("height", 65535)
    yield _first("R-5-1", "R-6.3-1", "limit", "frame_rate", "65535x65535 pixels, and a frame rate of 0",
                 lambda: of.overview(*large, Lie("frame_rate_numerator", 0)))  # fmt: skip
    said = int(of.is_main)
    last, rule, kind = ("main_tools", "R-3.2-1", "unsupported") if of.is_main else ("lane_count", "R-6.3-1", "invalid")
    yield _first(rule, "R-6.2-3", kind, "length", f"{last} is {said}, and a byte follows it",
                 lambda: of.overview(Lie(last, bytes([said, 0]))))  # fmt: skip


def _frames() -> Iterator[Broken]:
    many = Lie("splat_count", 2**32 - 1)
    yield _first("R-6.4-1", "R-5-2", "invalid", "splat_count", "frame_number is 7, splat_count 2^32 - 1",
                 lambda: overview(Lie("frame_number", 7), many))  # fmt: skip
    yield _first("R-5-2", "R-6.6-1", "limit", "survivor_map", "new_splat_count is 2^32 - 1, plane_mode of the map 3",
                 lambda: overview(Lie("new_splat_count", 2**32 - 1), Lie("survivor_map.plane_mode", 3)), 1)  # fmt: skip
    flags = {
        "colors_present": ("R-6.5-4", "R-6.5-2", "there is no quantiser, and colors_present is 0",
                           (Lie("quantizer_present", 0), Lie("colors_present", 0))),
        "block_reserved": ("R-6.5-2", "R-6.5-1", "positions_present is 0, block_reserved 1",
                           (Lie("positions_present", 0), Lie("block_reserved", 1))),
        "offset": ("R-6.5-5", "R-3.1-2", "cholesky_scale is 0, cholesky_offset infinite",
                   (Lie("cholesky_scale", [0.0]), Lie("cholesky_offset", [float("inf")]))),
    }  # fmt: skip
    for what, (rule, other, lie, lies) in flags.items():
        yield _first(rule, other, "invalid", what, lie, partial(overview, *lies))
    infinite = Lie("position_high[x].symbol", 0x7C)
    yield _first("R-6.6-1", "R-6.5-7", "unsupported", "position", "a position is infinite, and its low plane of mode 3",
                 lambda: overview(infinite, Lie("position_low[x].plane_mode", 3)))  # fmt: skip
    yield _first("R-6.5-7", "R-6.6-1", "invalid", "next_axis", "x is infinite, and the high plane of y of mode 3",
                 lambda: overview(infinite, Lie("position_high[y].plane_mode", 3)))  # fmt: skip
    huge = (Lie("cholesky_offset", [1e30]), Lie("cholesky_offset", [1e30], 2))
    overflow = (Lie("cholesky_scale", [3e38]), Lie("cholesky_code[l11].symbol", 63))
    wrong = Lie("parameter_checksum", 0)
    longer = Lie("color_index[1].align", "0" * 14)  # a byte more than there are bits to skip
    yield _first("R-6.2-3", "R-8-1", "malformed", "reconstruction", "a byte is left over, and a parameter is infinite",
                 lambda: overview(*overflow, longer))  # fmt: skip
    infinite_offset = Lie("cholesky_offset", [float("inf")])
    yield _first("R-3.1-2", "R-6.2-3", "invalid", "filled", "cholesky_offset is infinite, and a byte is left over",
                 lambda: overview(infinite_offset, longer))  # fmt: skip
    yield _first("R-8-1", "R-6.4-3", "invalid", "checksum", "a parameter is infinite, and the checksum wrong",
                 lambda: overview(*overflow, wrong, parameter_checksum_flag=True))  # fmt: skip
    yield _first("R-5-4", "R-6.4-3", "limit", "checksum", "the work is too much, and the checksum wrong",
                 lambda: flat(513, *huge, wrong, width=256, height=256, parameter_checksum_flag=True))  # fmt: skip
    yield _first("R-6.2-3", "R-6.4-3", "malformed", "checksum", "the checksum is wrong, and a byte left over",
                 lambda: overview(wrong, longer, parameter_checksum_flag=True))  # fmt: skip


def _covered() -> Iterator[Broken]:
    """What a later rule of the same kind would refuse, too: a fault of another kind stands between, so kinds tell."""
    raw_plane = Lie("position_high[x].symbol", [0x34, 0x7C, 0x34])
    positions = {
        "next_axis_not_a_number": ("an x is NaN", 0, overview, Lie("position_high[x].symbol", 0x7E)),
        "next_axis_of_a_splat": ("the second of three x is infinite", 0, _three_splats, raw_plane),
        "next_axis_of_differences": ("a difference of x is infinite", 1, overview,
                                     Lie("position_high[x].symbol", 0x7C, 1)),
    }  # fmt: skip
    for what, (lie, block, of, position) in positions.items():
        yield _first("R-6.5-7", "R-6.6-1", "invalid", what, f"{lie}, and the high plane of y of mode 3",
                     partial(of, position, Lie("position_high[y].plane_mode", 3, block)), complete=block)  # fmt: skip
    code = Lie("cholesky_code[l11].plane_mode", 3)
    y = Lie("position_high[y].symbol", 0xFC)
    yield _first("R-6.5-7", "R-6.6-1", "invalid", "cholesky_code", "a y is -infinity, and the plane of l11 of mode 3",
                 partial(overview, y, code))  # fmt: skip
    for name, said, value in (("scale", "infinite", float("inf")), ("offset", "NaN", float("nan"))):
        yield _first("R-3.1-2", "R-6.6-1", "invalid", f"cholesky_code_{name}",
                     f"cholesky_{name} is {said}, and the plane of l11 of mode 3",
                     partial(overview, Lie(f"cholesky_{name}", [value]), code))  # fmt: skip
    none = Lie("codeword_count", 0), Lie("codeword", "")
    yield _first("R-6.5-6", "R-6.6-1", "invalid", "color_index", "codeword_count is 0, and plane_mode of the indices 3",
                 partial(overview, *none, Lie("color_index[1].plane_mode", 3)))  # fmt: skip
    yield _first("R-6.6-3", "R-3.1-3", "invalid", "frequency", "table_bits is 0, a frequency begins with 17 zero bits",
                 partial(rich, Lie("table_bits", 0), Lie("frequency", "0" * 17 + "1" * 40)))  # fmt: skip
    yield _first("R-6.6-2", "R-6.2-3", "invalid", "last_symbol", "first_symbol is 7 of 5, and last_symbol is cut",
                 _cut_behind_first_symbol)  # fmt: skip


def _three_splats(*lies: Lie) -> bytes:
    return write_stream(HEADER, [FrameCodes.intra_frame(intra_block(3))], index=False, lies=lies)


def _cut_behind_first_symbol() -> bytes:
    """An I-frame whose last plane is of mode 2 and ends in the middle of `last_symbol`, the last of 17 bits."""
    intra = FrameCodes.intra_frame(intra_block(4, books=BOOKS[:1]))
    coded = Lie("color_index[1].plane_mode", "10" + "00001" + "0000" + "111" + "10"), Lie("color_index[1].symbol", "")
    return write_stream(HEADER, [intra], index=False, lies=coded)


def _planes() -> Iterator[Broken]:
    tables = {
        "order_of_ends": ("R-6.6-2", "R-6.6-4", "invalid", "first_symbol is 7 in an alphabet of 5, last_symbol 4",
                          (Lie("color_index[1].first_symbol", 7),)),
        "symbols": ("R-6.6-3", "R-6.6-4", "invalid", "table_bits is 0, first_symbol exceeds last_symbol",
                    (Lie("table_bits", 0), Lie("first_symbol", 4))),
        "align": ("R-6.6-4", "R-3.1-4", "invalid", "the frequencies add up to one more, and a skipped bit is 1",
                  (Lie("frequency", lambda f: [int(f[0]) + 1, *f[1:].tolist()]), Lie("align", 1, 5))),
        "lane_state": ("R-6.6-6", "R-6.6-5", "malformed", "word_count is 2^32 - 1, a lane_state 0",
                       (Lie("word_count", 2**32 - 1), Lie("lane_state", [0, 0]))),
        "ends_of_lanes": ("R-6.6-5", "R-7-1", "invalid", "a lane_state is 65535, a word another",
                          (Lie("lane_state", lambda x: [x[0], 65535]), Lie("word", lambda w: [*w[:-1], 1]))),
    }  # fmt: skip
    for what, (rule, other, kind, lie, lies) in tables.items():
        yield _first(rule, other, kind, what, lie, partial(rich, *lies))
    yield _first("R-6.2-3", "R-6.6-2", "malformed", "symbols", "a raw plane is cut, its first symbol 7 of 5",
                 _cut_behind_a_symbol)  # fmt: skip
    yield _first("R-6.2-3", "R-3.1-2", "malformed", "codewords", "100 codewords do not fit, and the first one is NaN",
                 _codewords_that_do_not_fit)  # fmt: skip
    yield _first("R-6.2-3", "R-6.6-5", "malformed", "lane_state", "two lane_states do not fit, and the first one is 0",
                 _states_that_do_not_fit)  # fmt: skip
    yield Broken("R-6.2-3", "malformed", "words_beyond_the_states",
                 "word_count is half the bytes left, of which the states take some", "words follow the states",
                 lambda: rich(Lie("word_count", room_behind(rich(), "word_count") // 2)), 0, ("R-7-1",))  # fmt: skip


def _cut_behind_a_symbol() -> bytes:
    """Four indices of 3 bits into a codebook of 5, without their last byte; the first one is 7."""
    intra = FrameCodes.intra_frame(intra_block(4, books=BOOKS[:1]))
    data = write_stream(HEADER, [intra], index=False, lies=[Lie("color_index[1].symbol", [7, 2, 4, 1])])
    return operated(lambda c: [c[0], (c[1][0], c[1][1][:-1]), c[2]], data)


def _ends(of: Sound) -> Iterator[Broken]:
    counts = (Lie("frame_count", 2), Lie("frame_count", 4, 1))
    yield _first("R-6.8-1", "R-6.3-2", "invalid", "header", "header and end chunk say 2 and 4 frames; there are 3",
                 lambda: of.overview(*counts), 3)  # fmt: skip
    yield _first("R-6.3-2", "R-6.8-2", "invalid", "index_length", "the header says 4 frames, index_length is 1",
                 lambda: of.overview(Lie("frame_count", 4), Lie("index_length", 1)), 3)  # fmt: skip
    yield Broken("R-6.8-1", "invalid", "before_filled", "both counts are 9, the end chunk is a byte too long",
                 "the first of two faults counts",
                 partial(_longer_end, of), 3, ("R-6.2-3",))  # fmt: skip
    yield _first("R-6.8-2", "R-6.1-4", "invalid", "what_follows", "index_length is 1, and a byte follows",
                 lambda: of.overview(Lie("index_length", 1)) + b"\0", 3)  # fmt: skip
    yield _first("R-6.2-3", "R-6.1-4", "malformed", "what_follows", "a byte is left over in the end chunk, one follows",
                 lambda: of.with_payload(4, lambda p: p + b"\0") + b"\0", 3)  # fmt: skip


def _longer_end(of: Sound) -> bytes:
    lies = Lie("frame_count", 9), Lie("frame_count", 9, 1)
    return of.edited(lambda c: [*c[:-1], (b"E", c[-1][1] + b"\0")], *lies)


def _states_that_do_not_fit() -> bytes:
    """An I-frame whose last plane is coded, by two lanes, and ends after five bytes of their states."""
    intra = rich_frames()[0].intra
    assert intra is not None
    assert intra.colors is not None
    assert intra.codebooks is not None
    block = replace(intra, colors=intra.colors[:, :1], codebooks=intra.codebooks[:1])
    lies = (
        Lie("color_index[1].word_count", 0),
        Lie("color_index[1].lane_state", bytes(5)),
        Lie("color_index[1].word", ""),
    )
    return write_stream(RICH_HEADER, [FrameCodes.intra_frame(block)], lies=lies)


def _codewords_that_do_not_fit() -> bytes:
    return overview(Lie("codeword_count", 100), Lie("codeword", [float("nan"), 0, 0]), color_codewords=100)
