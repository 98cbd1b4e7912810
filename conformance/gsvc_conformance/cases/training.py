"""Cases of the loss, the weights and learning rates."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case

F4 = NDArray[np.float32]


def f4(*numbers: Any) -> F4:
    """Numbers or rows as f4."""
    return np.array(numbers, np.float32)


# --- Loss ------------------------------------------------------------------------------------------------------------


@case("core", "loss", flags=["factor", "odd-size"])
def loss_of_a_wide_picture(rng: Draws) -> Inputs:
    """A picture of 19x11 pixels within [0, 1].

    The three channels are added, not averaged, and W x H is not a square: a mean over 3 H W is a third of the loss.
    """
    picture, target = rng.random((2, 11, 19, 3), np.float32)
    expected = yield {"picture": picture, "target": target}
    difference = picture.astype(np.float64) - target
    assert np.isclose(expected["loss"].value, 3 * np.mean(difference**2), rtol=1e-12)
    assert np.allclose(expected["residual"].value, 2 / 209 * difference, rtol=1e-6, atol=1e-12)


@case("core", "loss", flags=["straight-through", "clamp"])
def loss_beyond_black_and_white() -> Inputs:
    """Sums below 0 and above 1, over targets at the ends and inside.

    The loss is that of the clamped sum; its residual passes straight through the clamp, and is 0 over a saturated
    target.
    """
    sums, targets = np.meshgrid([-2.0, -0.25, 0.0, 0.5, 1.0, 1.25, 40.0], [0.0, 0.25, 1.0])
    channels = [1.0, 0.5, -1.0]
    picture = np.stack([sums * c for c in channels], axis=-1).astype(np.float32)
    target = np.stack([targets] * 3, axis=-1).astype(np.float32)
    expected = yield {"picture": picture, "target": target}
    residual = expected["residual"].value
    assert residual[1, 0, 0] < 0 < residual[1, 6, 0]
    assert residual[0, 0, 0] == residual[2, 6, 0] == 0


@case("core", "loss", flags=["factor"])
def loss_of_one_pixel() -> Inputs:
    """One pixel with one wrong channel: the loss is the square of its error and the residual twice the error."""
    expected = yield {"picture": f4([[0.5, 0.25, 1]]), "target": f4([[0.5, 0.75, 1]])}
    assert expected["loss"].value == 0.25
    assert expected["residual"].value.tolist() == [[[0.0, -1.0, 0.0]]]


@case("core", "loss", flags=["factor"])
def loss_of_one_channel() -> Inputs:
    """Only green differs, by a power of two, on 4x2 pixels: all of the arithmetic is exact."""
    picture, target = np.zeros((2, 2, 4, 3), np.float32)
    picture[..., 1] = 0.5
    expected = yield {"picture": picture, "target": target}
    assert expected["loss"].value == 0.25
    assert expected["loss"].bound == 0
    assert np.all(expected["residual"].value[..., 1] == 0.125)


@case("core", "loss", flags=["odd-size"])
def loss_of_the_last_pixel() -> Inputs:
    """Only the last pixel of 17x9 differs: it counts as much as any other."""
    picture, target = np.full((2, 9, 17, 3), 0.5, np.float32)
    picture[-1, -1] = f4(0.75, 0.5, 0.5)
    expected = yield {"picture": picture, "target": target}
    assert np.isclose(expected["loss"].value, 0.0625 / 153, rtol=1e-12)


@case("core", "loss", flags=["straight-through", "clamp", "cancellation"])
def loss_of_bright_sums() -> Inputs:
    """Sums of a hundred million: what a clamp takes from them is not all there when it is added again."""
    expected = yield {"picture": f4([[1e8, 0.5, -1e8], [3e7, 1, 0]]), "target": f4([[0.25, 0.5, 0.75], [0.5, 0.5, 0]])}
    assert np.allclose(expected["residual"].value.ravel(), [0.75, 0, -0.75, 0.5, 0.5, 0], rtol=1e-6)


@case("uncommon", "loss", flags=["empty"])
def loss_of_equal_pictures(rng: Draws) -> Inputs:
    """A picture that equals its target: no loss, and no residual."""
    picture = rng.random((5, 3, 3), np.float32)
    expected = yield {"picture": picture, "target": picture}
    assert expected["loss"].value == 0
    assert not expected["residual"].value.any()


@case("stress", "loss", flags=["clamp", "overflow"])
def loss_of_huge_sums() -> Inputs:
    """Sums up to 1e30 are clamped before they are squared, so that nothing overflows."""
    expected = yield {"picture": f4([[1e30, -1e30, 3e4], [1e20, 0, -1e-30]]), "target": f4([[0.5, 0.5, 1], [0, 1, 0]])}
    assert np.isclose(expected["loss"].value, (0.25 + 0.25 + 1 + 1) / 2)


# --- Weights ---------------------------------------------------------------------------------------------------------


def trained_rows(rng: Draws, count: int) -> F4:
    """Rows as training has them: weights of both signs and very different sizes."""
    values = rng.uniform(-1, 1, (count, 9)).astype(np.float32)
    values[:, :5] *= f4(30, 20, 4, 4, 4)
    values[:, 8] *= np.ldexp(1.0, rng.integers(-13, 4, count))
    return values


@case("core", "weighted_parameters", flags=["factor"])
def weights_multiply_colours(rng: Draws) -> Inputs:
    """Weights of both signs: each colour is multiplied once, and nothing else changes."""
    values = trained_rows(rng, 13)
    expected = yield {"values": values}
    parameters = expected["parameters"].value
    assert np.array_equal(parameters[:, :5], values[:, :5])
    assert not np.array_equal(parameters[:, 5:], values[:, 5:8] * abs(values[:, 8:]))


@case("uncommon", "weighted_parameters", flags=["signed-zero"])
def weight_of_zero() -> Inputs:
    """Weights 0 and -0, and 1: a product of zero has the sign of its factors, and a colour times 1 is the colour."""
    row = [1, 2, 3, 0, 4, 0.5, -0.25, 0.0]
    expected = yield {"values": f4([*row, 0.0], [*row, -0.0], [*row, 1.0])}
    parameters = expected["parameters"].value
    assert np.signbit(parameters[:, 5:]).tolist() == [[False, True, False], [True, False, True], [False, True, False]]


@case("core", "weighted_gradients", flags=["factor"])
def gradients_of_weights(rng: Draws) -> Inputs:
    """Gradients of colours are times w; that of w is the scalar product with the unweighted colour c'."""
    values, gradients = trained_rows(rng, 17), rng.normal(size=(17, 8)).astype(np.float32)
    expected = yield {"values": values, "gradients": gradients}
    found = expected["gradients"].value
    assert np.array_equal(found[:, :5], gradients[:, :5])
    step = values.astype(np.float64)
    step[:, 8] += 1e-3
    rendered = (step[:, 5:8] * step[:, 8:] - values[:, 5:8] * values[:, 8:].astype(np.float64)) * gradients[:, 5:]
    assert np.allclose(found[:, 8], rendered.sum(1) / 1e-3, atol=1e-6)


