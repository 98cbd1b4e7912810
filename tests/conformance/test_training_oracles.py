"""The oracles of a training step: against automatic differentiation, what their bounds let by, and what they do not.

Legal variants in binary32 lie inside the bounds of every case, small bugs outside those of at least one.
"""

import itertools

import numpy as np
import pytest
from oracle_checks import assert_found, assert_legal, in_blocks, judged

from gsvc_conformance.operations.training import loss_oracle

F4 = np.float32


def test_the_residual_is_the_derivative_of_the_loss():
    rng = np.random.default_rng(3)
    torch = pytest.importorskip("torch", reason="PyTorch is the peer that differentiates the loss")
    picture, target = rng.random((2, 6, 5, 3)).astype(np.float32)
    leaf = torch.tensor(picture, dtype=torch.float64, requires_grad=True)
    loss = ((leaf.clamp(0, 1) - torch.tensor(target)) ** 2).sum(-1).mean()
    loss.backward()
    expected = loss_oracle(picture, target)
    np.testing.assert_allclose(expected["loss"].value, loss.item(), rtol=1e-12)
    np.testing.assert_allclose(expected["residual"].value, leaf.grad, rtol=1e-12)


def flushed(array):
    return np.where(abs(array) < 2.0**-126, F4(0), array).astype(np.float32)


def loss_in_binary32(picture, target, *, backwards=False, by_reciprocal=False):
    pixels = F4(picture.shape[0] * picture.shape[1])
    difference = np.clip(picture, F4(0), F4(1)) - target
    squares = difference * difference
    total = in_blocks(squares[::-1] if backwards else squares)
    factor = F4(2) / pixels
    return {
        "loss": np.array(float(total * (F4(1) / pixels) if by_reciprocal else total / pixels)),
        "residual": difference * factor if by_reciprocal else F4(2) * difference / pixels,
    }


@pytest.mark.parametrize(("backwards", "by_reciprocal"), [(False, False), (False, True), (True, False), (True, True)])
def test_losses_in_any_order_are_legal(backwards, by_reciprocal):
    assert_legal("loss", lambda **v: loss_in_binary32(**v, backwards=backwards, by_reciprocal=by_reciprocal))


def test_a_loss_that_forgets_a_pixel_is_found():
    def forgetful(picture, target):
        picture = picture.copy()
        picture[-1, -1] = target[-1, -1]
        return {"loss": loss_in_binary32(picture, target)["loss"]}

    assert_found("loss", forgetful)


def adan_in_binary32(
    parameters, gradients, m, v, n, previous, steps, rates, units, beta1, beta2, beta3, epsilon, *, form, change=0.0
):
    """One step in binary32 arrays: `form` chooses among arrangements, `change` makes a wrong b2."""
    b1, b2, b3 = F4(beta1), F4(beta2 + change), F4(beta3)
    c1, c2, c3 = F4(1 - beta1), F4(1 - beta2), F4(1 - beta3)
    k = steps[:, None] + 1.0
    of_m, of_v, of_n = 1 - beta1**k, 1 - beta2**k, np.sqrt(1 - beta3**k)
    g = units * gradients
    d = np.where(k == 1, F4(0), g - previous)
    if form == "interpolated":
        new_m, new_v = m + c1 * (g - m), v + c2 * (d - v)
    elif form == "fused":
        new_m, new_v = ((np.float64(b1) * m + np.float64(c1) * g).astype(F4), (np.float64(b2) * v + c2 * d).astype(F4))
    else:
        new_m, new_v = b1 * m + c1 * g, b2 * v + c2 * d
    ahead = g + b2 * d
    new_n = b3 * n + c3 * (ahead * ahead)
    if form == "flushed":
        new_m, new_v, new_n = flushed(new_m), flushed(new_v), flushed(new_n)
    if form == "published":
        denominator = np.sqrt(new_n) / of_n.astype(F4) + F4(epsilon)
        moved = parameters - units * rates / of_m.astype(F4) * new_m / denominator
        moved = moved - units * rates * b2 / of_v.astype(F4) * new_v / denominator
    else:
        denominator = np.sqrt(new_n) * (1 / of_n).astype(F4) + F4(epsilon)
        update = (1 / of_m).astype(F4) * new_m + (beta2 / of_v).astype(F4) * new_v
        moved = parameters - (units * rates) * (update * (F4(1) / denominator))
    outputs = {"parameters": moved, "m": new_m, "v": new_v, "n": new_n, "previous": g}
    return {name: value.astype(F4) for name, value in outputs.items()} | {"steps": steps + 1}


@pytest.mark.parametrize("form", ["plain", "interpolated", "fused", "flushed", "published"])
def test_steps_of_adan_in_any_arrangement_are_legal(form):
    assert_legal("adan_step", lambda **v: adan_in_binary32(**v, form=form))


def test_a_decay_rate_that_is_off_by_a_ten_thousandth_is_found():
    found = judged("adan_step", lambda **v: adan_in_binary32(**v, form="plain", change=1e-4))
    assert {"parameters", "v", "n"} <= set(itertools.chain(*found.values()))


def test_a_step_that_is_off_by_a_hundred_thousandth_is_found():
    def longer(**v):
        outputs = adan_in_binary32(**v, form="plain")
        step = outputs["parameters"] - v["parameters"]
        return {"parameters": (v["parameters"] + step * F4(1 + 1e-5)).astype(F4)}

    assert_found("adan_step", longer)
