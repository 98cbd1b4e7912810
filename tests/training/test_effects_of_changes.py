"""What changes of splats do to the picture, against rendered differences, and the steps that follow from it."""

import math

import numpy as np
import pytest
from codec_cases import faint_splats

from gsvc_base.splats import Splats
from gsvc_ref.paper import RvqSettings
from gsvc_ref.rendering import render_sum
from gsvc_ref.training.block_quantizer import enough_codewords
from gsvc_ref.training.effects import FIXED_STEPS, effects, shape_error, shape_weights, steps_for
from gsvc_ref.training.settings import BlockSettings

SIDE = 48
BLOCK = BlockSettings(position_step=0.1, cholesky_step=0.1)


def a_splat(**changes: float) -> np.ndarray:
    p = np.array([[24.3, 23.8, 4.0, 1.0, 3.0, 0.4, 0.2, 0.3]], np.float32)
    for column, change in changes.items():
        p[0, int(column[1:])] += np.float32(change)
    return p


def many(count: int = 200) -> np.ndarray:
    return faint_splats(count, 2, SIDE)


@pytest.mark.parametrize(
    ("part", "changes"),
    [
        (0, {"c0": 0.1}), (0, {"c1": -0.1}), (0, {"c0": 0.07, "c1": 0.05}), (1, {"c2": 0.1}), (1, {"c3": 0.1}),
        (1, {"c4": 0.1}), (1, {"c2": 0.05, "c3": -0.1, "c4": 0.1}), (2, {"c5": 0.02, "c7": -0.01}),
    ],
)  # fmt: skip
def test_an_effect_is_the_squared_difference_of_the_pictures(part, changes):
    before, after = a_splat(), a_splat(**changes)
    pictures = [render_sum(Splats.from_array(p), SIDE, SIDE).astype(float) for p in (before, after)]
    found = effects(after, before)[0]
    assert found[part] == pytest.approx(((pictures[1] - pictures[0]) ** 2).sum(), rel=0.05)
    assert np.delete(found, part).max() == 0


def test_steps_add_about_the_error_that_they_may():
    p = many()
    may = 0.02
    settings = steps_for(p, None, may, BLOCK)
    steps = settings.position_step, settings.cholesky_step
    rng = np.random.default_rng(3)
    for part, (columns, step) in enumerate(zip((slice(0, 2), slice(2, 5)), steps, strict=True)):
        assert math.frexp(step)[0] == 0.5  # a power of two
        rounded = p.copy()
        shape = rounded[:, columns].shape
        rounded[:, columns] += rng.uniform(-step / 2, step / 2, shape).astype(np.float32)
        assert may / 5 < effects(rounded, p)[:, part].sum() < 1.2 * may


def test_what_may_not_change_takes_no_share_of_the_error():
    p = many()
    few = np.zeros((len(p), 3), np.bool_)
    few[:20] = True
    finer, coarser = steps_for(p, None, 0.02, BLOCK), steps_for(p, few, 0.02, BLOCK)
    assert coarser.position_step > finer.position_step
    assert coarser.cholesky_step > finer.cholesky_step
    none = steps_for(p, np.zeros_like(few), 0.02, BLOCK)
    assert (none.position_step, none.cholesky_step) == (FIXED_STEPS[1], FIXED_STEPS[1])
    assert steps_for(p, None, 0.0, BLOCK).position_step == FIXED_STEPS[0]
    assert steps_for(p, None, 0.02, BlockSettings()) == BlockSettings()  # steps that are not fixed stay free


def test_weights_of_shapes_tell_what_their_errors_do():
    p = many(30)
    rng = np.random.default_rng(4)
    products = []
    for column in range(3):
        changed = p.copy()
        changed[:, 2 + column] += np.float32(0.01) * rng.choice([-1, 1], 30).astype(np.float32)
        products.append(shape_error(changed, p) / (shape_weights(p)[:, column].sum()))
    assert products == pytest.approx([products[0]] * 3, rel=0.03)


@pytest.mark.parametrize(
    ("count", "zero", "expected"),
    [(3, False, (3,)), (8, False, (8,)), (9, False, (8, 8)), (3, True, (4,)), (7, True, (8,)), (8, True, (8, 8))],
)
def test_few_colours_take_a_codeword_each(count, zero, expected):
    assert enough_codewords(RvqSettings(codewords=(8, 8), zero_codeword=zero), count) == expected
