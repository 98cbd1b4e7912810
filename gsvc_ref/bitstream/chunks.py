"""The container: stream prefix, chunks, index and end (spec.md sections 6.1, 6.2, 6.7 and 6.8)."""

from collections.abc import Callable
from typing import Final, Literal, NoReturn, cast

import numpy as np

from gsvc_base.arrays import U4
from gsvc_base.errors import UsageError
from gsvc_ref.bitstream.coder import Bytes, Coder, encode_uv
from gsvc_ref.bitstream.crc import crc32c

MAGIC: Final = bytes.fromhex("89 47 53 56 43 0D 0A 1A")
VERSION_MAJOR: Final = 128 + 2
"""Draft 1 of version 1.0 (R-6.1-2)."""
VERSION_MINOR: Final = 0
PREFIX_SIZE: Final = len(MAGIC) + 2
END_CHUNK_SIZE: Final = 14
CRC_BITS: Final = 32

HEADER_TYPE: Final = ord("H")
I_TYPE: Final = ord("I")
P_TYPE: Final = ord("P")
R_TYPE: Final = ord("R")
INDEX_TYPE: Final = ord("x")
END_TYPE: Final = ord("E")
LAYER_TYPE: Final = ord("n")
"""A layer of the frame before it, in a stream of profile `main` (spec.md section 15.13)."""
DECISIONS: Final = "d"
"""The ancillary chunk that an encoder's decisions stand in (spec.md section 6.9)."""
FRAMES: Final = frozenset(b"IPR")
"""Chunk types of frames."""

PRIVATE: Final = frozenset(b"pqrs")
"""Ancillary chunk types that anybody may use, after a UUID."""

UUID_SIZE: Final = 16
"""Bytes of a UUID (RFC 9562)."""

CRITICAL: Final = FRAMES | {HEADER_TYPE, END_TYPE}
"""Chunk types that a decoder must know."""


def magic(s: Coder) -> None:
    """`magic` of stream(), spec.md section 6.1."""
    if s.raw("magic", len(MAGIC), MAGIC) != MAGIC:
        s.fail(
            "R-6.1-1", "this is not a .gsvc stream, or a transfer in text mode has damaged it: its magic number differs"
        )


def version(s: Coder) -> int:
    """`version_major` and `version_minor` of stream(), spec.md section 6.1; the minor one."""
    if (major := s.le("version_major", 1, VERSION_MAJOR)) != VERSION_MAJOR:
        is_old = major in (1, 129)
        advice = "encode its source again, with this version" if is_old else "a newer version of gsvc may read it"
        names = _version_name(major), _version_name(VERSION_MAJOR)
        s.fail("R-6.1-2", f"the stream is of {names[0]}; this decoder reads {names[1]}; {advice}")
    return s.le("version_minor", 1, VERSION_MINOR)


def _version_name(major: int) -> str:
    """What a `version_major` stands for: bit 7 marks a draft."""
    return f"draft {major - 128} of version 1 ({major})" if major > 128 else f"version {major}"


def chunk_head(
    s: Coder,
    longest: Callable[[int], int],
    chunk_type: int = 0,
    chunk_length: int = 0,
    *,
    own_longest: int | None = None,
) -> tuple[int, int]:
    """The first two elements of chunk(); `longest` tells the most bytes of a payload of a type.

    `own_longest` is that of a frame by the operating point of the quality that is decoded, if that is to be asked.
    """
    chunk_type = s.le("chunk_type", 1, chunk_type)
    if not is_letter(chunk_type):
        s.fail("R-6.2-1", f"`chunk_type` is {chunk_type:#04x}, which is no ASCII letter")
    chunk_length = s.uv("chunk_length", chunk_length)
    if chunk_length > longest(chunk_type):
        s.fail("R-5-3", f"a chunk {chr(chunk_type)} has {chunk_length} bytes; {longest(chunk_type)} are allowed")
    if chunk_type in FRAMES:
        check_own_length(s, chunk_length, own_longest)
    return chunk_type, chunk_length


def check_own_length(s: Coder, chunk_length: int, own_longest: int | None, *, bit: int | None = None) -> None:
    """R-5-9 of the payload of a chunk whose `chunk_length` was coded last, or stands at `bit`."""
    if own_longest is not None and chunk_length > own_longest:
        message = f"a chunk has {chunk_length} bytes; the operating point of the quality allows {own_longest}"
        s.fail("R-5-9", message, bit=bit)


