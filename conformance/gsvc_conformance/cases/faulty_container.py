"""Faults of the container: the prefix, chunks, sequence header, frame numbers, index and end; truncated streams.

Each is planted in a sound stream of profile `paper`, and in one of `main` where that can have it.
"""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Final

from gsvc_conformance.cases.building import Chunks, operated
from gsvc_conformance.cases.faults import PAPER, Broken, Sound, count_unknown, end_of
from gsvc_ref.bitstream import LEVELS
from gsvc_ref.bitstream.chunks import PREFIX_SIZE
from gsvc_ref.bitstream.coder import encode_uv
from gsvc_ref.paper import FrameCodes
from gsvc_ref.testing import OVERVIEW_HEADER, Lie, split_chunks, write_stream

OUT_OF_RANGE: Final = {
    "width": (0,), "height": (0,), "frame_rate_numerator": (0,), "frame_rate_denominator": (0,), "bit_depth": (7, 17),
}  # fmt: skip
"""Values beside the ranges of section 6.3, of elements that all profiles have."""

OUT_OF_RANGE_IN_PAPER: Final = {
    "cholesky_bits": (0, 13), "color_stages": (0, 9), "color_codewords": (0, 1025), "entropy_precision": (11, 17),
    "lane_count": (0, 65),
}  # fmt: skip
"""Values beside the ranges of section 6.3, of elements of profile `paper`."""

RESERVED: Final = {"profile": (2, 255), "level": (0, 6, 255), "flags": (4, 7, 8, 16, 32, 64, 128)}
"""Reserved values of section 6.3."""

CHUNK_NAMES: Final = ("header", "i_frame", "p_frame", "r_frame", "index", "end")
"""The chunks of the overview with its index."""


FRAME_NUMBERS: Final = {
    "one_first": (0, 1), "again": (1, 0), "skipped": (2, 3), "huge": (1, 2**32 - 1), "beyond_8_bits": (1, 2**8 + 1),
    "beyond_14_bits": (1, 2**14 + 1), "beyond_16_bits": (1, 2**16 + 1),
}  # fmt: skip
"""Wrong frame numbers: the true one and what is said."""

CODES_OF_THE_OVERVIEW: Final = {"l11": 8, "l21": 16, "l22": 8}
"""cholesky_code of the overview's splat."""


def container_faults() -> Iterator[Broken]:
    """All of profile `paper` but truncations, and those of streams whose profile cannot be read."""
    yield from _magic()
    yield from _unreadable()
    yield from _of_paper()
    yield from profile_faults(PAPER)


def profile_faults(of: Sound) -> Iterator[Broken]:
    """All but truncations that a stream of any profile can have."""
    yield from _versions(of)
    yield from _chunks(of)
    yield from _order_of_chunks(of)
    yield from _frame_numbers(of)
    yield from _lengths(of)
    yield from _header(of)
    yield from _end_and_index(of)


def _magic() -> Iterator[Broken]:
    magic = b"\x89GSVC\r\n\x1a"
    damages = {
        "another_format": b"\x89PNG\r\n\x1a\n",
        "line_ends_changed": b"\x89GSVC\n\x1a\n",
        "seventh_bit_lost": b"\x09GSVC\r\n\x1a",
    }
    for what, said in damages.items():
        yield Broken("R-6.1-1", "malformed", what, f"the magic number is {said.hex(' ')}", f"it is {magic.hex(' ')}",
                     partial(PAPER.overview, Lie("magic", said)))  # fmt: skip
    yield Broken("R-6.1-1", "malformed", "nothing", "the stream has no bytes", "it begins with magic", lambda: b"")
    yield Broken("R-6.1-1", "malformed", "seven_bytes", "the stream ends in magic", "it has 8 bytes",
                 lambda: PAPER.overview()[:7])  # fmt: skip


