"""The video format of a source in the sequence header, and back."""

from fractions import Fraction
from typing import Final

from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.video import ChromaFormat, ColorDescription, VideoFormat
from gsvc_ref.video.format import MAX_RATIO_TERM

CHROMA_FORMATS: Final[tuple[ChromaFormat, ...]] = ("rgb", "420", "422", "444")
"""`chroma_format` 0 to 3 (spec.md section 6.3)."""

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
    color = ColorDescription(
        header.color_primaries, header.transfer_characteristics, header.matrix_coefficients,
        bool(header.video_full_range_flag), header.chroma_sample_loc_type,
    )  # fmt: skip
    chroma_format = "444" if _subsamples_identity(header) else CHROMA_FORMATS[header.chroma_format]
    return VideoFormat(
        header.width, header.height, _nearest_rate(header.frame_rate), header.bit_depth, chroma_format,
        color, header.sample_aspect_ratio or Fraction(1), header.frame_count or None,
    )  # fmt: skip


def format_notes(header: SequenceHeader) -> list[str]:
    """Sentences without a full stop on where `video_format` differs from a header."""
    notes = []
    if _subsamples_identity(header):
        notes.append("the header says subsampled chroma and matrix 0, which has none: taken as 4:4:4")
    if (rate := header.frame_rate) != (nearest := _nearest_rate(rate)):
        notes.append(f"files cannot have the frame rate of the header, {rate}: taken as {nearest}")
    return notes


def _subsamples_identity(header: SequenceHeader) -> bool:
    return header.matrix_coefficients == 0 and CHROMA_FORMATS[header.chroma_format] in ("420", "422")


def _nearest_rate(rate: Fraction) -> Fraction:
    """The nearest frame rate whose terms a file can hold; the header's have 32 bits."""
    if max(rate.numerator, rate.denominator) <= MAX_RATIO_TERM:
        return rate
    small = max(min(rate, 1 / rate).limit_denominator(MAX_RATIO_TERM), Fraction(1, MAX_RATIO_TERM))
    return small if rate <= 1 else 1 / small
