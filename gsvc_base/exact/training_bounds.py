"""What a step of training computes, exactly, and how far a binary32 implementation may be from it (spec.md 13.6).

Each function takes the inputs of its operation and returns its outputs by name: the true numbers, rounded once to
binary64, and bounds of the same shape, both f8. The equations are evaluated operation by operation, each with the error
that the error model allows it (13-17).
"""

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4, I8
from gsvc_base.exact.distinct import distinct
from gsvc_base.exact.expansions import Expansion, exact
from gsvc_base.exact.running_error import COMPONENTS, Computed, given, rounded_once, stack, with_bound
from gsvc_base.rendering.error_models import FP32, ErrorModel

WithBound = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Numbers and their bounds, f8 of one shape."""


def loss_with_bound(picture: F4, target: F4, model: ErrorModel = FP32) -> dict[str, WithBound]:
    """The loss (10-1), (), and the residual (10-2), (H, W, 3), of a picture against its target; R-10.2-1.

    The difference has one rounding, its square one, the sum of 3 H W any sane order (13-4). Multiplying by a rounded
    2 / (H W) has two roundings, fewer than the quotient that is allowed for.
    """
    height, width = picture.shape[:2]
    pixels = given(height * width)
    first, inverse, times = distinct(picture.reshape(-1), target.reshape(-1))
    clamped, wanted = np.clip(picture.reshape(-1)[first], 0, 1), target.reshape(-1)[first]
    difference = given(clamped, model=model) - given(wanted, model=model)
    loss = (difference * difference).total(0, times=times, rows=height, columns=width) / pixels
    residual = given(2.0, model=model) * difference / pixels
    return {"loss": with_bound(loss), "residual": with_bound(residual[inverse.reshape(picture.shape)])}


def weighted_gradients_with_bound(values: F4, gradients: F4) -> dict[str, WithBound]:
    """The gradients (N, 9) of colours and weights (10-11) for values (N, 9) and gradients (N, 8); R-10.3-2.

    Copies are exact, w G has one rounding, G . c' three products in any order.
    """
    first, inverse, _ = distinct(values, gradients)
    values, gradients = values[first], gradients[first]
    by_product, color, w = given(gradients[:, 5:]), given(values[:, 5:8]), given(values[:, 8:])
    of_color, of_weight = with_bound(by_product * w), with_bound((by_product * color).total(1))
    value = np.concatenate([gradients[:, :5], of_color[0], of_weight[0][:, None]], axis=1)
    bound = np.concatenate([np.zeros((len(values), 5)), of_color[1], of_weight[1][:, None]], axis=1)
    return {"gradients": (value[inverse], bound[inverse])}


def adan_step_with_bound(
    parameters: F4,
    gradients: F4,
    m: F4,
    v: F4,
    n: F4,
    previous: F4,
    steps: I8,
    rates: F4,
    units: F4,
    beta1: float,
    beta2: float,
    beta3: float,
    epsilon: float,
) -> dict[str, WithBound]:
    """A step of Adan on arrays of the inputs of `adan_step`, (10-13) and (10-14); R-10.4-2.

    Averages may be b old + (1 - b) new or old + (1 - b) (new - old). Decay rates, 1 minus them and the corrections are
    known in binary64 and rounded once each; dividing by a correction allows for multiplying by its rounded reciprocal.
    Both averages are corrected and divided by themselves, and three terms summed in any order, so that two
    subtractions are covered as well as one. Near n = 0 the root's error is the difference of roots, against which
    stands epsilon. All outputs are (N, P); the steps are one more than they were.
    """
    first, inverse, _ = distinct(parameters, gradients, m, v, n, previous, steps)
    parameters, gradients, m, v, n, previous = (rows[first] for rows in (parameters, gradients, m, v, n, previous))
    k = steps[first, None] + 1
    b1, b2, b3 = rounded_once(beta1), rounded_once(beta2), rounded_once(beta3)
    c1, c2, c3 = (rounded_once(_correction(beta, np.ones((1, 1), np.int64))) for beta in (beta1, beta2, beta3))
    g = given(gradients) * given(units)
    d = g - given(previous)
    # A fused g - fl(g) is the rounding error of g.
    d = Computed(exact(np.zeros(g.error.shape)), g.error).where(k == 1, d)
    new_m = _average(b1, c1, given(m), g)
    new_v = _average(b2, c2, given(v), d)
    ahead = g + b2 * d
    new_n = _average(b3, c3, given(n), ahead * ahead)
    denominator = new_n.sqrt() / rounded_once(_correction(beta3, k).sqrt()) + rounded_once(epsilon)
    rate = given(rates) * given(units)
    by_m = rate * (new_m / rounded_once(_correction(beta1, k)) / denominator)
    by_v = rate * (b2 * (new_v / rounded_once(_correction(beta2, k))) / denominator)
    moved = stack(given(parameters), -by_m, -by_v).total(0)
    outputs = {"parameters": moved, "m": new_m, "v": new_v, "n": new_n, "previous": g}
    return {name: with_bound(output[inverse]) for name, output in outputs.items()}


def _correction(beta: float, k: I8) -> Expansion:
    """1 - beta^k for k (n, 1)."""
    distinct_k, inverse = np.unique(k, return_inverse=True)
    powers = exact(np.full(len(distinct_k), beta), COMPONENTS).raised(distinct_k)
    return (exact(1.0) - powers)[inverse.reshape(k.shape)]


def _average(b: Computed, c: Computed, old: Computed, new: Computed) -> Computed:
    """The moving average b old + c new with c = 1 - b, in either arrangement."""
    average, interpolated = b * old + c * new, old + c * (new - old)
    return Computed(average.number, np.maximum(average.error, interpolated.error))