def _unreadable() -> Iterator[Broken]:
    """Streams that have no sequence header where it must stand."""
    first = "the first chunk is H"
    for what, lie, edit in (
        ("no_header", "there is no sequence header", lambda c: c[1:]),
        ("ancillary_first", "an ancillary chunk stands first", lambda c: [(b"a", b""), *c]),
        ("index_first", "an index stands first", lambda c: [(b"x", b"\0"), *c]),
        ("end_first", "the end chunk stands first", lambda c: [end_of(0)]),
    ):
        yield Broken("R-6.1-3", "invalid", what, lie, first, partial(PAPER.edited, edit))
    yield Broken("R-3.2-1", "unsupported", "first_chunk_z", "the first chunk has the critical type Z", "it is H",
                 lambda: PAPER.edited(lambda c: [(b"Z", b""), *c]))  # fmt: skip
    yield Broken("R-5-3", "limit", "first_chunk", "the first chunk is an I-frame and has 1025 bytes",
                 "at most 1024, whatever its type", lambda: PAPER.edited(lambda c: [(b"I", bytes(1025)), *c]), 0,
                 ("R-6.1-3",))  # fmt: skip


def _versions(of: Sound) -> Iterator[Broken]:
    for major in (0, 1, 2, 128, 129, 131, 255):
        yield Broken("R-6.1-2", "unsupported", f"version_{major}", f"version_major is {major}", "it is 130",
                     partial(of.overview, Lie("version_major", major)))  # fmt: skip


def _chunks(of: Sound) -> Iterator[Broken]:
    for what, code in {"digit": b"1", "zero": b"\0", "beside_a": b"`", "beyond_z": b"{", "at_sign": b"@",
                       "bracket": b"[", "beyond_ascii": b"\xe9"}.items():  # fmt: skip
        yield Broken("R-6.2-1", "malformed", what, f"a chunk has the type {code[0]:#04x}", "types are ASCII letters",
                     partial(of.with_chunk, code), 1)  # fmt: skip
    for letter in (b"A", b"B", b"X", b"Z"):
        yield Broken("R-3.2-1", "unsupported", f"chunk_{letter.decode().lower()}",
                     f"a chunk has the critical type {letter.decode()}", "such types are reserved",
                     partial(of.with_chunk, letter), 1)  # fmt: skip
    for number, name in enumerate(CHUNK_NAMES):
        yield Broken("R-6.2-2", "malformed", f"crc_of_{name}", "one bit of chunk_crc is another", "it is the CRC-32C",
                     partial(of.overview, Lie("chunk_crc", lambda crc: crc ^ 1 << 31, number)),
                     min(max(0, number - 1), 3))  # fmt: skip
    yield Broken("R-6.2-2", "malformed", "crc_of_an_ancillary_chunk", "a skipped chunk has a wrong checksum",
                 "skipped chunks are checked too", partial(_damaged_ancillary, of), 1)  # fmt: skip
    for number, name in enumerate(("header", "i_frame", "p_frame", "r_frame", "end")):
        complete = max(0, number - 1)
        yield Broken("R-6.2-3", "malformed", f"{name}_too_long", "a byte follows the last element of the payload",
                     "the elements fill it",
                     partial(of.with_payload, number, lambda p: p + b"\0"), complete)  # fmt: skip
        yield Broken("R-6.2-3", "malformed", f"{name}_too_short", "the last byte of the payload is missing",
                     "the elements fill it", partial(of.with_payload, number, lambda p: p[:-1]), complete)  # fmt: skip
    yield Broken("R-6.2-3", "malformed", "i_frame_empty", "an I-frame has an empty payload", "it has elements",
                 lambda: of.with_payload(1, lambda p: b""))  # fmt: skip
    for count in (0, 2):
        yield Broken("R-6.2-3", "malformed", f"entry_count_{count}", f"entry_count is {count}", "there is one entry",
                     partial(of.overview, Lie("entry_count", count)), 3)  # fmt: skip


def _damaged_ancillary(of: Sound) -> bytes:
    return of.with_chunk(b"a", b"abc").replace(b"abc", b"abd")


