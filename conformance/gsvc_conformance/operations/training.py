"""The operations of a training step: the loss, the weights, learning rates and Adan."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gsvc_conformance.distinct import distinct
from gsvc_conformance.expansions import Expansion, certain, exact
from gsvc_conformance.expectations import Bounded, Exact, Expectation
from gsvc_conformance.operation import paired
from gsvc_conformance.running_error import COMPONENTS, Computed, expected, given, rounded_once, stack
from gsvc_ref.rendering.bounds import EPS, ETA

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]
I8 = NDArray[np.int64]
Expected = Mapping[str, Expectation]


def loss_oracle(picture: F4, target: F4) -> Expected:
    """Running error analysis: the difference has one rounding, its square one, the sum of 3 H W any sane order (13-4).

    Multiplying by a rounded 2 / (H W) has two roundings, fewer than the quotient that is allowed for.
    """
    height, width = picture.shape[:2]
    pixels = given(height * width)
    first, inverse, times = distinct(picture.reshape(-1), target.reshape(-1))
    difference = given(np.clip(picture.reshape(-1)[first], 0, 1)) - given(target.reshape(-1)[first])
    loss = (difference * difference).total(0, times=times, rows=height, columns=width) / pixels
    residual = given(2.0) * difference / pixels
    return {"loss": expected(loss, "<f8"), "residual": expected(residual[inverse.reshape(picture.shape)])}


paired(
    "loss",
    "training",
    "The loss of a picture against its target, and dL/dC.",
    inputs="picture: f4 (H, W, 3); target: f4 (H, W, 3)",
    outputs="loss: f8 (); residual: f4 (H, W, 3)",
    equations=("10-1", "10-2", "13-17"),
    rules=("R-10.2-1",),
    oracle=loss_oracle,
)


def weighted_parameters_oracle(values: F4) -> Expected:
    """One product each: exact in binary64, rounded once."""
    wide = values.astype(np.float64)
    products = wide[:, 5:8] * wide[:, 8:]
    return {"parameters": Exact(np.concatenate([values[:, :5], products.astype(np.float32)], axis=1))}


paired(
    "weighted_parameters",
    "training",
    "What is rendered of splats with weights: the colours are w c'.",
    inputs="values: f4 (N, 9)",
    outputs="parameters: f4 (N, 8)",
    equations=("10-10",),
    rules=("R-10.3-2",),
    oracle=weighted_parameters_oracle,
)


def weighted_gradients_oracle(values: F4, gradients: F4) -> Expected:
    """Running error analysis: copies are exact, w G has one rounding, G . c' three products in any order."""
    first, inverse, _ = distinct(values, gradients)
    values, gradients = values[first], gradients[first]
    by_product, color, w = given(gradients[:, 5:]), given(values[:, 5:8]), given(values[:, 8:])
    of_color, of_weight = expected(by_product * w), expected((by_product * color).total(1))
    value = np.concatenate([gradients[:, :5], of_color.value, of_weight.value[:, None]], axis=1)
    bound = np.concatenate([np.zeros((len(values), 5)), of_color.bound, of_weight.bound[:, None]], axis=1)
    return {"gradients": Bounded(value[inverse], bound[inverse])}


paired(
    "weighted_gradients",
    "training",
    "The gradients of colours and weights, from those of their products.",
    inputs="values: f4 (N, 9); gradients: f4 (N, 8)",
    outputs="gradients: f4 (N, 9)",
    equations=("10-11", "13-17"),
    rules=("R-10.3-2",),
    oracle=weighted_gradients_oracle,
)


def learning_rates_oracle(iterations: I8, rate: float, factor: float, interval: int) -> Expected:
    """The rate and the factor rounded, one product per halving: two roundings each, and two of the rate.

    A rate below 2^-800 is stored as 0. A product with a factor up to 1 is never rounded above its other operand.
    """
    distinct_halvings, inverse = np.unique(iterations // interval, return_inverse=True)

    def product(change: float) -> Expansion:
        """The rates where every rounding changes a number by a factor of 1 + change."""
        once = exact(1 + change, COMPONENTS)
        each = exact(factor) * once * once
        of_each = exact(np.minimum(each.near, 1.0)) if change > 0 else each
        return exact(rate) * once * once * of_each.broadcast(distinct_halvings.shape).raised(distinct_halvings)

    lowest, exactly, highest = (product(change) for change in (-EPS, 0.0, EPS))
    value = certain(exactly)
    bound = np.maximum(highest.near - value, value - lowest.near) + ETA
    return {"rates": Bounded(value[inverse], bound[inverse], "<f8")}


paired(
    "learning_rates",
    "training",
    "The learning rates of iterations, which are counted from 0.",
    inputs="iterations: i8 (K,); rate: float; factor: float; interval: int",
    outputs="rates: f8 (K,)",
    equations=("10-12",),
    rules=("R-10.4-1",),
    oracle=learning_rates_oracle,
)


def adan_oracle(
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
) -> Expected:
    """Running error analysis of (10-13) and (10-14).

    Averages may be b old + (1 - b) new or old + (1 - b) (new - old). Decay rates, 1 minus them and the corrections are
    known in binary64 and rounded once each; dividing by a correction allows for multiplying by its rounded reciprocal.
    Both averages are corrected and divided by themselves, and three terms summed in any order, so that two
    subtractions are covered as well as one. Near n = 0 the root's error is the difference of roots, against which
    stands epsilon.
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
    return {
        "parameters": expected(moved[inverse]),
        "m": expected(new_m[inverse]),
        "v": expected(new_v[inverse]),
        "n": expected(new_n[inverse]),
        "previous": expected(g[inverse]),
        "steps": Exact(steps + 1),
    }


def _correction(beta: float, k: I8) -> Expansion:
    """1 - beta^k for k (n, 1)."""
    distinct_k, inverse = np.unique(k, return_inverse=True)
    powers = exact(np.full(len(distinct_k), beta), COMPONENTS).raised(distinct_k)
    return (exact(1.0) - powers)[inverse.reshape(k.shape)]


def _average(b: Computed, c: Computed, old: Computed, new: Computed) -> Computed:
    """The moving average b old + c new with c = 1 - b, in either arrangement."""
    average, interpolated = b * old + c * new, old + c * (new - old)
    return Computed(average.number, np.maximum(average.error, interpolated.error))


paired(
    "adan_step",
    "training",
    "One step of Adan from a given state; every row counts its own steps.",
    inputs="parameters: f4 (N, P); gradients: f4 (N, P); m: f4 (N, P); v: f4 (N, P); n: f4 (N, P); "
    "previous: f4 (N, P); steps: i8 (N,); rates: f4 (P,); units: f4 (P,); "
    "beta1: float; beta2: float; beta3: float; epsilon: float",
    outputs="parameters: f4 (N, P); m: f4 (N, P); v: f4 (N, P); n: f4 (N, P); previous: f4 (N, P); steps: i8 (N,)",
    equations=("10-13", "10-14", "13-17"),
    rules=("R-10.4-2",),
    oracle=adan_oracle,
)
