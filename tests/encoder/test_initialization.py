"""Splats drawn from pictures and residuals, and when splats are added."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from gsvc_base.errors import UsageError
from gsvc_ref.encoder.initialization import SIZE_FACTOR, Growth, draw_from_density, image_start, residual_splats
from gsvc_ref.rendering import render_sum


def generator(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


densities = hnp.arrays(
    np.float32,
    st.tuples(st.integers(1, 6), st.integers(1, 6)),
    elements=st.one_of(st.just(0.0), st.floats(0, 2.0**66, width=32)),
)


@given(densities, st.integers(0, 2**32 - 1))
def test_positions_lie_in_pixels_of_positive_density(density: np.ndarray, seed: int) -> None:
    height, width = density.shape
    positions = draw_from_density(density, 50, generator(seed))
    assert positions.shape == (50, 2)
    assert positions.dtype == np.float32
    assert (positions >= 0).all()
    assert (positions <= [width, height]).all()
    inside = (positions != np.floor(positions)).all(axis=1)  # a rounded position may stand on a pixel's edge
    x, y = positions[inside].astype(int).T
    assert not density.any() or (density[y, x] > 0).all()


def test_positions_follow_the_density() -> None:
    density = np.array([[1.0, 0.0, 3.0], [0.0, 4.0, 0.0]])
    positions = draw_from_density(density, 8000, generator())
    counts = np.histogram2d(positions[:, 1], positions[:, 0], bins=[[0, 1, 2], [0, 1, 2, 3]])[0]
    assert np.abs(counts - density * 1000).max() < 5 * math.sqrt(2000)
    within = positions % 1
    assert np.abs(within.mean(axis=0) - 0.5).max() < 0.02


def test_no_density_at_all_is_uniform() -> None:
    positions = draw_from_density(np.zeros((2, 2)), 4000, generator())
    assert np.abs(np.histogram2d(*positions.T, bins=2)[0] - 1000).max() < 5 * math.sqrt(750)


def picture_with_an_edge() -> np.ndarray:
    """Left half dark, right half light, with a texture in the lower right quarter; 48 x 64."""
    picture = np.full((48, 64, 3), 0.2, np.float32)
    picture[:, 32:] = [0.9, 0.8, 0.7]
    picture[24:, 32:] -= np.float32(0.3) * (np.indices((24, 32)).sum(axis=0) % 4 < 2)[..., None]
    return picture


def test_a_start_by_picture_puts_small_splats_on_detail() -> None:
    splats = image_start(picture_with_an_edge(), 600, generator())
    x, y = splats.positions.T
    textured, flat = (x > 33) & (y > 25), x < 24
    assert np.count_nonzero(textured) / 736 > 3 * np.count_nonzero(flat) / 1152
    assert np.median(splats.cholesky[textured, 0]) < 0.7 * np.median(splats.cholesky[flat, 0])
    assert np.array_equal(splats.cholesky[:, 0], splats.cholesky[:, 2])
    assert not splats.cholesky[:, 1].any()


def test_a_start_by_picture_resembles_it() -> None:
    picture = picture_with_an_edge()
    splats = image_start(picture, 400, generator())
    shown = render_sum(splats, 64, 48)
    # Random places overlap unevenly, so single pixels vary; over a quarter of the frame that evens out.
    for rows in (slice(0, 24), slice(24, 48)):
        for columns in (slice(0, 32), slice(32, 64)):
            part = (rows, columns)
            assert shown[part].mean(axis=(0, 1)) == pytest.approx(picture[part].mean(axis=(0, 1)), rel=0.35)


def test_a_flat_picture_gets_even_splats_that_sum_to_its_colour() -> None:
    picture = np.full((64, 64, 3), [0.5, 0.25, 1.0], np.float32)
    splats = image_start(picture, 1024, generator())
    size = SIZE_FACTOR / math.sqrt(1024 / 64**2)
    assert splats.cholesky == pytest.approx(np.tile([size, 0, size], (1024, 1)), rel=1e-4)
    middle = render_sum(splats, 64, 64)[16:48, 16:48].mean(axis=(0, 1))
    assert middle == pytest.approx([0.5, 0.25, 1.0], rel=0.1)


@pytest.mark.parametrize(("height", "width", "count"), [(1, 1, 5), (1, 7, 3), (5, 1, 0), (3, 3, 20)])
def test_tiny_pictures_have_a_start(height: int, width: int, count: int) -> None:
    picture = generator().random((height, width, 3), np.float32)
    splats = image_start(picture, count, generator())
    assert len(splats) == count
    assert (splats.cholesky[:, 0] > 0).all()


def test_residual_splats_go_where_the_picture_is_wrong() -> None:
    residual = np.zeros((40, 60, 3), np.float32)
    residual[10:14, 20:24] = [0.8, -0.4, 0.0]  # the picture lacks red and has too much green
    splats = residual_splats(residual, 200, 1.5, generator())
    x, y = splats.positions.T
    assert ((x >= 20) & (x <= 24) & (y >= 10) & (y <= 14)).all()
    assert np.unique(splats.cholesky, axis=0).tolist() == [[1.5, 0, 1.5]]
    inside = (x % 1 > 0) & (y % 1 > 0)  # a rounded position may stand on the edge of the next pixel
    assert np.unique(splats.colors[inside], axis=0) == pytest.approx(np.array([[0.4, -0.2, 0.0]]))


def test_residual_splats_follow_the_cube_of_the_residual() -> None:
    residual = np.zeros((1, 2, 3), np.float32)
    residual[0, :, 1] = [-0.5, 1.0]
    left = np.count_nonzero(residual_splats(residual, 9000, 1.0, generator()).positions[:, 0] < 1)
    assert abs(left - 1000) < 5 * math.sqrt(9000 * 8 / 81)


def test_residual_splats_lower_the_error() -> None:
    residual = np.ones((20, 20, 1), np.float32) * np.array([0.5, -0.3, 0.1], np.float32)
    splats = residual_splats(residual, 40, 1.0, generator())
    assert np.square(residual - render_sum(splats, 20, 20)).sum() < np.square(residual).sum()


def test_a_picture_without_error_gets_invisible_splats() -> None:
    splats = residual_splats(np.zeros((4, 4, 3), np.float32), 7, 1.0, generator())
    assert len(splats) == 7
    assert not splats.colors.any()


@given(st.integers(1, 3000), st.integers(1, 300), st.sampled_from([Growth(), Growth(0.5, 3, 0.0, 0.9), Growth(1.0, 1)]))
def test_growth_always_ends_with_the_total(total, iterations, growth):
    counts = growth.counts(total, iterations)
    assert list(counts) == sorted(counts)
    assert list(counts.values()) == sorted(counts.values())
    assert min(counts) >= 0
    assert max(counts) < iterations
    assert counts[max(counts)] == total
    assert 1 <= growth.start(total) <= total


@pytest.mark.parametrize("wrong", [{"end": 1.0}, {"additions": 0}, {"first": -0.1}, {"begin": 0.7, "end": 0.6}])
def test_growth_that_would_not_end_with_the_total_is_refused(wrong):
    with pytest.raises(UsageError, match=r"[gG]rowth"):
        Growth(**wrong)