def _order_of_chunks(of: Sound) -> Iterator[Broken]:
    def broken(
        rule: str, what: str, lie: str, truth: str, edit: Callable[[Chunks], Chunks], complete: int = 0
    ) -> Broken:
        return Broken(rule, "invalid", what, lie, truth, partial(of.edited, edit), complete)

    yield broken("R-6.1-3", "second_header", "a second header follows", "there is one",
                 lambda c: [*c[:2], c[0], *c[2:]], 1)  # fmt: skip
    yield Broken("R-6.1-4", "invalid", "a_byte_follows", "a byte follows the end chunk", "nothing follows",
                 lambda: of.overview() + b"\0", 3)  # fmt: skip
    yield broken("R-6.1-4", "a_chunk_follows", "a chunk follows the end chunk", "nothing follows",
                 lambda c: [*c, (b"a", b"")], 3)  # fmt: skip
    yield Broken("R-6.1-4", "invalid", "a_stream_follows", "a whole stream follows the end chunk", "nothing follows",
                 lambda: of.overview(index=False) * 2, 3)  # fmt: skip
    yield broken("R-6.1-5", "no_frame", "the stream has no frame", "it has at least one",
                 lambda c: [(b"H", count_unknown(c[0][1])), end_of(0)])  # fmt: skip
    for letter, payload in {"R": b"\0", "P": b"\0\0"}.items():
        yield Broken("R-6.4-2", "invalid", f"first_frame_{letter.lower()}", f"the first frame is of type {letter}",
                     "it is an I-frame", partial(_one_frame, of, letter.encode(), payload))  # fmt: skip


def _frame_numbers(of: Sound) -> Iterator[Broken]:
    for what, (number, said) in FRAME_NUMBERS.items():
        yield Broken("R-6.4-1", "invalid", what, f"frame_number is {said}", f"it is {number}",
                     partial(of.overview, Lie("frame_number", said, number)), number)  # fmt: skip
    twice = partial(_with_count, of, 4, lambda c: [*c[:3], *c[2:]])
    missing = partial(_with_count, of, 2, lambda c: [*c[:2], *c[3:]])
    yield Broken("R-6.4-1", "invalid", "frame_twice", "a frame stands twice", "numbers grow by one", twice, 2)
    yield Broken("R-6.4-1", "invalid", "frame_missing", "a frame is missing", "numbers grow by one", missing, 1)


def _with_count(of: Sound, count: int, edit: Callable[[Chunks], Chunks]) -> bytes:
    """The overview without index after an operation on its chunks, with the number of frames that it has then."""
    return of.edited(edit, Lie("frame_count", count), Lie("frame_count", count, 1))


def _one_frame(of: Sound, chunk_type: bytes, payload: bytes) -> bytes:
    """The overview's header without a frame count, one frame and an end chunk."""
    return of.edited(lambda c: [(b"H", count_unknown(c[0][1])), (chunk_type, payload), end_of(1)])


def _lengths(of: Sound) -> Iterator[Broken]:
    """Payloads beyond the level."""
    for level, limits in LEVELS.items():
        most = limits.payload
        yield Broken("R-5-3", "limit", f"payload_of_level_{level}", f"a chunk claims {most + 1} bytes",
                     f"at most {most}",
                     partial(of.overview, Lie("chunk_length", most + 1, 1), level=level))  # fmt: skip
    yield Broken("R-5-3", "limit", "longest_claim", "a chunk claims 2^32 - 1 bytes", "at most 2^20",
                 lambda: of.overview(Lie("chunk_length", 2**32 - 1, 2)), 1)  # fmt: skip
    yield Broken("R-5-3", "limit", "header", "the header of a later minor version has 1025 bytes", "at most 1024",
                 partial(_long_header, of))  # fmt: skip
    yield Broken("R-5-3", "limit", "second_header", "a second header claims 1025 bytes", "at most 1024, and one",
                 partial(of.with_chunk, b"H", bytes(1025)), 1, ("R-6.1-3",))  # fmt: skip
    yield Broken("R-5-3", "limit", "ancillary", "an ancillary chunk claims 2^20 + 1 bytes", "at most 2^20",
                 lambda: of.overview(index=False)[:-14] + b"a" + encode_uv(2**20 + 1), 3)  # fmt: skip


