"""Cases of paced streams: the limits of a second, and the distance of I-frames (spec.md section 5)."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases import CAPACITY
from gsvc_conformance.cases.building import HEADER, Chunks, on, operated, predicted, result
from gsvc_conformance.cases.container import UUID, equal_splats
from gsvc_conformance.cases.faults import CRC_SIZE, SMALL_HEADER, Broken
from gsvc_conformance.cases.main_layers import SIZE, LayerPlan, covering, with_layers
from gsvc_conformance.cases.main_streams import READ, Plan, crowd
from gsvc_ref.bitstream import LEVELS, SequenceHeader
from gsvc_ref.bitstream.coder import encode_uv
from gsvc_ref.bitstream.header import PER_SECOND, Quality
from gsvc_ref.main.codes import MainCodes
from gsvc_ref.paper import FrameCodes
from gsvc_ref.stream.profiles import AnyCodes
from gsvc_ref.testing import Lie, write_stream

STREAM: Final = ("read_stream", "reconstruct_stream")
LEVEL: Final = LEVELS[1]
BYTES: Final = PER_SECOND.payload * LEVEL.payload
"""Bytes of a second at level 1."""

LARGEST: Final[dict[str, Any]] = {"width": 512, "height": 256}
"""As many pixels as level 1 allows."""

SIXTY_FIVE: Final[dict[str, Any]] = {"frame_rate_numerator": 129, "frame_rate_denominator": 2}
"""64.5 frames per second, so that a second has 65."""


@dataclass(frozen=True)
class Frames:
    """Frames of a profile for paced streams.

    Attributes
    ----------
    header
        The header of most streams.
    empty
        An I-frame without splats.
    equal, covering
        I-frames of a number of equal splats, small ones and such that cover a frame of a header.
    predicted
        A P-frame with a splat, after an I-frame without any.
    """

    header: SequenceHeader
    empty: AnyCodes
    equal: Callable[[int], AnyCodes]
    covering: Callable[[SequenceHeader, int], AnyCodes]
    predicted: AnyCodes

    def paced(
        self, frames: Sequence[AnyCodes], *lies: Lie, flags: int = 2, index: bool = False, **header: Any
    ) -> bytes:
        """A stream that says that it is paced, whether it is or not."""
        given = replace(self.header, parameter_checksum_flag=bool(flags & 1), **header)
        return write_stream(given, frames, index=index, lies=[Lie("flags", flags), *lies])

    def two_seconds(self, **header: Any) -> bytes:
        """Frames I R in each of two seconds."""
        return self.paced(group(self.equal(1), 2) * 2, frame_rate_numerator=2, **header)

    def heavy(self, count: int, level: int = 1, **size: int) -> list[AnyCodes]:
        """`count` frames, each of as much work as a level allows at its largest size."""
        header, limits = replace(self.header, level=level, **(size or LARGEST)), LEVELS[level]
        return group(self.covering(header, limits.work // limits.pixels), count)


def group(intra: AnyCodes, count: int) -> list[AnyCodes]:
    """`count` equal frames, of which `intra` is the first one."""
    return [intra, *[type(intra).repeated_frame()] * (count - 1)]


PAPER: Final = Frames(
    HEADER,
    FrameCodes.intra_frame(None),
    lambda count: FrameCodes.intra_frame(equal_splats(count)),
    lambda header, count: FrameCodes.intra_frame(equal_splats(count, 1e30)),
    predicted([], None, equal_splats(1)),
)
MAIN: Final = Frames(
    SMALL_HEADER,
    MainCodes(type="I", quantizer=24),
    lambda count: crowd(SMALL_HEADER, (32, 0), count),
    lambda header, count: crowd(header, (32, 0), count),
    replace(crowd(SMALL_HEADER, (32, 0), 1), type="P"),
)

paced = PAPER.paced


def of_both(**about: Any) -> Callable[[Callable[..., Inputs]], Callable[..., Inputs]]:
    """Register a function as a case of each profile."""

    def register(function: Callable[..., Inputs]) -> Callable[..., Inputs]:
        on("core", *STREAM, each={"": PAPER}, **about)(function)
        return on("core", *READ, each={"main": MAIN}, **about)(function)

    return register


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


RATES: Final[dict[str, dict[str, Any]]] = {
    "one": {"frame_rate_numerator": 1},
    "a_third": {"frame_rate_numerator": 1, "frame_rate_denominator": 3},
}
"""One frame a second and less."""
RATES_IN_WORDS: Final = {"one": "One frame", "a_third": "A third of a frame"}


@on("core", *STREAM, rules=["R-5-8"], each={key: (PAPER, rate) for key, rate in RATES.items()},
    flags=["limit"], said=RATES_IN_WORDS)  # fmt: skip
@on("core", *READ, rules=["R-5-8"], each={f"main_{key}": (MAIN, rate) for key, rate in RATES.items()},
    flags=["limit"], said={f"main_{key}": words for key, words in RATES_IN_WORDS.items()})  # fmt: skip
def i_frames_as_far_apart_as_allowed(value: tuple[Frames, dict[str, Any]]) -> Inputs:
    """{key} a second, and every fourth frame, or an earlier one, is an I-frame: the most that a paced stream allows."""
    of, rate = value
    data = of.paced([*group(of.empty, 4), *group(of.empty, 2), *group(of.empty, 4), of.empty], **rate)
    expected = yield {"stream": data}
    assert len(result(expected, "counts")) == 11
    if "header" in expected:
        assert result(expected, "header")[2] == 2


@of_both(flags=["limit"], rules=["R-5-8"])
def i_frames_of_a_broken_rate(value: Frames) -> Inputs:
    """Five fourths of a frame a second: a second has two frames, and an I-frame comes every eighth."""
    data = value.paced([*group(value.empty, 8), value.empty], frame_rate_numerator=5, frame_rate_denominator=4)
    expected = yield {"stream": data}
    assert len(result(expected, "counts")) == 9


HIGH_RATES: Final[dict[str, tuple[int, int]]] = {
    "2_to_the_30": (2**30, 1), "most": (2**32 - 1, 1), "two_large_numbers": (2**32 - 1, 2**32 - 1),
}  # fmt: skip
"""Frame rates of which a number, a sum or four times the frames of a second takes more than 32 bits."""
HIGH_RATES_IN_WORDS: Final = "2^30", "2^32 - 1", "2^32 - 1 by 2^32 - 1"


@case(
    "core", "reconstruct_stream", flags=["limit"], rules=["R-5-8"],
    each={f"{of_main}{key}": (of, rate) for of_main, of in (("", PAPER), ("main_", MAIN))
          for key, rate in HIGH_RATES.items()},
    said={f"{of_main}{key}": words for of_main in ("", "main_")
          for key, words in zip(HIGH_RATES, HIGH_RATES_IN_WORDS, strict=True)},
)  # fmt: skip
def paced_at_a_rate_of(value: tuple[Frames, tuple[int, int]]) -> Inputs:
    """At {key} frames per second no I-frame is due."""
    of, (numerator, denominator) = value
    frames = group(of.empty, 9) if denominator == 1 else group(of.empty, 4) * 2
    data = of.paced(frames, frame_rate_numerator=numerator, frame_rate_denominator=denominator)
    expected = yield {"stream": data}
    assert (result(expected, "error"), len(result(expected, "counts"))) == ("", len(frames))


@of_both(flags=["limit"], rules=["R-5-7"])
def as_many_pixels_of_a_second_as_allowed(value: Frames) -> Inputs:
    """64 of the largest frames in each of three seconds."""
    data = value.paced(group(value.empty, 192), **LARGEST, frame_rate_numerator=64)
    expected = yield {"stream": data}
    assert len(result(expected, "counts")) == 192


@case("core", "read_stream", flags=["limit", "many"], rules=["R-5-7"], each={"": PAPER})
@case(
    "core",
    "reconstruct_stream",
    flags=["limit", "many", CAPACITY],
    rules=["R-5-2", "R-5-7", "R-5-9"],
    each={"main": MAIN},
)
def as_many_splats_of_a_second_as_allowed(value: Frames) -> Inputs:
    """64 frames of as many splats as a frame may have in a second, and then four fewer."""
    most = value.equal(LEVEL.splats)
    expected = yield {"stream": value.paced([*group(most, 64), *group(most, 60)], frame_rate_numerator=64)}
    assert result(expected, "counts")[:64].sum() == PER_SECOND.splats * LEVEL.splats


@of_both(flags=["limit", "overflow"], rules=["R-5-7"])
def as_much_work_of_a_second_as_allowed(value: Frames) -> Inputs:
    """8 frames of the most work at the end of a second, and 8 at the start of the next; an R-frame has work, too."""
    frames = [*group(value.empty, 2), *value.heavy(16), *group(value.empty, 2)]
    expected = yield {"stream": value.paced(frames, **LARGEST, frame_rate_numerator=10)}
    assert len(result(expected, "counts")) == 20


@case("core", "reconstruct_stream", flags=["limit", CAPACITY], rules=["R-5-7"], each={"": PAPER, "main": MAIN})
def as_many_bytes_of_a_second_as_allowed(value: Frames) -> Inputs:
    """The second second has 2^20 bytes with the ancillary chunk before it; one after the last frame is not counted."""
    data = padded(value.two_seconds(), 2, (2, 3), BYTES)
    expected = yield {"stream": operated(lambda c: [*c[:-1], (b"q", UUID), c[-1]], data)}
    assert len(result(expected, "counts")) == 4


@of_both(flags=["limit"], rules=["R-5-7", "R-5-8"])
def paced_with_checksums(value: Frames) -> Inputs:
    """Both flags are 1."""
    expected = yield {"stream": value.paced(group(value.equal(2), 3), flags=3, index=True)}
    if "header" in expected:
        assert result(expected, "header")[2] == 3


@case("core", "reconstruct_layers", flags=["limit"], rules=["R-5-7", "R-15.13-3"])
def second_of_layers_of_as_much_work_as_allowed() -> Inputs:
    """9 frames, 8 of them in a second, have as much work as a frame may have, most of it in two layers."""
    layers = LayerPlan(0, 1, covering(300)), LayerPlan(0, 2, covering(112))
    frames: list[Plan | MainCodes] = [covering(100), *[Plan("R")] * 8]
    stream = with_layers(Draws(0), frames, layers, **SIZE, paced_flag=True, frame_rate_numerator=8)
    expected = yield {"stream": stream, "layer": 2}
    assert result(expected, "counts").tolist() == [LEVEL.work // (SIZE["width"] * SIZE["height"])] * 9


def pace_faults(of: Frames) -> Iterator[Broken]:
    """Paced streams of a profile that break a limit of a second, or the distance of I-frames."""
    yield from _sums(of, "R-5-7")
    yield from _sums_of_level_5(of)
    four, late = group(of.empty, 4), type(of.empty).repeated_frame()
    rate: dict[str, Any] = {"frame_rate_numerator": 1}
    faults: dict[str, tuple[list[AnyCodes], dict[str, Any]]] = {
        "fifth_frame": ([*four, late], rate),
        "fifth_frame_of_a_third": ([*four, late], {**rate, "frame_rate_denominator": 3}),
        "behind_the_second_i_frame": ([*group(of.empty, 2), *four, late], rate),
        "p_frame": ([*four, of.predicted], rate),
        "ninth_frame": (group(of.empty, 9), {"frame_rate_numerator": 5, "frame_rate_denominator": 4}),
    }
    for what, (frames, header) in faults.items():
        yield Broken("R-5-8", "limit", what, "an I-frame is due in a paced stream, and another frame comes",
                     "one comes at least every four seconds", partial(of.paced, frames, **header),
                     len(frames) - 1)  # fmt: skip
    yield Broken("R-6.4-3", "invalid", "before_i_frame_distance", "the checksum is wrong, and an I-frame is due",
                 "the first of two faults counts", partial(_wrong_and_late, of), 4, ("R-5-8",))  # fmt: skip


POINTS: Final[dict[str, Any]] = {"level": 2, "layer_count": 2, "qualities": (Quality(1), Quality(2))}
"""What makes the limits of quality 0 those of level 1, in a stream of level 2."""


def point_faults(of: Frames) -> Iterator[Broken]:
    """Paced streams of level 2 that break a limit of a second of level 1, for which their first quality asks."""
    yield from (fault for fault in _sums(of, "R-5-9", **POINTS) if "pixels" not in fault.what)


def _sums(of: Frames, rule: str, **header: Any) -> Iterator[Broken]:
    most = "level 1 allows 64 times those of a frame"
    many = group(of.empty, 66)
    paced: Callable[..., bytes] = partial(of.paced, **header)
    yield Broken(rule, "limit", "pixels", "65 frames of 512x256 pixels stand in a second", most,
                 partial(paced, many, **LARGEST, frame_rate_numerator=65), 64)  # fmt: skip
    yield Broken(rule, "limit", "pixels_at_a_broken_rate", "at 64.5 frames per second, 65 stand in a second", most,
                 partial(paced, many, **LARGEST, **SIXTY_FIVE), 64)  # fmt: skip
    yield Broken(rule, "limit", "splats", f"65 frames of {LEVEL.splats} splats stand in a second", most,
                 lambda: paced(group(of.equal(LEVEL.splats), 65), frame_rate_numerator=65), 64)  # fmt: skip
    yield Broken(rule, "limit", "work", "9 frames of a second take 2^25 pairs each",
                 "level 1 allows 8 times those of a frame",
                 lambda: paced([*group(of.empty, 10), *of.heavy(10)], **LARGEST, frame_rate_numerator=10),
                 18)  # fmt: skip
    yield Broken(rule, "limit", "bytes", "a second has 2^20 + 1 bytes", "level 1 allows 2^20",
                 lambda: padded(of.two_seconds(**header), 0, (0, 1), BYTES + 1), 1)  # fmt: skip


def _sums_of_level_5(of: Frames) -> Iterator[Broken]:
    """Those that 32 bits do not hold."""
    size: dict[str, Any] = {"width": 8192, "height": 8192}
    yield Broken("R-5-7", "limit", "pixels_beyond_32_bits", "65 frames of 8192x8192 pixels stand in a second",
                 "level 5 allows 64 times those of a frame",
                 lambda: of.paced(group(of.empty, 65), **size, level=5, frame_rate_numerator=65), 64)  # fmt: skip
    yield Broken("R-5-7", "limit", "work_beyond_32_bits", "9 frames of a second take 2^34 pairs each",
                 "level 5 allows 8 times those of a frame",
                 lambda: of.paced(of.heavy(9, 5, **size), **size, level=5, frame_rate_numerator=10), 8)  # fmt: skip


def _wrong_and_late(of: Frames) -> bytes:
    """Frames I R R R R, the last one with another checksum."""
    wrong = Lie("parameter_checksum", 0xDEADBEEF, 4)
    return of.paced(group(of.empty, 5), wrong, flags=3, frame_rate_numerator=1)
