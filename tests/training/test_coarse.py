"""Coarse to fine: the rule of sizes, and the objective of a reduced picture in pixels of the full size."""

import numpy as np
import pytest

from gsvc_ref.rendering import Objective
from gsvc_ref.training.coarse import LEAST_SIDE, Sizes, resized, step_for
from gsvc_ref.training.edges import tensor_plain, tensors
from gsvc_ref.training.reduction import block_means


def some_splats(count: int = 20, seed: int = 1, side: int = 64) -> np.ndarray:
    rng = np.random.default_rng(seed)
    p = np.empty((count, 8), np.float32)
    p[:, :2] = rng.uniform(0.2 * side, 0.8 * side, (count, 2))
    p[:, 2], p[:, 4] = rng.uniform(4, 8, (2, count))
    p[:, 3] = rng.normal(0, 1, count)
    p[:, 5:] = rng.uniform(0, 0.2, (count, 3))
    return p


def a_picture(height: int = 64, width: int = 64) -> np.ndarray:
    y, x = np.mgrid[:height, :width].astype(np.float32) / 64
    return np.stack([x, y, (x + y) / 2], axis=2) * np.float32(0.5)


@pytest.mark.parametrize(
    ("width", "height", "splats", "step"),
    [
        (1920, 1080, 5000, 4), (1920, 1080, 5200, 2), (1920, 1080, 20_000, 2), (1920, 1080, 21_000, 1),
        (352, 288, 2000, 1), (352, 288, 200, 4), (LEAST_SIDE * 2 - 1, 4000, 10, 1), (4000, LEAST_SIDE * 2, 10, 2),
        (8, 8, 0, 1),
    ],
)  # fmt: skip
def test_the_step_follows_from_the_pixels_of_a_splat(width, height, splats, step):
    assert step_for(width, height, splats) == step


def test_the_full_size_is_the_objective_itself():
    picture, p = a_picture(), some_splats()
    level, objective = Sizes(picture, 1).of(1), Objective(picture, 1)
    loss, gradient = level.evaluate(p)
    expected, by_objective = objective.evaluate(p)
    assert loss == expected == level.loss(p)
    assert np.array_equal(gradient, by_objective)


@pytest.mark.parametrize("step", [2, 4])
def test_wide_splats_lose_about_as_much_at_a_smaller_size_with_about_the_same_gradient(step):
    picture, p = a_picture(), some_splats()
    sizes = Sizes(picture, 1)
    full, by_full = sizes.of(1).evaluate(p)
    coarse, by_coarse = sizes.of(step).evaluate(p)
    assert coarse == pytest.approx(full, rel=0.02)
    for columns in (slice(0, 2), slice(2, 5), slice(5, 8)):
        difference = np.linalg.norm(by_coarse[:, columns] - by_full[:, columns])
        assert difference < 0.1 * np.linalg.norm(by_full[:, columns])


@pytest.mark.parametrize("step", [2, 4])
def test_the_gradient_is_the_derivative(step):
    """Of splats whose support holds every pixel: where one enters or leaves it, a loss makes a small jump."""
    level, p = Sizes(a_picture(30, 32), 1).of(step), some_splats(5, side=32)
    p[:, 2:5] *= np.float32(4)
    _, gradient = level.evaluate(p)
    for column in range(8):
        width = 0.1 if column < 5 else 1e-2
        for row in range(len(p)):
            ends = []
            for sign in (1, -1):
                q = p.copy()
                q[row, column] += sign * width
                ends.append(level.loss(q))
            assert gradient[row, column] == pytest.approx((ends[0] - ends[1]) / (2 * width), rel=0.02, abs=1e-6)


def test_frozen_splats_have_no_gradient():
    level, p = Sizes(a_picture(), 1).of(2), some_splats()
    frozen = np.arange(len(p)) < 7
    level.freeze(p, frozen)
    _, gradient = level.evaluate(p)
    assert not gradient[frozen].any()
    assert gradient[~frozen].any(axis=1).all()
    level.thaw()
    assert level.evaluate(p)[1][frozen].any()


def test_new_splats_stand_where_the_picture_lacks_something():
    picture = np.zeros((128, 128, 3), np.float32)
    picture[80:112, 16:48] = 0.8
    level = Sizes(picture, 1).of(4)
    level.loss(np.zeros((0, 8), np.float32))
    new = level.new_splats(30, 60, np.random.default_rng(0))
    assert ((new[:, 0] >= 16) & (new[:, 0] <= 48) & (new[:, 1] >= 80) & (new[:, 1] <= 112)).all()
    assert np.median(new[:, 2] * new[:, 4]) == pytest.approx(0.165**2 * 128 * 128 / 60, rel=0.01)


def test_sizes_are_made_once_and_may_begin_with_a_given_objective():
    picture = a_picture()
    objective = Objective(picture, 1)
    sizes = Sizes(picture, 1, full=objective)
    assert sizes.of(2) is sizes.of(2)
    p = some_splats()
    sizes.of(1).loss(p)
    assert np.array_equal(objective.residual(), objective.picture() - picture)
    assert objective.residual().any()


def test_resized_parameters_come_back():
    p = some_splats()
    assert resized(p, 1) is p
    assert np.array_equal(resized(resized(p, 0.25), 4), p)
    assert np.array_equal(resized(p, 0.5)[:, 5:], p[:, 5:])


def test_block_means_keep_a_flat_picture():
    flat = np.full((13, 10, 3), 0.3, np.float32)
    assert np.array_equal(block_means(flat, 4), np.full((4, 3, 3), 0.3, np.float32))
    assert block_means(flat, 1) is flat


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (3, 2), (24, 31)])
def test_the_tensor_at_a_pixel_is_that_of_the_whole_picture(shape):
    picture = np.random.default_rng(1).random((*shape, 3)).astype(np.float32)
    y, x = (index.ravel() for index in np.mgrid[: shape[0], : shape[1]])
    assert np.array_equal(tensors(picture, x, y).reshape(*shape, 3), tensor_plain(picture))
