"""LSQ+ parameters: their limits, starts by range and by squared error, and the exact zero for differences."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from gsvc_base.errors import UsageError
from gsvc_ref.paper import lsq, lsq_dequantize, lsq_quantize
from gsvc_ref.paper.lsq_parameters import (
    SCALE_FLOOR,
    LsqParameters,
    bounded_scale,
    from_mse,
    from_range,
    with_exact_zero,
    zero_codes,
)

columns = hnp.arrays(np.float32, st.tuples(st.integers(1, 40), st.just(2)), elements=st.floats(-50, 50, width=32))


def squared_error(x: np.ndarray, parameters: LsqParameters, bits: int, weights: np.ndarray | float = 1.0) -> np.ndarray:
    codes = lsq_quantize(x, parameters.scale, parameters.offset, bits)
    restored = lsq_dequantize(codes, parameters.scale, parameters.offset)
    return (weights * (restored - x.astype(np.float64)) ** 2).sum(axis=0)


@given(columns, st.integers(1, 12))
def test_a_start_by_range_reaches_every_value_within_half_a_step(x: np.ndarray, bits: int) -> None:
    parameters = from_range(x, bits)
    restored = lsq_dequantize(
        lsq_quantize(x, parameters.scale, parameters.offset, bits), parameters.scale, parameters.offset
    )
    assert (np.abs(restored - x.astype(np.float64)) <= parameters.scale / 2 + 2.0**-21 * 100).all()
    assert np.array_equal(parameters.offset, x.min(axis=0))


@given(columns, st.integers(1, 8))
def test_a_start_by_squared_error_is_never_worse_than_one_by_range(x: np.ndarray, bits: int) -> None:
    by_range, by_error = squared_error(x, from_range(x, bits), bits), squared_error(x, from_mse(x, bits), bits)
    assert (np.sqrt(by_error) <= np.sqrt(by_range) + len(x) * 2.0**-20 * 50).all()  # binary32 rounding of the values


def test_a_start_by_squared_error_clips_a_long_tail() -> None:
    x = np.random.default_rng(0).normal(size=(5000, 1)).astype(np.float32)
    x[17] = 12.0
    assert squared_error(x, from_mse(x, 4), 4)[0] < 0.5 * squared_error(x, from_range(x, 4), 4)[0]


def test_weights_say_which_values_matter() -> None:
    rng = np.random.default_rng(1)
    x = np.concatenate([rng.uniform(0, 1, (500, 1)), rng.uniform(0, 100, (500, 1))]).astype(np.float32)
    weights = np.concatenate([np.ones(500), np.full(500, 1e-6)])
    weighted, alike = from_mse(x, 5, weights), from_mse(x, 5)
    columns_of = weights[:, None]
    assert squared_error(x, weighted, 5, columns_of)[0] < squared_error(x, alike, 5, columns_of)[0] / 10
    assert from_mse(x, 5, columns_of).scale == weighted.scale
    assert from_mse(x, 5, np.full(1000, 3.0)).scale == pytest.approx(alike.scale, rel=1e-6)


def test_constant_channels_are_exact() -> None:
    x = np.full((7, 2), 3.25, np.float32)
    for parameters in (from_range(x, 6), from_mse(x, 6)):
        assert parameters.scale.tolist() == [SCALE_FLOOR] * 2
        assert squared_error(x, parameters, 6).tolist() == [0, 0]


def test_two_levels_are_found_exactly() -> None:
    x = np.array([[1.0], [5.0], [5.0], [1.0], [1.0]], np.float32)
    assert squared_error(x, from_mse(x, 1), 1).tolist() == [0]


@given(st.floats(2.0**-20, 100, width=32), st.floats(-90, 90, width=32), st.integers(1, 16))
def test_one_code_stands_for_exactly_zero(scale: float, offset: float, bits: int) -> None:
    start = LsqParameters(np.float32([scale]), np.float32([offset]))
    exact = with_exact_zero(start, bits)
    zeros = lsq_quantize(np.zeros((1, 1)), exact.scale, exact.offset, bits)
    assert zeros[0, 0] == zero_codes(exact, bits)[0] == zero_codes(start, bits)[0]
    assert lsq_dequantize(zeros, exact.scale, exact.offset).tobytes() == np.float32(0).tobytes()
    if 0 <= -offset <= lsq.largest_code(bits) * scale:
        assert abs(float(exact.offset[0]) - offset) <= scale * (0.5 + 2.0**-7)


def test_scales_never_go_below_their_floor() -> None:
    assert bounded_scale([-1.0, 0.0, 1e-12, 0.25]).tolist() == [SCALE_FLOOR, SCALE_FLOOR, SCALE_FLOOR, 0.25]
    assert LsqParameters(np.float32([SCALE_FLOOR]), np.float32([0])).scale[0] == SCALE_FLOOR


@pytest.mark.parametrize(
    ("scale", "offset", "message"),
    [
        ([1, 1], [0], "both must be"),
        ([[1.0]], [[0.0]], "both must be"),
        ([np.nan], [0], "finite"),
        ([1], [np.inf], "finite"),
        ([0], [0], "at least"),
        ([-1], [0], "at least"),
    ],
)
def test_parameters_that_cannot_be_coded_are_refused(scale: list[float], offset: list[float], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        LsqParameters(np.array(scale), np.array(offset))


@pytest.mark.parametrize("start", [from_range, from_mse])
def test_starts_refuse_values_that_give_none(start: object) -> None:
    assert callable(start)
    with pytest.raises(UsageError, match="N >= 1"):
        start(np.empty((0, 3)), 6)
    with pytest.raises(UsageError, match="NaN or infinite"):
        start([[np.nan]], 6)
    with pytest.raises(UsageError, match="finite"):
        start([[-3e38], [3e38]], 1)
    with pytest.raises(UsageError, match=r"1\.\.16"):
        start([[0.0]], 17)


@pytest.mark.parametrize(
    ("weights", "message"), [([1.0], "one per splat"), ([1.0, -1.0], "negative"), ([1.0, np.nan], "not finite")]
)
def test_weights_that_make_no_sense_are_refused(weights: list[float], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        from_mse([[0.0], [1.0]], 6, weights)


def test_weights_of_zero_everywhere_fall_back_to_the_range() -> None:
    x = np.array([[0.0], [3.0]], np.float32)
    assert from_mse(x, 2, np.zeros(2)).scale == from_range(x, 2).scale