def _header(of: Sound) -> Iterator[Broken]:
    for element, values in OUT_OF_RANGE.items():
        yield from _beside_the_range(element, values, of.overview)
    for element, reserved in RESERVED.items():
        for said in reserved:
            yield Broken("R-3.2-1", "unsupported", f"{element}_{said}", f"{element} is {said}", "it is reserved",
                         partial(of.overview, Lie(element, said), parameter_checksum_flag=said == 7))  # fmt: skip
    sizes = {"height_8193": (16, 8193, 1), "one_more": (3, 43691, 1), "largest": (65535, 65535, 5)}
    for what, (width, height, level) in sizes.items():
        lies = Lie("width", width), Lie("height", height), Lie("level", level)
        yield Broken("R-5-1", "limit", what, f"a frame has {width}x{height} pixels",
                     f"level {level} allows {LEVELS[level].pixels}", partial(of.overview, *lies))  # fmt: skip


def _beside_the_range(element: str, values: tuple[int, ...], make: Callable[[Lie], bytes]) -> Iterator[Broken]:
    for said in values:
        yield Broken("R-6.3-1", "invalid", f"{element}_{said or 'zero'}", f"{element} is {said}", "it is in its range",
                     partial(make, Lie(element, said)))  # fmt: skip


def _of_paper() -> Iterator[Broken]:
    for element, values in OUT_OF_RANGE_IN_PAPER.items():
        yield from _beside_the_range(element, values, _contradicted)


def _long_header(of: Sound) -> bytes:
    return of.edited(lambda c: [(b"H", c[0][1].ljust(1025, b"\0")), *c[1:]], Lie("version_minor", 9))


def _contradicted(lie: Lie) -> bytes:
    """A stream of profile `paper` that an element of its header contradicts in nothing but its range."""
    element, said = lie.element, lie.value
    if element == "cholesky_bits":  # planes of so many bits, and no bits at all if 0
        codes = {channel: format(code, f"0{said}b") if said else "" for channel, code in CODES_OF_THE_OVERVIEW.items()}
        return PAPER.overview(lie, *(Lie(f"cholesky_code[{channel}].symbol", bits) for channel, bits in codes.items()))
    if element in ("color_stages", "color_codewords") and said == 0:  # no splat, no codebook
        return write_stream(OVERVIEW_HEADER, [FrameCodes.intra_frame(None)], lies=[lie])
    return PAPER.overview(lie)


