"""Streams that ask for as much memory and time as their level allows, written by hand: encoders refuse some of them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np

from gsvc_ref.bitstream import LEVELS, SequenceHeader, crc32c
from gsvc_ref.bitstream.bit_writer import Writer
from gsvc_ref.bitstream.coder import encode_uv
from gsvc_ref.bitstream.header import MAIN, sequence_header
from gsvc_ref.main.cells import halving_count
from gsvc_ref.main.codes import SIDES, IntraCodes, MainCodes
from gsvc_ref.main.densities import Densities, Density
from gsvc_ref.main.motion import field_shape
from gsvc_ref.testing import write_stream

PREFIX: Final = bytes.fromhex("89 47 53 56 43 0D 0A 1A 82 00")
STAGES: Final = 8
CODEWORDS: Final = 1024
CHOLESKY_BITS: Final = 12
Factor = tuple[float, float, float]
"""l11, l21, l22 in pixels."""

MOTION_CELL: Final = 3
"""Cells of 16 pixels, so that a field has as many as there may be."""

DOT: Final[Factor] = (0.01, 0.0, 0.01)


def header(level: int, width: int, height: int, bit_depth: int = 8) -> SequenceHeader:
    """A header with the longest codes that there are."""
    return SequenceHeader(
        level=level,
        width=width,
        height=height,
        bit_depth=bit_depth,
        chroma_format=0,
        cholesky_bits=CHOLESKY_BITS,
        color_stages=STAGES,
        color_codewords=CODEWORDS,
    )


def chunk(chunk_type: str, *parts: bytes) -> bytes:
    """A chunk with the right length and checksum."""
    payload = b"".join(parts)
    body = b"".join((chunk_type.encode(), encode_uv(len(payload)), payload))
    return b"".join((body, crc32c(body).to_bytes(4, "little")))


def opening(head: SequenceHeader) -> bytes:
    """All that precedes the first frame."""
    s = Writer()
    sequence_header(s, head)
    return PREFIX + chunk("H", s.getvalue())


def end(frames: int, index_length: int = 0) -> bytes:
    """The end chunk."""
    return chunk("E", frames.to_bytes(4, "little"), index_length.to_bytes(4, "little"))


def constant(symbol: int, width: int) -> bytes:
    """A plane of one symbol of `width` bits."""
    size = (2 + width + 7) // 8
    return (symbol << (8 * size - 2 - width)).to_bytes(size, "big")


def raw(symbol: int, width: int, count: int) -> bytes:
    """A raw plane whose symbols are all 0 or all ones."""
    bits = 2 + width * count
    size = (bits + 7) // 8
    if symbol == 0:
        return b"\x40" + bytes(size - 1)
    return ((0b01 << width * count | (1 << width * count) - 1) << (8 * size - bits)).to_bytes(size, "big")


def block(
    count: int,
    *,
    factor: Factor = DOT,
    at: tuple[int, int] = (0, 0),
    long: bool = True,
    stages: int = STAGES,
    codewords: int = CODEWORDS,
) -> bytes:
    """A splat block: positions are two patterns of binary16 for all splats, in raw planes (of zeros) if `long`.

    Every splat has the same `factor`, and colour 0, from `stages` codebooks of `codewords` each.
    """

    def plane(width: int) -> bytes:
        return raw(0, width, count) if long else constant(0, width)

    parts = [b"\xf8"]
    for pattern in at:
        parts += [plane(8) if byte == 0 else constant(byte, 8) for byte in divmod(pattern, 256)]
    for value in factor:
        parts += [np.array([1, value], "<f4").tobytes(), plane(CHOLESKY_BITS)]
    parts.append(bytes([stages]))
    parts += [codewords.to_bytes(2, "little") + bytes(6 * codewords) for _ in range(stages)]
    parts += [plane((codewords - 1).bit_length()) for _ in range(stages)]
    return b"".join(parts)


def intra(number: int, count: int, **options: object) -> bytes:
    """An I-frame of `count` equal splats; see `block`."""
    return chunk("I", encode_uv(number), encode_uv(count), block(count, **options) if count else b"")  # type: ignore[arg-type]


def predicted(number: int, count: int, *, long: bool = True, **options: int) -> bytes:
    """A P-frame in which all `count` splats stay and every attribute has a difference, which is 0; see `block`."""
    survivors = raw(1, 1, count) if long else constant(1, 1)
    differences = block(count, factor=(0, 0, 0), long=long, **options)
    return chunk("P", encode_uv(number), encode_uv(0), survivors, differences)


def repeated(number: int) -> bytes:
    """An R-frame."""
    return chunk("R", encode_uv(number))


def main_header(level: int, width: int, height: int, **others: int) -> SequenceHeader:
    """A header of profile `main` with all lanes and layers that there may be."""
    return SequenceHeader(
        profile=MAIN,
        level=level,
        width=width,
        height=height,
        bit_depth=8,
        max_lane_exponent=6,
        layer_count=4,
        **others,
    )


def main_frames(head: SequenceHeader, count: int, predicted: int) -> list[MainCodes]:
    """An I-frame of `count` equal splats in one cell, which take next to no bits, and P-frames that change nothing."""
    sure = Density(), Density(), Density(), Density(scale_code=0), Density(), Density()
    none, once = np.zeros((count, 2), np.int64), np.zeros((count, 3), np.int64)
    once[:, 0] = 1  # a size of 1, so that a place has no bits
    new = IntraCodes(cells=none, colors=np.zeros((count, 3), np.int64), shapes=once, places=none)
    densities = Densities(sure, (0,) * halving_count(head.width, head.height))
    cells = field_shape(head.width, head.height, SIDES[MOTION_CELL])
    still = MainCodes(
        type="P", motion_cell=MOTION_CELL, vectors=np.zeros((*cells, 2), np.int64),
        modes=np.zeros(count, np.int64), differences=np.zeros((count, 8), np.int64),
    )  # fmt: skip
    return [MainCodes(type="I", densities=densities, new=new), *[still] * predicted]


def half(exponent: int) -> int:
    """The binary16 pattern of 2^exponent."""
    return (exponent + 15) << 10


@dataclass(frozen=True)
class Case:
    """A stream, piece by piece, and the rule that it breaks, if any."""

    head: SequenceHeader
    make: Callable[[], Iterator[bytes]]
    rule: str | None = None


def largest_picture(level: int) -> tuple[int, int]:
    """Width and height of a picture of as many pixels as the level allows."""
    height = 1 << (LEVELS[level].pixels.bit_length() - 1) // 2
    return LEVELS[level].pixels // height, height


def cases(level: int) -> dict[str, Case]:
    """What a level allows of everything, and what a stream may claim beyond it, by name."""
    most = LEVELS[level]
    width, height = largest_picture(level)
    small, picture = header(level, 16, 16), header(level, width, height)
    deep = header(level, width, height, bit_depth=16)
    tall = header(level, min(most.pixels // 65535, 65535) or 1, 65535)

    def frames(head: SequenceHeader, *make: Callable[[], bytes]) -> Callable[[], Iterator[bytes]]:
        def pieces() -> Iterator[bytes]:
            yield opening(head)
            for piece in make:
                yield piece()
            yield end(len(make))

        return pieces

    def splats(head: SequenceHeader) -> Callable[[], Iterator[bytes]]:
        """The longest codes of most splats, frame after frame."""
        count = most.splats
        return frames(head, lambda: intra(0, count), lambda: predicted(1, count), lambda: predicted(2, count))

    def few_bytes(number: int) -> bytes:
        """Most splats, off the screen, in the fewest bytes."""
        options: dict[str, Any] = {"long": False, "stages": 1, "codewords": 1}
        aside = (half(1), half(1))
        return predicted(number, most.splats, **options) if number else intra(0, most.splats, at=aside, **options)

    # Splats of one row through all strips: e_y below half a pixel, y in the middle of a row.
    rows_width = most.work // most.splats
    rows_head = header(level, rows_width, most.pixels // rows_width)
    center = half(-(rows_head.height.bit_length() - 1))

    def crowded(number: int) -> bytes:
        return intra(number, most.splats, factor=(rows_width, 0, 0.1), at=(0, center), long=False)

    def ancillary() -> Iterator[bytes]:
        yield opening(small)
        yield chunk("z", bytes(most.payload))
        yield from (intra(0, 0), end(1))

    def index() -> Iterator[bytes]:
        """Pairs of 1 and 1, with as many bytes before them as that takes."""
        yield from (opening(small), intra(0, 0), chunk("z", bytes(most.payload)))
        steps = (most.payload - 5) // 2
        last = chunk("x", encode_uv(steps), b"\1\1" * steps)
        yield from (last, end(1, len(last)))

    def words() -> bytes:
        """A coded plane of two symbols whose words fill the payload; none of them is needed."""
        count = most.splats
        head = b"".join((encode_uv(1), encode_uv(count), b"\xf8"))
        bits = "10" + f"{1:05b}" + f"{0:04b}" + f"{0:08b}" + f"{1:08b}" + "010" * 2
        table = int(bits.ljust(-(-len(bits) // 8) * 8, "0"), 2).to_bytes(-(-len(bits) // 8), "big")
        room = (most.payload - len(head) - len(table) - 5 - 4) // 2
        return chunk("I", head, table, encode_uv(room), (1 << 16).to_bytes(4, "little"), bytes(2 * room))

    def main_splats() -> Iterator[bytes]:
        """Most splats of profile `main` in the fewest bytes; their sizes are those of a pixel."""
        yield write_stream(small_main, main_frames(small_main, most.splats, 3), index=False)

    small_main = main_header(level, 16, 16)
    return {
        "main, splats in few bytes": Case(small_main, main_splats),
        "splats": Case(small, splats(small)),
        "splats in few bytes": Case(small, frames(small, *(partial(few_bytes, number) for number in range(4)))),
        "splats on a picture": Case(deep, splats(deep)),
        "pictures": Case(deep, frames(deep, lambda: intra(0, 0), lambda: repeated(1), lambda: intra(2, 0))),
        "tall picture": Case(tall, frames(tall, lambda: intra(0, 1, factor=(9, 0, 9)), lambda: predicted(1, 1))),
        "ancillary chunk": Case(small, ancillary),
        "index": Case(small, index),
        "words": Case(picture, frames(picture, lambda: intra(0, most.splats), words), rule="R-7-1"),
        "rows through all strips": Case(rows_head, frames(rows_head, lambda: crowded(0), lambda: crowded(1))),
    }
