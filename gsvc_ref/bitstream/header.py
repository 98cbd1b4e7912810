"""The sequence header and the levels (spec.md sections 5 and 6.3)."""

from dataclasses import dataclass, fields
from fractions import Fraction
from typing import Any, Final, NamedTuple

from gsvc_base.errors import UsageError
from gsvc_ref.bitstream.bit_writer import Writer
from gsvc_ref.bitstream.coder import Coder


@dataclass(frozen=True)
class Level:
    """The limits of a level for each frame; the payload of a chunk is in bytes."""

    pixels: int
    splats: int
    work: int
    payload: int

    def joined(self, other: "Level") -> "Level":
        """The limits that allow what either allows."""
        return Level(
            max(self.pixels, other.pixels),
            max(self.splats, other.splats),
            max(self.work, other.work),
            max(self.payload, other.payload),
        )


LEVELS: Final[dict[int, Level]] = {
    1: Level(1 << 17, 1 << 14, 1 << 25, 1 << 20),
    2: Level(1 << 20, 1 << 16, 1 << 28, 1 << 22),
    3: Level(1 << 22, 1 << 18, 1 << 30, 1 << 24),
    4: Level(1 << 24, 1 << 20, 1 << 32, 1 << 26),
    5: Level(1 << 26, 1 << 22, 1 << 34, 1 << 28),
}

LANE_EXPONENTS: Final = {1: 6, 2: 8, 3: 10, 4: 12, 5: 12}
"""The greatest `max_lane_exponent` that a level allows (R-5-11)."""

HIGHEST_LEVEL: Final = max(LEVELS)
"""The level that a decoder is made for by default (R-5-5)."""

PER_SECOND: Final = Level(64, 64, 8, 1)
"""The limits of a second of a paced stream (R-5-7), in those of a frame; that of the payload is one of whole chunks."""

I_FRAME_SECONDS: Final = 4
"""Seconds from an I-frame of a paced stream to the next one, at most (R-5-8)."""

LONGEST_HEADER: Final = 1024
"""Maximum number of bytes of a sequence header's payload (R-5-3)."""


def level_for(
    width: int, height: int, *, splats: int = 0, work: int = 0, payload: int = 0, lane_exponent: int = 0
) -> int:
    """The least level for frames of `width` by `height` pixels with that many splats, work and bytes of a chunk.

    `lane_exponent` is the `max_lane_exponent` of profile `main`.
    """
    for number, level in LEVELS.items():
        allowed = (level.pixels, level.splats, level.work, level.payload)
        needs = zip((width * height, splats, work, payload), allowed, strict=True)
        if lane_exponent <= LANE_EXPONENTS[number] and all(need <= most for need, most in needs):
            return number
    raise UsageError(
        f"no level allows {width}x{height} pixels with {splats} splats, {work} pairs of rendering work and chunks of "
        f"{payload} bytes; the highest, {number}, allows {level}"
    )


PAPER: Final = 0
MAIN: Final = 1
"""The values of `profile` that this decoder knows."""

PROFILES: Final = ("paper", "main")
"""The names of the profiles, by `profile`."""

MAX_LAYERS: Final = 4
"""The layers of a frame at most, with the base (section 15.2)."""

MAX_LANE_EXPONENT: Final = 12
"""The binary logarithm of the most lanes that a frame of profile `main` may have in any level."""


class Quality(NamedTuple):
    """The operating point of a quality: the level that it asks for, shown at 1/2^halvings of its size (R-5-9)."""

    level: int  # `quality_level`
    halvings: int = 0  # `quality_halvings`


_OF_PROFILE: Final = (
    (
        ("cholesky_bits", 1, 1, 12),
        ("color_stages", 1, 1, 8),
        ("color_codewords", 2, 1, 1024),
        ("entropy_precision", 1, 12, 16),
        ("lane_count", 1, 1, 64),
    ),
    (
        ("max_lane_exponent", 1, 0, MAX_LANE_EXPONENT),
        ("layer_count", 1, 1, MAX_LAYERS),
        ("main_tools", 1, 0, 0),
    ),
)
"""After `chroma_sample_loc_type`, by `profile`: name, bytes, lowest and highest value (sections 6.3 and 15.2)."""

