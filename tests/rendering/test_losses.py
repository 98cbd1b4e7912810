"""The loss of a picture, and that it is the one which training descends."""

import numpy as np
import pytest

from gsvc_base.errors import UsageError
from gsvc_base.splats import Splats
from gsvc_ref.rendering import Objective, loss, render_gradients, render_sum


@pytest.mark.parametrize("size", [(1, 1), (3, 16), (5, 17), (12, 40)])
def test_it_is_the_loss_of_the_objective_to_the_bit(size):
    height, width = size
    rng = np.random.default_rng(0)
    splats = Splats.from_array(
        np.concatenate([rng.uniform(0, width, (9, 2)), rng.uniform(0.5, 3, (9, 3)), rng.uniform(-1, 1, (9, 3))], axis=1)
    )
    target = rng.random((height, width, 3), np.float32)
    found = loss(render_sum(splats, width, height), target)
    value, gradient = Objective(target, 1).evaluate(splats.to_array())
    assert found.loss == value
    np.testing.assert_allclose(gradient, render_gradients(splats, found.residual), rtol=1e-4, atol=1e-6)


def test_values_by_hand():
    picture = np.array([[[0.5, -1.0, 2.0], [0.25, 0.0, np.nan]]], np.float32)
    target = np.array([[[0.25, 0.0, 0.5], [0.25, 0.5, 0.0]]], np.float32)
    found = loss(picture, target)
    assert found.loss == (0.25**2 + 0.5**2 + 0.5**2) / 2
    assert found.residual.tolist() == [[[0.25, 0, 0.5], [0, -0.5, 0]]]
    assert picture[0, 0, 1] == -1  # what was given stays as it was


@pytest.mark.parametrize(
    ("picture", "target"), [((2, 2, 3), (2, 3, 3)), ((2, 2, 1), (2, 2, 1)), ((0, 2, 3), (0, 2, 3)), ((2, 3), (2, 3))]
)
def test_shapes_that_do_not_fit_are_refused(picture, target):
    with pytest.raises(UsageError, match="must be"):
        loss(np.zeros(picture), np.zeros(target))
