"""The results of reading: frames, gaps, and the account of a whole stream."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final

from gsvc_base.arrays import I8
from gsvc_base.errors import GsvcError
from gsvc_base.splats import Splats
from gsvc_ref.bitstream.header import SequenceHeader
from gsvc_ref.bitstream.times import FrameTimes
from gsvc_ref.main.codes import MainCodes
from gsvc_ref.main.layers import Layers, joined_origins
from gsvc_ref.paper import FrameType
from gsvc_ref.stream.profiles import AnyCodes, AnyState

MAX_FAULTS: Final = 8
"""Maximum number of faults that a `Gap` keeps: a hostile stream may have one in every few bytes."""


@dataclass(frozen=True)
class DecodedLayer:
    """A layer of a frame as a stream holds it (spec.md section 15.13)."""

    number: int  # of its frame
    layer: int  # 1 for the first above the base
    type: FrameType  # `layer_type`
    codes: MainCodes
    splats: Splats  # of this layer alone
    bits: dict[str, int]  # this and the next two as of a `DecodedFrame`, of the chunk `n`
    offset: int
    size: int
    # The layers of the frame up to this one.
    layers: Layers = field(compare=False, repr=False)


@dataclass(frozen=True)
class DecodedFrame:
    """A frame as a stream holds it."""

    number: int  # `frame_number`, 0 for the first
    type: FrameType
    codes: AnyCodes  # those that the bytes hold: `FrameCodes` of profile `paper`, `MainCodes` of `main`
    base: Splats  # of the base; without layers, all splats
    bits: dict[str, int]  # of the chunk by category (`categories_of` the profile); together 8 · `size`
    offset: int  # of the chunk, in bytes from the start of the stream
    size: int  # of the chunk, in bytes
    # What the next frame is predicted from; of a frame with layers, that of the base.
    state: AnyState = field(compare=False, repr=False)
    chunks: tuple[DecodedLayer, ...] = ()  # of its layers, in their order; none where only the base is decoded
    # The layers of the frame with their states; None where only the base is decoded.
    layers: Layers | None = field(default=None, compare=False, repr=False)

    @cached_property
    def splats(self) -> Splats:
        """Bit for bit those of the encoder: those of the base, then those of the layers that are decoded."""
        return self.base if self.layers is None else self.layers.splats

    @property
    def lacking(self) -> tuple[int, ...]:
        """The layers, of those that are decoded, that the frame should have and that damage has taken."""
        return () if self.layers is None else self.layers.lacking

    @property
    def parts(self) -> tuple[AnyState, ...]:
        """The states of the base and of the layers, those without splats left out."""
        parts = (self.state,) if self.layers is None else self.layers.parts
        return tuple(part for part in parts if len(part.splats))

    def with_layer(self, chunk: DecodedLayer) -> "DecodedFrame":
        """The frame with one more of its layers."""
        return replace(self, chunks=(*self.chunks, chunk), layers=chunk.layers)

    def repeats(self, before: "DecodedFrame") -> bool:
        """Whether it has the same splats as the frame `before`: base and layers repeat, or have none."""
        ours, theirs = self.parts, before.parts
        return len(ours) == len(theirs) and all(one is other for one, other in zip(ours, theirs, strict=True))

    def origins(self, before: "DecodedFrame") -> I8 | None:
        """For each splat its index in the frame `before`, or -1 if it is new, (N,) i8; None if all of them are.

        A frame that repeats the one before is not asked.
        """
        if self.layers is None or not isinstance(self.codes, MainCodes):
            return self.codes.origins
        chunks = {chunk.layer: chunk.codes for chunk in self.chunks}
        return joined_origins(self.codes, chunks, self.layers, before.layers)


@dataclass(frozen=True)
class Gap:
    """A damaged part of a stream that was skipped, and the frames that are missing because of it.

    Attributes
    ----------
    faults
        The rules that are broken in it, in the order of the stream; the first `MAX_FAULTS` only.
    fault_count
        The number of faults.
    offset, size
        The offset of the first chunk at fault in bytes from the start of the stream, and the number of bytes from there
        to the end of what was skipped; 0 where frames are missing without a trace.
    skipped
        The number of these bytes that were skipped: all but those of sound chunks that hold no frame.
    first_missing
        The number that the next frame should have had.
    missing_count
        The number of frames that are missing from there on; None if unknown, which happens only at the end of a stream.
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
        """A sentence: which frames are missing, why, and which bytes were skipped."""
        fault, others = self.faults[0], self.fault_count - 1
        more = f" and {others} more fault{'s' if others > 1 else ''}" if others else ""
        joint = ", but" if self.missing_count == 0 else f"{self._sound_frames()}:"
        why = str(fault).removeprefix(f"{fault.kind}: ")
        return f"{self._missing_frames()}{joint} {why}{more}; {self._skipped_bytes()}"

    def _missing_frames(self) -> str:
        first, count = self.first_missing, self.missing_count
        if count is None:
            return f"frames from {first} on are missing, if there were any"
        if count == 0:
            return "no frame is missing"
        return f"frame {first} is missing" if count == 1 else f"frames {first} to {first + count - 1} are missing"

    def _sound_frames(self) -> str:
        """The missing frames that are sound; nothing if none is."""
        begin, last = self.predicted_from, self.first_missing + (self.missing_count or 0) - 1
        if begin is None or begin > last:
            return ""
        which = "" if begin <= self.first_missing else f" {last}" if begin == last else f" {begin} to {last}"
        return f",{which} because predicted from missing ones"

    def _skipped_bytes(self) -> str:
        if self.skipped == 0:
            return "no bytes skipped"
        last = self.offset + self.size - 1
        part = "" if self.skipped == self.size else f"{self.skipped:,} of the "
        return f"{part}bytes {self.offset:,} to {last:,} skipped"

    def clipped(self, start: int, stop: int | None) -> "Gap":
        """The gap with only the frames missing that are among `start` to `stop` - 1."""
        if self.missing_count == 0:
            return self
        first = max(self.first_missing, start)
        if self.missing_count is None:
            return replace(self, first_missing=first)
        end = self.first_missing + self.missing_count
        end = end if stop is None else min(end, stop)
        return replace(self, first_missing=first, missing_count=max(end - first, 0))

    def reaches(self, start: int) -> bool:
        """Whether it lies after the frame before `start`, or misses frames from there on."""
        return self.missing_count is None or self.first_missing + max(self.missing_count, 1) > start


