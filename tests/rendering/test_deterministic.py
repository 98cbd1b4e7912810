"""The precision ``deterministic``: the bits of its plain form for any threads, regions, CPU, with JIT or without."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from render_cases import EXAMPLES, HEIGHT, JIT, NAMED, WIDTH, extreme, ordinary, population, single, splat_sets

from gsvc_base.constants import ONE, SUPPORT_SQUARED
from gsvc_base.splats import Splats
from gsvc_ref.rendering import (
    Objective,
    Renderer,
    covered_pixels,
    render_exact_with_bound,
    render_frame,
    render_gradients,
    render_sum,
    to_frame,
)  # fmt: skip
from gsvc_ref.rendering.deterministic import gradients_plain, sum_plain, weight, whitened
from gsvc_ref.rendering.fast.exponential import K1, K2, K3, K4, K5, exp_minus_half, exp_minus_half_strict

pytestmark = [] if JIT else [pytest.mark.filterwarnings("ignore:.*encountered:RuntimeWarning")]

RESIDUAL = np.random.default_rng(5).normal(0, 1, (HEIGHT, WIDTH, 3)).astype(np.float32)
ANY = st.one_of(ordinary, extreme)


def rendered(splats, width=WIDTH, height=HEIGHT, **options):
    return Renderer(width, height, precision="deterministic", **options).picture(splats, clamp=False)


@settings(max_examples=EXAMPLES, deadline=None)
@given(splat_sets(ANY), st.integers(1, 3), st.sampled_from([None, 1, 8, 9, 16, 31, 64]))
def test_the_sum_is_that_of_the_plain_form(splats, threads, region_rows):
    expected = sum_plain(splats, WIDTH, HEIGHT)
    assert rendered(splats, threads=threads, region_rows=region_rows).tobytes() == expected.tobytes()


@settings(max_examples=EXAMPLES, deadline=None)
@given(splat_sets(ANY, largest=3), st.integers(1, 3))
def test_the_gradients_are_those_of_the_plain_form(splats, threads):
    with np.errstate(all="ignore"):
        expected = gradients_plain(splats, RESIDUAL)
    actual = render_gradients(splats, RESIDUAL, precision="deterministic", threads=threads)
    assert np.array_equal(actual, expected, equal_nan=True)


@pytest.mark.parametrize("name", NAMED)
def test_named_cases_equal_the_plain_form(name):
    assert rendered(NAMED[name]).tobytes() == sum_plain(NAMED[name], WIDTH, HEIGHT).tobytes()


@pytest.mark.parametrize("size", [(1, 1), (1, 23), (23, 1), (15, 2), (16, 3), (17, 5), (33, 31), (65, 70)])
@pytest.mark.parametrize("count", [0, 1, 40])
def test_any_size_and_number(size, count):
    splats = population(40, *size).take(np.arange(count))
    assert rendered(splats, *size, region_rows=8).tobytes() == sum_plain(splats, *size).tobytes()
    C, bound = render_exact_with_bound(splats, *size)
    assert np.all(abs(rendered(splats, *size) - C) <= bound)


def test_thousands_of_splats_on_one_pixel():
    """The order of a sum shows most where terms cancel."""
    rng = np.random.default_rng(3)
    count = 2000 if JIT else 20
    place = np.array([10.4, 9.7, 3.0, 1.0, 2.0])
    packed = np.concatenate([np.tile(place, (count, 1)), rng.normal(0, 100, (count, 3))], axis=1)
    splats = Splats.from_array(packed.astype(np.float32))
    expected = sum_plain(splats, 20, 20)
    assert rendered(splats, 20, 20, region_rows=8).tobytes() == expected.tobytes()
    backwards = splats.take(np.arange(count)[::-1].copy())
    assert rendered(backwards, 20, 20).tobytes() != expected.tobytes()


@settings(max_examples=EXAMPLES, deadline=None)
@given(splat_sets(ANY))
def test_it_is_within_the_bound_of_the_definition(splats):
    C, bound = render_exact_with_bound(splats, WIDTH, HEIGHT)
    with np.errstate(invalid="ignore"):
        outside = abs(rendered(splats) - C) > bound
    assert not outside.any()


SPECIAL = {
    "reciprocals are subnormal": single(3e38, 10.5, 3e38, 0.0, 3e38),
    "1/l22 is subnormal": single(10.5, 3e38, 2.0, 0.0, 3e38),
    "shear is subnormal": single(10.5, 10.5, 3.0, 2e-38, 1.2e-38),
    "l22 is subnormal": single(10.5, 10.5, 3.0, 0.0, 5.88e-39),
    "colours are subnormal": single(10.5, 10.5, 3.0, 0.0, 3.0, (1e-39, -1e-39, 2.0**-149)),
    "infinity minus infinity": single(9.5, 3e38, 1.0, 3e38, 0.5),
    "cancellation": single(9.5, 3e38, 1.0, 3e38, 2.0),
    "minus zero": single(-0.0, -0.0, 3.0, -0.0, 3.0, (-0.0, 0.0, 1.0)),
}
"""Splats that a machine gets wrong if it flushes subnormals to zero, or orders products otherwise."""


@pytest.mark.parametrize("name", SPECIAL)
def test_special_values(name):
    expected = sum_plain(SPECIAL[name], WIDTH, HEIGHT)
    assert rendered(SPECIAL[name]).tobytes() == expected.tobytes()
    C, bound = render_exact_with_bound(SPECIAL[name], WIDTH, HEIGHT)
    assert np.all(abs(expected - C) <= bound)


def on_the_edge():
    """A round splat at (x, y) whose m is K itself at the centre (10.5, 10.5), and the next float beside it."""
    rng = np.random.default_rng(8)
    target = SUPPORT_SQUARED
    while True:
        x = np.float32(10.5) - np.float32(rng.uniform(0.5, 3.2))
        u1 = np.float32(10.5) - x
        y = np.float32(10.5) - np.float32(np.sqrt(np.float64(target) - np.float64(u1) ** 2))
        u2 = np.float32(10.5) - y
        if u1 * u1 + u2 * u2 == target:
            return x, y


def test_the_edge_belongs_to_the_splat():
    x, y = on_the_edge()
    inside, outside = single(x, y, 1.0, 0.0, 1.0), single(np.nextafter(x, np.float32(0)), y, 1.0, 0.0, 1.0)
    for splats, covered in ((inside, True), (outside, False)):
        m = whitened(splats.to_array()[0], WIDTH, HEIGHT)[2][10, 10]
        assert (m == SUPPORT_SQUARED) == covered
        assert bool(rendered(splats)[10, 10].any()) == covered
        assert rendered(splats).tobytes() == sum_plain(splats, WIDTH, HEIGHT).tobytes()


def test_frames_and_counts_follow_the_sum():
    splats = population(30, WIDTH, HEIGHT)
    C = sum_plain(splats, WIDTH, HEIGHT)
    for bit_depth in (8, 10, 16):
        frame = render_frame(splats, WIDTH, HEIGHT, bit_depth, precision="deterministic")
        assert np.array_equal(frame, to_frame(C, bit_depth))
    counts = [np.count_nonzero(weight(whitened(splat, WIDTH, HEIGHT)[2])) for splat in splats.to_array()]
    assert covered_pixels(splats, WIDTH, HEIGHT, precision="deterministic").tolist() == counts


def test_a_sum_that_is_no_number_is_black():
    """Infinity minus infinity: a binary32 sum can leave its range only with colours that no stream holds."""
    huge = [single(5.5, 5.5, 3.0, 0.0, 3.0, (3e38, 3e38, 0.0))] * 2
    splats = huge[0].append(huge[1]).append(single(5.5, 5.5, 3.0, 0.0, 3.0, (-3e38, 0.0, 0.0)))
    splats = splats.append(splats.take(np.array([2])))
    with np.errstate(over="ignore", invalid="ignore"):
        C = rendered(splats, 11, 11)
    assert C[5, 5, 0] == np.inf or np.isnan(C[5, 5, 0])
    frame = render_frame(splats, 11, 11, 8, precision="deterministic")
    assert frame[5, 5].tolist() == [0 if np.isnan(C[5, 5, 0]) else 255, 255, 0]


def test_the_polynomial_is_evaluated_as_written():
    s = np.concatenate([np.linspace(0, SUPPORT_SQUARED, 5001), np.geomspace(2.0**-140, 1, 301)]).astype(np.float32)
    t = s * s
    p = ((K5 * t + (K4 * s + K3)) * t + (K2 * s + K1)) * s + ONE
    p = p * p
    p = p * p
    expected = p * p
    assert np.array_equal(weight(s)[s <= SUPPORT_SQUARED], expected[s <= SUPPORT_SQUARED])
    assert [exp_minus_half_strict(value) for value in s] == expected.tolist()
    if JIT:  # the twin is another function, or this test would compare it with itself
        assert exp_minus_half_strict.__wrapped__ is not exp_minus_half.__wrapped__


def test_the_objective_adds_in_a_stated_order():
    """Loss and gradient from the plain sum alone."""
    target = np.random.default_rng(1).random((HEIGHT, WIDTH, 3), np.float32)
    splats = population(12, WIDTH, HEIGHT)
    e = np.clip(sum_plain(splats, WIDTH, HEIGHT), 0, 1) - target
    loss, gradient = Objective(target, precision="deterministic").evaluate(splats.to_array())
    assert loss == pytest.approx(np.sum(e.astype(np.float64) ** 2) / (WIDTH * HEIGHT), rel=1e-6)
    scaled = gradients_plain(splats, e).astype(np.float64) * (2 / (WIDTH * HEIGHT))
    np.testing.assert_allclose(gradient, scaled, rtol=1e-6)  # scaled before it is rounded once, not after


def test_render_sum_and_render_agree():
    splats = population(10, WIDTH, HEIGHT)
    C = render_sum(splats, WIDTH, HEIGHT, precision="deterministic")
    assert C.dtype == np.float32
    clamped = Renderer(WIDTH, HEIGHT, precision="deterministic").picture(splats)
    assert np.array_equal(np.clip(C, 0, 1), clamped)
