"""How a stream is laid out: its chunks, its elements, and ways to replace a part of a payload."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

from gsvc_base.errors import GsvcError
from gsvc_ref.bitstream.chunks import PREFIX_SIZE
from gsvc_ref.bitstream.coder import Element, encode_uv
from gsvc_ref.stream import StreamReader
from gsvc_ref.testing import join_chunks

from .checks import uv


@dataclass(frozen=True)
class Parts:
    """A stream taken apart: `prefix` (magic and version), chunks (type, payload), and `rest`, which is no chunk."""

    prefix: bytes
    chunks: tuple[tuple[bytes, bytes], ...]
    rest: bytes

    def joined(self, chunks: Sequence[tuple[bytes, bytes]] | None = None) -> bytes:
        """The stream, maybe with other chunks; lengths and checksums are right."""
        return join_chunks(self.chunks if chunks is None else chunks, prefix=self.prefix) + self.rest


@lru_cache(4096)
def split(data: bytes) -> Parts:
    """Take any bytes apart as far as they look like a stream; checksums are not looked at."""
    at = PREFIX_SIZE
    chunks = []
    while at < len(data):
        size, first = uv(data, at + 1)
        if first + size + 4 > len(data):
            break
        chunks.append((data[at : at + 1], data[first : first + size]))
        at = first + size + 4
    return Parts(data[:PREFIX_SIZE], tuple(chunks), data[at:])


@lru_cache(4096)
def elements(data: bytes) -> dict[str, list[Element]]:
    """The elements of a stream up to its fault, by name."""
    found: dict[str, list[Element]] = {}

    def note(element: Element) -> None:
        if element.value is not None:  # it was read
            found.setdefault(element.name, []).append(element)

    try:
        for _ in StreamReader(data, trace=note):
            pass
    except GsvcError:
        pass
    return found


def with_part_of_payload(data: bytes, first: int, end: int, new: bytes) -> bytes:
    """The stream with bytes first..end - 1, which lie in one payload, replaced."""
    parts = split(data)
    chunks = list(parts.chunks)
    at = PREFIX_SIZE
    for number, (chunk_type, payload) in enumerate(chunks):
        start = at + 1 + len(encode_uv(len(payload)))
        if start <= first <= start + len(payload):
            chunks[number] = chunk_type, payload[: first - start] + new + payload[end - start :]
            break
        at = start + len(payload) + 4
    return parts.joined(chunks)
