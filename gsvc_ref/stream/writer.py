"""Writing streams, frame by frame."""

import os
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import BinaryIO, Final

from gsvc_base.errors import UsageError
from gsvc_ref.bitstream import chunks
from gsvc_ref.bitstream.bit_writer import Writer
from gsvc_ref.bitstream.coder import Bytes, categories_of
from gsvc_ref.bitstream.crc import parameter_checksum
from gsvc_ref.bitstream.frames import frame_head, layer_mask
from gsvc_ref.bitstream.header import (
    LONGEST_HEADER,
    Level,
    Quality,
    SequenceHeader,
    check_descriptive,
    halved_size,
    level_for,
    sequence_header,
)
from gsvc_ref.main.codes import NO_FIELD, MainCodes
from gsvc_ref.main.kept_state import MainState
from gsvc_ref.main.layers import Layers, layer_body, layer_checksum, layer_head, layer_number
from gsvc_ref.paper import FrameType
from gsvc_ref.stream.decoded import DecodedFrame, DecodedLayer
from gsvc_ref.stream.pace import Pace
from gsvc_ref.stream.profiles import AnyCodes, AnyState, MakeWriter, profile_of, work_after

MAX_INDEX_BYTES_PER_ENTRY: Final = 10

PACE_REMEDIES: Final = {
    "R-5-7": "write fewer splats, or a higher level, or a stream that is not paced",
    "R-5-9": "write fewer splats, or a higher level of that quality, or a stream that is not paced",
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


Amounts = Callable[[int, int], tuple[int, int]]
"""Tells splats and rendering work of a frame in a quality, at a size halved so often."""


def _amounts(state: AnyState, shown: Layers | None, work: int, quality: int, halvings: int) -> tuple[int, int]:
    """`Amounts` of a frame that has these layers, or, without layers, `work` pairs."""
    if shown is None:
        return len(state.splats), work
    parts = [part for layer, part in zip((0, *shown.there), shown.parts, strict=True) if layer <= quality]
    return sum(len(part.values) for part in parts), sum(part.work_at(halvings) for part in parts)


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
        self._most = [Level(0, 0, 0, 0)] * header.layer_count  # what frames asked for so far, by quality
        self._profile = profile_of(header)
        self._categories = categories_of(header.profile)
        self.state = self._profile.initial(header)  # of a decoder after the frames so far
        self._paces = [Pace(header.limits_of(quality)) for quality in range(header.layer_count)]
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

    def write_frame(
        self, codes: AnyCodes, state: AnyState | None = None, layers: Mapping[int, MainCodes] | None = None
    ) -> DecodedFrame:
        """Write a frame with the chunks of its layers: what a reader will make of it, with the bits that each took.

        An encoder that has the state after the frame already, ``reconstruct(codes, self.state)``, gives it, so that it
        is not computed again; profile `main` finds it as it writes the codes. `layers` has the codes of each layer that
        has a chunk, 1 to `layer_count` - 1; they continue those of the same layer after the frame before. A layer that
        is there and not in it is carried: it moves with the field of the base, or is repeated where the base is. A
        `motion_cell` 0 of a layer is the field of the base (spec.md section 15.13). A UsageError names the rule or
        limit that the codes break, and a parameter that is not finite after reconstruction is a GsvcError (R-8-1);
        nothing has been written then.
        """
        if self.frame_count == 0 and codes.type != "I":
            raise UsageError(f"the first frame is of type {codes.type}; it must be an I-frame (R-6.4-2)")
        named = tuple(sorted(layers or ()))
        if named and not 0 < named[0] <= named[-1] < self.header.layer_count:
            most = self.header.layer_count - 1
            raise UsageError(f"frame {self.frame_count} has the layers {named}; they must be 1 to {most} (R-15.13-1)")
        prepared = self._profile.prepare(self._make_writer, self.header, self.state, codes, state)
        state = prepared.state
        work = self._work if state is self.state else work_after(state)
        checksum = parameter_checksum(state.splats) if self.header.parameter_checksum_flag else None
        number, shown = self.frame_count, self.layers
        if shown is not None:
            assert isinstance(state, MainState)
            moves = codes.field if isinstance(codes, MainCodes) and codes.type == "P" else NO_FIELD
            shown = shown.after(codes.type, state, named, moves, number)
            self._check("splats", "R-5-2", shown.count)
        self._check("work", "R-5-4", work if shown is None else shown.work())

        def content(p: Writer) -> None:
            frame_head(p, self.header, number, number, checksum)
            layer_mask(p, self.header, named)
            prepared.write(p)

        # All chunks are made, and all limits are checked, before a byte is written.
        made = [self._chunk(ord(codes.type), content)]
        counts = {0: prepared.splats, **({} if shown is None else {n: len(s.values) for n, s in shown.there.items()})}
        steps: list[tuple[int, MainCodes, Layers]] = []
        for layer in named:
            assert shown is not None
            assert layers is not None
            begin = self.offset + sum(len(s.getvalue()) for s, _ in made)
            chunk, shown = self._layer_chunk(layer, layers[layer], shown, begin)
            made.append(chunk)
            steps.append((layer, layers[layer], shown))
            counts[layer] = max(len(layers[layer].modes) + layers[layer].intra_count, len(shown.there[layer].values))
            self._check("work", "R-5-4", shown.work())
        sizes = [len(s.getvalue()) for s, _ in made]
        payloads = dict(zip((0, *named), (sum(bits.values()) // 8 for _, bits in made), strict=True))
        amounts = partial(_amounts, state, shown, work)
        needs = [self._need(quality, amounts, counts, payloads) for quality in range(self.header.layer_count)]
        paces = self._paced(codes.type, amounts, needs, self.offset - self._frame_end + sum(sizes))
        offsets = [self.offset + sum(sizes[:i]) for i in range(len(sizes))]
        bits = [self._append(*one) for one in made]
        if codes.type == "I" and self._entries is not None:
            self._entries.append(_IndexEntry(self.frame_count, offsets[0]))
        self.frame_count += 1
        self._most = [most.joined(need) for most, need in zip(self._most, needs, strict=True)]
        self.state, self.layers, self._paces, self._work, self._frame_end = state, shown, paces, work, self.offset
        spent = [{category: one[category] for category in self._categories if one[category]} for one in bits]
        written = tuple(
            DecodedLayer(number, layer, of.type, of, step.there[layer].splats, spent[i], offsets[i], sizes[i], step)
            for i, (layer, of, step) in enumerate(steps, 1)
        )
        return DecodedFrame(
            number, codes.type, codes, state.splats, spent[0], offsets[0], sizes[0], state, written, shown
        )

    def _layer_chunk(
        self, layer: int, codes: MainCodes, before: Layers, begin: int
    ) -> tuple[tuple[Writer, Counter[str]], Layers]:
        """The chunk of a layer that begins at a byte, and the layers after it."""
        after = before

        def content(p: Writer) -> None:
            nonlocal after
            layer_number(p, before, layer)
            layer_head(p, self.header, before, layer, codes.type)
            body = self._make_writer(0)
            state = layer_body(body, self.header, before, layer, codes.type, codes).after
            layer_checksum(p, self.header, state.checksum if self.header.parameter_checksum_flag else 0)
            p.append(body)
            after = before.with_layer(layer, state)

        return self._chunk(chunks.LAYER_TYPE, content, begin), after

    def _need(self, quality: int, amounts: Amounts, counts: dict[int, int], payloads: dict[int, int]) -> Level:
        """What a frame asks of the level of a quality, at the size of its operating point (R-5-9)."""
        point = self.header.limits_of(quality).quality
        halvings = 0 if point is None else point.halvings
        columns, rows = halved_size(self.header.width, self.header.height, halvings)
        need = Level(
            columns * rows,
            sum(count for layer, count in counts.items() if layer <= quality),
            amounts(quality, halvings)[1],
            max(size for layer, size in payloads.items() if layer <= quality),
        )
        for name, rule in {"splats": "R-5-2", "work": "R-5-4", "payload": "R-5-3"}.items():
            if point is not None:
                self._check(name, rule, 0, getattr(need, name), quality)
        return need

    def _check(self, name: str, rule: str, amount: int, own: int = 0, quality: int = 0) -> None:
        """Refuse what a frame has too much of, by the level or by the operating point of a quality."""
        if (fault := self.header.limits_of(quality).fault(name, rule, amount, own)) is not None:
            what = {"splats": "splats", "work": "pairs of rendering work", "payload": "bytes in a chunk"}[name]
            frame = f"frame {self.frame_count} has {max(amount, own)} {what}"
            raise UsageError(f"{frame}; {fault[1]} ({fault[0]})")

    def _paced(self, frame_type: FrameType, amounts: Amounts, needs: list[Level], size: int) -> list[Pace]:
        """The pace after a frame whose chunks have this many bytes, for each quality."""
        if not self.header.paced_flag:
            return self._paces
        paces = []
        for quality, (pace, need) in enumerate(zip(self._paces, needs, strict=True)):
            splats, work = amounts(quality, 0)
            paces.append(pace.after(self.header, frame_type, splats, (work, need.work), size))
            if (fault := paces[-1].fault(self.header)) is not None:
                rule, message = fault
                raise UsageError(f"{message} ({rule}); {PACE_REMEDIES[rule]}")
        return paces

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
        header = self.header
        if any(point.halvings for point in header.operating_points):  # they are what the caller promises
            return
        levels = [
            level_for(header.width, header.height, splats=most.splats, work=most.work, payload=most.payload)
            for most in self._most
        ]
        levels[-1] = max(levels[-1], level_for(1, 1, lane_exponent=header.max_lane_exponent))
        qualities = tuple(map(Quality, levels)) if header.layer_count > 1 else ()
        self.header = replace(header, level=levels[-1], qualities=qualities)

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

    def _chunk(
        self, chunk_type: int, content: Callable[[Writer], object], begin: int | None = None
    ) -> tuple[Writer, Counter[str]]:
        """A chunk whose payload `content` writes, and the bits of the payload by category; by default it comes next."""
        if self._finished:
            raise UsageError("the stream is finished; make a new StreamWriter for another one")
        p = self._make_writer(0)
        content(p)
        s = self._make_writer(8 * (self.offset if begin is None else begin))
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
