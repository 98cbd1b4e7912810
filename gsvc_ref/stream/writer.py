"""Writing streams, frame by frame."""

import os
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import BinaryIO, Final

from gsvc_base.errors import UsageError
from gsvc_ref.bitstream import chunks
from gsvc_ref.bitstream.bit_writer import Writer
from gsvc_ref.bitstream.coder import Bytes, categories_of
from gsvc_ref.bitstream.crc import parameter_checksum
from gsvc_ref.bitstream.frames import frame_head
from gsvc_ref.bitstream.header import LONGEST_HEADER, SequenceHeader, check_descriptive, level_for, sequence_header
from gsvc_ref.main.codes import MainCodes
from gsvc_ref.main.frames import MainState
from gsvc_ref.main.layers import LayerHead, Layers, layer_body, layer_head
from gsvc_ref.stream.decoded import DecodedFrame, DecodedLayer
from gsvc_ref.stream.pace import Pace
from gsvc_ref.stream.profiles import AnyCodes, AnyState, MakeWriter, profile_of, work_after

MAX_INDEX_BYTES_PER_ENTRY: Final = 10

PACE_REMEDIES: Final = {
    "R-5-7": "write fewer splats, or a higher level, or a stream that is not paced",
    "R-5-8": "write an I-frame here, or a stream that is not paced",
}
"""How a frame that comes too fast for a paced stream may be written."""


@dataclass(frozen=True)
class _IndexEntry:
    frame_number: int
    offset: int


def appends(target: BinaryIO) -> bool:
    """Whether all that is written lands at the end of the file (``>>`` in a shell), so no header can be corrected."""
    try:
        import fcntl

        return bool(fcntl.fcntl(target.fileno(), fcntl.F_GETFL) & os.O_APPEND)
    except (ImportError, AttributeError, OSError):  # no such system, or no file of the system's
        return "a" in str(getattr(target, "mode", ""))


def can_go_back(target: BinaryIO) -> bool:
    """Whether the header can be corrected: not on a pipe, at the end of a log, on a device, in a compressed file."""
    if not target.seekable() or appends(target):
        return False
    try:
        target.truncate()  # devices claim to be seekable and then refuse this
    except (AttributeError, OSError):
        return False
    return True


def write_all(target: BinaryIO, data: Bytes) -> None:
    """Write everything, also to a raw file that takes less at a time."""
    rest = memoryview(data)
    while rest:
        rest = rest[target.write(rest) or 0 :]


