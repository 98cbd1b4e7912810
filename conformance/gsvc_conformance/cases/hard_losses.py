"""Hard cases of the loss and of weights: `tests/hard_cases` measures them against 60 digits."""

import numpy as np

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases.training import f4

ONE = np.float32(1)


@case("stress", "loss", flags=["hard", "cancellation"])
def hard_loss_near_zero(rng: Draws) -> Inputs:
    """A picture that is one step of binary32 beside its target in each sample: a loss of some 10^-15."""
    target = rng.uniform(0.25, 0.75, (4, 5, 3)).astype(np.float32)
    expected = yield {"picture": np.nextafter(target, ONE), "target": target}
    assert 0 < expected["loss"].value < 1e-13
    assert expected["residual"].value.all()


@case("stress", "loss", flags=["hard", "cancellation"])
def hard_loss_of_white_with_a_dim_pixel() -> Inputs:
    """All white, and one sample of the target a millionth darker: 59 samples of 1 add nothing."""
    picture, target = np.ones((2, 4, 5, 3), np.float32)
    target[2, 3, 1] -= np.float32(2.0**-20)
    expected = yield {"picture": picture, "target": target}
    assert expected["loss"].value == 2.0**-40 / 20


@case("stress", "loss", flags=["hard", "straight-through", "clamp"])
def hard_loss_of_black_with_a_hot_pixel() -> Inputs:
    """Sums a hair below zero over a black target with one hot sample: that one pulls, all others are right."""
    picture, target = np.full((4, 5, 3), -1e-30, np.float32), np.zeros((4, 5, 3), np.float32)
    target[1, 2, 0] = 1
    expected = yield {"picture": picture, "target": target}
    assert expected["loss"].value == 1 / 20
    assert np.count_nonzero(expected["residual"].value) == 1


@case("stress", "weighted_gradients", flags=["hard", "cancellation", "overflow"])
def hard_weights(rng: Draws) -> Inputs:
    """Weights from 1e-30 to 1e30, and colours of 10000 whose products with the gradients cancel but for little."""
    values = rng.uniform(1, 2, (6, 9)).astype(np.float32)
    values[:, 5:8] = f4(1e4, -1e4, 1e-3)
    values[:, 8] = f4(1e-30, -1e-10, -0.0, 1e-40, 1e10, 1e30)
    gradients = rng.normal(size=(6, 8)).astype(np.float32)
    gradients[:, 6] = gradients[:, 5]
    expected = yield {"values": values, "gradients": gradients}
    assert np.all(abs(expected["gradients"].value[:, 8]) < 0.01)


@case("stress", "weighted_parameters", flags=["hard", "subnormal", "signed-zero"])
def hard_products() -> Inputs:
    """Products of weights and colours that are subnormal, ties among subnormal numbers, zero or minus zero."""
    row = [1, 2, 3, 0, 4]
    last = 2.0**-149
    expected = yield {
        "values": f4(
            [*row, 1e-20, -3e-20, 1e-30, 1e-20],
            [*row, last, 3 * last, -5 * last, 0.5],
            [*row, last, -last, 3 * last, 0.25],
            [*row, 2.0**-126, -(2.0**-126), 2.0**-127, 1 - 2.0**-24],
            [*row, -0.0, 0.0, 1.0, -1e-39],
        )
    }
    parameters = expected["parameters"].value
    assert (parameters[1, 5:] / np.float32(last)).tolist() == [0, 2, -2]
    assert np.signbit(parameters[2:, 5:]).tolist() == [[False, True, False], [False, True, False], [False, True, True]]
