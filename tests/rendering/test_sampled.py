"""The loss on a lattice of pixels: over all turns that of the whole target, whatever the lattice and the background."""

import numpy as np
import pytest
from render_cases import population

from gsvc_base.arrays import F4
from gsvc_base.errors import UsageError
from gsvc_ref.rendering import Objective, Precision, SampledObjective

LATTICES: tuple[tuple[int, int], ...] = ((1, 1), (2, 1), (1, 2), (2, 2))


@pytest.fixture
def target() -> F4:
    return np.random.default_rng(3).random((24, 38, 3), np.float32)


@pytest.mark.parametrize("precision", ["fast", "deterministic"])
@pytest.mark.parametrize(("down", "right"), LATTICES)
def test_the_turns_together_see_every_pixel(target: F4, down: int, right: int, precision: Precision) -> None:
    splats = population(12, 38, 24).to_array()
    behind, front = splats[:5], splats[5:]
    whole, gradient = Objective(target, 1, precision=precision, background=behind).evaluate(front)
    sampled = SampledObjective(target, 1, precision=precision, background=behind, down=down, right=right)
    found = [sampled.evaluate(front, turn) for turn in range(down * right)]
    assert np.mean([loss for loss, _ in found]) == pytest.approx(whole, rel=1e-5)
    mean = np.mean([by for _, by in found], axis=0)
    np.testing.assert_allclose(mean, gradient, rtol=1e-3, atol=1e-4 * np.abs(gradient).max())
    assert sampled.evaluate(front, down * right)[0] == found[0][0]
    held = SampledObjective(target, 1, precision=precision, down=down, right=right)
    held.hold(behind)
    for turn, (loss, by) in enumerate(found):
        again = held.evaluate(front, turn)
        assert again[0] == loss
        np.testing.assert_array_equal(again[1], by)


def test_each_turn_sees_its_own_pixels(target: F4) -> None:
    splats = population(12, 38, 24).to_array()
    objective = Objective(target, 1)
    objective.loss(splats)
    residual = objective.residual().astype(np.float64)
    sampled = SampledObjective(target, 1, down=2, right=2)
    for turn, (y, x) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1))):
        loss = (residual[y::2, x::2] ** 2).sum(axis=2).mean()
        assert sampled.evaluate(splats, turn)[0] == pytest.approx(loss, rel=1e-5)


@pytest.mark.parametrize(("down", "right"), LATTICES)
def test_a_quarter_of_the_picture(target: F4, down: int, right: int) -> None:
    splats = population(12, 38, 24).to_array()
    objective = Objective(target, 1)
    objective.loss(splats)
    sampled = SampledObjective(target, 1, down=down, right=right)
    sampled.evaluate(splats)
    np.testing.assert_allclose(sampled.quarter(), objective.picture()[::2, ::2], atol=1e-5)


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (7, 1), (5, 5)])
def test_sides_of_one_pixel_and_odd_sides(shape: tuple[int, int]) -> None:
    target = np.full((*shape, 3), 0.5, np.float32)
    splats = population(3, shape[1], shape[0]).to_array()
    objective = Objective(target, 1)
    objective.loss(splats)
    residual = objective.residual().astype(np.float64)
    sampled = SampledObjective(target, 1, down=2, right=2)
    for turn in range(4):
        lattices = [residual[y::2, x::2] for y in range(2) for x in range(2) if residual[y::2, x::2].size]
        loss = (lattices[turn % len(lattices)] ** 2).sum(axis=2).mean()
        assert sampled.evaluate(splats, turn)[0] == pytest.approx(loss, rel=1e-5, abs=1e-9)


def test_threads_do_not_matter(target: F4) -> None:
    splats = population(12, 38, 24).to_array()
    one, two = (SampledObjective(target, threads, down=2, right=2).evaluate(splats, 3) for threads in (1, 2))
    assert one[0] == two[0]
    np.testing.assert_array_equal(one[1], two[1])


@pytest.mark.parametrize(("down", "right"), [(0, 1), (1, 3), (2, -1)])
def test_other_steps_are_refused(target: F4, down: int, right: int) -> None:
    with pytest.raises(UsageError, match="each must be 1 or 2"):
        SampledObjective(target, 1, down=down, right=right)
