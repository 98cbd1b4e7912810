"""A second decoder, written from spec.md alone and sharing nothing with gsvc_ref: it sees what a round trip cannot.

Writer and reader share one description of the syntax, so a misreading of the spec would go unnoticed between them. This
decoder knows legal streams only and checks nothing but checksums.
"""

import struct
from typing import Any

import numpy as np
from hypothesis import given, settings

from gsvc_ref.bitstream import StreamReader
from gsvc_ref.testing import RICH_HEADER, Stream, rich_frames, streams, write_stream

HEADER = (
    "profile:1 level:1 flags:1 width:2 height:2 frame_rate_numerator:4 frame_rate_denominator:4 "
    "sample_aspect_numerator:2 sample_aspect_denominator:2 frame_count:4 bit_depth:1 chroma_format:1 "
    "color_primaries:1 transfer_characteristics:1 matrix_coefficients:1 video_full_range_flag:1 "
    "chroma_sample_loc_type:1 cholesky_bits:1 color_stages:1 color_codewords:2 entropy_precision:1 lane_count:1"
)
f4 = np.float32


def crc32c(data: bytes) -> int:
    register = 0xFFFFFFFF
    for byte in data:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ (0x82F63B78 if register % 2 else 0)
    return register ^ 0xFFFFFFFF


class Bits:
    """The bits of some bytes, as a string of 0 and 1."""

    def __init__(self, data: bytes) -> None:
        self.bits = "".join(f"{byte:08b}" for byte in data)
        self.at = 0

    def u(self, n: int) -> int:
        self.at += n
        return int(self.bits[self.at - n : self.at] or "0", 2)

    def raw(self, n: int) -> bytes:
        return bytes(self.u(8) for _ in range(n))

    def le(self, n: int) -> int:
        return int.from_bytes(self.raw(n), "little")

    def uv(self) -> int:
        value, weight = 0, 1
        while True:
            byte = self.u(8)
            value += byte % 128 * weight
            weight *= 128
            if byte < 128:
                return value

    def eg(self, k: int) -> int:
        z = 0
        while self.u(1) == 0:
            z += 1
        return ((2**z - 1) << k) + self.u(z + k)

    def align(self) -> None:
        self.at += -self.at % 8


def plane(s: Bits, header: dict[str, int], count: int, alphabet: int) -> list[int]:
    w = 0
    while 2**w < alphabet:
        w += 1
    plane_mode = s.u(2)
    if plane_mode == 0:
        symbols = [s.u(w)] * count
    elif plane_mode == 1:
        symbols = [s.u(w) for _ in range(count)]
    else:
        table_bits, golomb_order, first, last = s.u(5), s.u(4), s.u(w), s.u(w)
        R = header["entropy_precision"]
        f = {symbol: s.eg(golomb_order) << (R - table_bits) for symbol in range(first, last + 1)}
        slots = [symbol for symbol in f for _ in range(f[symbol])]
        c = {symbol: slots.index(symbol) if f[symbol] else 0 for symbol in f}
        assert len(slots) == 2**R
        s.align()
        word_count = s.uv()
        x = [s.le(4) for _ in range(min(header["lane_count"], count))]
        words = iter([s.le(2) for _ in range(word_count)])
        symbols = []
        for i in range(count):
            lane = i % header["lane_count"]
            slot = x[lane] % 2**R
            symbol = slots[slot]
            x[lane] = f[symbol] * (x[lane] >> R) + slot - c[symbol]
            if x[lane] < 2**16:
                x[lane] = x[lane] * 2**16 + next(words)
            symbols.append(symbol)
        assert list(words) == []
        assert set(x) == {2**16}
    s.align()
    return symbols


