"""The definition against hand calculation, plain loops and central differences in binary64."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from render_cases import DEGENERATE, EXAMPLES, HEIGHT, NAMED, SMOOTH, WIDTH, ordinary, population, single, splat_sets

from gsvc_base.errors import UsageError
from gsvc_base.rendering.definition import exact_covered_pixels, exact_gradients, exact_sum, footprint
from gsvc_base.splats import Splats
from gsvc_ref.rendering import LN_255, SMALLEST_NORMAL, render, render_gradients, render_sum


def plain_sum(splats, width, height):
    """Equation (9-2) of spec.md pixel by pixel with math.exp."""
    C = np.zeros((height, width, 3))
    for x, y, l11, l21, l22, *color in splats.to_array().astype(np.float64).tolist():
        if l11 < 2.0**-126 or l22 < 2.0**-126:
            continue
        for j in range(height):
            for i in range(width):
                u1 = (i + 0.5 - x) / l11
                u2 = (j + 0.5 - y - l21 * u1) / l22
                sigma = (u1 * u1 + u2 * u2) / 2
                if sigma <= math.log(255):
                    C[j, i] += np.array(color) * math.exp(-sigma)
    return C


def test_constants():
    assert abs(LN_255 - math.log(255)) < 1e-15
    assert float(np.finfo(np.float32).smallest_normal) == SMALLEST_NORMAL


@settings(max_examples=EXAMPLES // 3, deadline=None)
@given(splat_sets(ordinary, largest=3))
def test_the_sum_equals_plain_loops(splats):
    np.testing.assert_allclose(exact_sum(splats, 21, 18), plain_sum(splats, 21, 18), rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("name", NAMED)
def test_the_sum_of_named_cases_equals_plain_loops(name):
    expected = plain_sum(NAMED[name], WIDTH, HEIGHT)
    np.testing.assert_allclose(exact_sum(NAMED[name], WIDTH, HEIGHT), expected, rtol=1e-12, atol=1e-13)


def test_one_pixel_by_hand():
    """Pixel (3, 2) has its centre at (3.5, 2.5): d = (1, 2), u1 = 1/2, u2 = (2 - 1.5/2)/1.25 = 1, sigma = 5/8."""
    C = exact_sum(single(2.5, 0.5, 2.0, 1.5, 1.25, (1.0, 2.0, -1.0)), 6, 5)
    np.testing.assert_allclose(C[2, 3], np.exp(-0.625) * np.array([1, 2, -1]), rtol=1e-15)


def test_a_centre_on_a_pixel_centre_gives_the_colour_itself():
    assert exact_sum(single(2.5, 1.5, 0.3, 0.2, 0.3, (0.25, -0.5, 2)), 6, 5)[1, 2].tolist() == [0.25, -0.5, 2]


def test_the_support_ends_where_the_weight_is_one_step_of_255():
    """At distance d in a row the weight is exp(-d^2 / (2 l11^2)), which is 1/255 at 3.329 l11."""
    C = exact_sum(single(0.5, 0.5, 3.0, 0.0, 1.0, (1, 1, 1)), 20, 1)[0, :, 0]
    np.testing.assert_allclose(C[:10], np.exp(-(np.arange(10) ** 2) / 18), rtol=1e-15)
    assert np.count_nonzero(C) == 10  # 3.329 * 3 = 9.987


def test_no_splats_are_black():
    assert not exact_sum(Splats.empty(), 7, 5).any()
    assert exact_gradients(Splats.empty(), np.ones((5, 7, 3))).shape == (0, 8)


@pytest.mark.parametrize("name", DEGENERATE)
def test_degenerate_factors_cover_nothing(name):
    assert exact_covered_pixels(NAMED[name], WIDTH, HEIGHT).tolist() == [0]
    assert not render_gradients(NAMED[name], np.ones((HEIGHT, WIDTH, 3)), precision="exact").any()


def test_the_smallest_normal_factors_are_not_degenerate():
    assert exact_covered_pixels(NAMED["smallest factors on a centre"], WIDTH, HEIGHT).tolist() == [1]


@pytest.mark.parametrize("precision", ["fast", "exact"])
def test_determinant_cancellation_does_not_kill_a_splat(precision):
    """l = (1, 50, 0.01): the covariance's a c - b^2 is 0 in binary32, but its factors give (l11 l22)^2 = 1e-4."""
    l11, l21, l22 = np.float32([1, 50, 0.01])
    a, b, c = l11 * l11, l11 * l21, l21 * l21 + l22 * l22
    assert a * c - b * b == 0
    picture = render(single(20.5, 18.5, 1.0, 50.0, 0.01, (1, 1, 1)), WIDTH, HEIGHT, precision=precision)
    assert picture[18, 20].tolist() == [1, 1, 1]


def loss(parameters, residual):
    """sum(residual * C) of one splat (8,) f8; residual comes zero near the cut, so that no pixel crosses it."""
    pixels = footprint(parameters, residual.shape[1], residual.shape[0], margin=2)
    return np.sum(residual[pixels.rows, pixels.columns] * pixels.g[..., None] * parameters[5:])


