"""The Gram matrix of splats: its integrals against rendered products, its twins, and what is solved in it."""

from itertools import pairwise

import numpy as np
import pytest

from gsvc_base.splats import Splats
from gsvc_ref.rendering import Objective, render_sum
from gsvc_ref.training.gram import RIDGE, TOLERANCE, gram, gram_plain, solved_colors, squared_change


def some_splats(count: int = 30, seed: int = 1, side: float = 64) -> np.ndarray:
    rng = np.random.default_rng(seed)
    p = np.empty((count, 8), np.float32)
    p[:, :2] = rng.uniform(0.25 * side, 0.75 * side, (count, 2))
    p[:, 2], p[:, 4] = rng.uniform(1.5, 3, (2, count))
    p[:, 3] = rng.normal(0, 1, count)
    p[:, 5:] = rng.uniform(0, 0.3, (count, 3))
    return p


def dense(matrix, count: int) -> np.ndarray:
    full = np.zeros((count, count))
    for n in range(count):
        row = slice(matrix.starts[n], matrix.starts[n + 1])
        full[n, matrix.columns[row]] = matrix.values[row]
    return full


def test_entries_are_the_integrals_of_products_of_rendered_splats():
    p = some_splats(8)
    matrix = dense(gram(p), len(p))
    pictures = []
    for row in p:
        one = row[None].copy()
        one[:, 5:] = 1
        pictures.append(render_sum(Splats.from_array(one), 64, 64)[..., 0].astype(float))
    for m, first in enumerate(pictures):
        for n, second in enumerate(pictures):
            scale = np.sqrt(matrix[m, m] * matrix[n, n])
            assert abs((first * second).sum() - matrix[m, n]) < 1.2 * TOLERANCE * scale


@pytest.mark.parametrize(("count", "side"), [(0, 64), (1, 64), (200, 90), (150, 3000)])
def test_rows_have_the_bits_of_the_definition(count, side):
    p = some_splats(count, side=side)
    p[: count // 4, 2:5] *= 9  # some that reach far
    p[count // 2 : count // 2 + 3, :2] -= np.float32(2 * side)  # and some outside
    matrix = gram(p)
    assert np.array_equal(dense(matrix, count), gram_plain(p))
    assert np.array_equal(matrix.diagonal, np.diag(gram_plain(p)))


def test_splats_far_beyond_the_cells_still_meet_their_neighbours():
    p = some_splats(20)
    p[:, :2] += np.float32(40_000)
    assert np.array_equal(dense(gram(p), 20), gram_plain(p))


def test_the_matrix_is_symmetric_and_rows_grow_as_they_must():
    p = some_splats(300, side=30)  # more than 32 neighbours each
    matrix = gram(p)
    full = dense(matrix, 300)
    assert len(matrix.values) > 32 * 300 + 32
    assert np.array_equal(full, full.T)


def test_conjugate_gradients_solve_the_system():
    p = some_splats(60)
    matrix = gram(p)
    b = np.random.default_rng(2).normal(0, 1, (60, 3))
    x = solved_colors(matrix, b, 200)
    full = dense(matrix, 60)
    full += RIDGE * np.diag(np.diag(full))
    assert x == pytest.approx(np.linalg.solve(full, b), rel=1e-6, abs=1e-8)


def test_more_steps_take_more_of_the_error():
    p = some_splats(60)
    matrix = gram(p)
    b = np.random.default_rng(2).normal(0, 1, (60, 3))

    def left(steps: int) -> float:
        x = solved_colors(matrix, b, steps)
        return squared_change(matrix, x) + RIDGE * float((matrix.diagonal[:, None] * x * x).sum()) - 2 * (b * x).sum()

    falling = [left(steps) for steps in range(8)]
    assert falling[0] == 0
    assert all(after < before for before, after in pairwise(falling))


def test_nothing_lacks_where_nothing_is_asked_for():
    p = some_splats(10)
    zero = solved_colors(gram(p), np.zeros((10, 3)), 5)
    assert not zero.any()


def test_solved_colours_bring_the_picture_closer():
    p = some_splats(60)
    target = render_sum(Splats.from_array(p), 64, 64)
    wrong = p.copy()
    wrong[:, 5:] *= np.random.default_rng(3).uniform(0.7, 1.3, (60, 3)).astype(np.float32)
    objective = Objective(target, 1)
    loss, gradient = objective.evaluate(wrong)
    b = gradient[:, 5:8] * (-64 * 64 / 2)
    wrong[:, 5:] += solved_colors(gram(wrong), b, 10).astype(np.float32)
    assert objective.loss(wrong) < 0.1 * loss
