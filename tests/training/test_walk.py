"""The walk by L-BFGS: the pull and its derivative, and the bounds of shapes."""

import numpy as np
import pytest
from codec_cases import faint_splats

from gsvc_base.splats import Splats
from gsvc_ref.rendering import render_sum
from gsvc_ref.training.coordinates import moved, to_coordinates, to_parameters
from gsvc_ref.training.loop import MIN_FACTOR
from gsvc_ref.training.walk import MOST_SHEAR, add_pull, hold_at_bounds, keep_shapes, pull_plain

SIDE = 48


def some_splats(count: int = 40, seed: int = 1) -> np.ndarray:
    return faint_splats(count, seed, SIDE)


def test_the_pull_has_the_value_and_the_derivative_of_its_definition():
    start = to_coordinates(some_splats())
    z = moved(start, np.random.default_rng(2).normal(0, 0.2, start.shape))
    weights = np.random.default_rng(3).uniform(0, 0.1, len(z))
    weights[::4] = 0
    gradient = np.zeros_like(z)
    pull = add_pull(z, start, weights, gradient)
    expected, by_definition = pull_plain(z, start, weights)
    assert pull == pytest.approx(expected, rel=1e-12)
    assert gradient == pytest.approx(by_definition, rel=1e-9, abs=1e-9)
    for column in range(8):
        step = np.zeros_like(z)
        step[:, column] = 1e-4
        slope = (pull_plain(moved(z, step), start, weights)[0] - pull_plain(moved(z, -step), start, weights)[0]) / 2e-4
        assert gradient[:, column].sum() == pytest.approx(slope, rel=1e-4, abs=1e-5)


def test_the_pull_of_a_small_change_is_the_error_that_it_makes():
    p = some_splats(1)
    p[:, :2] = SIDE / 2
    before = render_sum(Splats.from_array(p), SIDE, SIDE).astype(float)
    start = to_coordinates(p)
    step = np.array([[0.02, -0.03, 0.02, 0.03, 0.02, 1.0, -0.5, 0.3]])
    z = moved(start, step)
    after = render_sum(Splats.from_array(to_parameters(z)), SIDE, SIDE).astype(float)
    pull = add_pull(z, start, np.ones(1), np.zeros((1, 8)))
    assert pull == pytest.approx(255**2 * ((after - before) ** 2).sum(), rel=0.1)


def test_shapes_are_kept_in_bounds():
    z, step = to_coordinates(some_splats(4)), np.full((4, 8), 0.1)
    step[0, 2] = -9
    step[1, 4] = 300
    step[3, 2:5] = 0
    z[3, 2] = -9  # smaller than any may become, but its shape does not move
    intended = moved(z, step)
    following, made = intended.copy(), step.copy()
    keep_shapes(z, following, made)
    q = to_parameters(following)
    assert q[0, 2] == pytest.approx(MIN_FACTOR)
    assert q[0, 4] == pytest.approx(MIN_FACTOR)
    assert following[1, 4] == MOST_SHEAR
    assert np.array_equal(following[2:], intended[2:])
    assert np.array_equal(made[2:], step[2:])
    assert moved(z, made)[:, 2:] == pytest.approx(following[:, 2:], rel=1e-12)


def test_what_pushes_over_a_bound_is_no_gradient():
    z = to_coordinates(some_splats(4))
    z[0, 2:4] = np.log(float(MIN_FACTOR)) * 2**0.5, 0.0  # both factors at their least
    z[1, 4] = -MOST_SHEAR
    gradient = np.ones((4, 8))
    hold_at_bounds(z, gradient)  # m and r are to fall alike: l11 is to shrink, l22 to stay
    assert gradient[0, 2:4] == pytest.approx(0, abs=1e-12)
    assert gradient[1, 4] == 0
    assert np.array_equal(gradient[2:], np.ones((2, 8)))
    z[1, 4], gradient[1, 4] = MOST_SHEAR, 1.0
    hold_at_bounds(z, gradient)
    assert gradient[1, 4] == 1  # that leads back
