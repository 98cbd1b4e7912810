"""Every truncation and every flipped bit of a stream, and what spec.md section 12 says a decoder makes of each.

`of_cut` and `of_flip` say it from the bytes of the whole stream alone. `LibraryDecoder` and `SpecDecoder` say what a
decoder does. What comes before the damaged chunk is as in the whole stream, so that both begin to decode there.
"""

import copy
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

from gsvc_base.errors import GsvcError
from gsvc_conformance.spec import namespace
from gsvc_ref.bitstream import LEVELS
from gsvc_ref.stream import StreamReader
from gsvc_ref.stream.chunk_decoder import ChunkDecoder, Place
from gsvc_ref.stream.source import Source

CORE: Final = Path(__file__).parents[2] / "vectors" / "core"
MAGIC_SIZE: Final = 8
PREFIX_SIZE: Final = 10
MINOR: Final = 9
"""The byte of `version_minor`: any value is accepted."""

LONGEST_HEADER: Final = 1024
LONGEST: Final = 3500
"""Bytes of a stream whose every damage is tried."""
NO_FAULT: Final = ""


@cache
def core_streams() -> dict[str, bytes]:
    """Every legal core stream, each once however many vectors use it, by the name of the first of them.

    Those of `seek` are left out, which may have a fault that is not met, and longer ones: they have more of the same
    chunks, and time grows with the square of the length.
    """
    streams: dict[bytes, str] = {}
    for path in sorted(CORE.rglob("*.gsvc")):
        if path.stat().st_size <= LONGEST and path.parts[-3] != "seek":
            streams.setdefault(path.read_bytes(), "/".join(path.parts[-3:-1]))
    return {name: data for data, name in streams.items()}


@dataclass(frozen=True)
class Chunk:
    """Where a chunk of a legal stream stands: offsets in bytes of its type, its length, payload, checksum and end."""

    first: int
    length_at: int
    payload_at: int
    crc_at: int
    end: int


def chunks_of(data: bytes) -> list[Chunk]:
    """The chunks of a legal stream."""
    chunks, at = [], PREFIX_SIZE
    while at < len(data):
        length, payload_at, _ = uv(data, at + 1)
        chunks.append(Chunk(at, at + 1, payload_at, payload_at + length, payload_at + length + 4))
        at = chunks[-1].end
    return chunks


def uv(data: bytes, at: int) -> tuple[int, int, bool]:
    """The value of a `uv`, where it ends, and whether it keeps R-3.1-1; an end after the data: it does not fit."""
    value = 0
    for group in range(5):
        if at + group >= len(data):
            return 0, len(data) + 1, True
        byte = data[at + group]
        value += (byte & 0x7F) << 7 * group
        if byte < 0x80:
            return value, at + group + 1, value < 2**32 and (byte > 0 or group == 0)
    return value, at + 5, False


def of_cut(data: bytes, size: int) -> str:
    """The error of the first `size` bytes of a legal stream: "kind rule bit"."""
    if size < MAGIC_SIZE:
        return "malformed R-6.1-1 0"
    element = size  # of one byte, or no chunk at all
    for chunk in chunks_of(data):
        for first, end in (
            (chunk.length_at, chunk.payload_at),
            (chunk.payload_at, chunk.crc_at),
            (chunk.crc_at, chunk.end),
        ):
            if first < size < end:
                element = first
    return f"malformed R-6.2-4 {8 * element}"


def of_flip(data: bytes, bit: int) -> str:
    """The error of a legal stream in which one bit, counted from the most significant of byte 0, is another."""
    at = bit // 8
    damaged = flipped(data, bit)
    if at < MAGIC_SIZE:
        return "malformed R-6.1-1 0"
    if at < PREFIX_SIZE:
        return NO_FAULT if at == MINOR else f"unsupported R-6.1-2 {8 * MAGIC_SIZE}"
    chunk = next(chunk for chunk in chunks_of(data) if chunk.first <= at < chunk.end)
    chunk_type = damaged[chunk.first]
    if not (chr(chunk_type).isascii() and chr(chunk_type).isalpha()):
        return f"malformed R-6.2-1 {8 * chunk.first}"
    length, payload_at, legal = uv(damaged, chunk.length_at)
    if payload_at > len(data):
        return f"malformed R-6.2-4 {8 * chunk.length_at}"
    if not legal:
        return f"malformed R-3.1-1 {8 * chunk.length_at}"
    level = data[uv(data, PREFIX_SIZE + 1)[1] + 1]  # behind type, length and `profile` of the sequence header
    short = chunk_type == ord("H") or chunk.first == PREFIX_SIZE
    if length > (LONGEST_HEADER if short else LEVELS[level].payload):
        return f"limit R-5-3 {8 * chunk.length_at}"
    if payload_at + length > len(data):
        return f"malformed R-6.2-4 {8 * payload_at}"
    crc_at = payload_at + length
    return f"malformed {'R-6.2-4' if crc_at + 4 > len(data) else 'R-6.2-2'} {8 * crc_at}"


