"""Streams copied chunk by chunk, without decoding a splat, for joining and cutting (spec.md section 6.10).

Only one chunk is held. Of a frame the container's part is read and written anew: its number, and what follows from it.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.bitstream import chunks
from gsvc_ref.bitstream.bit_reader import Reader
from gsvc_ref.bitstream.bit_writer import Writer
from gsvc_ref.bitstream.coder import UV_LIMIT, Bytes, encode_uv
from gsvc_ref.bitstream.crc import crc32c
from gsvc_ref.bitstream.frames import frame_number_of, layer_mask
from gsvc_ref.bitstream.header import LEVELS, MAIN, SequenceHeader, sequence_header
from gsvc_ref.bitstream.times import TIMES
from gsvc_ref.stream.chunk_decoder import ChunkDecoder
from gsvc_ref.stream.source import Source
from gsvc_ref.stream.writer import MAX_INDEX_BYTES_PER_ENTRY, write_all
from gsvc_tools.editing.retiming import Retiming

Part = str | Path | bytes | bytearray | memoryview | BinaryIO
OnPart = Callable[[int, int, int | None], None]
"""What is called with the number of a part, the bytes read so far of all parts, and those of all parts if known."""


@dataclass(frozen=True)
class Opening:
    """What a stream has before its first frame."""

    version_minor: int
    header: SequenceHeader
    later: bytes  # what a later minor version adds after the last element of the sequence header


@dataclass(frozen=True)
class JoinedPart:
    """A part of a concatenation: its name, the number of its first frame in the result, and how many frames it has."""

    name: str
    first_frame: int
    frame_count: int


@dataclass(frozen=True)
class ConcatReport:
    """A concatenation that was written.

    Attributes
    ----------
    header
        The sequence header of the result.
    parts
        Its parts in their order.
    frame_count
        The number of its frames.
    file_bytes
        Its size.
    left_out
        The number of ancillary chunks of each type that were not copied. Indexes do not count: there is a new one.
    """

    header: SequenceHeader
    parts: list[JoinedPart]
    frame_count: int
    file_bytes: int
    left_out: dict[str, int]


class OpenedPart:
    """A source that is opened twice, for its opening and for its chunks; files of the caller stay open."""

    def __init__(self, source: Part, number: int) -> None:
        self.name = str(source) if isinstance(source, str | Path) else f"part {number + 1}"
        with self._refused():
            self._stream, self.opening = _open(Source(source))
        self.size = self._stream.source.size  # None for a pipe
        self._path = source if isinstance(source, str | Path) else None
        if self._path is not None:
            self._stream.source.close()  # there may be more parts than files may be open

    @contextmanager
    def again(self) -> Iterator[ChunkDecoder]:
        """The stream, opened, with its faults named after it."""
        with self._refused():
            if self._path is None:
                yield self._stream
                return
            stream, opening = _open(Source(self._path))
            with stream.source:
                if opening != self.opening:
                    raise UsageError(f"{self.name} was written anew while it was read; try again when it is complete")
                yield stream

    @contextmanager
    def _refused(self) -> Iterator[None]:
        try:
            yield
        except GsvcError as error:
            message = f"{self.name}: {error.message}; only sound streams are copied: fetch it again, or leave it out"
            raise GsvcError(error.kind, message, rule=error.rule, bit=error.bit) from None


def _open(source: Source) -> tuple[ChunkDecoder, Opening]:
    elements: dict[str, Any] = {}
    try:
        stream = ChunkDecoder(source, lambda element: elements.setdefault(element.name, element.value))
    except BaseException:
        source.close()
        raise
    return stream, Opening(elements["version_minor"], stream.header, elements.get("unknown", b""))


class _Index:
    """The index in the making, as bytes: there may be more I-frames than would fit into memory as objects."""

    def __init__(self) -> None:
        self.entry_count = 0
        self.steps = bytearray()
        self._last = 0, 0

    def add(self, frame_number: int, offset: int) -> None:
        """Add an I-frame, unless a step to it is too large for a `uv`: an index that ends early is still true."""
        steps = frame_number - self._last[0], offset - self._last[1]
        if max(steps) < UV_LIMIT:
            self.steps += encode_uv(steps[0]) + encode_uv(steps[1])
            self.entry_count += 1
            self._last = frame_number, offset


class CopiedStream:
    """The stream in the making; with `same_frames`, what was decided about the frames stays true.

    Layers that its header does not have are left out.
    """

    def __init__(self, target: BinaryIO, opening: Opening, *, same_frames: bool = False) -> None:
        self._target = target
        self._header = opening.header
        self._same_frames = same_frames
        self.times = Retiming(opening.header)
        self._parts: list[JoinedPart] = []
        self.frame_count = 0
        self._offset = 0
        self._left_out: Counter[str] = Counter()
        self._index: _Index | None = _Index()
        self._write(chunks.MAGIC + bytes([chunks.VERSION_MAJOR, opening.version_minor]))
        p = Writer()
        sequence_header(p, self._header)
        self._write_chunk(chunks.HEADER_TYPE, p.getvalue(), opening.later)

    def copy(
        self,
        name: str,
        stream: ChunkDecoder,
        selection: Iterable[tuple[int, Reader]],
        *,
        start: int = 0,
        with_times: bool = True,
    ) -> Iterator[int]:
        """Copy the chunks `selection` of a part (R-6.10-3, R-6.10-4); yields the bytes of it that have been read.

        `start` is the number that the first of its frames has in the part. Without `with_times` time stamps are left
        out; otherwise they are those of `times`.
        """
        first = self.frame_count
        masked = stream.header.layer_count > 1 == self._header.layer_count
        for chunk_type, p in selection:
            if masked and chunk_type in chunks.FRAMES:  # the base alone has no `layer_mask`
                start_of_frame = p.raw("payload", 4 * stream.header.parameter_checksum_flag, counted=False)
                layer_mask(p, stream.header)
                rest: Bytes = bytes(start_of_frame) + bytes(p.raw("payload", p.bytes_left, counted=False))
            else:
                rest = p.raw("payload", p.bytes_left, counted=False)
            if chunk_type in chunks.FRAMES:
                self._write_frame(name, chunk_type, rest)
            elif (with_times and chunk_type == ord(TIMES)) or self._may_stay(chunk_type, rest, first):
                if chunk_type == chunks.LAYER_TYPE and self._header.layer_count > 1 and rest:
                    low = rest[0] + first - start & 15  # of a wrong `frame_low` another wrong one
                    self._write_chunk(chunk_type, bytes([rest[0] & 0xF0 | low]), rest[1:])
                else:
                    self._write_chunk(chunk_type, rest)
            else:
                self._left_out[chr(chunk_type)] += 1
            yield stream.source.offset
        self._parts.append(JoinedPart(name, first, self.frame_count - first))

    def finish(self) -> ConcatReport:
        """Write index and end chunk (R-6.10-5)."""
        index_length = -self._offset
        if self._index is not None:
            self._write_chunk(chunks.INDEX_TYPE, encode_uv(self._index.entry_count), self._index.steps)
        index_length += self._offset
        p = Writer()
        chunks.end(p, self.frame_count, index_length)
        self._write_chunk(chunks.END_TYPE, p.getvalue())
        self._target.flush()
        if self.times.lost:
            self._left_out[TIMES] += self.times.lost
        left_out = dict(sorted(self._left_out.items()))
        return ConcatReport(self._header, self._parts, self.frame_count, self._offset, left_out)

    def _may_stay(self, chunk_type: int, payload: Bytes, first: int) -> bool:
        """Whether an ancillary chunk of a part whose first frame gets the number `first` stays true (R-6.10-4)."""
        if chunk_type == chunks.LAYER_TYPE and self._header.profile == MAIN:  # the number of the layer comes first
            return self.frame_count > first and (len(payload) == 0 or payload[0] >> 6 < self._header.layer_count)
        if len(payload) > self._header.limits.payload:  # a cut to lower layers may have lowered the level
            return False
        if chr(chunk_type) == chunks.DECISIONS and self._same_frames:
            return True
        without_frame = belongs_to_frame(chunk_type) and self.frame_count == first > 0
        return is_safe_to_copy(chunk_type) and not without_frame

    def _write_frame(self, name: str, chunk_type: int, rest: Bytes) -> None:
        number = encode_uv(self.frame_count)
        level = self._header.operating_points[0].level if self._header.operating_points else self._header.level
        size, most = len(number) + len(rest), LEVELS[level].payload
        if size > most:
            raise UsageError(
                f"frame {self.frame_count}, of {name}, would have a chunk of {size} bytes with its new number; level "
                f"{level} allows {most} (R-5-3): put {name} before the others, or join fewer"
            )
        if chunk_type == chunks.I_TYPE and self._index is not None:
            self._index.add(self.frame_count, self._offset)
            if len(self._index.steps) + MAX_INDEX_BYTES_PER_ENTRY > most:
                self._index = None  # the level has no room for it
        self._write_chunk(chunk_type, number, rest)
        self.frame_count += 1

    def _write_chunk(self, chunk_type: int, *payload: Bytes) -> None:
        """Write a chunk whose payload is there in pieces, which are not copied."""
        head = bytes([chunk_type]) + encode_uv(sum(map(len, payload)))
        crc = 0
        for piece in (head, *payload):
            crc = crc32c(piece, crc)
            self._write(piece)
        self._write(crc.to_bytes(chunks.CRC_BITS // 8, "little"))

    def _write(self, data: Bytes) -> None:
        write_all(self._target, data)
        self._offset += len(data)


def sound_chunks(stream: ChunkDecoder) -> Iterator[tuple[int, Reader]]:
    """Frames, after their `frame_number`, and ancillary chunks of a stream; all but splats is checked (R-6.10-6)."""
    place, chunk_type = stream.first, chunks.HEADER_TYPE
    while chunk_type != chunks.END_TYPE:
        s, chunk_type, p = stream.read(place)
        size = s.position // 8 - place.offset
        after = replace(place, offset=place.offset + size, index_length=0)
        if chunk_type in chunks.FRAMES:
            frame_number_of(p, place.next_number)
            yield chunk_type, p
            after = replace(after, next_number=place.next_number + 1)
        elif chunk_type == chunks.INDEX_TYPE:
            stream.check_index(p, place)
            after = replace(after, index_length=size)
        elif chunk_type == chunks.END_TYPE:
            stream.check_end(p, place)
        else:
            yield chunk_type, p
        place = after
    stream.check_nothing_follows(place)


def is_safe_to_copy(chunk_type: int) -> bool:
    """Whether an ancillary chunk stays right when frames are changed, cut, added or renumbered (R-6.2-7)."""
    return chunk_type & 1 != 0


def belongs_to_frame(chunk_type: int) -> bool:
    """Whether an ancillary chunk belongs to the last frame before it, if there is one, not to the stream (R-6.2-6)."""
    return chunk_type & 2 != 0
