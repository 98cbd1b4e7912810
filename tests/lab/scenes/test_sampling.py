"""Smoothing and splines are those that scipy.ndimage has, in stated sums."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import correlate1d, gaussian_filter, map_coordinates, spline_filter

from gsvc_lab.scenes.sampling import correlated, read_at, read_grid, smoothed, spline_coefficients


def samples(height, width):
    return np.random.default_rng(height * 10 + width).standard_normal((height, width, 3))


PLACES = st.lists(st.floats(-40, 40), min_size=1, max_size=4)


@given(st.integers(1, 9), st.integers(1, 9), PLACES, PLACES)
def test_reading_is_that_of_scipy(height, width, rows, columns):
    coefficients = samples(height, width)
    places = np.broadcast_arrays(np.array(rows)[:, None], np.array(columns)[None, :])
    expected = np.stack(
        [map_coordinates(coefficients[..., c], places, order=3, mode="reflect", prefilter=False) for c in range(3)], -1
    )
    np.testing.assert_allclose(read_grid(coefficients, np.array(rows), np.array(columns)), expected, atol=1e-9)
    np.testing.assert_allclose(read_at(coefficients, *places), expected, atol=1e-9)


@pytest.mark.parametrize("size", [(1, 1), (1, 7), (2, 3), (5, 4), (40, 31)])
def test_splines_go_through_their_samples(size):
    picture = samples(*size)
    values = read_grid(spline_coefficients(picture), np.arange(float(size[0])), np.arange(float(size[1])))
    np.testing.assert_allclose(values, picture, atol=1e-12)


def test_coefficients_are_those_of_scipy():
    picture = samples(40, 31)
    expected = np.stack([spline_filter(picture[..., c], 3, mode="reflect") for c in range(3)], -1)
    np.testing.assert_allclose(spline_coefficients(picture), expected, atol=1e-12)


def test_many_places_are_read_in_parts():
    coefficients = samples(9, 8)
    rows, columns = np.random.default_rng(1).uniform(-9, 20, (2, 300, 301))
    values = read_at(coefficients, rows, columns)
    assert np.array_equal(values[-1], read_at(coefficients, rows[-1], columns[-1]))


@pytest.mark.parametrize("deviation", [0.05, 0.4, 1.0, 7.3])
def test_smoothing_is_that_of_scipy(deviation):
    picture = samples(21, 34)
    expected = gaussian_filter(picture, (deviation, deviation, 0), mode="reflect")
    np.testing.assert_allclose(smoothed(picture, deviation), expected, atol=1e-12)


@pytest.mark.parametrize("axis", [0, 1])
def test_sums_of_neighbours_are_those_of_scipy(axis):
    picture, taps = samples(5, 6), np.array([0.5, -1.0, 2.0, 3.0, 0.25, 1.0, -4.0])
    expected = correlate1d(picture, taps, axis=axis, mode="wrap")
    np.testing.assert_allclose(correlated(picture, taps, axis, "wrap"), expected, atol=1e-12)
