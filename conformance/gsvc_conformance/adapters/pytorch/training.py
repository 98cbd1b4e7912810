"""Steps of training on tensors (sections 10.2 to 10.4, 10.7 and 10.8); autograd finds every gradient."""

from typing import Final

import torch
from torch import Tensor

from gsvc_conformance.adapters.pytorch.device import DEVICE, Array, Arrays, array, tensor

NEW_WEIGHT: Final = 0.01


def straight_through(value: Tensor, x: Tensor) -> Tensor:
    """A value with the gradient of x.

    The usual x + (value - x).detach() rounds: from x = 10^8 it makes 0 of the value 1. Here a zero is added.
    """
    return value.detach() + (x - x.detach())


def loss_of(picture: Tensor, target: Tensor) -> Tensor:
    """(10-1), with the gradient handed straight through the clamp, so that its gradient is (10-2)."""
    height, width, _ = picture.shape
    difference = straight_through(picture.clamp(0, 1), picture) - target
    return (difference * difference).sum() / (height * width)


def loss(picture: Array, target: Array) -> Arrays:
    """Operation: the loss and dL/dC."""
    C = tensor(picture).requires_grad_()
    value = loss_of(C, tensor(target))
    (residual,) = torch.autograd.grad(value, C)
    return {"loss": value.item(), "residual": array(residual, "f4")}


def weighted(values: Tensor) -> Tensor:
    """The parameters that splats in training (N, 9) are rendered by: (10-10)."""
    return torch.cat((values[:, :5], values[:, 5:8] * values[:, 8:]), 1)


def weighted_parameters(values: Array) -> Arrays:
    """Operation: (10-10)."""
    return {"parameters": array(weighted(tensor(values)), "f4")}


def weighted_gradients(values: Array, gradients: Array) -> Arrays:
    """Operation: (10-11), a vector-Jacobian product of (10-10)."""
    splats = tensor(values).requires_grad_()
    (result,) = torch.autograd.grad(weighted(splats), splats, tensor(gradients))
    return {"gradients": array(result, "f4")}


def learning_rates(iterations: Array, rate: float, factor: float, interval: int) -> Arrays:
    """Operation: (10-12), which is torch.optim.lr_scheduler.StepLR(step_size=interval, gamma=factor) in closed form."""
    factors = torch.tensor(factor, dtype=torch.float64, device=DEVICE) ** (tensor(iterations) // interval)
    return {"rates": array(rate * factors, "f8")}


def adan_step(
    parameters: Array,
    gradients: Array,
    m: Array,
    v: Array,
    n: Array,
    previous: Array,
    steps: Array,
    rates: Array,
    units: Array,
    beta1: float,
    beta2: float,
    beta3: float,
    epsilon: float,
) -> Arrays:
    """Operation: (10-13) and (10-14); every row counts its own steps, which no optimiser of PyTorch does."""
    unit, k = tensor(units), tensor(steps)[:, None] + 1
    # 1 - β^k in binary64, rounded once: in binary32 the difference would lose digits.
    correct1, correct2, correct3 = ((1 - beta ** k.double()).float() for beta in (beta1, beta2, beta3))
    g = unit * tensor(gradients)
    d = torch.where(k == 1, 0.0, g - tensor(previous))
    new_m = beta1 * tensor(m) + (1 - beta1) * g
    new_v = beta2 * tensor(v) + (1 - beta2) * d
    new_n = beta3 * tensor(n) + (1 - beta3) * (g + beta2 * d) ** 2
    update = (new_m / correct1 + beta2 * new_v / correct2) / (new_n.sqrt() / correct3.sqrt() + epsilon)
    moved = tensor(parameters) - unit * tensor(rates) * update
    state = {"parameters": moved, "m": new_m, "v": new_v, "n": new_n, "previous": g}
    return {**{name: array(values, "f4") for name, values in state.items()}, "steps": array(k[:, 0], "i8")}


def prune(weights: Array, removed: int) -> Arrays:
    """Operation: the splats of largest |w|; a stable sort keeps equal ones in order, so that the later ones go."""
    order = torch.sort(tensor(weights).abs(), descending=True, stable=True).indices
    return {"survivors": array(order[: len(weights) - removed].sort().values, "i8")}


def compact(survivors: Array, values: Array, m: Array, v: Array, n: Array, previous: Array, steps: Array) -> Arrays:
    """Operation: a gather of all rows of a splat by one index."""
    rows = tensor(survivors)
    state = {"values": values, "m": m, "v": v, "n": n, "previous": previous}
    return {
        **{name: array(tensor(values)[rows], "f4") for name, values in state.items()},
        "steps": array(tensor(steps)[rows], "i8"),
    }


def augment(values: Array, uniforms: Array, width: int, height: int) -> Arrays:
    """Operation: (10-26) and (10-27), after the splats that are there."""
    a = tensor(uniforms)
    x, y, l11, l21, l22 = a[:, 0] * width, a[:, 1] * height, a[:, 2] + 0.5, a[:, 3], a[:, 4] + 0.5
    w = torch.full_like(x, NEW_WEIGHT)
    new = torch.stack((x, y, l11, l21, l22, *a[:, 5:].unbind(1), w), 1)
    return {"values": array(torch.cat((tensor(values), new)), "f4")}