def away_from_the_cut(splats, residual):
    """The residual, zero at pixels whose coverage a small step could change."""
    splat = splats.to_array().astype(np.float64)[0]
    pixels = footprint(splat, residual.shape[1], residual.shape[0], margin=2)
    residual[pixels.rows, pixels.columns] *= (abs(pixels.sigma - LN_255) > 0.01)[..., None]
    return residual


def central_differences(splats, residual):
    """The gradient (8,) f8 by (f(p + h) - f(p - h)) / 2h, extrapolated from two steps."""
    splat = splats.to_array().astype(np.float64)[0]
    gradient = np.zeros(8)
    for column in range(8):
        estimates = []
        for step in (1e-4, 5e-5):
            h = step * max(np.sqrt(splat[2] * splat[4]) if column < 5 else 1.0, 1e-3)
            h *= min(1.0, splat[4] / splat[2]) if column < 5 else 1.0
            up, down = splat.copy(), splat.copy()
            up[column] += h
            down[column] -= h
            estimates.append((loss(up, residual) - loss(down, residual)) / (up[column] - down[column]))
        gradient[column] = (4 * estimates[1] - estimates[0]) / 3
    return gradient


@pytest.mark.parametrize("name", SMOOTH)
def test_gradients_equal_central_differences(name):
    residual = away_from_the_cut(NAMED[name], np.random.default_rng(1).normal(0, 1, (HEIGHT, WIDTH, 3)))
    actual = exact_gradients(NAMED[name], residual)[0]
    expected = central_differences(NAMED[name], residual)
    assert np.all(abs(actual) > 0)
    np.testing.assert_allclose(actual, expected, rtol=2e-7, atol=2e-8 * abs(expected).max())


def test_doubled_off_diagonal_is_wrong():
    """The authors' kernel counts the off-diagonal of dL/dSigma twice: l11 and l21 come out wrong, l22 right.

    dL/dSigma = G = 1/2 sum q v v^T (since d sigma = -1/2 v^T dSigma v), and Sigma = L L^T gives dL/dL = 2 G L. With
    G12 doubled that is another number, and central differences decide which.
    """
    splats = NAMED["strong shear"]
    residual = away_from_the_cut(splats, np.random.default_rng(5).normal(0.3, 1, (HEIGHT, WIDTH, 3)))
    splat = splats.to_array().astype(np.float64)[0]
    pixels = footprint(splat, WIDTH, HEIGHT)
    q = pixels.g * (residual[pixels.rows, pixels.columns] @ splat[5:])
    L = np.array([[splat[2], 0], [splat[3], splat[4]]])
    v = np.einsum("ji,jhw->ihw", np.linalg.inv(L), np.stack([pixels.u1, pixels.u2]))
    G = np.einsum("hw,ihw,jhw->ij", q, v, v) / 2
    right = (2 * G @ L)[[0, 1, 1], [0, 0, 1]]
    wrong = (2 * (G * [[1, 2], [2, 1]]) @ L)[[0, 1, 1], [0, 0, 1]]
    expected = central_differences(splats, residual)[2:5]
    np.testing.assert_allclose(right, expected, rtol=1e-6)
    np.testing.assert_allclose(exact_gradients(splats, residual)[0, 2:5], expected, rtol=1e-6)
    assert np.all(abs(wrong[:2] / expected[:2] - 1) > 0.05)


def test_the_gradient_is_linear_in_the_residual():
    splats = population(12, WIDTH, HEIGHT)
    rng = np.random.default_rng(2)
    a, b = rng.normal(size=(2, HEIGHT, WIDTH, 3))
    together = exact_gradients(splats, 2 * a - b)
    np.testing.assert_allclose(together, 2 * exact_gradients(splats, a) - exact_gradients(splats, b), atol=1e-11)


def test_the_colour_gradient_is_the_transpose_of_the_sum():
    """sum(residual * C) is linear in the colours, so colours times their gradients add up to it."""
    splats = population(12, WIDTH, HEIGHT)
    residual = np.random.default_rng(3).normal(size=(HEIGHT, WIDTH, 3))
    total = np.sum(residual * exact_sum(splats, WIDTH, HEIGHT))
    assert np.sum(exact_gradients(splats, residual)[:, 5:] * splats.colors) == pytest.approx(total, rel=1e-12)


@pytest.mark.parametrize(
    "residual", [np.zeros((4, 5)), np.zeros((4, 5, 4)), np.zeros((0, 5, 3)), np.full((4, 5, 3), np.nan)]
)
@pytest.mark.parametrize("precision", ["fast", "exact"])
def test_a_residual_that_is_no_picture_is_refused(residual, precision):
    with pytest.raises(UsageError, match="residual"):
        render_gradients(population(9, 5, 4), residual, precision=precision)


def test_render_exact_clamps_and_rounds_the_sum():
    splats = single(5.5, 5.5, 2.0, 0.0, 2.0, (3.0, -1.0, 0.5))
    C = render_sum(splats, 11, 11, precision="exact")
    assert C.dtype == np.float64
    picture = render(splats, 11, 11, precision="exact")
    assert picture.dtype == np.float32
    assert np.array_equal(picture, np.clip(C, 0, 1).astype(np.float32))
