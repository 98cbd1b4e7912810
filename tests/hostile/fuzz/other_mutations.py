"""Planes, source videos and settings to begin with, and mutations of them."""

import io
import struct
import zlib
from collections.abc import Sequence
from fractions import Fraction
from random import Random
from typing import Final

import numpy as np

from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.bitstream.bit_writer import Writer
from gsvc_ref.bitstream.planes import plane
from gsvc_ref.testing.random_streams import SYMBOL_KINDS, paint_symbols
from gsvc_ref.video import ColorDescription, VideoFormat, encode_png
from gsvc_ref.video.format import ChromaFormat
from gsvc_ref.video.png import PNG_SIGNATURE
from gsvc_ref.video.y4m import Y4mWriter

from .other_targets import PLANE_HEAD, plane_numbers
from .stream_mutations import MAX_BYTES, bytes_changed, number_for, with_bits

CHROMA_FORMATS: Final[tuple[ChromaFormat, ...]] = ("420", "422", "444", "rgb")


def some_planes() -> list[bytes]:
    """Planes of all kinds of symbols, as `targets.planes` takes them."""
    rng = np.random.default_rng(0)
    made = []
    for n in range(60):
        head = bytes(rng.integers(0, 256, PLANE_HEAD, np.uint8)) if n % 3 else bytes([n, n % 2, n % 7, 0, n, n % 5])
        count, alphabet, precision, lanes = plane_numbers(head)
        header = SequenceHeader(level=1, width=1, height=1, entropy_precision=precision, lane_count=lanes)
        symbols = paint_symbols(rng, SYMBOL_KINDS[n % len(SYMBOL_KINDS)], count, alphabet)
        writer = Writer()
        plane(writer, header, "colors", "plane", count, alphabet, symbols)
        made.append(head + writer.getvalue())
    return made


def mutate_plane(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """Bits of the head and of the table, more likely than of what follows."""
    for _ in range(rng.choice((1, 1, 2, 3))):
        if rng.randrange(3) and data:
            size = min(rng.randrange(1, 17), 8 * len(data))
            bit = rng.randrange(min(8 * len(data), rng.choice((80, 400, 1 << 20))) - size + 1 or 1)
            if bit + size <= 8 * len(data):
                data = with_bits(data, bit, size, number_for(rng, size, 0))
        else:
            data = bytes_changed(data, rng, others)
    return data[:MAX_BYTES]


def some_videos() -> list[bytes]:
    """y4m of all chroma formats and PNG of all kinds, a few pixels each."""
    rng = np.random.default_rng(0)
    made = []
    for chroma in CHROMA_FORMATS:
        for depth in (8, 10, 16):
            color = ColorDescription(1, 1, 0 if chroma == "rgb" else 1, depth == 10, 0)
            video = VideoFormat(5, 3, Fraction(25), depth, chroma, color)
            target = io.BytesIO()
            with Y4mWriter(target, video) as writer:
                for _ in range(2):
                    writer.write(rng.integers(0, 1 << depth, (3, 5, 3), video.dtype))
            made.append(target.getvalue())
            frame = rng.integers(0, 1 << depth, (3, 5, 3), np.uint8 if depth == 8 else np.uint16)
            made.append(encode_png(frame, depth, color))
    made.append(b"YUV4MPEG2 W2 H2 F25:1 It A1:1 Cmono10 XCOLORRANGE=FULL\nFRAME Ixyz\n" + bytes(8))
    made += [_png(color_type, depth, lace) for color_type, depth in PNG_KINDS for lace in (0, 1)]
    return made


PNG_KINDS: Final = ((0, 1), (0, 2), (0, 4), (0, 16), (2, 8), (3, 1), (3, 4), (3, 8), (4, 8), (4, 16), (6, 8), (6, 16))
"""Colour type and depth."""


def _png(color_type: int, depth: int, interlaced: int) -> bytes:
    """A PNG of 9 by 9 pixels with all row filters, opaque; interlaced, it has seven passes."""
    channels = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[color_type]
    grids = ((0, 0, 8, 8), (0, 4, 8, 8), (4, 0, 8, 4), (0, 2, 4, 4), (2, 0, 4, 2), (0, 1, 2, 2), (1, 0, 2, 1))
    rows = []
    for y, x, dy, dx in grids if interlaced else ((0, 0, 1, 1),):
        width = (len(range(x, 9, dx)) * channels * depth + 7) // 8
        rows += [bytes([0]) + b"\xff" * width if color_type in (4, 6) else bytes(1 + width) for _ in range(y, 9, dy)]
    parts = [(b"IHDR", struct.pack(">IIBBBBB", 9, 9, depth, color_type, 0, 0, interlaced))]
    if color_type == 3:
        parts += [(b"PLTE", bytes(n % 256 for n in range(3 << depth))), (b"tRNS", b"\xff")]
    parts += [
        (b"cICP", bytes([9, 16, 0, 1])),
        (b"IDAT", zlib.compress(b"".join(rows)[:-1] + rows[-1][-1:])),
        (b"IEND", b""),
    ]
    return _joined_png(parts)


def _joined_png(parts: Sequence[tuple[bytes, bytes]]) -> bytes:
    made = PNG_SIGNATURE
    for kind, body in parts:
        made += struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(body, zlib.crc32(kind)))
    return made