def chunk_rest(s: Coder, chunk_type: int, chunk_length: int, payload: bytes = b"") -> Bytes:
    """The other two elements of chunk(): the payload, whose bits the payload's own elements count, and the checksum."""
    coded = s.raw("payload", chunk_length, payload, counted=False)
    crc = crc32c(coded, crc32c(bytes([chunk_type]) + encode_uv(chunk_length)))
    if s.le("chunk_crc", 4, crc) != crc:
        wrong_checksum(s, chunk_type)
    return coded


def wrong_checksum(s: Coder, chunk_type: int, *, bit: int | None = None) -> NoReturn:
    """Say that the `chunk_crc` coded last, or at `bit`, is wrong (R-6.2-2)."""
    s.fail("R-6.2-2", f"the checksum of a chunk {chr(chunk_type)} is wrong: the chunk is damaged", bit=bit)


def chunk(
    s: Coder,
    longest: Callable[[int], int],
    chunk_type: int = 0,
    payload: bytes = b"",
    *,
    own_longest: int | None = None,
) -> tuple[int, Bytes]:
    """chunk() of spec.md section 6.2: its type and payload."""
    chunk_type, chunk_length = chunk_head(s, longest, chunk_type, len(payload), own_longest=own_longest)
    return chunk_type, chunk_rest(s, chunk_type, chunk_length, payload)


def is_letter(chunk_type: int) -> bool:
    """Whether a chunk type is an ASCII letter (R-6.2-1)."""
    return bytes([chunk_type]).isalpha()


def is_ancillary(chunk_type: int) -> bool:
    """Whether a decoder that does not know a chunk type skips it."""
    return bytes([chunk_type]).islower()


def check_private(chunk_type: int, payload: Bytes) -> None:
    """Refuse a payload of an ancillary chunk that lacks what its type demands: a private one, its UUID (R-6.2-8)."""
    if chunk_type in PRIVATE and len(payload) < UUID_SIZE:
        raise UsageError(
            f"a chunk of the private type {chr(chunk_type)} has {len(payload)} bytes; begin it with a UUID of "
            f"{UUID_SIZE} bytes, for instance uuid.UUID(...).bytes (R-6.2-8)"
        )


def check_known(s: Coder, chunk_type: int) -> None:
    """Refuse critical types that this version does not define."""
    if chunk_type not in CRITICAL and not is_ancillary(chunk_type):
        s.fail("R-3.2-1", f"a chunk is of the critical type {chr(chunk_type)}, which is reserved")


def frame_type_of(chunk_type: int) -> Literal["I", "P", "R"]:
    """The frame type that a chunk type in `FRAMES` stands for."""
    return cast(Literal["I", "P", "R"], chr(chunk_type))


def index(s: Coder, index_offset: int, steps: U4 | None = None) -> None:
    """index() of spec.md section 6.7, in a stream whose index chunk begins at byte `index_offset`.

    `steps` (entry_count, 2) u4, with columns `frame_number_step` and `offset_step`, is what a Writer writes.
    """
    last = np.zeros(2, np.int64)  # frame number and offset
    with s.part("index"):
        entry_count = s.uv("entry_count", 0 if steps is None else len(steps))
        first = s.position
        for number, block in enumerate(s.pairs(("frame_number_step", "offset_step"), entry_count, steps)):
            entries = last + block.cumsum(axis=0, dtype=np.int64)  # (n, 2): a block is too short to overflow
            last = entries[-1] if len(entries) else last
            if (block[int(number == 0) :] == 0).any() or last[1] >= index_offset:
                s.fail(
                    "R-6.7-1", "frame numbers and offsets of the index must grow, and end before the index", bit=first
                )


def index_steps(entries: list[tuple[int, int]]) -> U4:
    """The steps of index() for I-frames (frame number, offset in bytes), as far as steps are below 2^32.

    An index that ends early is still true: it need not name every I-frame.
    """
    steps = np.diff(np.array([(0, 0), *entries], np.int64), axis=0)  # (entry_count, 2)
    whole = int(np.argmax((steps >= 1 << 32).any(axis=1))) if (steps >= 1 << 32).any() else len(steps)
    return steps[:whole].astype(np.uint32)


def end(s: Coder, frame_count: int = 0, index_length: int = 0) -> tuple[int, int]:
    """end() of spec.md section 6.8: `frame_count` and `index_length`."""
    with s.part("end"):
        frame_count = s.le("frame_count", 4, frame_count)
        return frame_count, s.le("index_length", 4, index_length)


def check_ancillary_type(chunk_type: str) -> int:
    """The code of a type that an application may give its ancillary chunk: a lower-case letter other than `x`."""
    if len(chunk_type) != 1 or not chunk_type.isascii() or not chunk_type.islower() or chunk_type == "x":
        raise UsageError(
            f"the type of an ancillary chunk is {chunk_type!r}; it must be a lower-case ASCII letter but x"
        )
    return ord(chunk_type)