def splat_block(s: Bits, header: dict[str, int], count: int, kept: dict[str, Any]) -> list[Any]:
    """Values or differences of positions (normalised), Cholesky factors and colours; None where not present."""
    has_positions, has_cholesky, own_quantizer, has_colors, own_codebooks = (s.u(1) for _ in range(5))
    assert s.u(3) == 0
    positions = cholesky = colors = None
    if has_positions:
        axes = []
        for _ in range(2):
            high, low = plane(s, header, count, 256), plane(s, header, count, 256)
            axes.append([struct.unpack(">e", bytes(pair))[0] for pair in zip(high, low, strict=True)])
        positions = np.array(axes, f4).T
    if has_cholesky:
        channels = []
        for channel in range(3):
            if own_quantizer:
                kept[f"quantizer {channel}"] = struct.unpack("<ff", s.raw(8))
            scale, offset = (f4(number) for number in kept[f"quantizer {channel}"])
            q = np.array(plane(s, header, count, 2 ** header["cholesky_bits"]), f4)
            channels.append(q * scale + offset)
        cholesky = np.array(channels, f4).T
    if has_colors:
        if own_codebooks:
            kept["books"] = []
            for _ in range(s.le(1)):
                size = s.le(2)
                kept["books"].append([struct.unpack("<3e", s.raw(6)) for _ in range(size)])
        for book in kept["books"]:
            stage = np.array([book[i] for i in plane(s, header, count, len(book))], f4)
            colors = stage if colors is None else colors + stage
    return [positions, cholesky, colors]


def decode(stream: bytes) -> tuple[dict[str, int], list[list[Any]]]:
    """The header's elements, and positions, Cholesky factors and colours of each frame."""
    s = Bits(stream)
    assert s.raw(8) == b"\x89GSVC\r\n\x1a"
    assert s.le(1) == 1
    s.le(1)
    frames: list[list[Any]] = []
    splats: list[Any] = []
    header: dict[str, int] = {}
    while True:
        start = s.at // 8
        chunk_type = chr(s.le(1))
        payload = s.raw(s.uv())
        end = s.at // 8
        assert s.le(4) == crc32c(stream[start:end])
        p = Bits(payload)
        if chunk_type == "E":
            assert p.le(4) == len(frames)
            return header, frames
        if chunk_type == "H":
            header = {name: p.le(int(size)) for name, size in (part.split(":") for part in HEADER.split())}
            half_size = np.array([header["width"] / 2, header["height"] / 2], f4)
        if chunk_type not in "IPR":
            continue
        assert p.uv() == len(frames)
        checksum = p.le(4) if header["flags"] else None
        if chunk_type == "I":
            splats = [np.zeros((0, 2), f4), np.zeros((0, 3), f4), np.zeros((0, 3), f4)]
            kept: dict[str, dict[str, Any]] = {"inter": {}, "intra": {}}
        if chunk_type != "R":
            new_count = p.uv()
            if len(splats[0]):
                stays = np.array(plane(p, header, len(splats[0]), 2), bool)
                splats = [part[stays] for part in splats]
            if len(splats[0]):
                difference = splat_block(p, header, len(splats[0]), kept["inter"])
                if difference[0] is not None:
                    difference[0] = difference[0] * half_size
                splats = [a if d is None else a + d for a, d in zip(splats, difference, strict=True)]
            if new_count:
                new = splat_block(p, header, new_count, kept["intra"])
                new[0] = (new[0] + f4(1)) * half_size
                splats = [np.concatenate([a, n]) for a, n in zip(splats, new, strict=True)]
        if checksum is not None:
            assert checksum == crc32c(b"".join(part.astype("<f4").tobytes() for part in splats))
        frames.append(splats)


@given(streams(max_frames=4, max_count=60))
@settings(max_examples=40)
def test_second_decoder_agrees(stream: Stream) -> None:
    header, frames = decode(stream.data)
    for name, value in header.items():
        assert value == getattr(stream.header, "parameter_checksum_flag" if name == "flags" else name)
    assert [b"".join(part.tobytes() for part in frame) for frame in frames] == [s.tobytes() for s in stream.splats]


def test_second_decoder_on_the_rich_stream() -> None:
    """Coded planes, kept quantisers and codebooks in few frames."""
    data = write_stream(RICH_HEADER, rich_frames())
    frames = [b"".join(part.tobytes() for part in frame) for frame in decode(data)[1]]
    assert frames == [frame.splats.tobytes() for frame in StreamReader(data)]
