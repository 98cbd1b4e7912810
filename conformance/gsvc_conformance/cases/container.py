"""Cases of the container: index, frame counts, chunks that a decoder skips, and what a later version adds."""

from typing import Final

import numpy as np

from gsvc_conformance.case import Inputs
from gsvc_conformance.cases.building import (
    HEADER,
    Chunks,
    intra_block,
    on,
    operated,
    predicted,
    quantizer_of,
    result,
    stream_of,
)
from gsvc_ref.bitstream.chunks import PREFIX_SIZE, index_steps
from gsvc_ref.bitstream.coder import encode_uv
from gsvc_ref.paper import FrameCodes, SplatBlock
from gsvc_ref.testing import Lie, split_chunks, write_stream

STREAM: Final = ("read_stream", "reconstruct_stream")
UUID: Final = bytes.fromhex("0b3c8f1e5a7d4c2e9f60a1b2c3d4e5f6")
"""That of the private chunks, of version 4."""


def sequence() -> list[FrameCodes]:
    """Frames I P I R I."""
    first, second, third = (FrameCodes.intra_frame(intra_block(2, first=n)) for n in (0, 3, 6))
    return [first, predicted([1, 1]), second, FrameCodes.repeated_frame(), third]


def entries_of(data: bytes) -> list[tuple[int, int]]:
    """Frame number and offset of each I-frame of a stream."""
    offset, number, entries = PREFIX_SIZE, 0, []
    for chunk_type, payload in split_chunks(data):
        if chunk_type == b"I":
            entries.append((number, offset))
        number += chunk_type in (b"I", b"P", b"R")
        offset += 1 + len(encode_uv(len(payload))) + len(payload) + 4
    return entries


def with_index(entries: list[tuple[int, int]], data: bytes | None = None) -> bytes:
    """A stream, else that of `sequence`, with an index of these entries."""
    steps = index_steps(entries)
    payload = encode_uv(len(steps)) + b"".join(encode_uv(int(step)) for step in steps.ravel())

    def edit(chunks: Chunks) -> Chunks:
        length = 1 + len(encode_uv(len(payload))) + len(payload) + 4
        end = chunks[-1][1][:4] + length.to_bytes(4, "little")
        return [*chunks[:-1], (b"x", payload), (b"E", end)]

    return operated(edit, stream_of(sequence()) if data is None else data)


def indices(data: bytes | None = None) -> dict[str, list[tuple[int, int]] | None]:
    """Indices that a stream, else that of `sequence`, may have, by what is special; None: no index."""
    every = entries_of(stream_of(sequence()) if data is None else data)
    return {
        "absent": None,
        "complete": every,
        "without_the_first": every[1:],
        "without_the_last": every[:-1],
        "empty": [],
        "that_points_elsewhere": [(0, 0), (1, 1), (2, every[1][1] + 1), (3, every[2][1])],
        "with_numbers_of_33_bits": [every[0], (2**32 - 1, 1 + every[0][1]), (2**33 - 2, every[1][1])],
    }


INDICES_IN_WORDS: Final = {
    "absent": "No index", "complete": "An index of all I-frames", "empty": "An index without entries",
    "without_the_first": "An index without the first I-frame", "without_the_last": "An index without the last I-frame",
    "that_points_elsewhere": "An index that points elsewhere",
    "with_numbers_of_33_bits": "An index whose frame numbers add up to more than 32 bits",
}  # fmt: skip


@on("core", *STREAM, flags=["index"], rules=["R-6.7-1"], each={name: name for name in indices()}, said=INDICES_IN_WORDS)
def index(value: str) -> Inputs:
    """{key}: an index is a help and never an authority, so the frames are the same."""
    entries = indices()[value]
    data = stream_of(sequence()) if entries is None else with_index(entries)
    expected = yield {"stream": data}
    assert result(expected, "counts").tolist() == [2] * 5


@on("core", *STREAM, flags=["index", "unknown"], rules=["R-6.7-2", "R-6.8-2"])
def index_that_is_not_last() -> Inputs:
    """An index in the middle is read and not used; `index_length` is 0, since none stands before the end chunk."""
    entries = entries_of(stream_of(sequence()))[:1]
    payload = encode_uv(1) + encode_uv(entries[0][0]) + encode_uv(entries[0][1])
    middle: Chunks = [(b"x", payload), (b"a", b"")]
    data = operated(lambda c: [*c[:3], *middle, *c[3:-1], *middle, c[-1]], stream_of(sequence()))
    expected = yield {"stream": data}
    assert len(result(expected, "counts")) == 5


