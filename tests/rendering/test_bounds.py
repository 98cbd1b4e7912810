"""The error bound: the fast renderer keeps within it for any splats, and it is narrow enough to find small bugs."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from render_cases import (
    EXAMPLES,
    HEIGHT,
    JIT,
    NAMED,
    WIDTH,
    extreme,
    ordinary,
    population,
    single,
    splat_sets,
)  # fmt: skip

from gsvc_base.rendering.error_models import EPS, gamma
from gsvc_base.splats import Splats
from gsvc_ref.rendering import (
    LN_255,
    exact_gradients_with_bound,
    render_exact_with_bound,
    render_gradients,
    render_sum,
)  # fmt: skip

# Interpreted kernels work on NumPy scalars, which warn where the compiled ones quietly make an infinity.
pytestmark = [] if JIT else [pytest.mark.filterwarnings("ignore:.*encountered:RuntimeWarning")]

RESIDUAL = np.random.default_rng(7).normal(0, 1, (HEIGHT, WIDTH, 3)).astype(np.float32)


def assert_sum_within_bound(splats):
    C, bound = render_exact_with_bound(splats, WIDTH, HEIGHT)
    actual = render_sum(splats, WIDTH, HEIGHT)
    assert np.isfinite(actual).all()
    assert np.all(abs(actual - C) <= bound)
    assert np.array_equal(C, render_sum(splats, WIDTH, HEIGHT, precision="exact"))


def assert_gradients_within_bound(splats):
    gradients, bound = exact_gradients_with_bound(splats, RESIDUAL)
    actual = render_gradients(splats, RESIDUAL).astype(np.float64)
    representable = abs(gradients) + bound < np.finfo(np.float32).max
    assert np.all(abs(actual - gradients)[representable] <= bound[representable])
    exact = render_gradients(splats, RESIDUAL, precision="exact")
    np.testing.assert_allclose(gradients, exact, rtol=1e-9, atol=1e-12 * abs(exact).max(initial=0))


@settings(max_examples=EXAMPLES, deadline=None)
@given(splat_sets(ordinary))
def test_ordinary_splats_keep_within_the_bound(splats):
    assert_sum_within_bound(splats)


@settings(max_examples=EXAMPLES * 3, deadline=None)
@given(splat_sets(extreme, largest=4))
def test_extreme_splats_keep_within_the_bound(splats):
    assert_sum_within_bound(splats)


@settings(max_examples=EXAMPLES, deadline=None)
@given(splat_sets(ordinary, largest=3))
def test_ordinary_gradients_keep_within_the_bound(splats):
    assert_gradients_within_bound(splats)


@settings(max_examples=EXAMPLES, deadline=None)
@given(splat_sets(extreme, largest=3))
def test_extreme_gradients_keep_within_the_bound(splats):
    assert_gradients_within_bound(splats)


@pytest.mark.parametrize("name", NAMED)
def test_named_cases_keep_within_the_bound(name):
    assert_sum_within_bound(NAMED[name])
    assert_gradients_within_bound(NAMED[name])


def test_a_coverage_flip_is_inside_the_band_and_nothing_else_is_that_wide():
    """A splat whose edge lies on a pixel centre to within binary32: that pixel may lose 1/255, no other may."""
    l11 = np.float32(4 / math.sqrt(2 * LN_255))
    C, bound = render_exact_with_bound(single(10.5, 10.5, l11, 0.0, 1.0, (1, 1, 1)), 21, 21)
    edge = np.zeros((21, 21), bool)
    edge[10, [6, 14]] = True
    assert np.all(bound[edge] > 1 / 256)
    assert np.all(bound[~edge] < 1e-5)
    assert np.all(C[edge] < 1 / 254)


def test_the_bound_is_narrow():
    """A hundredth of an 8-bit step at most in the median pixel, or the check would find no bug."""
    splats = population(100 if JIT else 20, WIDTH, HEIGHT)
    C, bound = render_exact_with_bound(splats, WIDTH, HEIGHT)
    assert np.median(bound) < 1e-5
    off = splats.to_array()
    off[:, 5:] *= np.float32(1 + 1e-4)
    caught = abs(render_sum(Splats.from_array(off), WIDTH, HEIGHT) - C) > bound
    assert np.mean(caught) > 0.5


def test_gamma():
    assert gamma(3) == pytest.approx(3 * EPS, rel=1e-6)
    assert gamma(3) > 3 * EPS
    assert gamma(2**23) == math.inf


def test_gradient_aggregates():
    """Relative L2 at most 1e-5 and signed bias at most 1e-6: the per-element bounds would let a scale bug pass."""
    splats = population(400 if JIT else 15, WIDTH * 3, HEIGHT * 3)
    residual = np.random.default_rng(9).normal(0, 1, (HEIGHT * 3, WIDTH * 3, 3)).astype(np.float32)
    exact = render_gradients(splats, residual, precision="exact")
    error = render_gradients(splats, residual) - exact
    for group in (slice(0, 2), slice(2, 5), slice(5, 8)):
        assert np.linalg.norm(error[:, group]) <= 1e-5 * np.linalg.norm(exact[:, group])
        assert abs(np.sum(error[:, group])) <= 1e-6 * np.sum(abs(exact[:, group]))