@case("core", "weighted_gradients", flags=["factor"])
def gradient_of_one_weight() -> Inputs:
    """One splat in small whole numbers: dL/dw = 1 * 4 + 2 * 5 + 3 * 6 = 32, dL/dc' = -2 (4, 5, 6)."""
    expected = yield {"values": f4([7, 8, 1, 0, 1, 1, 2, 3, -2]), "gradients": f4([1, 2, 3, 4, 5, 4, 5, 6])}
    assert expected["gradients"].value.tolist() == [[1, 2, 3, 4, 5, -8, -10, -12, 32]]
    assert not expected["gradients"].bound.any()


@case("uncommon", "weighted_gradients", flags=["empty"])
def gradients_of_zero_weights() -> Inputs:
    """A splat of weight 0 has no gradient by its colour, but one by its weight: it may come back."""
    expected = yield {"values": f4([7, 8, 1, 0, 1, 1, 0.5, 0.25, 0]), "gradients": f4([0, 0, 0, 0, 0, 1, 1, 1])}
    assert expected["gradients"].value[0, 5:].tolist() == [0, 0, 0, 1.75]


# --- Learning rates --------------------------------------------------------------------------------------------------


@case("core", "learning_rates", flags=["schedule"])
def rates_at_the_halvings() -> Inputs:
    """The paper's schedule around its halvings: iteration 19,999 is the last of the first rate."""
    iterations = np.array([0, 1, 19_999, 20_000, 20_001, 39_999, 40_000, 49_999, 60_000], np.int64)
    expected = yield {"iterations": iterations, "rate": 1e-3, "factor": 0.5, "interval": 20_000}
    assert (expected["rates"].value / 1e-3).tolist() == [1, 1, 1, 0.5, 0.5, 0.5, 0.25, 0.25, 0.125]


@case("core", "learning_rates", flags=["schedule"])
def rates_out_of_order() -> Inputs:
    """Another factor and interval, iterations in any order: a rate follows from its iteration alone."""
    iterations = np.array([21, 0, 7, 6, 13, 14, 6, 700], np.int64)
    expected = yield {"iterations": iterations, "rate": 0.018, "factor": 0.9, "interval": 7}
    assert np.allclose(expected["rates"].value[:4], 0.018 * np.array([0.729, 1, 0.9, 1]), rtol=1e-12)


@case("uncommon", "learning_rates", flags=["schedule"])
def rates_that_stay() -> Inputs:
    """Factor 1: the rate never changes."""
    expected = yield {"iterations": np.array([0, 1, 99], np.int64), "rate": 0.25, "factor": 1.0, "interval": 1}
    assert expected["rates"].value.tolist() == [0.25] * 3