@on("core", *STREAM, flags=["index"], rules=["R-6.7-2", "R-6.8-2"])
def index_behind_an_index() -> Inputs:
    """Two indices before the end chunk: `index_length` is that of the one directly before it."""

    def edit(chunks: Chunks) -> Chunks:
        return [*chunks[:-2], (b"x", b"\0"), *chunks[-2:]]

    expected = yield {"stream": operated(edit, with_index(entries_of(stream_of(sequence()))))}
    assert len(result(expected, "counts")) == 5


DESCRIPTIVE: Final[dict[str, dict[str, int]]] = {
    "chroma_format_4": {"chroma_format": 4},
    "chroma_format_255": {"chroma_format": 255},
    "video_full_range_flag_2": {"video_full_range_flag": 2},
    "video_full_range_flag_255": {"video_full_range_flag": 255},
    "chroma_sample_loc_type_6": {"chroma_sample_loc_type": 6},
    "chroma_sample_loc_type_255": {"chroma_sample_loc_type": 255},
    "aspect_without_denominator": {"sample_aspect_numerator": 1},
    "aspect_without_numerator": {"sample_aspect_denominator": 1},
    "all_of_them": {"sample_aspect_numerator": 65535, "chroma_format": 99, "color_primaries": 254,
                    "transfer_characteristics": 254, "matrix_coefficients": 254, "video_full_range_flag": 77,
                    "chroma_sample_loc_type": 200},
}  # fmt: skip


@on("core", *STREAM, "decode_stream_deterministic", flags=["unknown"], rules=["R-6.3-3"], each=DESCRIPTIVE)
def descriptive(value: dict[str, int]) -> Inputs:
    """An element that only describes the source is beyond its range, and nothing is refused: {key}."""
    lies = [Lie(element, said) for element, said in value.items()]
    expected = yield {"stream": write_stream(HEADER, sequence(), lies=lies)}
    if "header" in expected:
        assert set(value.values()) <= set(result(expected, "header").tolist())


@on("core", *STREAM, rules=["R-6.3-2"], each={"unknown": 0, "known": 5})
def frame_count(value: int) -> Inputs:
    """The header's frame count is {key}."""
    expected = yield {"stream": write_stream(HEADER, sequence(), lies=[Lie("frame_count", value)])}
    if "header" in expected:
        assert result(expected, "header")[9] == value


@on("core", *STREAM, flags=["unknown"], rules=["R-6.2-1", "R-6.2-5"])
def ancillary_chunks() -> Inputs:
    """Chunks of unknown lower-case types may be anywhere: a decoder skips them."""
    data = stream_of(sequence())
    like_a_frame = b"p", b"\x07\0" + UUID[2:]
    extra = [(b"a", b""), (b"z", bytes(range(200))), (b"i", b"\0"), like_a_frame, (b"h", b"?"), (b"e", bytes(8))]
    expected = yield {"stream": operated(lambda c: [c[0], *extra, *c[1:3], extra[1], *c[3:-1], *extra, c[-1]], data)}
    assert result(expected, "counts").tolist() == [2] * 5


@on("core", *STREAM, flags=["unknown"], rules=["R-6.2-5", "R-6.2-6", "R-6.2-8"])
def every_ancillary_type() -> Inputs:
    """All lower-case letters but x; the private ones begin with a UUID."""
    letters = [bytes([c]) for c in range(ord("a"), ord("z") + 1) if c != ord("x")]
    extra = [(letter, UUID + letter if letter in b"pqrs" else letter) for letter in letters]
    expected = yield {"stream": operated(lambda c: [*c[:2], *extra, *c[2:]])}
    assert len(result(expected, "counts")) == 3


def timed(*payloads: bytes) -> bytes:
    """The stream of `sequence` with chunks `t` before its first frames, one before each."""
    chunks = split_chunks(stream_of(sequence()))
    head, frames = chunks[:1], chunks[1:]
    between = [part for payload, frame in zip(payloads, frames, strict=False) for part in ((b"t", payload), frame)]
    return operated(lambda _: [*head, *between, *frames[len(payloads) :]], stream_of(sequence()))