@dataclass(frozen=True, slots=True)
class LayerSummary:
    """`layer`, `type`, `splats` (its own), `bits` by category, `offset` and `size` in bytes of a layer of a frame."""

    layer: int
    type: FrameType
    splats: int
    bits: dict[str, int]
    offset: int
    size: int


@dataclass(frozen=True, slots=True)
class FrameSummary:
    """`number`, `type`, `splats` (how many), `bits` by category, `offset` and `size` in bytes of a frame.

    They are those of the base; `layers` has a summary of each of its chunks of layers.
    """

    number: int
    type: FrameType
    splats: int
    bits: dict[str, int]
    offset: int
    size: int
    layers: tuple[LayerSummary, ...] = ()
    lacking: tuple[int, ...] = ()  # layers that damage has taken from it


@dataclass(frozen=True)
class StreamSummary:
    """The contents of a stream."""

    header: SequenceHeader
    frames: list[FrameSummary]  # the complete ones
    bits: dict[str, int]
    """The number of bits by category (`categories_of` the profile), and those ``unread``, which follow a fault, or when
    salvaging ``skipped``. Together 8 · `file_bytes`."""
    file_bytes: int
    error: GsvcError | None  # at which reading stopped before the end
    times: FrameTimes
    gaps: list[Gap] = field(default_factory=list)  # empty unless salvaging
    ancillary: bytes | None = None  # the last payload of the type of chunks that was asked for
