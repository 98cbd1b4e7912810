"""What a reader hands out: frames, and the account of a whole stream."""

from dataclasses import dataclass

from gsvc_ref.bitstream.header import SequenceHeader
from gsvc_ref.errors import GsvcError
from gsvc_ref.reconstruction import FrameCodes, FrameType
from gsvc_ref.splats import Splats


@dataclass(frozen=True)
class DecodedFrame:
    """A frame as a stream holds it.

    Attributes
    ----------
    number
        `frame_number`, 0 for the first.
    type
        ``I``, ``P`` or ``R``.
    codes
        What the bytes say.
    splats
        What they stand for, bit for bit what the encoder had.
    bits
        How many bits of the chunk went to each of `CATEGORIES`; together 8 · `size`.
    offset, size
        Where the chunk begins, in bytes from the start of the stream, and its bytes.
    """

    number: int
    type: FrameType
    codes: FrameCodes
    splats: Splats
    bits: dict[str, int]
    offset: int
    size: int


@dataclass(frozen=True, slots=True)
class FrameSummary:
    """`number`, `type`, `splats` (how many), `bits` by category, `offset` and `size` in bytes of a frame."""

    number: int
    type: FrameType
    splats: int
    bits: dict[str, int]
    offset: int
    size: int


@dataclass(frozen=True)
class StreamSummary:
    """What a stream holds.

    Attributes
    ----------
    header
        The sequence header.
    frames
        The complete frames.
    bits
        How many bits went to each of `CATEGORIES`, and to ``unread``: what follows a fault. Together 8 · `file_bytes`.
    file_bytes
        Size of the stream in bytes.
    error
        Why reading stopped before the end, or None.
    """

    header: SequenceHeader
    frames: list[FrameSummary]
    bits: dict[str, int]
    file_bytes: int
    error: GsvcError | None
