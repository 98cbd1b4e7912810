"""binary16: the conversions against spec.md, and the encoder's coarser grids."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gsvc_base.errors import UsageError
from gsvc_ref import spec
from gsvc_ref.paper.half import (
    LARGEST_HALF,
    coarsen_half,
    from_half,
    half_is_finite,
    to_half,
)

ALL_PATTERNS = np.arange(1 << 16, dtype=np.uint16)
FINITE_PATTERNS = ALL_PATTERNS[half_is_finite(ALL_PATTERNS)]
in_range = st.floats(-65519.0, 65519.0, allow_subnormal=True)


def test_every_pattern_has_the_defined_value() -> None:
    values, nan = from_half(ALL_PATTERNS), (ALL_PATTERNS & 0x7FFF) > 0x7C00
    assert values.dtype == np.float32
    assert values[~nan].tobytes() == spec.from_half(ALL_PATTERNS[~nan])["values"].tobytes()
    assert np.isnan(values[nan]).all()
    assert np.array_equal(half_is_finite(ALL_PATTERNS), np.isfinite(values))


def test_every_finite_pattern_survives_the_round_trip() -> None:
    values = from_half(FINITE_PATTERNS)
    assert np.array_equal(to_half(values), FINITE_PATTERNS)


def test_midpoints_go_to_the_even_pattern() -> None:
    lower = np.arange(0x7BFF, dtype=np.uint16)  # every finite positive pattern but the largest
    upper = (lower + 1).astype(np.uint16)
    middle = (from_half(lower).astype(np.float64) + from_half(upper)) / 2  # exact in binary64
    even = np.where(lower % 2 == 0, lower, upper)
    assert np.array_equal(to_half(middle), even)
    assert np.array_equal(to_half(np.nextafter(middle, 0.0)), lower)
    assert np.array_equal(to_half(np.nextafter(middle, np.inf)), upper)
    assert np.array_equal(to_half(-middle), even | 0x8000)


@given(in_range)
def test_arrays_follow_the_definition(value: float) -> None:
    for values in (np.array([value]), np.array([value], np.float32)):
        assert to_half(values).tobytes() == spec.to_half(values)["bits"].tobytes()


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 65520.0, -65520.0, 1e30])
def test_values_without_a_finite_binary16_are_refused(value: float) -> None:
    with pytest.raises(UsageError, match="65504"):
        to_half(np.array([0.0, value]))
    with pytest.raises(UsageError, match="value 1 is"):
        coarsen_half(np.array([0.0, value]), -10)


def test_the_largest_binary16_takes_everything_under_the_next_midpoint() -> None:
    assert from_half(to_half(np.nextafter(65520.0, 0.0))) == LARGEST_HALF


def test_signed_zero_is_kept() -> None:
    assert to_half(np.array([0.0, -0.0, 1e-9, -1e-9])).tolist() == [0, 0x8000, 0, 0x8000]


def test_shapes_are_kept() -> None:
    bits = to_half(np.zeros((3, 2), np.float32))
    assert bits.shape == (3, 2)
    assert from_half(bits.T).shape == (2, 3)
    assert from_half(np.uint16(0x3C00)) == 1.0
    assert half_is_finite(np.array([[0x7C00, 0xFC00, 0x7E00, 0x7BFF]], np.uint16)).tolist() == [[False] * 3 + [True]]


def test_patterns_of_another_type_are_refused() -> None:
    with pytest.raises(UsageError, match="uint16"):
        from_half(np.zeros(2, np.int32))


@given(in_range)
def test_the_finest_grid_is_plain_rounding(value: float) -> None:
    expected = from_half(to_half(np.array([value])))
    assert coarsen_half(np.array([value]), -24).tobytes() == expected.tobytes()


@given(st.floats(-2000, 2000), st.integers(-24, 6))
def test_coarse_values_are_the_nearest_binary16_multiple(value: float, step_exponent: int) -> None:
    coarse = float(coarsen_half(value, step_exponent))
    candidates = from_half(FINITE_PATTERNS).astype(np.float64)
    candidates = candidates[np.remainder(candidates, 2.0**step_exponent) == 0]
    assert coarse in candidates
    assert abs(coarse - value) == np.abs(candidates - value).min()


def test_coarse_ties_go_to_the_even_multiple() -> None:
    assert coarsen_half(np.array([0.5, 1.5, 2.5, -0.5, -1.5]), 0).tolist() == [0.0, 2.0, 2.0, 0.0, -2.0]


def test_coarse_values_keep_the_shape_and_the_order():
    values = np.arange(12.0).reshape(3, 4)
    assert coarsen_half(values.T, 1).tolist() == (2 * np.rint(values.T / 2)).tolist()
    assert coarsen_half(values[:, ::2], -24).tolist() == values[:, ::2].tolist()
    assert coarsen_half(np.zeros((0, 2)), 0).shape == (0, 2)