def flipped(data: bytes, bit: int) -> bytes:
    """The stream with one bit changed."""
    damaged = bytearray(data)
    damaged[bit // 8] ^= 0x80 >> bit % 8
    return bytes(damaged)


def said(error: Any) -> str:
    """Kind, rule and bit of an error of gsvc_ref or of spec.md's decoder."""
    return f"{error.kind} {error.rule} {error.bit}"


class LibraryDecoder:
    """gsvc_ref at every place between two chunks of a legal stream.

    Attributes
    ----------
    frames
        The parameters of all frames as bytes.
    """

    def __init__(self, data: bytes) -> None:
        with StreamReader(data) as reader:
            self.frames = [frame.splats.tobytes() for frame in reader]
        self._decoder = ChunkDecoder(Source(data))
        self._places: dict[int, Place] = {}
        place, is_end = self._decoder.first, False
        while not is_end:
            self._places[place.offset] = place
            decoded = self._decoder.decode(place)
            place, is_end = decoded.after, decoded.is_end

    def frames_before(self, offset: int) -> int:
        """The number of frames before the chunk at an offset."""
        return self._places[offset].next_number if offset in self._places else 0

    def outcome(self, damaged: bytes, offset: int) -> str:
        """The error that a damaged stream raises in the chunk at an offset, which no damage stands before."""
        try:
            if offset not in self._places:  # magic, version, sequence header
                with StreamReader(damaged) as reader:
                    return NO_FAULT if [frame.splats.tobytes() for frame in reader] == self.frames else "other frames"
            self._decoder.source = Source(damaged)
            decoded = self._decoder.decode(self._places[offset])
        except GsvcError as error:
            return said(error)
        return f"accepted: {decoded}"


class SpecDecoder:
    """The decoder of spec.md at every place between two chunks of a legal stream."""

    def __init__(self, data: bytes) -> None:
        self._spec = namespace()
        s, state = self._spec["open_stream"](data)
        self._states = {s.position() // 8: copied(state)}
        self._frames = 0
        ends = {chunk.end for chunk in chunks_of(data)}
        for _ in self._spec["read_frames"](s, state):
            self._frames += 1
            self._states[s.position() // 8] = copied(state)
        # Where a chunk without a frame ends, the state is that of the place before but for `index_length`.
        for end in sorted(ends - set(self._states)):
            before = max(place for place in self._states if place < end)
            self._states[end] = copied(self._states[before])

    def outcome(self, damaged: bytes, offset: int) -> str:
        """As of `LibraryDecoder`."""
        spec = self._spec
        try:
            if offset not in self._states:
                s, state = spec["open_stream"](damaged)
                return NO_FAULT if sum(1 for _ in spec["read_frames"](s, state)) == self._frames else "other frames"
            s = spec["Bits"](damaged, end_rule="R-6.2-4")
            s.at = 8 * offset
            next(spec["read_frames"](s, copied(self._states[offset])))
        except spec["Fault"] as fault:
            return said(fault)
        return "accepted"


def copied(state: Any) -> Any:
    """A State of spec.md's decoder that goes its own way."""
    other = copy.copy(state)
    other.kept = {kind: dict(kept) for kind, kept in state.kept.items()}
    return other


@dataclass(frozen=True)
class Damage:
    """One damaged stream: what was done, its bytes, the chunk it was done to, and the error that must come of it."""

    name: str
    data: bytes
    offset: int
    error: str


def damages(data: bytes, step: int = 1, first: int = 0) -> Iterator[Damage]:
    """Truncations and flips of a legal stream, those of number first, first + step, ... of all."""
    chunks = chunks_of(data)
    for number in range(first, 9 * len(data), step):
        if number < len(data):
            size = number
            offset = max((chunk.first for chunk in chunks if chunk.first <= size), default=0)
            yield Damage(f"cut to {size} bytes", data[:size], offset, of_cut(data, size))
        else:
            bit = number - len(data)
            offset = max((chunk.first for chunk in chunks if chunk.first <= bit // 8), default=0)
            yield Damage(f"bit {bit} flipped", flipped(data, bit), offset, of_flip(data, bit))
