"""The format of a source in the sequence header, and back."""

from dataclasses import replace
from fractions import Fraction
from io import BytesIO

import numpy as np
import pytest
from codec_cases import video_format
from hypothesis import given
from hypothesis import strategies as st

from gsvc_base.errors import UsageError
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.stream import Stream, StreamWriter, decode
from gsvc_ref.stream import video_format as format_of_header
from gsvc_ref.stream.formats import CHROMA_FORMATS, format_notes, header_fields
from gsvc_ref.testing import OVERVIEW_HEADER, Lie, overview_frames, write_stream
from gsvc_ref.video import ColorDescription, VideoFormat

points = st.integers(0, 255)
terms = st.integers(1, 2**31 - 1)


@st.composite
def formats(draw: st.DrawFn) -> VideoFormat:
    chroma_format = draw(st.sampled_from(CHROMA_FORMATS))
    matrix = draw(points if chroma_format in ("rgb", "444") else st.integers(1, 255))
    color = ColorDescription(draw(points), draw(points), matrix, draw(st.booleans()), draw(st.integers(0, 5)))
    aspect = Fraction(draw(st.integers(1, 65535)), draw(st.integers(1, 65535)))
    return VideoFormat(
        draw(st.integers(1, 65535)), draw(st.integers(1, 1023)), Fraction(draw(terms), draw(terms)),
        draw(st.integers(8, 16)), chroma_format, color, aspect, draw(st.none() | terms),
    )  # fmt: skip


@given(formats())
def test_a_format_survives_the_header(video):
    header = SequenceHeader(level=5, frame_count=video.frame_count or 0, **header_fields(video))
    assert format_of_header(header) == video


@given(st.builds(Fraction, terms, terms))
def test_any_shape_of_pixels_has_a_place(ratio):
    fields = header_fields(replace(video_format(), sample_aspect_ratio=ratio))
    assert 1 <= fields["sample_aspect_numerator"] <= 65535
    assert 1 <= fields["sample_aspect_denominator"] <= 65535
    written = Fraction(fields["sample_aspect_numerator"], fields["sample_aspect_denominator"])
    if Fraction(1, 1000) <= ratio <= 1000:  # no other denominator gives a nearer one
        less, mine = min(ratio, 1 / ratio), min(written, 1 / written)
        denominators = np.arange(1, 65536)
        numerators = (2 * less.numerator * denominators + less.denominator) // (2 * less.denominator)
        far = abs(numerators * less.denominator - less.numerator * denominators) / denominators
        assert abs(mine - less) * less.denominator <= far.min() * (1 + 1e-12)


def test_an_unknown_shape_of_pixels_is_taken_as_square():
    assert format_of_header(SequenceHeader(level=1, width=8, height=8)).sample_aspect_ratio == 1


def test_identity_without_its_chroma_is_taken_as_444():
    header = SequenceHeader(level=1, width=8, height=8, chroma_format=1, matrix_coefficients=0)
    assert format_of_header(header).chroma_format == "444"
    assert len(format_notes(header)) == 1


@pytest.mark.parametrize(
    ("numerator", "denominator", "nearest"),
    [
        (2**32 - 1, 1, Fraction(2**31 - 1)),
        (1, 2**32 - 1, Fraction(1, 2**31 - 1)),
        (2**32 - 1, 2**32 - 2, Fraction(1)),
        (3 * 2**30, 2**30, Fraction(3)),
    ],
)
def test_a_frame_rate_of_large_terms_is_taken_as_the_nearest(numerator, denominator, nearest):
    header = SequenceHeader(
        level=1, width=8, height=8, frame_rate_numerator=numerator, frame_rate_denominator=denominator
    )
    assert format_of_header(header).frame_rate == nearest
    assert len(format_notes(header)) == (nearest != Fraction(numerator, denominator))


BEYOND = {
    "chroma_format": (9, "chroma format 9: taken as R'G'B'"),
    "video_full_range_flag": (2, "video_full_range_flag 2: taken as 1"),
    "chroma_sample_loc_type": (6, "chroma siting 6: taken as 0"),
    "sample_aspect_numerator": (4, "a sample aspect ratio of 4:0: taken as unknown"),
    "sample_aspect_denominator": (3, "a sample aspect ratio of 0:3: taken as unknown"),
}
"""Descriptive elements beyond their ranges, and what is said of each."""


@pytest.mark.parametrize("element", BEYOND)
def test_what_only_describes_is_read_beyond_its_range_and_never_written(element):
    said, note = BEYOND[element]
    plain = SequenceHeader(level=1, width=16, height=12, chroma_format=0, matrix_coefficients=1)
    header = replace(plain, **{element: said})
    assert format_of_header(header) == format_of_header(plain)  # in all of these the value read is the default
    assert format_notes(header) == [f"the header says {note}"]
    with pytest.raises(UsageError, match=r"R-6\.3-4"):
        StreamWriter(BytesIO(), header)


def test_a_stream_is_decoded_whatever_describes_it():
    lies = [Lie(element, said) for element, (said, _) in BEYOND.items() if element != "sample_aspect_denominator"]
    data = write_stream(OVERVIEW_HEADER, overview_frames(), lies=lies)
    plain = write_stream(OVERVIEW_HEADER, overview_frames())
    assert all(np.array_equal(a, b) for a, b in zip(decode(data), decode(plain), strict=True))
    with Stream(data) as stream:
        assert stream.format.chroma_format == "rgb"
        assert len(stream.notes) == 4
