"""Streams that get far: mutations of elements, payloads and chunks behind checksums that are made right again."""

from collections.abc import Callable, Sequence
from random import Random
from typing import Any, Final

import numpy as np

from gsvc_ref.bitstream import LEVELS
from gsvc_ref.bitstream.chunks import PREFIX_SIZE
from gsvc_ref.bitstream.coder import Element, encode_uv
from gsvc_ref.testing import join_chunks

from .checks import uv
from .layout import elements, split, with_part_of_payload
from .recoding import plane_recoded

MAX_BYTES: Final = 4096
"""Longest input that a mutation makes."""

BYTES: Final = (0, 1, 2, 0x3F, 0x40, 0x7B, 0x7C, 0x7F, 0x80, 0x81, 0xC0, 0xFE, 0xFF)
COUNTS: Final = (0, 1, 2, 3, 5, 63, 64, 127, 128, 255, 256, 1 << 14, (1 << 14) + 1, 1 << 20, 1 << 28, (1 << 32) - 1)
LENGTHS: Final = (*COUNTS, *(limits.payload + 1 for limits in LEVELS.values()))
FLOATS: Final = tuple(
    np.array([0, -0.0, 1, -1, 2.0**-149, 2.0**-126, -(2.0**-126), 1e30, -1e30, 3.4e38, -3.4e38, np.inf, np.nan], "f4")
)
LETTERS: Final = tuple(bytes([code]) for code in b"HIPREx" + b"IIPPRabzABBBXZ1@[`{\x00\xe9")
CROWDED_SIZE: Final = 512, 256
"""Width and height of as many pixels as level 1 allows."""

UV_ELEMENTS: Final = ("frame_number", "splat_count", "new_splat_count", "word_count", "entry_count")
CONTAINER_ELEMENTS: Final = ("magic", "version_major", "version_minor", "chunk_type", "chunk_length", "chunk_crc")


def with_bits(data: bytes, bit: int, size: int, value: int) -> bytes:
    """The bytes with `size` bits from `bit` on replaced."""
    total = 8 * len(data)
    shift = total - bit - size
    mask = ((1 << size) - 1) << shift
    whole = int.from_bytes(data, "big") & ~mask | (value & ((1 << size) - 1)) << shift
    return whole.to_bytes(len(data), "big")


def with_checksums(data: bytes, original: bytes) -> bytes:
    """Data of the same layout as `original`, with right checksums again."""
    return data if data == original else split(data).joined()


def number_for(rng: Random, size: int, now: int) -> int:
    """A value of `size` bits, likely one at an edge of something."""
    most = (1 << size) - 1
    edges = (0, 1, most, most - 1, most >> 1, (most >> 1) + 1, now + 1, now - 1, now ^ 1 << rng.randrange(max(1, size)))
    return rng.choice((*edges, rng.randrange(most + 1), 1 << rng.randrange(max(1, size)))) & most


