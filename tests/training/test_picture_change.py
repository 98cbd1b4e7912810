"""What changes of splats do to the picture, against rendered differences."""

import numpy as np
import pytest
from codec_cases import faint_splats

from gsvc_base.splats import Splats
from gsvc_ref.rendering import render_sum
from gsvc_ref.training.picture_change import picture_change, shape_weights

SIDE = 48


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
    found = picture_change(after, before)[0]
    assert found[part] == pytest.approx(((pictures[1] - pictures[0]) ** 2).sum(), rel=0.05)
    assert np.delete(found, part).max() == 0


def test_weights_of_shapes_tell_what_their_errors_do():
    p = many(30)
    rng = np.random.default_rng(4)
    products = []
    for column in range(3):
        changed = p.copy()
        changed[:, 2 + column] += np.float32(0.01) * rng.choice([-1, 1], 30).astype(np.float32)
        products.append(picture_change(changed, p)[:, 1].sum() / (shape_weights(p)[:, column].sum()))
    assert products == pytest.approx([products[0]] * 3, rel=0.03)
