"""Decoding one chunk after the other; the checks stand in the order of spec.md section 12."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

from gsvc_base.errors import GsvcError
from gsvc_ref.bitstream import chunks
from gsvc_ref.bitstream.bit_reader import Reader
from gsvc_ref.bitstream.coder import Bytes, Element, categories_of, encode_uv
from gsvc_ref.bitstream.crc import parameter_checksum
from gsvc_ref.bitstream.frames import frame_head, layer_mask
from gsvc_ref.bitstream.header import HIGHEST_LEVEL, LONGEST_HEADER, MAIN, MAX_LAYERS, SequenceHeader, sequence_header
from gsvc_ref.bitstream.rules import broken, kind_of
from gsvc_ref.bitstream.times import TIMES, read_times, times
from gsvc_ref.main.codes import NO_FIELD, MainCodes
from gsvc_ref.main.frames import Body
from gsvc_ref.main.kept_state import MainState
from gsvc_ref.main.layers import Layers, layer_body, layer_checksum, layer_head, layer_number
from gsvc_ref.paper import FrameType
from gsvc_ref.stream.decoded import DecodedFrame, DecodedLayer
from gsvc_ref.stream.pace import Pace
from gsvc_ref.stream.profiles import AnyCodes, AnyState, Parsed, profile_of, work_after
from gsvc_ref.stream.source import Source, SourceReader

CRC_SIZE: Final = chunks.CRC_BITS // 8
"""Bytes of `chunk_crc`."""


class PaceError(GsvcError):
    """A frame comes too fast for a paced stream (R-5-7, R-5-8, or R-5-9 in the place of R-5-7); else it is sound."""


@dataclass(frozen=True)
class Place:
    """The place of a decoder between two chunks."""

    offset: int  # of the next chunk, in bytes from the start of the stream
    state: AnyState  # after the frame before
    next_number: int = 0  # that the next frame must have
    index_length: int = 0  # bytes of the chunk directly before, if that is an index
    frame_end: int = 0  # offset of the end of the last frame's chunks, or of the sequence header
    work: int = 0  # rendering work of the frame before, in pairs
    checksum: int | None = None  # `parameter_checksum` of the frame before, if the stream has some
    pace: Pace | None = None
    """What a paced stream has used of its second. It counts as long as it expects the frame that comes next: not after
    seeking, nor after a gap. None: not checked."""
    layers: Layers | None = None  # of the frame before; None: only the base is decoded, and layers are skipped


@dataclass(frozen=True)
class DecodedChunk:
    """A chunk's bits by category, its frame if it has one, whether it is the end chunk, and the place after it.

    `ancillary` is the type and payload of an ancillary chunk without which the splats are the same; `layer` is the
    layer of a chunk `n` that is wanted.
    """

    bits: Counter[str]
    frame: DecodedFrame | None
    is_end: bool
    after: Place
    ancillary: tuple[str, Bytes] | None = None
    layer: DecodedLayer | None = None


class _Layer(NamedTuple):
    """The layer that a chunk holds: its number, and its body."""

    layer: int
    body: Body


class ChunkDecoder:
    """The chunks of one source."""

    def __init__(
        self,
        source: Source,
        trace: Callable[[Element], None] | None = None,
        *,
        max_level: int = HIGHEST_LEVEL,
        layer: int | None = 0,
    ) -> None:
        """Read all that precedes the first frame; a level above `max_level` is refused (R-5-6).

        `layer` is the highest layer that is decoded; None: all.
        """
        self.source = source
        self._trace = trace
        m = SourceReader(source, trace, end_rule="R-6.1-1")
        chunks.magic(m)
        # A stream that ends inside the magic number breaks another rule than one that ends after it.
        s = SourceReader(source, trace)
        version_minor = chunks.version(s)
        chunk_bit = s.position
        chunk_type, payload = chunks.chunk(s, lambda _: LONGEST_HEADER)
        s.element_bit = chunk_bit
        chunks.check_known(s, chunk_type)
        if chunk_type != chunks.HEADER_TYPE:
            s.fail("R-6.1-3", f"the first chunk is of type {chr(chunk_type)}; it must be the sequence header, H")
        p = payload_reader(s, payload, trace)
        self.header: SequenceHeader = sequence_header(p, max_level=max_level, quality=layer)
        if version_minor == chunks.VERSION_MINOR:
            _check_filled(p)
        else:  # R-6.1-6; by R-6.1-7 all else is as with minor version 0
            with p.part("header"):
                p.raw("unknown", p.bytes_left)
        self.opening_bits = m.bits_by_category() + s.bits_by_category() + p.bits_by_category()
        self._profile = profile_of(self.header)
        state, begin = self._profile.initial(self.header), s.position // 8
        highest = self.header.layer_count - 1 if layer is None else layer
        layers = Layers(highest) if highest > 0 and self.header.profile == MAIN else None
        self.limits = self.header.limits_of(highest)
        pace = Pace(self.limits) if self.header.paced_flag else None
        # The first chunk after the sequence header.
        self.first = Place(begin, state, frame_end=begin, pace=pace, layers=layers)

    def longest_payload(self, chunk_type: int) -> int:
        """Maximum number of bytes of the payload of a chunk of a type (R-5-3)."""
        return LONGEST_HEADER if chunk_type == chunks.HEADER_TYPE else self.header.limits.payload

    def read(self, place: Place) -> tuple[SourceReader, int, Reader]:
        """The chunk at a place: what was read around its payload, its type and its payload.

        These are steps 1 to 3 of spec.md section 12.2: the chunk is whole, of a type that is known or skipped, and may
        stand there.
        """
        with self.source.lock:
            self.source.seek(place.offset)
            s = SourceReader(self.source, self._trace)
            if s.at_end():
                s.fail("R-6.2-4", "the stream ends without an end chunk: it was cut")
            chunk_type, payload = chunks.chunk(s, self.longest_payload, own_longest=self._own_longest)
        s.element_bit = 8 * place.offset
        chunks.check_known(s, chunk_type)
        _check_may_stand(s, chunk_type, place)
        return s, chunk_type, payload_reader(s, payload, self._trace)

    def decode(self, place: Place) -> DecodedChunk:
        """Decode the chunk at a place."""
        s, chunk_type, p = self.read(place)
        size = s.position // 8 - place.offset
        after = replace(place, offset=place.offset + size, index_length=0)
        codes: AnyCodes | None = None
        ancillary: tuple[str, Bytes] | None = None
        layer: _Layer | None = None
        if place.layers is not None and chunk_type in chunks.CRITICAL:
            _check_none_missing(place.layers, MAX_LAYERS, place)
        if chunk_type in chunks.FRAMES:
            frame_type = chunks.frame_type_of(chunk_type)
            _, checksum = frame_head(p, self.header, place.next_number)
            named = layer_mask(p, self.header)
            parsed = self._profile.read(p, self.header, place.state, frame_type, self.limits)
            _check_filled(p)
            state, layers = self._reconstruct(parsed, named, place)
            work = self._check_shown(state, layers, place)
            self._check_frame_checksum(checksum, state, place, p)
            codes = parsed.codes
            count = len(state.splats) if layers is None else layers.count
            pace = self._pace(place, frame_type, count, work, after.offset)
            number, offset = place.next_number + 1, after.offset
            after = Place(offset, state, number, 0, offset, work[0], checksum, pace, layers)
        elif chunk_type == chunks.INDEX_TYPE:
            self.check_index(p, place)
            after = replace(after, index_length=size)
        elif chunk_type == chunks.END_TYPE:
            self.check_end(p, place)
        elif chunk_type == chunks.LAYER_TYPE and place.layers is not None and place.layers.base is not None:
            layers, layer = self._layer(p, place, place.layers)
            after = self._after_layer(replace(after, layers=layers), place)
        else:  # R-6.2-5
            if chunk_type == chunks.LAYER_TYPE and self.header.layer_count > 1 and place.next_number > 0:
                after = self._after_layer(after, place)
            ancillary = chr(chunk_type), p.rest
            with p.part("ancillary"):
                if self._trace is not None and chunk_type == ord(TIMES) and read_times(p.rest) is not None:
                    times(p)  # each element for those who list them
                else:
                    p.raw("payload", p.bytes_left)
        bits = s.bits_by_category() + p.bits_by_category()
        decoded = None if codes is None else self._decoded_frame(codes, bits, place, after)
        shown = None if layer is None else self._decoded_layer(layer, bits, place, after)
        return DecodedChunk(bits, decoded, chunk_type == chunks.END_TYPE, after, ancillary, shown)

    def _layer(self, p: Reader, place: Place, before: Layers) -> tuple[Layers, "_Layer | None"]:
        """A chunk `n`: the layers after it, and the layer that it holds, if that is wanted (spec.md section 15.13)."""
        layers, size = before, p.bytes_left
        if (layer := layer_number(p, before)) is not None:
            _check_none_missing(before, layer, place)
            if layer > before.highest:
                layers = before.passed(layer)
            else:
                chunks.check_own_length(p, size, self._own_longest, bit=8 * place.offset + 8)
                layer_type, layers = layer_head(p, self.header, before, layer)
                if layer_type is not None:
                    checksum, checksum_bit = layer_checksum(p, self.header)
                    body = layer_body(p, self.header, before, layer, layer_type)
                    _check_filled(p)
                    layers = before.with_layer(layer, body.after)
                    self._check_work(layers.work, place)
                    _check_checksum(checksum, lambda: body.after.checksum, checksum_bit)
                    return layers, _Layer(layer, body)
        with p.part("ancillary"):
            p.raw("payload", p.bytes_left)
        return layers, None

    def _after_layer(self, after: Place, place: Place) -> Place:
        """The place after a chunk `n` of a frame, in which R-5-7 and its part of R-5-9 are checked."""
        pace = after.pace
        if pace is not None and pace.next_number == place.next_number:
            splats, work = 0, (0, 0)
            if after.layers is not None and place.layers is not None:
                splats = after.layers.count - place.layers.count
                now, then = (self._works(layers.work) for layers in (after.layers, place.layers))
                work = now[0] - then[0], now[1] - then[1]
            pace = _checked(pace.added(splats, work, after.offset - place.frame_end), self.header, place)
        return replace(after, pace=pace, frame_end=after.offset)

    def check_nothing_follows(self, place: Place) -> None:
        """R-6.1-4, at the place after the end chunk."""
        with self.source.lock:
            self.source.seek(place.offset)
            if self.source.read(1):
                raise broken("R-6.1-4", "something follows the end chunk; cut the file there", 8 * place.offset)

    def hop(self, place: Place) -> tuple[int, Place]:
        """The type of the chunk at a place of a file, and the place after it.

        What R-12.6-1 says is checked: no payload is read, and no checksum compared.
        """
        with self.source.lock:
            self.source.seek(place.offset)
            s = SourceReader(self.source)
            chunk_type, chunk_length = chunks.chunk_head(s, self.longest_payload)
            size = self.source.current_size()
        end = s.position // 8 + chunk_length + CRC_SIZE
        check_complete(s, end, size)
        s.element_bit = 8 * place.offset
        chunks.check_known(s, chunk_type)
        _check_may_stand(s, chunk_type, place)
        return chunk_type, replace(
            place,
            offset=end,
            next_number=place.next_number + (chunk_type in chunks.FRAMES),
            index_length=end - place.offset if chunk_type == chunks.INDEX_TYPE else 0,
        )

    def chunk_at(self, offset: int) -> tuple[int, Reader]:
        """The type of the chunk at an offset, and its payload; nothing else is checked."""
        with self.source.lock:
            self.source.seek(offset)
            s = SourceReader(self.source)
            chunk_type, payload = chunks.chunk(s, self.longest_payload)
        return chunk_type, payload_reader(s, payload)

    def _reconstruct(self, parsed: Parsed, named: tuple[int, ...], place: Place) -> tuple[AnyState, Layers | None]:
        """The state that follows, with R-8-1, and the layers that are wanted."""
        try:
            state = parsed.reconstruct()
        except GsvcError as error:
            raise broken("R-8-1", error.message, 8 * place.offset) from None
        if place.layers is None or not isinstance(parsed.codes, MainCodes):
            return state, None
        assert isinstance(state, MainState)
        moves = parsed.codes.field if parsed.codes.type == "P" else NO_FIELD
        return state, place.layers.after(parsed.codes.type, state, named, moves, place.next_number)

    def _check_shown(self, state: AnyState, layers: Layers | None, place: Place) -> tuple[int, int]:
        """R-5-2 of carried layers, and R-5-4 (R-15.13-3); the work of the frame as `_works` has it."""
        if layers is not None:
            if layers.there and (fault := self.limits.fault("splats", "R-5-2", layers.count)) is not None:
                message = f"with the layers that are carried the frame has {layers.count} splats"
                raise broken(fault[0], f"{message}; {fault[1]}", 8 * place.offset)
            return self._check_work(layers.work, place)
        # an R-frame has the work of the frame before
        repeated = state is place.state
        return self._check_work(lambda h: place.work if repeated and h == 0 else work_after(state, h), place)

    def _works(self, work: Callable[[int], int]) -> tuple[int, int]:
        """The work at the coded size and at that of the operating point, as a function tells it by the halvings."""
        quality = self.limits.quality
        full = work(0)
        return full, work(quality.halvings) if quality is not None and quality.halvings else full

    def _check_work(self, work: Callable[[int], int], place: Place) -> tuple[int, int]:
        works = self._works(work)
        if (fault := self.limits.fault("work", "R-5-4", *works)) is not None:
            pairs = works[0] if fault[0] == "R-5-4" else works[1]
            raise broken(fault[0], f"rendering takes {pairs} pairs; {fault[1]}", 8 * place.offset)
        return works

    def _check_frame_checksum(self, checksum: int | None, state: AnyState, place: Place, p: Reader) -> None:
        repeated = state is place.state  # an R-frame has the checksum of the frame before
        bit = p.first_bit + 8 * len(encode_uv(place.next_number))
        _check_checksum(checksum, lambda: place.checksum if repeated else parameter_checksum(state.splats), bit)

    def _decoded_frame(self, codes: AnyCodes, bits: Counter[str], place: Place, after: Place) -> DecodedFrame:
        size, state = after.offset - place.offset, after.state
        return DecodedFrame(
            place.next_number, codes.type, codes, state.splats, self._spent(bits), place.offset, size, state, (),
            after.layers,
        )  # fmt: skip

    def _decoded_layer(self, found: "_Layer", bits: Counter[str], place: Place, after: Place) -> DecodedLayer:
        assert after.layers is not None
        codes, size = found.body.codes, after.offset - place.offset
        return DecodedLayer(
            place.next_number - 1, found.layer, codes.type, codes, found.body.after.splats, self._spent(bits),
            place.offset, size, after.layers,
        )  # fmt: skip

    def _spent(self, bits: Counter[str]) -> dict[str, int]:
        return {category: bits[category] for category in categories_of(self.header.profile) if bits[category]}

    def _pace(self, place: Place, frame_type: FrameType, splats: int, work: tuple[int, int], end: int) -> Pace | None:
        """The pace after the frame whose chunk stands at a place and ends at an offset: R-5-7 to R-5-9."""
        if place.pace is None or place.pace.next_number != place.next_number:  # after seeking, or a gap
            return None
        pace = place.pace.after(self.header, frame_type, splats, work, end - place.frame_end)
        return _checked(pace, self.header, place)

    @property
    def _own_longest(self) -> int | None:
        """The most bytes of a payload by the operating point, where that is to be asked (R-5-9)."""
        return None if self.limits.own is None else self.limits.own.payload

    def check_index(self, p: Reader, place: Place) -> None:
        """Check the payload of an index at a place, wherever that is (R-6.7-1, R-6.7-2)."""
        chunks.index(p, place.offset)
        _check_filled(p)

    def check_end(self, p: Reader, place: Place) -> None:
        """Check the payload of the end chunk at a place (R-6.8-1, R-6.3-2, R-6.8-2)."""
        frame_count, index_length = chunks.end(p)
        if frame_count != place.next_number:
            message = f"`frame_count` is {frame_count}; the stream has {place.next_number} frames"
            p.fail("R-6.8-1", message, bit=p.first_bit)
        if self.header.frame_count not in (0, frame_count):
            message = f"`frame_count` is {self.header.frame_count} in the header and {frame_count} at the end"
            p.fail("R-6.3-2", message, bit=p.first_bit)
        if index_length != place.index_length:
            p.fail("R-6.8-2", f"`index_length` is {index_length}; {place.index_length} bytes of index stand before it")
        _check_filled(p)


def payload_reader(s: Reader, payload: Bytes, trace: Callable[[Element], None] | None = None) -> Reader:
    """The Reader of the payload of the chunk that `s` has just read."""
    return Reader(payload, first_bit=s.position - chunks.CRC_BITS - 8 * len(payload), trace=trace)


def _check_checksum(stated: int | None, true: Callable[[], int | None], bit: int) -> None:
    """R-6.4-3, where a checksum is stated."""
    if stated is not None and stated != true():
        raise broken("R-6.4-3", "`parameter_checksum` is not that of the reconstructed splats", bit)


def check_complete(s: Reader, end: int, size: int) -> None:
    """R-6.2-4, of a chunk that ends at the byte `end`, and whose payload `s` has not read; the source has `size`."""
    if end > size:
        payload_cut = end - CRC_SIZE > size
        name, bit = ("payload", s.position) if payload_cut else ("chunk_crc", 8 * (end - CRC_SIZE))
        s.fail("R-6.2-4", f"the stream ends inside `{name}`: it was cut, or a length is wrong", bit=bit)


def _check_none_missing(layers: Layers, layer: int, place: Place) -> None:
    """R-15.13-6, where a chunk of `layer`, or of what ends the frame, stands at a place."""
    if (message := layers.missing(layer)) is not None:
        raise broken("R-15.13-6", message, 8 * place.offset)


def _checked(pace: Pace, header: SequenceHeader, place: Place) -> Pace:
    """A pace in which the chunk at a place breaks no rule."""
    if (fault := pace.fault(header)) is not None:
        rule, message = fault
        raise PaceError(kind_of(rule), message, rule=rule, bit=8 * place.offset)
    return pace


def _check_may_stand(s: Reader, chunk_type: int, place: Place) -> None:
    if chunk_type == chunks.HEADER_TYPE:
        s.fail("R-6.1-3", "a second sequence header follows; a stream has one")
    if place.next_number == 0 and chunk_type == chunks.END_TYPE:
        s.fail("R-6.1-5", "the stream has no frame")
    if place.next_number == 0 and chunk_type in chunks.FRAMES and chunk_type != chunks.I_TYPE:
        s.fail("R-6.4-2", f"the first frame is of type {chr(chunk_type)}; it must be an I-frame")


def _check_filled(p: Reader) -> None:
    if p.bits_left:
        p.fail("R-6.2-3", f"{p.bytes_left} bytes of a payload are left over after its last element", bit=p.position)
