"""What must hold of what a reader says about any stream."""

import io
import re
from typing import Final

import numpy as np

from gsvc_base.errors import ERROR_KINDS, GsvcError
from gsvc_ref.bitstream import LEVELS, SequenceHeader
from gsvc_ref.bitstream.chunks import PREFIX_SIZE
from gsvc_ref.bitstream.header import MAIN
from gsvc_ref.bitstream.rules import kind_of
from gsvc_ref.stream import DecodedFrame, StreamReader, StreamSummary

RULE: Final = re.compile(r"R-([3-8]|15)(\.\d+)?-\d+")
DIGITS_OF_UV: Final = range(0, 35, 7)


class Pipe(io.BytesIO):
    """Bytes that come a few at a time and cannot be read again."""

    def seekable(self) -> bool:
        return False

    def read(self, size: int | None = -1) -> bytes:
        return super().read(min(7, size) if size is not None and size >= 0 else 7)


def taken(reader: StreamReader, start: int = 0) -> tuple[list[DecodedFrame], GsvcError | None]:
    """The frames from `start` on, and the fault after them."""
    frames: list[DecodedFrame] = []
    try:
        frames.extend(reader.frames(start))
    except GsvcError as error:
        return frames, error
    return frames, None


def read(
    data: bytes, *, pipe: bool = False, layer: int | None = 0
) -> tuple[SequenceHeader | None, list[DecodedFrame], GsvcError | None]:
    """All that a reader says, from its construction on."""
    try:
        reader = StreamReader(Pipe(data) if pipe else data, layer=layer)
    except GsvcError as error:
        return None, [], error
    return reader.header, *taken(reader)


def uv(data: bytes, at: int) -> tuple[int, int]:
    """A `uv` at a byte, as far as it goes, and the byte after it."""
    value = 0
    for shift in DIGITS_OF_UV:
        if at >= len(data):
            break
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            break
    return value, at


LAYER_COUNT = 31
"""The offset of `layer_count` in the payload of a sequence header of profile `main`."""


def declared_splats(data: bytes) -> int:
    """The splats that all frames of a stream declare together: a bound of what decoding it costs.

    Frames that declare more than their level allows are left out: they are refused at once.
    """
    at, total, checksum_size, most, profile, masked = PREFIX_SIZE, 0, 0, 0, 0, False
    while at < len(data):
        chunk_type = data[at : at + 1]
        size, at = uv(data, at + 1)
        payload = data[at : at + size]
        at += size + 4
        if chunk_type == b"H" and most == 0 and len(payload) > 2:
            most = LEVELS[payload[1]].splats if payload[1] in LEVELS else 0
            checksum_size, profile = 4 * (payload[2] & 1), payload[0]
            masked = profile == MAIN and payload[LAYER_COUNT : LAYER_COUNT + 1] > b"\1"
        if chunk_type in (b"I", b"P", b"n"):
            of_layer = chunk_type == b"n"  # which begins with `layer`, `layer_type` and `frame_low` in a byte
            behind = (1 if of_layer else uv(payload, 0)[1] + masked) + checksum_size
            if profile == MAIN:
                flags = payload[behind] if behind < len(payload) else 0  # `quantizer_present` and `new_present` last
                declared = uv(payload, behind + 1 + (flags >> 1 & 1))[0] // 2 + 1 if flags & 1 else 0
            else:
                declared, _ = uv(payload, behind)
            total += declared if declared <= most else 0
    return total


def same_error(a: GsvcError | None, b: GsvcError | None) -> bool:
    """Whether two readings failed in the same way."""
    return str(a) == str(b) and (a is None or b is None or (a.kind, a.rule, a.bit) == (b.kind, b.rule, b.bit))


def check_error(error: GsvcError | None, data: bytes, frames: list[DecodedFrame]) -> None:
    """A fault names a rule, the kind of that rule, and a bit after all complete frames."""
    if error is None:
        return
    assert error.kind in ERROR_KINDS
    assert error.rule is not None, f"no rule: {error}"
    assert RULE.fullmatch(error.rule), error.rule
    assert error.kind == kind_of(error.rule)
    assert error.message
    complete = 8 * (frames[-1].offset + frames[-1].size) if frames else 0
    assert error.bit is not None, f"no bit: {error}"
    assert complete <= error.bit <= 8 * len(data), f"{error}: bit {error.bit} of {8 * len(data)}, frames to {complete}"


def check_frames(frames: list[DecodedFrame], data: bytes) -> None:
    """Frames are numbered, follow each other, account for their bits, and are finite."""
    end = PREFIX_SIZE
    for number, frame in enumerate(frames):
        assert frame.number == number
        assert frame.offset >= end
        assert data[frame.offset : frame.offset + 1] == frame.type.encode()
        assert sum(frame.bits.values()) == 8 * frame.size
        end = frame.offset + frame.size
        assert np.isfinite(frame.splats.to_array()).all()
        if frame.type == "R":
            assert frame.splats == frames[number - 1].splats
    assert end <= max(PREFIX_SIZE, len(data))


def check_summary(
    summary: StreamSummary, frames: list[DecodedFrame], error: GsvcError | None, data: bytes, header: SequenceHeader
) -> None:
    """An account of a stream says what reading says, and every bit is in it once."""
    assert summary.header == header
    told = [(f.number, f.type, f.splats, f.bits, f.offset, f.size) for f in summary.frames]
    assert told == [(f.number, f.type, len(f.splats), f.bits, f.offset, f.size) for f in frames]
    assert same_error(summary.error, error)
    assert summary.file_bytes == len(data)
    assert sum(summary.bits.values()) == 8 * len(data)
    assert min(summary.bits.values()) >= 0
    assert error is not None or summary.bits["unread"] == 0


def check_same_frames(a: list[DecodedFrame], b: list[DecodedFrame]) -> None:
    """Two readings gave the same frames, bit for bit."""
    assert [(f.number, f.type, f.offset, f.size) for f in a] == [(f.number, f.type, f.offset, f.size) for f in b]
    for mine, theirs in zip(a, b, strict=True):
        assert mine.splats == theirs.splats
        assert mine.codes == theirs.codes
