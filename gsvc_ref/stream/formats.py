"""The video format of a source in the sequence header, and back."""

from collections.abc import Iterator
from fractions import Fraction
from typing import Final

from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.video.format import MAX_RATIO_TERM, ChromaFormat, ColorDescription, VideoFormat

CHROMA_FORMATS: Final[tuple[ChromaFormat, ...]] = ("rgb", "420", "422", "444")
"""`chroma_format` 0 to 3 (spec.md section 6.3); greater values have no planes, like 0 (R-6.3-3)."""

CHROMA_LOCATIONS: Final = 6
"""Values of `chroma_sample_loc_type` that have a meaning; greater ones are read as 0 (R-6.3-3)."""

LARGEST_ASPECT: Final = 65535


def header_fields(video: VideoFormat) -> dict[str, int]:
    """The elements of the sequence header that describe the source."""
    aspect, color = _nearest_aspect(video.sample_aspect_ratio), video.color
    return {
        "width": video.width,
        "height": video.height,
        "frame_rate_numerator": video.frame_rate.numerator,
        "frame_rate_denominator": video.frame_rate.denominator,
        "sample_aspect_numerator": aspect.numerator,
        "sample_aspect_denominator": aspect.denominator,
        "bit_depth": video.bit_depth,
        "chroma_format": CHROMA_FORMATS.index(video.chroma_format),
        "color_primaries": color.primaries,
        "transfer_characteristics": color.transfer,
        "matrix_coefficients": color.matrix,
        "video_full_range_flag": int(color.full_range),
        "chroma_sample_loc_type": color.chroma_location,
    }


def _nearest_aspect(ratio: Fraction) -> Fraction:
    """The nearest ratio whose terms the header can hold; square where even its largest is far away."""
    small = min(ratio, 1 / ratio).limit_denominator(LARGEST_ASPECT)  # at most 1, so that its denominator is the larger
    if small == 0:
        return Fraction(1)
    return small if ratio <= 1 else 1 / small


def video_format(header: SequenceHeader) -> VideoFormat:
    """The format of the source that a header describes, or the nearest that a file can have: see `format_notes`."""
    location = header.chroma_sample_loc_type
    color = ColorDescription(
        header.color_primaries, header.transfer_characteristics, header.matrix_coefficients,
        header.video_full_range_flag > 0, location if location < CHROMA_LOCATIONS else 0,
    )  # fmt: skip
    chroma_format = "444" if _subsamples_identity(header) else _chroma_format(header)
    return VideoFormat(
        header.width, header.height, _nearest_rate(header.frame_rate), header.bit_depth, chroma_format,
        color, header.sample_aspect_ratio or Fraction(1), header.frame_count or None,
    )  # fmt: skip


def format_notes(header: SequenceHeader) -> list[str]:
    """Sentences without a full stop on where `video_format` differs from a header."""
    notes = [f"the header says {value}: taken as {legal}" for value, legal in _beyond_their_ranges(header)]
    if _subsamples_identity(header):
        notes.append("the header says subsampled chroma and matrix 0, which has none: taken as 4:4:4")
    if (rate := header.frame_rate) != (nearest := _nearest_rate(rate)):
        notes.append(f"files cannot have the frame rate of the header, {rate}: taken as {nearest}")
    return notes


def _subsamples_identity(header: SequenceHeader) -> bool:
    return header.matrix_coefficients == 0 and _chroma_format(header) in ("420", "422")


def _chroma_format(header: SequenceHeader) -> ChromaFormat:
    return CHROMA_FORMATS[header.chroma_format] if header.chroma_format < len(CHROMA_FORMATS) else "rgb"


def _beyond_their_ranges(header: SequenceHeader) -> Iterator[tuple[str, str]]:
    """What descriptive elements beyond their ranges say, and how they are read (R-6.3-3)."""
    aspect = header.sample_aspect_numerator, header.sample_aspect_denominator
    if (aspect[0] == 0) != (aspect[1] == 0):
        yield f"a sample aspect ratio of {aspect[0]}:{aspect[1]}", "unknown"
    if header.chroma_format >= len(CHROMA_FORMATS):
        yield f"chroma format {header.chroma_format}", "R'G'B'"
    if header.video_full_range_flag > 1:
        yield f"video_full_range_flag {header.video_full_range_flag}", "1"
    if header.chroma_sample_loc_type >= CHROMA_LOCATIONS:
        yield f"chroma siting {header.chroma_sample_loc_type}", "0"


def _nearest_rate(rate: Fraction) -> Fraction:
    """The nearest frame rate whose terms a file can hold; the header's have 32 bits."""
    if max(rate.numerator, rate.denominator) <= MAX_RATIO_TERM:
        return rate
    small = max(min(rate, 1 / rate).limit_denominator(MAX_RATIO_TERM), Fraction(1, MAX_RATIO_TERM))
    return small if rate <= 1 else 1 / small
