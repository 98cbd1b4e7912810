"""The sequence header and the levels (spec.md sections 5 and 6.3)."""

from dataclasses import fields, replace
from fractions import Fraction
from typing import Any

import pytest
from hypothesis import given

from gsvc_base.errors import UsageError
from gsvc_ref.bitstream import LEVELS, SequenceHeader, level_for
from gsvc_ref.bitstream.bit_reader import Reader
from gsvc_ref.bitstream.bit_writer import Writer
from gsvc_ref.bitstream.header import sequence_header
from gsvc_ref.testing import OVERVIEW_HEADER, headers


@given(headers())
def test_round_trip(header: SequenceHeader) -> None:
    s = Writer()
    sequence_header(s, header)
    reader = Reader(s.getvalue())
    assert sequence_header(reader) == header
    assert reader.bits_left == 0
    assert set(reader.bits_by_category()) == {"header"}
    assert len(s.getvalue()) == 36


def test_properties() -> None:
    header = replace(OVERVIEW_HEADER, frame_rate_numerator=30000, frame_rate_denominator=1001)
    assert header.frame_rate == Fraction(30000, 1001)
    assert header.sample_aspect_ratio is None
    wide = replace(header, sample_aspect_numerator=12, sample_aspect_denominator=11)
    assert wide.sample_aspect_ratio == Fraction(12, 11)
    assert header.limits == LEVELS[1]


@pytest.mark.parametrize("name", [field.name for field in fields(SequenceHeader) if field.type is int])
def test_values_out_of_range_are_refused_with_the_rule(name: str) -> None:
    with pytest.raises(UsageError, match=name):
        replace(OVERVIEW_HEADER, **{name: -1})
    with pytest.raises(UsageError, match=name if name != "sample_aspect_numerator" else "sample"):
        replace(OVERVIEW_HEADER, **{name: 1 << 40})


@pytest.mark.parametrize(
    ("qualities", "message"),
    [
        (((0, 0), (2, 0)), "`quality_level` is 0; .*R-3.2-1"),
        (((9, 0), (2, 0)), "`quality_level` = 9 does not fit"),
        (((1, -1), (2, 0)), "`quality_halvings` = -1 does not fit"),
        (((1, 4), (2, 0)), "`quality_halvings` = 4 does not fit"),
        (((1, 0), (1, 0)), "`level` is 2; .*R-5-9"),
        (((1, 0), (3, 0)), "`level` is 2; .*R-5-9"),
        (((1, 0),), "there are 1 operating points; a stream with 2 layers has 2"),
    ],
)
def test_operating_points_out_of_range_are_refused(qualities: tuple[tuple[int, int], ...], message: str) -> None:
    header: dict[str, Any] = {"profile": 1, "level": 2, "width": 64, "height": 48, "layer_count": 2}
    with pytest.raises(UsageError, match=message):
        SequenceHeader(**header, qualities=qualities)


def test_limits_are_those_of_the_spec() -> None:
    exponents = {
        1: (17, 14, 25, 20),
        2: (20, 16, 28, 22),
        3: (22, 18, 30, 24),
        4: (24, 20, 32, 26),
        5: (26, 22, 34, 28),
    }
    assert {n: (level.pixels, level.splats, level.work, level.payload) for n, level in LEVELS.items()} == {
        n: tuple(2**e for e in row) for n, row in exponents.items()
    }


@pytest.mark.parametrize(
    ("need", "level"),
    [
        ({"width": 352, "height": 288}, 1),
        ({"width": 352, "height": 288, "splats": 2**14 + 1}, 2),
        ({"width": 352, "height": 288, "work": 2**28 + 1}, 3),
        ({"width": 352, "height": 288, "payload": 2**24 + 1}, 4),
        ({"width": 1920, "height": 1080}, 3),
        ({"width": 8192, "height": 8192}, 5),
    ],
)
def test_least_level(need: dict[str, int], level: int) -> None:
    assert level_for(**need) == level


def test_no_level() -> None:
    with pytest.raises(UsageError, match="no level"):
        level_for(8193, 8192)
    with pytest.raises(UsageError, match=r"R-5-1"):
        SequenceHeader(level=1, width=1920, height=1080)
