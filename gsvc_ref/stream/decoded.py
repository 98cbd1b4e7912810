"""What a reader hands out: frames, and the account of a whole stream."""

from dataclasses import dataclass, field, replace
from typing import Final

from gsvc_ref.bitstream.header import SequenceHeader
from gsvc_ref.errors import GsvcError
from gsvc_ref.reconstruction import FrameCodes, FrameType
from gsvc_ref.splats import Splats

MAX_FAULTS: Final = 8
"""Faults that a `Gap` keeps: a hostile stream may have one in every few bytes."""


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


@dataclass(frozen=True)
class Gap:
    """A damaged part of a stream that was skipped, and the frames that are missing because of it.

    Attributes
    ----------
    faults
        The rules that are broken in it, in the order of the stream; the first `MAX_FAULTS` only.
    fault_count
        How many faults there are.
    offset, size
        Where the first chunk at fault begins, in bytes from the start of the stream, and the bytes from there to the
        end of what was skipped; 0 bytes where frames are missing without a trace.
    skipped
        How many of these bytes were skipped: all but those of sound chunks that hold no frame.
    first_missing
        The number that the next frame should have had.
    missing_count
        How many frames are missing from there on; None if the stream does not tell, which happens only at its end.
    predicted_from
        Frames with this number and greater ones are sound, but predicted from missing ones; None if there are none.
    """

    faults: tuple[GsvcError, ...]
    fault_count: int
    offset: int
    size: int
    skipped: int
    first_missing: int
    missing_count: int | None
    predicted_from: int | None = None

    def __str__(self) -> str:
        fault, others = self.faults[0], self.fault_count - 1
        more = f" and {others} more fault{'s' if others > 1 else ''}" if others else ""
        joint = ", but" if self.missing_count == 0 else f"{self._predicted}:"
        return f"{self.frames_missing}{joint} {str(fault).removeprefix(f'{fault.kind}: ')}{more}; {self.bytes_skipped}"

    def clipped(self, start: int, stop: int | None) -> "Gap":
        """What it misses of frames `start` to `stop` - 1."""
        if self.missing_count == 0:
            return self
        first = max(self.first_missing, start)
        if self.missing_count is None:
            return replace(self, first_missing=first)
        end = self.first_missing + self.missing_count
        end = end if stop is None else min(end, stop)
        return replace(self, first_missing=first, missing_count=max(end - first, 0))

    def reaches(self, start: int) -> bool:
        """Whether it lies behind the frame before `start`, or misses frames from there on."""
        return self.missing_count is None or self.first_missing + max(self.missing_count, 1) > start

    @property
    def frames_missing(self) -> str:
        """Which frames are missing, in words."""
        first, count = self.first_missing, self.missing_count
        if count is None:
            return f"frames from {first} on are missing, if there were any"
        if count == 0:
            return "no frame is missing"
        return f"frame {first} is missing" if count == 1 else f"frames {first} to {first + count - 1} are missing"

    @property
    def _predicted(self) -> str:
        """Which of the missing frames are sound, in words."""
        begin, last = self.predicted_from, self.first_missing + (self.missing_count or 0) - 1
        if begin is None or begin > last:
            return ""
        which = "" if begin <= self.first_missing else f" {last}" if begin == last else f" {begin} to {last}"
        return f",{which} because predicted from missing ones"

    @property
    def bytes_skipped(self) -> str:
        """Which bytes were skipped, in words."""
        if self.skipped == 0:
            return "no bytes skipped"
        last = self.offset + self.size - 1
        if self.skipped == self.size:
            return f"bytes {self.offset:,} to {last:,} skipped"
        return f"{self.skipped:,} of the bytes {self.offset:,} to {last:,} skipped"


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
        How many bits went to each of `CATEGORIES`, and to ``unread``, what follows a fault, or when salvaging to
        ``skipped``. Together 8 · `file_bytes`.
    file_bytes
        Size of the stream in bytes.
    error
        Why reading stopped before the end, or None.
    gaps
        What was skipped; empty unless salvaging.
    ancillary
        The payload of the last ancillary chunk of the type asked for; None if there is none.
    """

    header: SequenceHeader
    frames: list[FrameSummary]
    bits: dict[str, int]
    file_bytes: int
    error: GsvcError | None
    gaps: list[Gap] = field(default_factory=list)
    ancillary: bytes | None = None