class StreamWriter:
    """A `.gsvc` stream in the making; what it accepts, every conforming decoder decodes to the same splats.

    Header and frames are handed to the system at once, so that a reader of the other end can follow. `finish` makes the
    stream whole and may be called after any frame, also after `write_frame` was interrupted. It corrects `frame_count`
    in the header if the target can go back; otherwise, as on a pipe, that is written as 0, unknown.
    """

    def __init__(
        self,
        target: BinaryIO,  # stays open
        header: SequenceHeader,  # `frame_count` may be 0 or a guess
        *,
        index: bool = True,  # so that readers find I-frames at once
        live: bool = False,  # never go back: at every moment the file is the beginning of the stream that it will be
        least_level: bool = False,  # let `finish` lower the level to the least that allows all frames
        make_writer: MakeWriter = Writer,  # of each payload and chunk, given its first bit; for tests of decoders
    ) -> None:
        self._target = target
        self._make_writer = make_writer
        self.goes_back = not live and can_go_back(target)  # whether `finish` corrects what was written
        self._start = target.tell() if self.goes_back else 0
        self._entries: list[_IndexEntry] | None = [] if index else None
        self.frame_count = 0
        self._finished = False
        check_descriptive(header)
        self.header = self._written = header if self.goes_back else replace(header, frame_count=0)
        self._least_level = least_level and self.goes_back
        self._most_splats = self._most_work = self._longest_frame = 0
        self._profile = profile_of(header)
        self._categories = categories_of(header.profile)
        self.state = self._profile.initial(header)  # of a decoder after the frames so far
        self._pace = Pace()
        self._work = 0  # of the frame before, in pairs
        # Those of the last frame, for a decoder of all layers.
        self.layers = Layers(header.layer_count - 1) if header.layer_count > 1 else None
        self.bits: Counter[str] = Counter()  # written, by category (`categories_of` the profile)
        self.offset = 0  # bytes written
        s = make_writer(0)
        chunks.magic(s)
        chunks.version(s)
        self._append(s, Counter())
        self._header_offset = self.offset
        self._write_chunk(chunks.HEADER_TYPE, lambda p: sequence_header(p, self.header))
        self._frame_end = self.offset

    def write_frame(self, codes: AnyCodes, state: AnyState | None = None) -> DecodedFrame:
        """Write a frame: what a reader will make of it, with the bits that each category took.

        An encoder that has the state after the frame already, ``reconstruct(codes, self.state)``, gives it, so that it
        is not computed again; profile `main` finds it as it writes the codes. A UsageError names the rule or limit that
        the codes break, and a parameter that is not finite after reconstruction is a GsvcError (R-8-1); nothing has
        been written then.
        """
        if self.frame_count == 0 and codes.type != "I":
            raise UsageError(f"the first frame is of type {codes.type}; it must be an I-frame (R-6.4-2)")
        prepared = self._profile.prepare(self._make_writer, self.header, self.state, codes, state)
        state = prepared.state
        repeated = state is self.state
        work = self._work if repeated else work_after(state)
        if work > self.header.limits.work:
            limit = f"level {self.header.level} allows {self.header.limits.work}"
            raise UsageError(f"rendering frame {self.frame_count} takes {work} pairs; {limit} (R-5-4)")
        checksum = parameter_checksum(state.splats) if self.header.parameter_checksum_flag else None
        number, offset = self.frame_count, self.offset

        def content(p: Writer) -> None:
            frame_head(p, self.header, number, number, checksum)
            prepared.write(p)

        # The whole chunk is made, and all limits are checked, before a byte is written.
        s, payload_bits = self._chunk(ord(codes.type), content)
        size = offset + len(s.getvalue()) - self._frame_end
        pace = self._pace.after(self.header, codes.type, len(state.splats), work, size)
        if self.header.paced_flag and (fault := pace.fault(self.header)) is not None:
            rule, message = fault
            raise UsageError(f"{message} ({rule}); {PACE_REMEDIES[rule]}")
        bits = self._append(s, payload_bits)
        if codes.type == "I" and self._entries is not None:
            self._entries.append(_IndexEntry(self.frame_count, offset))
        self.frame_count += 1
        self._most_splats = max(self._most_splats, prepared.splats)
        self._most_work = max(self._most_work, work)
        self._longest_frame = max(self._longest_frame, sum(payload_bits.values()) // 8)
        self.state, self._pace, self._work, self._frame_end = state, pace, work, self.offset
        if self.layers is not None:
            assert isinstance(state, MainState)
            self.layers = self.layers.after(codes.type, state)
        spent = {category: bits[category] for category in self._categories if bits[category]}
        size = self.offset - offset
        return DecodedFrame(number, codes.type, codes, state.splats, spent, offset, size, state)

    def write_layer(self, layer: int, codes: MainCodes) -> DecodedLayer:
        """Write a layer of the frame written last: what a reader will make of it (spec.md section 15.13).

        `layer` is 1 to `layer_count` - 1, greater than that of any layer written after the same frame, and its codes
        continue those of the same layer after the frame before. A UsageError names the rule or limit that the codes
        break; nothing has been written then.
        """
        if self.layers is None or self.layers.base is None:
            raise UsageError("a layer needs a header with a `layer_count` above 1, and a frame that it is added to")
        header, before, offset = self.header, self.layers, self.offset
        if not before.last < layer < header.layer_count:
            least, most = before.last + 1, header.layer_count - 1
            raise UsageError(f"layer {layer} cannot stand here; it must be {least} to {most} (R-15.13-1)")
        body = self._make_writer(0)
        state = layer_body(body, header, before, layer, codes.type, codes).after
        after = before.with_layer(layer, state)
        work = after.work
        if work > header.limits.work:
            limit = f"level {header.level} allows {header.limits.work}"
            raise UsageError(
                f"rendering frame {self.frame_count - 1} with layer {layer} takes {work} pairs; {limit} (R-5-4)"
            )
        checksum = state.checksum if header.parameter_checksum_flag else None

        def content(p: Writer) -> None:
            layer_head(p, header, before, LayerHead(layer, codes.type, checksum))
            p.append(body)

        s, payload_bits = self._chunk(chunks.LAYER_TYPE, content)
        bits = self._append(s, payload_bits)
        self.layers = after
        splats = before.others(layer) + len(codes.modes) + codes.intra_count
        self._most_splats = max(self._most_splats, splats, before.others(layer) + len(state.values))
        self._most_work = max(self._most_work, work)
        self._longest_frame = max(self._longest_frame, sum(payload_bits.values()) // 8)
        spent = {category: bits[category] for category in self._categories if bits[category]}
        size = self.offset - offset
        return DecodedLayer(self.frame_count - 1, layer, codes.type, codes, state.splats, spent, offset, size, after)

    def write_ancillary(self, chunk_type: str, payload: bytes) -> None:
        """Write a chunk that decoders skip; its type is a lower-case ASCII letter but x.

        Private data have the types p, q, r and s (spec.md section 6.2) and begin with a UUID of 16 bytes.
        """
        code = chunks.check_ancillary_type(chunk_type)
        chunks.check_private(code, payload)

        def content(p: Writer) -> None:
            with p.part("ancillary"):
                p.raw("payload", len(payload), payload)

        self._write_chunk(code, content)

    def finish(self, ancillary: tuple[str, bytes] | None = None) -> dict[str, int]:
        """Write index and end chunk and correct the header: how many bits of the stream went to each category.

        `ancillary` is the type and payload of one more chunk for `write_ancillary`, before the index; it is left out if
        the level has no room for it. Without a frame it raises a UsageError: a stream must have one (R-6.1-5).
        """
        if self.frame_count == 0:
            raise UsageError("no frame has been written; a stream must have at least one (R-6.1-5)")
        if not self._finished:
            if self.goes_back:  # an interrupted write may have left part of a chunk
                self._target.seek(self._start + self.offset)
                self._target.truncate()
            if self._least_level:
                self._lower_level()
            if ancillary is not None and len(ancillary[1]) <= self.header.limits.payload:
                self.write_ancillary(*ancillary)
            index_length = self._write_index()
            self._write_chunk(chunks.END_TYPE, lambda p: chunks.end(p, self.frame_count, index_length))
            self._correct_header()
            self._finished = True
        return {category: self.bits[category] for category in self._categories}

    def _write_index(self) -> int:
        """Write the index, if there is one and the level has room for it; the bytes of its chunk."""
        most = self.header.limits.payload // MAX_INDEX_BYTES_PER_ENTRY - 1
        if self._entries is None or len(self._entries) > most:
            return 0
        entries = [(entry.frame_number, entry.offset) for entry in self._entries]
        offset = self.offset
        self._write_chunk(chunks.INDEX_TYPE, lambda p: chunks.index(p, offset, chunks.index_steps(entries)))
        return self.offset - offset

    def _lower_level(self) -> None:
        """Take the least level that allows the frames that were written."""
        level = level_for(
            self.header.width, self.header.height,
            splats=self._most_splats, work=self._most_work, payload=self._longest_frame,
        )  # fmt: skip
        self.header = replace(self.header, level=level)

    def _correct_header(self) -> None:
        if not self.goes_back:
            return
        self.header = replace(self.header, frame_count=self.frame_count)
        if self.header == self._written:  # the file is not touched
            return
        p, s = self._make_writer(0), self._make_writer(8 * self._header_offset)
        sequence_header(p, self.header)
        chunks.chunk(s, self._longest_payload, chunks.HEADER_TYPE, p.getvalue())
        self._target.seek(self._start + self._header_offset)
        self._write_all(s.getvalue())
        self._target.seek(self._start + self.offset)

    def _longest_payload(self, chunk_type: int) -> int:
        return LONGEST_HEADER if chunk_type == chunks.HEADER_TYPE else self.header.limits.payload

    def _write_chunk(self, chunk_type: int, content: Callable[[Writer], object]) -> Counter[str]:
        """Write a chunk whose payload `content` writes; its bits by category."""
        return self._append(*self._chunk(chunk_type, content))

    def _chunk(self, chunk_type: int, content: Callable[[Writer], object]) -> tuple[Writer, Counter[str]]:
        """A chunk whose payload `content` writes, and the bits of the payload by category."""
        if self._finished:
            raise UsageError("the stream is finished; make a new StreamWriter for another one")
        p = self._make_writer(0)
        content(p)
        s = self._make_writer(8 * self.offset)
        chunks.chunk(s, self._longest_payload, chunk_type, p.getvalue())
        return s, p.bits_by_category()

    def _append(self, s: Writer, payload_bits: Counter[str]) -> Counter[str]:
        data = s.getvalue()
        self._write_all(data)
        self.offset += len(data)
        bits = s.bits_by_category() + payload_bits
        self.bits += bits
        return bits

    def _write_all(self, data: bytes) -> None:
        write_all(self._target, data)
        self._target.flush()  # whoever reads need not wait for a buffer to fill, and a killed process takes none along