def _split_png(data: bytes) -> list[tuple[bytes, bytes]]:
    parts, at = [], len(PNG_SIGNATURE)
    while at + 12 <= len(data):
        length, kind = struct.unpack_from(">I4s", data, at)
        parts.append((kind, data[at + 8 : at + 8 + length]))
        at += 12 + length
    return parts


TAGS: Final = tuple(
    b"W0 W1 W5 W65536 W999999999 W-1 H0 H3 H65535 Hx F0:0 F25:0 F2147483648:1 F30000:1001 A0:0 A1:0 It Ib Im I? Iq Ip "
    b"C420 C420jpeg C420mpeg2 C420paldv C422 C444 C444p9 C420p16 C422p17 Cmono Cmono12 C411 C444alpha XCOLORRANGE=FULL "
    b"XCOLORRANGE=LIMITED XYSCSS=420 XGSVC_COLOR=1:1:0:1:0 XGSVC_COLOR=9:16:9:0:5 XGSVC_COLOR=256:1:1:1:1 "
    b"XGSVC_COLOR=1:1:3:0:0 XGSVC_COLOR= \xff".split(b" ")
)


def mutate_video(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """Tags of a y4m header and chunks of a PNG, with checksums made right; or any bytes."""
    how = rng.randrange(4)
    if how == 0 or not data:
        return bytes_changed(data, rng, others)[:MAX_BYTES]
    if not data.startswith(PNG_SIGNATURE):
        line, end, rest = data.partition(b"\n")
        words = line.split(b" ")
        place = rng.randrange(len(words) + 1)
        words[place : place + rng.randrange(2)] = [rng.choice(TAGS)]
        if how == 1:
            rest = bytes_changed(rest, rng, others)
        return (b" ".join(words) + end + rest)[:MAX_BYTES]
    parts = _split_png(data)
    number = rng.randrange(len(parts) or 1)
    if how == 1 and parts:
        parts.insert(rng.randrange(len(parts) + 1), rng.choice(_split_png(rng.choice(others)) or parts))
    elif parts:
        kind, body = parts[number]
        if kind == b"IDAT" and rng.randrange(2):
            body = zlib.compress(bytes_changed(_inflated(body), rng, others))
        else:
            body = bytes_changed(body, rng, others)
        parts[number] = kind, body
    return _joined_png(parts)[:MAX_BYTES]


def _inflated(body: bytes) -> bytes:
    try:
        return zlib.decompressobj().decompress(body, 1 << 16)
    except zlib.error:
        return body


def some_settings() -> list[bytes]:
    """Seeds of settings; all inputs are."""
    return [bytes([n]) for n in range(16)]


def mutate_settings(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """Another seed."""
    return rng.randbytes(8)