TIMES: Final[dict[str, list[tuple[int, ...]]]] = {
    "of_all_frames": [(1000, 0, 3, 2, 40, 1, 120, 2, 33)],
    "of_a_live_stream": [(90000, 0, 1, 1, 3003), (90000, 1, 1, 1, 6006), (90000, 2, 1, 3, 1)],
    "of_frames_that_never_come": [(1, 4, 2, 2, 2**32 - 1, 2**32 - 6, 1)],
    "of_no_frame": [(2**32 - 1, 0, 0)],
}
"""What chunks `t` hold: ticks_per_second, first_frame, run_count, and both elements of each run."""


@on("core", *STREAM, flags=["unknown"], rules=["R-6.11-1", "R-6.11-2"], each=TIMES)
def time_stamps(value: list[tuple[int, ...]]) -> Inputs:
    """Time stamps {key}, which change no frame."""
    expected = yield {"stream": timed(*(b"".join(map(encode_uv, numbers)) for numbers in value))}
    assert result(expected, "counts").tolist() == [2] * 5


FAULTY_TIMES: Final[dict[str, tuple[bytes, ...]]] = {
    "empty": (b"",),
    "cut_off": (bytes([100, 0, 2, 1, 40, 1]),),
    "that_go_on": (bytes([100, 0, 1, 1, 40, 0]),),
    "without_ticks": (bytes([0, 0, 1, 1, 40]),),
    "of_no_duration": (bytes([100, 0, 1, 1, 0]),),
    "of_33_bits": (b"\xff\xff\xff\xff\x1f",),
    "of_2_to_the_32_runs": (bytes([100, 0]) + encode_uv(2**32 - 1),),
    "told_twice": (bytes([100, 0, 1, 4, 40]), bytes([100, 1, 1, 4, 50])),
    "told_too_late": (bytes([100, 0, 1, 1, 40]), bytes([100, 0, 1, 1, 40])),
    "of_two_units": (bytes([100, 0, 1, 1, 40]), bytes([99, 1, 1, 1, 40])),
}


@on("core", "reconstruct_stream", flags=["unknown"], rules=["R-6.11-1", "R-6.11-2", "R-6.11-3"], each=FAULTY_TIMES)
def faulty_time_stamps(value: tuple[bytes, ...]) -> Inputs:
    """Time stamps {key}: they are ignored, and refuse no stream."""
    expected = yield {"stream": timed(*value)}
    assert result(expected, "counts").tolist() == [2] * 5


@on("core", "reconstruct_stream", flags=["unknown"], rules=["R-6.2-5"])
def chunk_length_of_three_bytes() -> Inputs:
    """A payload of 16384 bytes: `chunk_length` takes three bytes."""
    expected = yield {"stream": operated(lambda c: [*c[:2], (b"q", UUID.ljust(1 << 14, b"\0")), *c[2:]])}
    assert len(result(expected, "counts")) == 3


MINORS: Final[dict[str, tuple[int, bytes]]] = {
    "nothing_new": (1, b""),
    "an_element": (1, b"\x05"),
    "many": (255, bytes(range(60))),
}


@on("core", *STREAM, flags=["unknown"], rules=["R-6.1-2", "R-6.1-6", "R-6.1-7"], each=MINORS,
    said={"nothing_new": "nothing", "many": "sixty bytes"})  # fmt: skip
def later_minor_version(value: tuple[int, bytes]) -> Inputs:
    """A later minor version, which adds {key} to the header: what follows the known elements is ignored."""
    minor, extra = value
    lies = [Lie("version_minor", minor), Lie("lane_count", bytes([HEADER.lane_count]) + extra)]
    expected = yield {"stream": write_stream(HEADER, sequence(), lies=lies)}
    assert result(expected, "counts").tolist() == [2] * 5


@on("core", *STREAM, flags=["unknown", "limit"], rules=["R-5-3", "R-6.1-6"])
def header_of_1024_bytes() -> Inputs:
    """The longest header that any version may have."""
    size = len(split_chunks(stream_of(sequence()))[0][1])
    lies = [Lie("version_minor", 9), Lie("lane_count", bytes([HEADER.lane_count]) + bytes(1024 - size))]
    expected = yield {"stream": write_stream(HEADER, sequence(), lies=lies)}
    assert len(result(expected, "counts")) == 5


def equal_splats(count: int, factor: float = 1.0, color: float = 2.0**-14) -> SplatBlock:
    """`count` equal splats in the middle of the frame; every plane is one symbol, so they take few bytes."""
    zeros = np.zeros((count, 3), np.uint16)
    quantizer = quantizer_of([1, 1, 1], [factor, 0, factor])
    return SplatBlock(zeros[:, :2], zeros, zeros[:, :1], quantizer, (np.full((1, 3), color, np.float16),))
