"""The operations of a training step: the loss, the weights, learning rates and Adan."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gsvc_base.exact.expansions import Expansion, certain, exact
from gsvc_base.exact.running_error import COMPONENTS
from gsvc_base.exact.training_bounds import adan_step_with_bound, loss_with_bound, weighted_gradients_with_bound
from gsvc_base.rendering.error_models import EPS, ETA, FP32, ErrorModel
from gsvc_conformance.expectations import Bounded, Exact, Expectation
from gsvc_conformance.operation import Values, paired

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]
I8 = NDArray[np.int64]
Expected = Mapping[str, Expectation]


def loss_oracle(picture: F4, target: F4) -> Expected:
    """The running error analysis of `loss_with_bound`."""
    return _loss_by_model(FP32, {}, {"picture": picture, "target": target})


def _loss_by_model(model: ErrorModel, _: Expected, inputs: Values) -> Expected:
    """The same by another error model."""
    outputs = loss_with_bound(**inputs, model=model)
    overflow = model is not FP32
    return {
        "loss": Bounded(*outputs["loss"], "<f8", may_overflow=overflow),
        "residual": Bounded(*outputs["residual"], may_overflow=overflow),
    }


paired(
    "loss",
    "training",
    "The loss of a picture against its target, and dL/dC.",
    inputs="picture: f4 (H, W, 3); target: f4 (H, W, 3)",
    outputs="loss: f8 (); residual: f4 (H, W, 3)",
    equations=("10-1", "10-2", "13-17"),
    rules=("R-10.2-1",),
    oracle=loss_oracle,
    by_model=_loss_by_model,
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
    """The running error analysis of `weighted_gradients_with_bound`."""
    return {"gradients": Bounded(*weighted_gradients_with_bound(values, gradients)["gradients"])}


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


def adan_oracle(steps: I8, **inputs: Any) -> Expected:
    """The running error analysis of `adan_step_with_bound`; steps are counted."""
    outputs = adan_step_with_bound(steps=steps, **inputs)
    return {name: Bounded(*output) for name, output in outputs.items()} | {"steps": Exact(steps + 1)}


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
