"""Streams of profile `main` for the tests of this folder."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from gsvc_ref import spec
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.bitstream.chunks import PREFIX_SIZE
from gsvc_ref.bitstream.header import MAIN
from gsvc_ref.main.codes import MainCodes
from gsvc_ref.main.kept_state import MainState
from gsvc_ref.stream import reconstruct_stream
from gsvc_ref.testing import join_chunks, split_chunks, write_stream
from gsvc_ref.testing.choices import SeededChoices
from gsvc_ref.testing.random_main_streams import make_main_frame
from tests.hostile.hostile_streams import main_frames

HEADER = SequenceHeader(
    profile=MAIN, level=1, width=32, height=24, parameter_checksum_flag=True, max_lane_exponent=2, bit_depth=8
)


@cache
def codes_of(types: str, seed: int = 7, count: int = 12, header: SequenceHeader = HEADER) -> tuple[MainCodes, ...]:
    """Codes of frames of these types, a letter each, with `count` new splats; all symbols are as likely."""
    choices, state, found = SeededChoices(seed), MainState.initial(header.width, header.height), []
    for letter in types:
        codes, state = make_main_frame(choices, header, state, types=letter, count=count, kind="any")
        found.append(codes)
    return tuple(found)


@cache
def stream_of(types: str, seed: int = 7, count: int = 12, header: SequenceHeader = HEADER) -> bytes:
    """A stream of such frames."""
    return write_stream(header, codes_of(types, seed, count, header))


def with_payload(stream: bytes, number: int, change: Callable[[bytes], bytes]) -> bytes:
    """A stream with a changed payload of a chunk, whose length and checksum are right."""
    chunks = split_chunks(stream)
    chunks[number] = chunks[number][0], change(chunks[number][1])
    return join_chunks(chunks, prefix=stream[:PREFIX_SIZE])


def flipped(bit: int) -> Callable[[bytes], bytes]:
    """Flips a bit of a payload, the highest one of a byte being the first."""

    def flip(payload: bytes) -> bytes:
        changed = bytearray(payload)
        changed[bit // 8] ^= 128 >> bit % 8
        return bytes(changed)

    return flip


def damages(stream: bytes, step: int, first: int = 0) -> Iterator[tuple[str, bytes]]:
    """Every `step`-th of all cuts of a stream, all cuts of payloads, and all flipped bits of payloads."""
    made: list[tuple[str, Callable[[], bytes]]] = [
        (f"cut at byte {end}", lambda end=end: stream[:end]) for end in range(len(stream))
    ]
    for number, (kind, payload) in enumerate(split_chunks(stream)):
        where = f"chunk {number} ({kind.decode()})"
        made += [
            (f"{where} cut at byte {end}", lambda n=number, end=end: with_payload(stream, n, lambda p: p[:end]))
            for end in range(len(payload))
        ]
        made += [
            (f"{where} with {more!r} behind", lambda n=number, more=more: with_payload(stream, n, lambda p: p + more))
            for more in (b"\0", b"\0\0", b"\1\2\3")
        ]
        made += [
            (f"{where} with bit {bit} flipped", lambda n=number, bit=bit: with_payload(stream, n, flipped(bit)))
            for bit in range(8 * len(payload))
        ]
    for name, make in made[first::step]:
        yield name, make()


def both(stream: bytes) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    """Counts, parameters and error of the library and of spec.md's code."""
    ours, theirs = reconstruct_stream(stream), spec.reconstruct_stream(stream)
    return (
        (ours.counts.tolist(), ours.parameters.tobytes(), ours.error),
        (theirs["counts"].tolist(), theirs["parameters"].tobytes(), theirs["error"]),
    )


GROWING: dict[str, tuple[dict[int, tuple[str, int]], ...]] = {
    "the base grows": ({0: ("I", 10), 1: ("I", 16000)}, {0: ("P", 500), 1: ("R", 0)}),
    "a layer below grows": ({0: ("I", 10), 1: ("I", 1), 2: ("I", 9000)}, {0: ("P", 1), 1: ("I", 9000), 2: ("R", 0)}),
}
"""Frames whose last layer repeats: by layer its type and the new splats, together more than level 1 allows."""


def growing_codes(name: str, header: SequenceHeader) -> tuple[list[MainCodes], dict[int, list[tuple[int, MainCodes]]]]:
    """The codes of the base and of the layers of a stream of `GROWING`, of equal splats that take next to no bits."""
    base: list[MainCodes] = []
    layers: dict[int, list[tuple[int, MainCodes]]] = {}
    counts: dict[int, int] = {}
    for number, parts in enumerate(GROWING[name]):
        for layer, (letter, count) in parts.items():
            codes = main_frames(header, count, 0)[0] if count else MainCodes.repeated_frame()
            if letter == "P":
                before = counts[layer]
                still = np.zeros(before, np.int64), np.zeros((before, 8), np.int64)
                codes = replace(codes, type="P", modes=still[0], differences=still[1])
                counts[layer] += count
            elif letter == "I":
                counts[layer] = count
            if layer:
                layers.setdefault(number, []).append((layer, codes))
            else:
                base.append(codes)
    return base, layers


@cache
def growing(name: str, level: int, checksums: bool = False) -> bytes:
    """A stream of `GROWING` whose header states a level, which may be too low."""
    header = SequenceHeader(
        profile=MAIN, level=2, width=32, height=24, layer_count=3, parameter_checksum_flag=checksums
    )
    base, layers = growing_codes(name, header)

    def stated(payload: bytes) -> bytes:
        """The header with the level, and with it at all operating points."""
        count = header.layer_count
        return payload[:1] + bytes([level]) + payload[2:-count] + bytes([level << 5]) * count

    return with_payload(write_stream(header, base, layers=layers), 0, stated)
