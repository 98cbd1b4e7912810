"""Cases of paced streams: the limits of a second, and the distance of I-frames (spec.md section 5)."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any, Final

from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases import CAPACITY
from gsvc_conformance.cases.building import HEADER, Chunks, on, operated, predicted, result
from gsvc_conformance.cases.container import UUID, equal_splats
from gsvc_conformance.cases.faults import CRC_SIZE, Broken
from gsvc_ref.bitstream import LEVELS
from gsvc_ref.bitstream.coder import encode_uv
from gsvc_ref.bitstream.header import PER_SECOND
from gsvc_ref.paper import FrameCodes, SplatBlock
from gsvc_ref.testing import Lie, write_stream

STREAM: Final = ("read_stream", "reconstruct_stream")
LEVEL: Final = LEVELS[1]
BYTES: Final = PER_SECOND.payload * LEVEL.payload
"""Bytes of a second at level 1."""

EMPTY: Final = FrameCodes.intra_frame(None)
REPEATED: Final = FrameCodes.repeated_frame()
LARGEST: Final = {"width": 512, "height": 256}
"""As many pixels as level 1 allows."""

SIXTY_FIVE: Final = {"frame_rate_numerator": 129, "frame_rate_denominator": 2}
"""64.5 frames per second, so that a second has 65."""


def paced(frames: list[FrameCodes], *lies: Lie, **header: Any) -> bytes:
    """A stream that says that it is paced, whether it is or not, without an index."""
    said = [Lie("flags", 2), *lies]
    return write_stream(replace(HEADER, **header), frames, index=False, lies=said)


def repeated(block: SplatBlock | None, count: int) -> list[FrameCodes]:
    """`count` equal frames, the first one an I-frame."""
    return [FrameCodes.intra_frame(block), *[REPEATED] * (count - 1)]


def padded(data: bytes, number: int, same_second: tuple[int, ...], total: int) -> bytes:
    """A stream in which a chunk before frame `number` makes the bytes of the frames of its second `total`."""

    def edit(chunks: Chunks) -> Chunks:
        frames = [index for index, (letter, _) in enumerate(chunks) if letter in b"IPR"]
        room = total - sum(_size(chunks[frames[n]][1]) for n in same_second)
        payload = UUID.ljust(room - 1 - len(encode_uv(room)) - CRC_SIZE, b"\0")
        assert _size(payload) == room
        return [*chunks[: frames[number]], (b"q", payload), *chunks[frames[number] :]]

    return operated(edit, data)


def _size(payload: bytes) -> int:
    """Bytes of the chunk of a payload."""
    return 1 + len(encode_uv(len(payload))) + len(payload) + CRC_SIZE


def two_seconds() -> bytes:
    """Frames I R in each of two seconds."""
    return paced([*repeated(equal_splats(1), 2), *repeated(equal_splats(1), 2)], frame_rate_numerator=2)


def heavy(count: int) -> list[FrameCodes]:
    """`count` frames, each of as much work as level 1 allows at LARGEST."""
    return repeated(equal_splats(LEVEL.work // LEVEL.pixels, 1e30), count)


@on("core", *STREAM, rules=["R-5-8"], each={"one": {"frame_rate_numerator": 1},
                                            "a_third": {"frame_rate_numerator": 1, "frame_rate_denominator": 3}},
    flags=["limit"], said={"one": "One frame", "a_third": "A third of a frame"})  # fmt: skip
def i_frames_as_far_apart_as_allowed(value: dict[str, int]) -> Inputs:
    """{key} a second, and every fourth frame, or an earlier one, is an I-frame: the most that a paced stream allows."""
    frames = [EMPTY, *[REPEATED] * 3, EMPTY, REPEATED, EMPTY, *[REPEATED] * 3, EMPTY]
    data = paced(frames, **value)
    expected = yield {"stream": data}
    assert len(result(expected, "counts")) == 11
    if "header" in expected:
        assert result(expected, "header")[2] == 2


@on("core", *STREAM, flags=["limit"], rules=["R-5-8"])
def i_frames_of_a_broken_rate() -> Inputs:
    """Five fourths of a frame a second: a second has two frames, and an I-frame comes every eighth."""
    frames = [EMPTY, *[REPEATED] * 7, EMPTY]
    data = paced(frames, frame_rate_numerator=5, frame_rate_denominator=4)
    expected = yield {"stream": data}
    assert len(result(expected, "counts")) == 9


@on("core", *STREAM, flags=["limit"], rules=["R-5-7"])
def as_many_pixels_of_a_second_as_allowed() -> Inputs:
    """64 of the largest frames in each of three seconds."""
    data = paced([*repeated(None, 192)], **LARGEST, frame_rate_numerator=64)
    expected = yield {"stream": data}
    assert len(result(expected, "counts")) == 192


@case("core", "read_stream", flags=["limit", "many"], rules=["R-5-7"])
def as_many_splats_of_a_second_as_allowed() -> Inputs:
    """64 frames of as many splats as a frame may have in a second, and then four fewer."""
    frames = [*repeated(equal_splats(LEVEL.splats), 64), *repeated(equal_splats(LEVEL.splats), 60)]
    data = paced(frames, frame_rate_numerator=64)
    expected = yield {"stream": data}
    assert result(expected, "counts")[:64].sum() == PER_SECOND.splats * LEVEL.splats


@on("core", *STREAM, flags=["limit", "overflow"], rules=["R-5-7"])
def as_much_work_of_a_second_as_allowed() -> Inputs:
    """8 frames of the most work at the end of a second, and 8 at the start of the next; an R-frame has work, too."""
    frames = [*repeated(None, 2), *heavy(16), *repeated(None, 2)]
    expected = yield {"stream": paced(frames, **LARGEST, frame_rate_numerator=10)}
    assert len(result(expected, "counts")) == 20


@case("core", "reconstruct_stream", flags=["limit", CAPACITY], rules=["R-5-7"])
def as_many_bytes_of_a_second_as_allowed() -> Inputs:
    """The second second has 2^20 bytes with the ancillary chunk before it; one after the last frame is not counted."""
    data = padded(two_seconds(), 2, (2, 3), BYTES)
    expected = yield {"stream": operated(lambda c: [*c[:-1], (b"q", UUID), c[-1]], data)}
    assert len(result(expected, "counts")) == 4


@on("core", *STREAM, flags=["limit"], rules=["R-5-7", "R-5-8"])
def paced_with_checksums() -> Inputs:
    """Both flags are 1."""
    header = replace(HEADER, parameter_checksum_flag=True, paced_flag=True)
    expected = yield {"stream": write_stream(header, repeated(equal_splats(2), 3))}
    if "header" in expected:
        assert result(expected, "header")[2] == 3


def pace_faults() -> Iterator[Broken]:
    """Paced streams that break a limit of a second, or the distance of I-frames."""
    yield from _sums()
    four = [EMPTY, *[REPEATED] * 3]
    rate: dict[str, int] = {"frame_rate_numerator": 1}
    faults: dict[str, tuple[list[FrameCodes], dict[str, int]]] = {
        "fifth_frame": ([*four, REPEATED], rate),
        "fifth_frame_of_a_third": ([*four, REPEATED], {**rate, "frame_rate_denominator": 3}),
        "behind_the_second_i_frame": ([EMPTY, REPEATED, *four, REPEATED], rate),
        "p_frame": ([*four, predicted([], None, equal_splats(1))], rate),
        "ninth_frame": (repeated(None, 9), {"frame_rate_numerator": 5, "frame_rate_denominator": 4}),
    }
    for what, (frames, header) in faults.items():
        yield Broken("R-5-8", "limit", what, "an I-frame is due in a paced stream, and another frame comes",
                     "one comes at least every four seconds", partial(paced, frames, **header),
                     len(frames) - 1)  # fmt: skip
    yield Broken("R-6.4-3", "invalid", "before_i_frame_distance", "the checksum is wrong, and an I-frame is due",
                 "the first of two faults counts", _wrong_and_late, 4, ("R-5-8",))  # fmt: skip


def _sums() -> Iterator[Broken]:
    most = "level 1 allows 64 times those of a frame"
    yield Broken("R-5-7", "limit", "pixels", "65 frames of 512x256 pixels stand in a second", most,
                 partial(paced, repeated(None, 66), **LARGEST, frame_rate_numerator=65), 64)  # fmt: skip
    yield Broken("R-5-7", "limit", "pixels_at_a_broken_rate", "at 64.5 frames per second, 65 stand in a second", most,
                 partial(paced, repeated(None, 66), **LARGEST, **SIXTY_FIVE), 64)  # fmt: skip
    yield Broken("R-5-7", "limit", "splats", f"65 frames of {LEVEL.splats} splats stand in a second", most,
                 partial(paced, repeated(equal_splats(LEVEL.splats), 65), frame_rate_numerator=65), 64)  # fmt: skip
    yield Broken("R-5-7", "limit", "work", "9 frames of a second take 2^25 pairs each",
                 "level 1 allows 8 times those of a frame",
                 partial(paced, [*repeated(None, 10), *heavy(10)], **LARGEST, frame_rate_numerator=10), 18)  # fmt: skip
    yield Broken("R-5-7", "limit", "bytes", "a second has 2^20 + 1 bytes", "level 1 allows 2^20",
                 lambda: padded(two_seconds(), 0, (0, 1), BYTES + 1), 1)  # fmt: skip


def _wrong_and_late() -> bytes:
    """Frames I R R R R, the last one with another checksum."""
    header = replace(HEADER, parameter_checksum_flag=True, frame_rate_numerator=1)
    lies = [Lie("flags", 3), Lie("parameter_checksum", 0xDEADBEEF, 4)]
    return write_stream(header, repeated(None, 5), index=False, lies=lies)
