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
from gsvc_ref.bitstream.frames import frame_head
from gsvc_ref.bitstream.header import HIGHEST_LEVEL, LONGEST_HEADER, MAIN, SequenceHeader, sequence_header
from gsvc_ref.bitstream.rules import broken
from gsvc_ref.bitstream.times import TIMES, read_times, times
from gsvc_ref.main.frames import Body, MainState
from gsvc_ref.main.layers import Layers, layer_body, layer_head
from gsvc_ref.paper import FrameType
from gsvc_ref.stream.decoded import DecodedFrame, DecodedLayer
from gsvc_ref.stream.pace import Pace
from gsvc_ref.stream.profiles import AnyCodes, AnyState, Parsed, profile_of, work_after
from gsvc_ref.stream.source import Source, SourceReader

CRC_SIZE: Final = chunks.CRC_BITS // 8
"""Bytes of `chunk_crc`."""


@dataclass(frozen=True)
class Place:
    """The place of a decoder between two chunks."""

    offset: int  # of the next chunk, in bytes from the start of the stream
    state: AnyState  # after the frame before
    next_number: int = 0  # that the next frame must have
    index_length: int = 0  # bytes of the chunk directly before, if that is an index
    frame_end: int = 0  # offset of the end of the last frame's chunk, or of the sequence header
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
        self.header: SequenceHeader = sequence_header(p, max_level=max_level)
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
        pace = Pace() if self.header.paced_flag else None
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
            chunk_type, payload = chunks.chunk(s, self.longest_payload)
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
        if chunk_type in chunks.FRAMES:
            frame_type = chunks.frame_type_of(chunk_type)
            _, checksum = frame_head(p, self.header, place.next_number)
            parsed = self._profile.read(p, self.header, place.state, frame_type)
            _check_filled(p)
            state, work = self._reconstruct(parsed, checksum, place, p)
            codes = parsed.codes
            pace = self._pace(place, frame_type, len(state.splats), work, after.offset)
            layers = None
            if place.layers is not None:
                assert isinstance(state, MainState)
                layers = place.layers.after(frame_type, state)
            number, offset = place.next_number + 1, after.offset
            after = Place(offset, state, number, 0, offset, work, checksum, pace, layers)
        elif chunk_type == chunks.INDEX_TYPE:
            self.check_index(p, place)
            after = replace(after, index_length=size)
        elif chunk_type == chunks.END_TYPE:
            self.check_end(p, place)
        elif chunk_type == chunks.LAYER_TYPE and place.layers is not None and place.layers.takes_chunks:
            layers, layer = self._layer(p, place, place.layers)
            after = replace(after, layers=layers)
        else:  # R-6.2-5
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
        head = layer_head(p, self.header, before)
        if head.type is None:
            with p.part("ancillary"):
                p.raw("payload", p.bytes_left)
            return replace(before, last=head.layer), None
        body = layer_body(p, self.header, before, head.layer, head.type)
        _check_filled(p)
        layers = before.with_layer(head.layer, body.after)
        self._check_work(layers.work, place)
        _check_checksum(head.checksum, lambda: body.after.checksum, head.checksum_bit)
        return layers, _Layer(head.layer, body)

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

    def _reconstruct(self, parsed: Parsed, checksum: int | None, place: Place, p: Reader) -> tuple[AnyState, int]:
        """The checks that follow parsing: R-8-1, R-5-4 and R-6.4-3; the state, and the rendering work in pairs."""
        try:
            state = parsed.reconstruct()
        except GsvcError as error:
            raise broken("R-8-1", error.message, 8 * place.offset) from None
        repeated = state is place.state  # an R-frame has the work and the checksum of the frame before
        work = place.work if repeated else work_after(state)
        self._check_work(work, place)
        checksum_bit = p.first_bit + 8 * len(encode_uv(place.next_number))
        _check_checksum(
            checksum, lambda: place.checksum if repeated else parameter_checksum(state.splats), checksum_bit
        )
        return state, work

    def _check_work(self, work: int, place: Place) -> None:
        if work > self.header.limits.work:
            message = f"rendering takes {work} pairs; level {self.header.level} allows {self.header.limits.work}"
            raise broken("R-5-4", message, 8 * place.offset)

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

    def may_have_layers(self, place: Place) -> bool:
        """Whether a layer of the frame before that is wanted may still follow at a place."""
        layers = place.layers
        if layers is None or not layers.takes_chunks:
            return False
        if layers.last >= min(layers.highest, self.header.layer_count - 1):  # a greater layer cannot follow
            return False
        with self.source.lock:
            self.source.seek(place.offset)
            following = self.source.peek()  # one byte, so that a frame is not kept back until the next chunk is whole
        return following is not None and chunks.is_ancillary(following)

    def _pace(self, place: Place, frame_type: FrameType, splats: int, work: int, end: int) -> Pace | None:
        """The pace after the frame whose chunk stands at a place and ends at an offset: R-5-7 and R-5-8."""
        if place.pace is None or place.pace.next_number != place.next_number:  # after seeking, or a gap
            return None
        pace = place.pace.after(self.header, frame_type, splats, work, end - place.frame_end)
        if (fault := pace.fault(self.header)) is not None:
            raise broken(*fault, 8 * place.offset)
        return pace

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
