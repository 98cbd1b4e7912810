"""Coarse to fine: the rule of sizes, the objective of a reduced picture in pixels of the full size, and edges."""

import numpy as np
import pytest

from gsvc_ref.encoder.main.edges import edge_splats, structure_tensor
from gsvc_ref.encoder.main.target import MIN_REDUCED_SIDE, Reduced, resized, step_for
from gsvc_ref.rendering import Objective
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


def reduced(picture: np.ndarray, step: int) -> tuple[Reduced, Objective]:
    small = block_means(picture, step)
    objective = Objective(small, 1)
    return Reduced(objective, small, step), objective


@pytest.mark.parametrize(
    ("width", "height", "splats", "step"),
    [
        (1920, 1080, 5000, 4), (1920, 1080, 5200, 2), (1920, 1080, 20_000, 2), (1920, 1080, 21_000, 1),
        (352, 288, 2000, 1), (352, 288, 200, 4), (MIN_REDUCED_SIDE * 2 - 1, 4000, 10, 1),
        (4000, MIN_REDUCED_SIDE * 2, 10, 2), (8, 8, 0, 1),
    ],
)  # fmt: skip
def test_the_step_follows_from_the_pixels_of_a_splat(width, height, splats, step):
    assert step_for(width, height, splats) == step


def test_the_full_size_is_the_objective_itself():
    picture, p = a_picture(), some_splats()
    loss, gradient = reduced(picture, 1)[0].evaluate(p)
    expected, by_objective = Objective(picture, 1).evaluate(p)
    assert loss == expected
    assert np.array_equal(gradient, by_objective)


@pytest.mark.parametrize("step", [2, 4])
def test_wide_splats_lose_about_as_much_at_a_smaller_size_with_about_the_same_gradient(step):
    picture, p = a_picture(), some_splats()
    full, by_full = reduced(picture, 1)[0].evaluate(p)
    coarse, by_coarse = reduced(picture, step)[0].evaluate(p)
    assert coarse == pytest.approx(full, rel=0.02)
    for columns in (slice(0, 2), slice(2, 5), slice(5, 8)):
        difference = np.linalg.norm(by_coarse[:, columns] - by_full[:, columns])
        assert difference < 0.1 * np.linalg.norm(by_full[:, columns])


@pytest.mark.parametrize("step", [2, 4])
def test_the_gradient_is_the_derivative(step):
    """Of splats whose support holds every pixel: where one enters or leaves it, a loss makes a small jump."""
    size, p = reduced(a_picture(30, 32), step)[0], some_splats(5, side=32)
    p[:, 2:5] *= np.float32(4)
    _, gradient = size.evaluate(p)
    for column in range(8):
        width = 0.1 if column < 5 else 1e-2
        for row in range(len(p)):
            ends = []
            for sign in (1, -1):
                q = p.copy()
                q[row, column] += sign * width
                ends.append(size.evaluate(q)[0])
            assert gradient[row, column] == pytest.approx((ends[0] - ends[1]) / (2 * width), rel=0.02, abs=1e-6)


def test_new_splats_stand_where_the_picture_lacks_something():
    picture = np.zeros((128, 128, 3), np.float32)
    picture[80:112, 16:48] = 0.8
    size, objective = reduced(picture, 4)
    objective.loss(np.zeros((0, 8), np.float32))
    new = size.new_splats(30, 60, np.random.default_rng(0))
    assert ((new[:, 0] >= 16) & (new[:, 0] <= 48) & (new[:, 1] >= 80) & (new[:, 1] <= 112)).all()
    assert np.median(new[:, 2] * new[:, 4]) == pytest.approx(0.165**2 * 128 * 128 / 60, rel=0.01)


def test_resized_parameters_come_back():
    p = some_splats()
    assert resized(p, 1) is p
    assert np.array_equal(resized(resized(p, 0.25), 4), p)
    assert np.array_equal(resized(p, 0.5)[:, 5:], p[:, 5:])


def test_block_means_keep_a_flat_picture():
    flat = np.full((13, 10, 3), 0.3, np.float32)
    assert np.array_equal(block_means(flat, 4), np.full((4, 3, 3), 0.3, np.float32))
    assert block_means(flat, 1) is flat


def test_new_splats_lie_along_edges():
    picture = np.zeros((64, 64, 3), np.float32)
    picture[:, 32:] = 1.0
    tensor = structure_tensor(picture)
    assert tensor[5:60, 31, 0].min() > 0.01
    assert not tensor[..., 1:].any()
    new = edge_splats(tensor, np.abs(picture - 0.5), 40, 60, np.random.default_rng(1))
    at_edge, away = np.abs(new[:, 0] - 32) < 1.5, np.abs(new[:, 0] - 32) > 5
    np.testing.assert_allclose(new[away, 2], new[away, 4], rtol=1e-3)
    assert (new[at_edge, 4] > 3 * new[at_edge, 2]).all()