def element_changed(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """One to three elements have other values; all names are equally likely."""
    found = elements(data)
    if not found:
        return bytes_changed(data, rng, others)
    names = list(found)
    changed = data
    for _ in range(rng.choice((1, 1, 2, 3))):
        element = rng.choice(found[rng.choice(names)])
        name = element.name.rpartition(".")[2]
        if name in UV_ELEMENTS or name == "frame_number_step, offset_step":
            first = element.bit // 8
            said = encode_uv(rng.choice((*COUNTS, max(0, _low(element.value) + rng.choice((-1, 1))))))
            return with_part_of_payload(with_checksums(changed, data), first, first + _uv_size(data, first), said)
        changed = _overwritten(changed, element, rng)
        if name in CONTAINER_ELEMENTS and name != "chunk_type":
            return changed  # the fault is to stay
    return with_checksums(changed, data)


def _low(value: Any) -> int:
    return int(np.asarray(value).ravel()[0]) if np.size(value) else 0


def _uv_size(data: bytes, first: int) -> int:
    return uv(data, first)[1] - first


def _overwritten(data: bytes, element: Element, rng: Random) -> bytes:
    """The bytes with another value of an element, or of one of a run."""
    bit, size, value = element.bit, element.bits, element.value
    if size == 0:
        return data
    if isinstance(value, np.ndarray) and value.dtype == np.int64:  # frequencies, which have no common size
        return with_bits(data, bit + rng.randrange(size), 1, rng.randrange(2))
    if isinstance(value, np.ndarray) and len(value):
        size //= len(value)
        bit += size * rng.randrange(len(value))
        if value.dtype == np.float32:
            pattern = rng.choice(FLOATS).tobytes() if rng.randrange(4) else rng.randbytes(4)
            return with_bits(data, bit, size, int.from_bytes(pattern, "big"))
        if size in (16, 32):  # little-endian, at a byte
            said = number_for(rng, size, int.from_bytes(data[bit // 8 : (bit + size) // 8], "little"))
            return with_bits(data, bit, size, int.from_bytes(said.to_bytes(size // 8, "little"), "big"))
        return with_bits(data, bit, size, number_for(rng, size, 0)) if size else data
    if isinstance(value, bytes):
        return with_bits(data, bit + rng.randrange(size), 1, rng.randrange(2))
    said = number_for(rng, size, int(value))
    if size % 8 == 0 and bit % 8 == 0 and size > 8:
        said = int.from_bytes(said.to_bytes(size // 8, "little"), "big")
    return with_bits(data, bit, size, said)


def crowded(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """More large splats than the level's rendering work allows, where planes are of one symbol for so many."""
    found = elements(data)
    counts = found.get(rng.choice(("splat_count", "new_splat_count")), [])
    blocks = list(zip(*(found.get(f"{name}.cholesky_offset", []) for name in ("l11", "l22")), strict=False))
    if not counts or not blocks:
        return data
    width, height = CROWDED_SIZE
    changed = with_bits(data, found["width"][0].bit, 16, _bits_of(width.to_bytes(2, "little")))
    changed = with_bits(changed, found["height"][0].bit, 16, _bits_of(height.to_bytes(2, "little")))
    for element in rng.choice(blocks):
        changed = with_bits(changed, element.bit, 32, _bits_of(np.float32(1e6).tobytes()))
    changed = with_checksums(changed, data)
    count = LEVELS[found["level"][0].value].work // (width * height) + 1
    for element in reversed(counts):  # so that those before keep their places
        first = element.bit // 8
        changed = with_part_of_payload(changed, first, first + _uv_size(data, first), encode_uv(count))
    return changed


def _bits_of(data: bytes) -> int:
    return int.from_bytes(data, "big")


def payload_changed(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """Bytes of one payload are set, flipped, put in, taken out or copied."""
    parts = split(data)
    if not parts.chunks:
        return bytes_changed(data, rng, others)
    chunks = list(parts.chunks)
    number = rng.randrange(len(chunks))
    chunks[number] = chunks[number][0], _edited(chunks[number][1], rng)
    return parts.joined(chunks)


def _edited(data: bytes, rng: Random) -> bytes:
    edited = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        at = rng.randrange(len(edited) + 1)
        how = rng.randrange(6)
        if how == 0:
            edited[at:at] = rng.randbytes(rng.randrange(1, 9))
        elif how == 1:
            del edited[at : at + rng.randrange(1, 9)]
        elif how == 2 and edited:
            start = rng.randrange(len(edited))
            edited[at : at + rng.choice((0, 8))] = edited[start : start + rng.randrange(1, 9)]
        elif at < len(edited):
            edited[at] = (edited[at] ^ 1 << rng.randrange(8), rng.choice(BYTES), rng.randrange(256))[how % 3]
    return bytes(edited)


def chunks_changed(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """A chunk is dropped, doubled, moved, retyped, made of random bytes, or taken from another stream."""
    parts = split(data)
    chunks = list(parts.chunks)
    if not chunks:
        return bytes_changed(data, rng, others)
    number, place = rng.randrange(len(chunks)), rng.randrange(len(chunks) + 1)
    how = rng.randrange(6)
    if how == 0:
        del chunks[number]
    elif how == 1:
        chunks.insert(place, chunks[number])
    elif how == 2:
        chunks.insert(min(place, len(chunks) - 1), chunks.pop(number))
    elif how == 3:
        chunks[number] = rng.choice(LETTERS), chunks[number][1]
    elif how == 4:
        chunks.insert(place, (rng.choice(LETTERS), rng.randbytes(rng.randrange(24))))
    else:
        chunks[place:place] = rng.sample(more := split(rng.choice(others)).chunks, min(len(more), rng.randrange(1, 4)))
    return parts.joined(chunks)


def framing_changed(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """One chunk claims another length, or has another checksum; those of all others are right."""
    parts = split(data)
    if not parts.chunks:
        return bytes_changed(data, rng, others)
    number = rng.randrange(len(parts.chunks))
    first, end = (len(join_chunks(parts.chunks[:n], prefix=parts.prefix)) for n in (number, number + 1))
    changed = parts.joined()
    if rng.randrange(2):
        length = uv(changed, first + 1)[1]
        return changed[: first + 1] + encode_uv(rng.choice(LENGTHS)) + changed[length:]
    return changed[: end - 4] + _edited(changed[end - 4 : end], rng)[:4].ljust(4, b"\0") + changed[end:]


def renumbered(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """Frame numbers in order, true counts, no index, no checksums of parameters: what stands there is reached."""
    parts = split(data)
    chunks: list[tuple[bytes, bytes]] = []
    number, checksum_size = 0, 0
    for chunk_type, payload in parts.chunks:
        if chunk_type == b"H":
            checksum_size = 4 * (len(payload) > 2 and payload[2] & 1)
            chunks.append((chunk_type, payload[:2] + b"\0" + payload[3:19] + bytes(4) + payload[23:]))
        elif chunk_type in b"IPR":
            chunks.append((chunk_type, encode_uv(number) + payload[uv(payload, 0)[1] + checksum_size :]))
            number += 1
        elif chunk_type not in b"xE":
            chunks.append((chunk_type, payload))
    chunks.append((b"E", number.to_bytes(4, "little") + bytes(4)))
    return join_chunks(chunks, prefix=parts.prefix)


def paced(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """A stream of level 1 whose bit 1 of `flags` is set, and more R-frames than it may have, by pixels or in a row."""
    chunks = list(split(data).chunks)
    place = max((number + 1 for number, (chunk_type, _) in enumerate(chunks) if chunk_type in b"IPR"), default=0)
    frames, (width, height) = rng.choice(((5, (16, 16)), (70, CROWDED_SIZE)))
    chunks[place:place] = [(b"R", b"\0")] * frames
    parts = split(renumbered(split(data).joined(chunks), rng, others))
    numbers = ((1, 1), (2, 1), (width, 2), (height, 2), (1 if frames == 5 else 100, 4), (1, 4))  # `level` to frame rate
    said = b"".join(value.to_bytes(size, "little") for value, size in numbers)
    header = [(t, p[:1] + said + p[1 + len(said) :]) if t == b"H" else (t, p) for t, p in parts.chunks]
    return parts.joined(header)


def bytes_changed(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """Bytes are changed wherever they stand, and no checksum is made right."""
    return _edited(data, rng)


def cut(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """The stream ends early, or goes on."""
    return data[: rng.randrange(len(data) + 1)] if rng.randrange(3) else data + rng.randbytes(rng.randrange(1, 40))


def concatenated(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """Two streams, or the start of one and the end of another."""
    other = rng.choice(others)
    return (
        data + other if rng.randrange(2) else data[: rng.randrange(len(data) + 1)] + other[rng.randrange(len(other)) :]
    )


def unrelated(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """Random bytes, alone or after a header."""
    start = rng.choice((0, PREFIX_SIZE, PREFIX_SIZE + 42))
    return data[:start] + rng.randbytes(rng.randrange(80))


Mutation = Callable[[bytes, Random, Sequence[bytes]], bytes]

MUTATIONS: Final[dict[Mutation, int]] = {
    element_changed: 30,
    payload_changed: 16,
    chunks_changed: 14,
    renumbered: 12,
    plane_recoded: 6,
    crowded: 2,
    framing_changed: 5,
    paced: 2,
    bytes_changed: 3,
    cut: 2,
    concatenated: 2,
    unrelated: 1,
}
"""Mutations of streams and how likely they are."""


LOOKING: Final = (element_changed, plane_recoded, crowded)
"""Mutations that need to know the elements, which takes time if the stream is not one to begin with."""


LAST: Final = (framing_changed, bytes_changed, cut)
"""Mutations that another one after them would mend, because it makes chunks whole again."""


def mutate_stream(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """One to four mutations of a stream; `others` give parts. The elements are looked up in `data` as it comes."""
    several = rng.choices(list(MUTATIONS), list(MUTATIONS.values()), k=rng.choice((1, 1, 2, 2, 3, 4)))
    several.sort(key=lambda mutation: (mutation not in LOOKING, mutation in LAST))
    for number, mutation in enumerate(several):
        if mutation not in LOOKING or number == 0:
            data = mutation(data, rng, others)
    return data[:MAX_BYTES]
