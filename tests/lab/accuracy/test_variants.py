"""The renderer with open choices, the exact picture for any cut-off, and the polynomials."""

import math
from itertools import pairwise

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gsvc_lab.accuracy.exponential import coefficients, squarings
from gsvc_lab.accuracy.oracle import NOTHING_SIGMA, cut_sum
from gsvc_lab.accuracy.variants import Variant, render_variant
from gsvc_ref.errors import UsageError
from gsvc_ref.rendering import LN_255, render_exact_with_bound, render_sum
from gsvc_ref.splats import Splats

JIT = not numba.config.DISABLE_JIT
WIDTH, HEIGHT = 45, 37  # no multiple of any tile


def population(count=60, width=WIDTH, height=HEIGHT, seed=0):
    """Sheared splats of natural sizes, some over the edges."""
    rng = np.random.default_rng(seed)
    radius = math.sqrt(width * height / max(count, 1))
    columns = [
        rng.random((count, 2)) * (width + 8, height + 8) - 4,
        radius * rng.lognormal(-0.4, 0.5, (count, 1)),
        radius * rng.normal(0, 0.7, (count, 1)),
        radius * rng.lognormal(-0.4, 0.5, (count, 1)),
        rng.normal(0.1, 0.25, (count, 3)),
    ]
    return Splats.from_array(np.concatenate(columns, axis=1).astype(np.float32))


def assert_within_bound(splats, width, height, variant):
    C, bound = render_exact_with_bound(splats, width, height)
    picture = render_variant(splats, width, height, variant)
    assert picture.shape == C.shape
    assert (abs(picture - C) <= bound).all()


@settings(max_examples=30 if JIT else 3)
@given(st.integers(0, 10**6), st.integers(0, 80), st.integers(1, 70), st.integers(1, 70))
def test_the_defaults_stay_within_the_bound_of_the_reference(seed, count, width, height):
    count = count if JIT else count // 10
    assert_within_bound(population(count, width, height, seed), width, height, Variant())


@pytest.mark.parametrize("tile", [(8, None), (32, None), (64, None), (16, 16), (16, 64), (64, 64), (16, 1), (1, None)])
def test_tiles_change_nothing(tile):
    splats = population()
    assert_within_bound(splats, WIDTH, HEIGHT, Variant(tile=tile))
    whole = render_variant(splats, WIDTH, HEIGHT, Variant())
    np.testing.assert_allclose(render_variant(splats, WIDTH, HEIGHT, Variant(tile=tile)), whole, atol=1e-5, rtol=0)


@pytest.mark.parametrize("degree", [5, 7, None])
def test_a_good_exp_stays_within_the_bound(degree):
    assert_within_bound(population(seed=1), WIDTH, HEIGHT, Variant(degree=degree))


def test_a_bad_exp_does_not():
    splats = population(seed=1)
    C, bound = render_exact_with_bound(splats, WIDTH, HEIGHT)
    assert (abs(render_variant(splats, WIDTH, HEIGHT, Variant(degree=3)) - C) > bound).any()


def test_binary64_is_exact_to_its_last_bits():
    splats = population(seed=2)
    picture = render_variant(splats, WIDTH, HEIGHT, Variant(degree=9, bits=64))
    assert picture.dtype == np.float64
    np.testing.assert_allclose(picture, render_sum(splats, WIDTH, HEIGHT, precision="exact"), atol=1e-13, rtol=0)


@pytest.mark.parametrize("cutoff", [1 / 1024, 1 / 4096, 0])
def test_a_cutoff_cuts_there(cutoff):
    splats = population(seed=3)
    variant = Variant(cutoff=cutoff, bits=64, degree=9)
    wanted = cut_sum(splats, WIDTH, HEIGHT, variant.support_sigma)
    np.testing.assert_allclose(render_variant(splats, WIDTH, HEIGHT, variant), wanted, atol=1e-12, rtol=0)
    narrower = Variant(bits=64, degree=9)
    assert abs(render_variant(splats, WIDTH, HEIGHT, narrower) - wanted).max() > 1e-3


def test_splats_that_cover_nothing():
    rows = [[500, -300, 4, 1, 4], [20, 20, 0, 0, 3], [20, 20, 3, 0, -1], [11, 10, 0.1, 0, 0.1]]
    splats = Splats.from_array(np.array([[*row, 0.5, 0.5, 0.5] for row in rows], np.float32))
    assert not render_variant(splats, WIDTH, HEIGHT, Variant()).any()
    assert not render_variant(Splats.empty(), WIDTH, HEIGHT, Variant()).any()


@pytest.mark.parametrize(
    ("choice", "words"),
    [({"degree": 0}, "degree"), ({"degree": 13}, "degree"), ({"cutoff": 1.0}, "cut-off"), ({"cutoff": -0.1}, "cut-off"),
     ({"tile": (0, None)}, "tile"), ({"tile": (16, 0)}, "tile"), ({"bits": 16}, "32 or 64")],
)  # fmt: skip
def test_choices_out_of_range(choice, words):
    with pytest.raises(UsageError, match=words):
        Variant(**choice)


def test_the_usual_cut_of_the_oracle_has_the_bits_of_the_definition():
    splats = population(seed=4)
    np.testing.assert_array_equal(cut_sum(splats, WIDTH, HEIGHT), render_sum(splats, WIDTH, HEIGHT, precision="exact"))


def test_without_a_cut_the_oracle_sums_every_splat_over_every_pixel():
    splats = population(12, seed=5)
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
    wanted = np.zeros((HEIGHT, WIDTH, 3))
    for mu_x, mu_y, l11, l21, l22, *color in splats.to_array().astype(np.float64):
        u1 = (x - mu_x) / l11
        u2 = (y - mu_y - l21 * u1) / l22
        wanted += np.exp(-(u1**2 + u2**2) / 2)[..., None] * color
    np.testing.assert_allclose(cut_sum(splats, WIDTH, HEIGHT, NOTHING_SIGMA), wanted, atol=1e-14, rtol=0)


def exp_errors(degree, sigma=LN_255, bits=32):
    """The error of the polynomial's power at points from 0 to the edge."""
    s = np.linspace(0, 2 * sigma, 20001)
    power = np.polyval(coefficients(degree, sigma, bits)[::-1], s) ** (2 ** squarings(sigma, bits))
    return power - np.exp(-s / 2)


@pytest.mark.parametrize(("degree", "most"), [(2, 1.1e-3), (3, 4.6e-5), (4, 1.6e-6), (5, 4.5e-8), (7, 3e-11)])
def test_the_polynomials_are_the_best_of_their_degree(degree, most):
    error = exp_errors(degree)
    assert coefficients(degree, LN_255, 32)[0] == 1
    assert abs(error).max() < most
    # Chebyshev: with p(0) = 1 given, `degree` coefficients are free, and the best has degree + 1 extremes of one size.
    changes = np.flatnonzero(np.diff(np.sign(error[1:]))) + 1
    extremes = [abs(error[a:b]).max() for a, b in pairwise([0, *changes + 1, len(error)])]
    assert len(extremes) >= degree + 1
    assert min(sorted(extremes)[-(degree + 1) :]) > 0.9 * max(extremes)


def test_the_binary64_polynomial_is_exact_to_its_last_bits():
    assert abs(exp_errors(9, bits=64)).max() < 3e-15


def test_more_range_takes_more_squarings():
    assert squarings(LN_255, 32) == 3
    assert squarings(LN_255, 64) == 5
    assert squarings(Variant(cutoff=0).support_sigma, 32) == 7
    assert abs(exp_errors(5, Variant(cutoff=0).support_sigma)).max() < 1e-7