_RESERVED: Final = ("profile", "level", "layer_count", "main_tools")
"""The elements of which other values are reserved."""


@dataclass(frozen=True)
class Limits:
    """The limits that the frames of a quality keep."""

    level: int  # of the stream, at the coded size
    quality: Quality | None = None  # its operating point, where it asks for more than `level` does

    @property
    def frame(self) -> Level:
        """Those of `level`."""
        return LEVELS[self.level]

    @property
    def own(self) -> Level | None:
        """Those of `quality_level`, where they are to be checked (R-5-9)."""
        return None if self.quality is None else LEVELS[self.quality.level]

    def fault(self, name: str, rule: str, amount: int, own_amount: int | None = None) -> tuple[str, str] | None:
        """The rule that an amount breaks, and what it says: `rule` by `level`, else R-5-9 by the operating point.

        `name` is that of a limit, `own_amount` the amount at the size of the operating point, where it is another.
        """
        if amount > (most := getattr(self.frame, name)):
            return rule, f"level {self.level} allows {most}"
        if self.own is not None and self.quality is not None:
            amount = amount if own_amount is None else own_amount
            if amount > (most := getattr(self.own, name)):
                return "R-5-9", f"the operating point of the quality, of level {self.quality.level}, allows {most}"
        return None


@dataclass(frozen=True, kw_only=True)
class SequenceHeader:
    """The sequence header, element by element as in spec.md sections 6.3 and 15.2.

    Descriptive elements are as the stream says them, also beyond their ranges: `sample_aspect_ratio` and
    `gsvc_ref.stream.formats.video_format` read them (R-6.3-3). A UsageError names the rule that a value breaks.
    """

    profile: int = PAPER
    level: int
    parameter_checksum_flag: bool = False  # in `flags`
    paced_flag: bool = False  # in `flags`
    width: int
    height: int
    frame_rate_numerator: int = 25
    frame_rate_denominator: int = 1
    sample_aspect_numerator: int = 0
    sample_aspect_denominator: int = 0
    frame_count: int = 0  # unknown
    bit_depth: int = 8
    chroma_format: int = 0
    color_primaries: int = 1
    transfer_characteristics: int = 1
    matrix_coefficients: int = 0
    video_full_range_flag: int = 1
    chroma_sample_loc_type: int = 0
    # Up to `lane_count` of profile `paper` alone, the others of `main`: elsewhere they keep these values.
    cholesky_bits: int = 6
    color_stages: int = 2
    color_codewords: int = 8
    entropy_precision: int = 14
    lane_count: int = 1
    max_lane_exponent: int = 0
    layer_count: int = 1
    main_tools: int = 0
    # of each quality of a stream with layers; empty: each is of `level`, at the coded size
    qualities: tuple[Quality, ...] = ()

    def __post_init__(self) -> None:
        qualities = tuple(Quality(*quality) for quality in self.qualities)
        if set(qualities) == {Quality(self.level)} and len(qualities) == self.layer_count:
            qualities = ()
        object.__setattr__(self, "qualities", qualities)
        written = _header_elements(Writer(), self)
        for other in fields(self):
            if other.name not in written and getattr(self, other.name) != other.default:
                raise UsageError(f"`{other.name}` is not an element of profile {PROFILES[self.profile]}; leave it out")

    @property
    def elements(self) -> dict[str, int]:
        """The elements that a stream of the profile has by name, in their order; those of quality q end in ``[q]``."""
        known = {name: getattr(self, name) for name in header_elements(self.profile)}
        for number, quality in enumerate(self.operating_points):
            known |= {f"quality_level[{number}]": quality.level, f"quality_halvings[{number}]": quality.halvings}
        return known

    @property
    def operating_points(self) -> tuple[Quality, ...]:
        """The operating point of each quality; none of a stream without layers."""
        there = 1 < self.layer_count <= MAX_LAYERS
        return self.qualities or ((Quality(self.level),) * self.layer_count if there else ())

    def limits_of(self, quality: int) -> "Limits":
        """What the frames of a quality must keep; those of a quality above the highest are of the highest."""
        points = self.operating_points
        own = points[min(quality, len(points) - 1)] if points else Quality(self.level)
        return Limits(self.level, None if own == Quality(self.level) else own)

    @property
    def arguments(self) -> dict[str, Any]:
        """What makes this header again: `elements`, with the flags by their names."""
        known = self.elements
        flags = ("parameter_checksum_flag", "paced_flag", *(("qualities",) if self.qualities else ()))
        return {part.name: getattr(self, part.name) for part in fields(self) if part.name in (*known, *flags)}

    @property
    def flags(self) -> int:
        """The element `flags`."""
        return self.parameter_checksum_flag | self.paced_flag << 1

    @property
    def frame_rate(self) -> Fraction:
        """Frames per second."""
        return Fraction(self.frame_rate_numerator, self.frame_rate_denominator)

    @property
    def frames_of_second(self) -> int:
        """The number k of frames of a second (spec.md section 5), the frame rate rounded up."""
        return -(-self.frame_rate_numerator // self.frame_rate_denominator)

    @property
    def sample_aspect_ratio(self) -> Fraction | None:
        """Width over height of a sample; None if unknown, as where one of both elements is 0 (R-6.3-3)."""
        if 0 in (self.sample_aspect_numerator, self.sample_aspect_denominator):
            return None
        return Fraction(self.sample_aspect_numerator, self.sample_aspect_denominator)

    @property
    def limits(self) -> Level:
        """The limits of the level."""
        return LEVELS[self.level]


_COMMON: Final = tuple(field.name for field in fields(SequenceHeader)[4:-9])
"""The names of the elements from `width` to `chroma_sample_loc_type`."""


def header_elements(profile: int) -> tuple[str, ...]:
    """The names of the elements of the sequence header of a profile, in their order; `SequenceHeader` has each."""
    return ("profile", "level", "flags", *_COMMON, *(name for name, *_ in _OF_PROFILE[profile]))


def sequence_header(
    s: Coder, header: SequenceHeader | None = None, *, max_level: int = HIGHEST_LEVEL, quality: int | None = None
) -> SequenceHeader:
    """sequence_header() of spec.md section 6.3; levels above `max_level` are refused (R-5-6).

    Of a stream with layers it is the level of the `quality` that counts, by default the highest (R-5-10).
    """
    with s.part("header"):
        elements = _header_elements(s, header, max_level, quality)
    return header or SequenceHeader(**elements)


def _header_elements(
    s: Coder, header: SequenceHeader | None, max_level: int = HIGHEST_LEVEL, quality: int | None = None
) -> dict[str, Any]:
    given = {field.name: getattr(header, field.name, 0) for field in fields(SequenceHeader)}
    elements: dict[str, Any] = {}

    def element(name: str, size: int, lowest: int, highest: int) -> int:
        value = elements[name] = s.le(name, size, given[name])
        if not lowest <= value <= highest:
            rule = "R-3.2-1" if name in _RESERVED else "R-6.3-1"
            s.fail(rule, f"`{name}` is {value}; it must be in {lowest}..{highest}")
        return value

    profile = element("profile", 1, 0, len(PROFILES) - 1)
    level = element("level", 1, 1, HIGHEST_LEVEL)
    level_bit, most = s.element_bit, f"this decoder reads level {max_level} at most"
    if level > max_level and profile != MAIN:
        s.fail("R-5-6", f"the stream is of level {level}; {most}")
    flags = s.le("flags", 1, header.flags if header else 0)
    if flags > 3:
        s.fail("R-3.2-1", f"`flags` is {flags:08b} in binary; all bits but the last two are reserved")
    elements["parameter_checksum_flag"], elements["paced_flag"] = flags & 1 != 0, flags & 2 != 0
    width = element("width", 2, 1, 0xFFFF)
    height = element("height", 2, 1, 0xFFFF)
    if width * height > LEVELS[level].pixels:
        s.fail("R-5-1", f"a frame has {width}x{height} pixels; level {level} allows {LEVELS[level].pixels}")
    element("frame_rate_numerator", 4, 1, 0xFFFFFFFF)
    element("frame_rate_denominator", 4, 1, 0xFFFFFFFF)
    element("sample_aspect_numerator", 2, 0, 0xFFFF)
    element("sample_aspect_denominator", 2, 0, 0xFFFF)
    element("frame_count", 4, 0, 0xFFFFFFFF)
    element("bit_depth", 1, 8, 16)
    element("chroma_format", 1, 0, 0xFF)
    element("color_primaries", 1, 0, 0xFF)
    element("transfer_characteristics", 1, 0, 0xFF)
    element("matrix_coefficients", 1, 0, 0xFF)
    element("video_full_range_flag", 1, 0, 0xFF)
    element("chroma_sample_loc_type", 1, 0, 0xFF)
    for name, size, lowest, highest in _OF_PROFILE[profile]:
        value = element(name, size, lowest, highest)
        if name == "max_lane_exponent" and value > LANE_EXPONENTS[level]:
            s.fail("R-5-11", f"`max_lane_exponent` is {value}; level {level} allows {LANE_EXPONENTS[level]}")
    if elements.get("layer_count", 1) > 1:
        points = () if header is None else header.operating_points
        elements["qualities"] = points = _qualities(s, width, height, level, elements["layer_count"], points)
        level = points[-1 if quality is None else min(quality, len(points) - 1)].level
    if level > max_level:
        s.fail("R-5-6", f"the stream, in this quality, is of level {level}; {most}", bit=level_bit)
    return elements


def _qualities(
    s: Coder, width: int, height: int, level: int, count: int, given: tuple[Quality, ...]
) -> tuple[Quality, ...]:
    """The operating points of `count` qualities, in which the first part of R-5-9 is checked."""
    if given and len(given) != count:
        raise UsageError(f"there are {len(given)} operating points; a stream with {count} layers has {count}")
    found: list[Quality] = []
    bits: list[int] = []
    for quality in given or (Quality(0),) * count:
        quality_level = s.u("quality_level", 3, quality.level)
        bits.append(s.element_bit)
        if quality_level not in LEVELS:
            s.fail("R-3.2-1", f"`quality_level` is {quality_level}; it must be in 1..{HIGHEST_LEVEL}")
        halvings = s.u("quality_halvings", 2, quality.halvings)
        if (reserved := s.u("quality_reserved", 3)) != 0:
            s.fail("R-3.2-1", f"`quality_reserved` is {reserved}; it is reserved and must be 0")
        found.append(Quality(quality_level, halvings))
    for number, (quality, bit) in enumerate(zip(found, bits, strict=True)):
        columns, rows = halved_size(width, height, quality.halvings)
        if columns * rows > LEVELS[quality.level].pixels:
            message = (
                f"quality {number} has {columns}x{rows} pixels; level {quality.level}, that of its operating point"
            )
            s.fail("R-5-9", f"{message}, allows {LEVELS[quality.level].pixels}", bit=bit)
    if (greatest := max(quality.level for quality in found)) != level:
        message = f"`level` is {level}; it must be the greatest `quality_level`, {greatest}"
        s.fail("R-5-9", message, bit=bits[-1])
    return tuple(found)


def halved_size(width: int, height: int, halvings: int) -> tuple[int, int]:
    """Width and height in pixels at 1/2^halvings of a size, rounded up."""
    return -(-width >> halvings), -(-height >> halvings)


def check_descriptive(header: SequenceHeader) -> None:
    """Refuse what an encoder must not say of its source (R-6.3-4), though every decoder reads it."""
    aspect = header.sample_aspect_numerator, header.sample_aspect_denominator
    if (aspect[0] == 0) != (aspect[1] == 0):
        raise UsageError(f"the sample aspect ratio is {aspect[0]}:{aspect[1]}; write 0:0 (unknown), or no 0 (R-6.3-4)")
    for name, highest in {"chroma_format": 3, "video_full_range_flag": 1, "chroma_sample_loc_type": 5}.items():
        if (value := getattr(header, name)) > highest:
            raise UsageError(f"`{name}` is {value}; an encoder must write 0..{highest} (R-6.3-4)")
