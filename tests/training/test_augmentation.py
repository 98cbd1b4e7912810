"""The paper's random placement of splats."""

import math

import numpy as np
import pytest

from gsvc_base.errors import UsageError
from gsvc_ref.training import NEW_WEIGHT, random_splats, uniform_numbers
from gsvc_ref.training.augmentation import augment


def generator(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def test_random_splats_have_the_documented_ranges() -> None:
    splats = random_splats(uniform_numbers(4000, generator()), 64, 32)
    x, y = splats.positions.T
    assert 0 <= x.min() < 1 < 63 < x.max() <= 64
    assert 0 <= y.min() < 1 < 31 < y.max() <= 32
    low, high = splats.cholesky.min(axis=0), splats.cholesky.max(axis=0)
    assert (low >= [0.5, 0.0, 0.5]).all()
    assert (low < [0.51, 0.01, 0.51]).all()
    assert (high < [1.5, 1.0, 1.5]).all()
    assert (high > [1.49, 0.99, 1.49]).all()
    assert splats.colors.min() >= 0
    assert splats.colors.max() < 1
    quadrant = np.histogram2d(x, y, bins=2)[0]
    assert np.abs(quadrant - 1000).max() < 5 * math.sqrt(750)


def test_the_same_generator_gives_the_same_numbers() -> None:
    assert uniform_numbers(9, generator(3)).tobytes() == uniform_numbers(9, generator(3)).tobytes()
    assert uniform_numbers(9, generator(3)).tobytes() != uniform_numbers(9, generator(4)).tobytes()
    assert len(random_splats(uniform_numbers(0, generator()), 1, 1)) == 0


def test_new_splats_come_after_the_old_ones_with_a_small_weight() -> None:
    old, uniforms = np.arange(18, dtype=np.float32).reshape(2, 9), uniform_numbers(3, generator())
    values = augment(old, uniforms, 5, 7)
    assert values.shape == (5, 9)
    assert values[:2].tobytes() == old.tobytes()
    assert values[2:, :8].tobytes() == random_splats(uniforms, 5, 7).to_array().tobytes()
    assert values[2:, 8].tolist() == [np.float32(NEW_WEIGHT)] * 3


@pytest.mark.parametrize(("width", "height"), [(0, 2), (2, 0)])
def test_impossible_placements_are_refused(width: int, height: int) -> None:
    with pytest.raises(UsageError, match="cannot place"):
        random_splats(uniform_numbers(1, generator()), width, height)


def test_wrong_numbers_of_splats_are_refused() -> None:
    with pytest.raises(UsageError, match="cannot place -1"):
        uniform_numbers(-1, generator())
    with pytest.raises(UsageError, match=r"\(2, 7\)"):
        random_splats(np.zeros((2, 7), np.float32), 4, 4)
