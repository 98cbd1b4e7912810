"""Reading what is left of a damaged file: frames and gaps (spec.md section 12.5)."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Final

from gsvc_base.errors import GsvcError
from gsvc_ref.bitstream import chunks
from gsvc_ref.bitstream.bit_reader import Reader
from gsvc_ref.bitstream.rules import broken
from gsvc_ref.stream.chunk_decoder import CRC_SIZE, ChunkDecoder, DecodedChunk, PaceError, Place, check_complete
from gsvc_ref.stream.decoded import MAX_FAULTS, Gap
from gsvc_ref.stream.source import SourceReader
from gsvc_ref.stream.whole_chunks import WholeChunks

P_AND_R: Final = frozenset(b"PR")


@dataclass
class _OpenGap:
    """A gap whose end has not been reached."""

    offset: int
    faults: list[GsvcError] = field(default_factory=list)
    fault_count: int = 0
    end: int = 0
    skipped: int = 0
    sound: range = range(0)  # the last run of whole P- and R-frames that could not be decoded

    def note(self, fault: GsvcError) -> None:
        self.fault_count += 1
        if len(self.faults) < MAX_FAULTS:
            # Where it was raised a whole frame is held: a gap must not keep that alive.
            fault.__traceback__ = fault.__context__ = fault.__cause__ = None
            self.faults.append(fault)

    def note_sound(self, number: int) -> None:
        self.sound = range(self.sound.start if number == self.sound.stop else number, number + 1)

    def closed(self, first_missing: int, missing_count: int | None) -> Gap:
        reaches_end = missing_count is not None and self.sound.stop == first_missing + missing_count
        predicted_from = self.sound.start if reaches_end and self.sound.start > first_missing else None
        return Gap(
            tuple(self.faults), self.fault_count, self.offset, max(self.end - self.offset, 0), self.skipped,
            first_missing, missing_count, predicted_from,
        )  # fmt: skip


@dataclass(frozen=True)
class _Head:
    """The elements of a whole chunk that are needed before it is decoded.

    `frame_number` is that of a frame; `ending` are `frame_count` and `index_length` of an end chunk; None if unknown.
    """

    chunk_type: int
    size: int
    frame_number: int | None = None
    ending: tuple[int, int] | None = None


class Salvage:
    """The chunks of a damaged file that can be decoded, and the gaps between them, in their order.

    Nothing is believed without a right checksum, and nothing is guessed: after a gap decoding goes on only

    - with a P- or R-frame that has the number that was due, if no frame is known to be missing before it;
    - with an I-frame that has this number or a greater one;
    - with an end chunk whose `frame_count` is possible.

    A frame that only comes too fast for a paced stream (`PaceError`) is reported and decoded all the same. A chunk
    of a layer that is skipped or missing loses no frame of the base: its layer, and no other one, is gone until its
    next I, and `lacking` of a frame tells so.

    What follows a second sequence header, up to its end chunk, belongs to another stream and is skipped.
    """

    def __init__(self, decoder: ChunkDecoder, place: Place) -> None:
        self._decoder = decoder
        self._place = place
        self._whole = WholeChunks(decoder.source, decoder.header.limits.payload)
        self._gap: _OpenGap | None = None
        self._state_lost = False

    @property
    def checksummed(self) -> int:
        """The number of bytes checksummed so far."""
        return self._whole.checksummed

    def __iter__(self) -> Iterator[DecodedChunk | Gap]:
        while self._place.offset < self._whole.end:
            if (head := self._whole_chunk()) is None:
                continue
            if (decoded := self._decoded(head)) is None:
                self._skip_chunk(head)
                continue
            after = decoded.after
            if decoded.frame is None and not decoded.is_end:  # says nothing about missing frames
                self._place = replace(after, next_number=self._place.next_number)
                yield decoded
                continue
            number = decoded.frame.number if decoded.frame is not None else after.next_number
            yield from self._closed_gap(number - self._place.next_number)
            yield decoded
            self._place, self._state_lost = after, False
            if decoded.is_end:
                yield from self._trailing_data()
                return
        if self._gap is None:
            self._note(broken("R-6.2-4", "the stream ends without an end chunk: it was cut", 8 * self._place.offset))
        missing = self._decoder.header.frame_count - self._place.next_number
        known = self._decoder.header.frame_count > 0 and missing >= 0
        yield from self._closed_gap(missing if known else None)

    def _whole_chunk(self) -> _Head | None:
        """The chunk here, if it is whole; else its fault is noted and it is skipped."""
        offset = self._place.offset
        size = self._whole.size_at(offset)
        source, end = self._decoder.source, None
        try:
            with source.lock:
                source.seek(offset)
                s = SourceReader(source)
                chunk_type, chunk_length = chunks.chunk_head(s, self._decoder.longest_payload)
                if size is not None:
                    return _head(chunk_type, size, bytes(source.read(min(chunk_length, 8))))
            end = s.position // 8 + chunk_length + CRC_SIZE
            check_complete(s, end, self._whole.end)
            chunks.wrong_checksum(s, chunk_type, bit=8 * (end - CRC_SIZE))
        except GsvcError as fault:
            self._note(fault)
        self._skip_to(self._whole.after_damaged(offset, end))
        return None

    def _decoded(self, head: _Head) -> DecodedChunk | None:
        """The whole chunk here, if decoding can go on with it; else its fault is noted, unless the gap explains it."""
        after_gap = self._place_after_gap(head)
        # What a P- or R-frame is predicted from may be missing: the gap explains why it cannot be decoded.
        if self._gap is not None and after_gap is None and head.chunk_type in P_AND_R:
            if head.frame_number is not None:
                self._gap.note_sound(head.frame_number)
            return None
        places = [after_gap or self._place]
        if self._gap is None and places[0] is not self._place:
            places.insert(0, self._place)  # this will fail, and opens the gap
        while places:
            place = places.pop(0)
            try:
                return self._decoder.decode(place)
            except GsvcError as fault:
                self._note(fault)
                if isinstance(fault, PaceError):  # too fast, but whole
                    places.insert(0, replace(place, pace=None))
                elif fault.rule == "R-15.13-6" and place.layers is not None:  # this is not what is missing
                    places.insert(0, replace(place, layers=place.layers.interrupted()))
        return None

    def _place_after_gap(self, head: _Head) -> Place | None:
        """The place of the chunk here, if frames may be missing before it; None if decoding cannot go on with it."""
        place, due = self._place, self._place.next_number
        if head.chunk_type == chunks.I_TYPE:
            if head.frame_number is None or head.frame_number < due:  # an old frame, or a copy
                return None
            return place if head.frame_number == due else replace(place, next_number=head.frame_number)
        if head.chunk_type in P_AND_R:
            return place if head.frame_number == due and not self._state_lost else None
        if head.chunk_type == chunks.END_TYPE:
            if head.ending is None or head.ending[0] < max(due, 1):
                return None
            return replace(place, next_number=head.ending[0], index_length=head.ending[1])
        return place if chunks.is_ancillary(head.chunk_type) else None

    def _skip_chunk(self, head: _Head) -> None:
        """Skip the whole chunk here; after a second sequence header, the whole stream that it begins."""
        if head.chunk_type in chunks.FRAMES:
            old = head.frame_number is not None and head.frame_number < self._place.next_number
            self._state_lost |= not old  # a frame that was skipped may have changed the splats
        elif head.chunk_type not in chunks.CRITICAL and not chunks.is_ancillary(head.chunk_type):
            # An unknown critical chunk may be a frame of a later version.
            self._state_lost = True
        end = self._place.offset + head.size
        # H begins another stream
        self._skip_to(self._end_of_stream(end) if head.chunk_type == chunks.HEADER_TYPE else end)

    def _end_of_stream(self, offset: int) -> int:
        """The offset after the next end chunk, or the end of the file."""
        while offset < self._whole.end:
            size = self._whole.size_at(offset)
            if size is None:
                offset = self._whole.after_damaged(offset, None)
                continue
            with self._decoder.source.lock:
                self._decoder.source.seek(offset)
                chunk_type = self._decoder.source.read(1)[0]
            offset += size
            if chunk_type == chunks.END_TYPE:
                break
        return offset

    def _note(self, fault: GsvcError) -> None:
        """Add a fault to the gap, which begins here if there is none."""
        if self._gap is None:
            self._gap = _OpenGap(self._place.offset)
        self._gap.note(fault)

    def _skip_to(self, offset: int) -> None:
        """Go on after what is damaged or cannot be used."""
        assert self._gap is not None
        self._gap.skipped += offset - self._place.offset
        self._gap.end = offset
        layers = None if self._place.layers is None else self._place.layers.interrupted()
        self._place = replace(self._place, offset=offset, index_length=0, pace=None, layers=layers)

    def _closed_gap(self, missing_count: int | None) -> Iterator[Gap]:
        if self._gap is not None:
            yield self._gap.closed(self._place.next_number, missing_count)
            self._gap = None

    def _trailing_data(self) -> Iterator[Gap]:
        """R-6.1-4, after the end chunk: what follows is not part of the stream."""
        try:
            self._decoder.check_nothing_follows(self._place)
        except GsvcError as fault:
            self._note(fault)
            self._skip_to(self._whole.end)
            yield from self._closed_gap(0)


def _head(chunk_type: int, size: int, payload: bytes) -> _Head:
    """The elements in the first 8 bytes of a payload, which may be anything."""
    p = Reader(payload)
    try:
        if chunk_type in chunks.FRAMES:
            return _Head(chunk_type, size, frame_number=p.uv("frame_number"))
        if chunk_type == chunks.END_TYPE:
            return _Head(chunk_type, size, ending=chunks.end(p))
    except GsvcError:
        pass
    return _Head(chunk_type, size)