def _end_and_index(of: Sound) -> Iterator[Broken]:
    for what, said in (("", 4), ("_2", 2), ("_two_to_the_31", 2**31), ("_most", 2**32 - 1)):
        yield Broken("R-6.3-2", "invalid", f"frame_count{what}", f"the header says {said} frames", "there are 3",
                     partial(of.overview, Lie("frame_count", said)), 3)  # fmt: skip
    for said in (2, 4, 0):
        yield Broken("R-6.8-1", "invalid", f"frame_count_{said}", f"header and end chunk say {said} frames",
                     "there are 3",
                     partial(of.overview, Lie("frame_count", said), Lie("frame_count", said, 1)), 3)  # fmt: skip
    unknown = Lie("frame_count", 0)
    yield Broken("R-6.8-1", "invalid", "frame_count_2_alone", "the end chunk says 2 frames, the header none",
                 "there are 3", partial(of.overview, unknown, Lie("frame_count", 2, 1)), 3)  # fmt: skip
    for what, index, said in (("none", True, 0), ("one", False, 1), ("huge", True, 2**32 - 1)):
        yield Broken("R-6.8-2", "invalid", f"index_length_{what}", f"index_length is {said}",
                     "it is the size of the index chunk directly before",
                     partial(of.overview, Lie("index_length", said), index=index), 3)  # fmt: skip
    yield Broken("R-6.8-2", "invalid", "chunk_between", "a chunk stands between index and end, index_length is not 0",
                 "the index stands directly before the end", partial(_chunk_after_index, of), 3)  # fmt: skip
    yield Broken("R-6.7-1", "invalid", "at_itself", "an index entry has the offset of the index",
                 "offsets lie before it", partial(_at_the_index, of), 3)  # fmt: skip
    yield Broken("R-6.7-1", "invalid", "in_the_middle", "an index between frames has an entry after itself",
                 "it is checked wherever it stands, and used nowhere",
                 lambda: of.with_chunk(b"x", b"\1\0" + encode_uv(5000)), 1)  # fmt: skip
    for what, row, column, said in (("number_again", 1, 0, 0), ("offset_again", 1, 1, 0), ("beyond_itself", 1, 1, 2000),
                                    ("offset_overflows", 1, 1, 2**32 - 1)):  # fmt: skip
        yield Broken("R-6.7-1", "invalid", what, f"a step of an index entry is {said}",
                     "numbers and offsets grow, and stay before the index",
                     partial(of.three, _step(row, column, said)), 3)  # fmt: skip


def _at_the_index(of: Sound) -> bytes:
    """The second entry's offset is that of the index itself."""
    chunks = split_chunks(of.three())
    sizes = [1 + len(encode_uv(len(payload))) + len(payload) + 4 for _, payload in chunks]
    return of.three(_step(1, 1, sum(sizes[1:4])))  # from the first I-frame to the index: frames I P I


def _step(row: int, column: int, value: int) -> Lie:
    def lie(truth: Any) -> Any:
        steps = truth.copy()
        steps[row, column] = value
        return steps

    return Lie("frame_number_step", lie)


def _chunk_after_index(of: Sound) -> bytes:
    def edit(chunks: Chunks) -> Chunks:
        return [*chunks[:-1], (b"a", b""), chunks[-1]]

    return operated(edit, of.overview())


def _cut(data: bytes, size: int) -> bytes:
    return data[:size]


def truncations(of: Sound = PAPER) -> Iterator[Broken]:
    """The overview cut at the end of each chunk, a byte before and a byte after it."""
    data = of.overview(index=False)
    at, ends = PREFIX_SIZE, [("prefix", PREFIX_SIZE)]
    for (_, payload), name in zip(split_chunks(data), ("header", "i_frame", "p_frame", "r_frame", "end"), strict=True):
        at += 1 + len(encode_uv(len(payload))) + len(payload) + 4
        ends.append((name, at))
    for number, (name, end) in enumerate(ends):
        for what, size in (("before", end - 1), ("at", end), ("after", end + 1)):
            readable = size > PREFIX_SIZE + 1  # else the stream states no profile, so that of paper is of both
            if size < len(data) and (readable or of is PAPER):
                complete = max(0, number - 1 - (what == "before"))
                yield Broken("R-6.2-4", "malformed", f"cut_{what}_the_end_of_{name}",
                             f"the stream ends after {size} bytes", f"it has {len(data)}",
                             partial(_cut, data, size), complete)  # fmt: skip
    yield Broken("R-6.2-4", "malformed", "cut_zero_of_the_last_checksum",
                 "the last byte of the stream, which is 0, is missing", "chunks are complete",
                 partial(_without_the_last_zero, of), 20)  # fmt: skip


def _without_the_last_zero(of: Sound) -> bytes:
    """20 frames and an index of 9 bytes, for which the last byte of the end chunk is 0, without this byte."""
    intra, _, repeated = of.frames()
    data = write_stream(of.header, [intra, *[repeated] * 19])
    assert data[-1] == 0
    return data[:-1]
