"""A hundred thousand steps of gsvc_ref's own optimiser on one parameter for each kind of gradients."""

from dataclasses import dataclass
from functools import cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_ref.training.adan import Adan, AdanSettings

F4 = NDArray[np.float32]

STEPS: Final = 100_000
RATE: Final = 2.0**-10
SETTINGS: Final = AdanSettings()
SAMPLED: Final = (0, 1, 2, 10, 99, 1000, 3000, 4000, 20_000, 60_000, 99_999)
"""Steps before which the whole state is kept."""


@cache
def gradients() -> dict[str, F4]:
    """The gradients of each kind, (STEPS,) f4."""
    k = np.arange(STEPS)
    sign = np.where(k % 2 == 0, 1.0, -1.0)
    growth = np.exp2(-66 + 128 * k / (STEPS - 1))  # from 2^-66 to 2^62, the largest that is allowed
    noise = np.random.default_rng(5).normal(size=STEPS)
    kinds = {
        "constant": np.ones(STEPS),
        "zero": np.zeros(STEPS),
        "alternating": sign,
        "exploding": growth,
        "exploding_and_alternating": sign * growth,
        "exploding_and_random": noise * growth / 6,
        "fading": growth[::-1],
        "bursts": np.where(k % 5000 < 3, 1e6 * sign, 0),
        "at_rate_zero": growth,
    }
    return {name: values.astype(np.float32) for name, values in kinds.items()}


@dataclass(frozen=True)
class Run:
    """The optimiser's trajectory.

    Attributes
    ----------
    path
        (STEPS + 1, kinds) f4, the parameters before the first step and after each.
    inputs
        By sampled step, the inputs of the operation adan_step.
    outputs
        By sampled step, what the optimiser made of them.
    """

    path: F4
    inputs: dict[int, dict[str, Any]]
    outputs: dict[int, dict[str, Any]]


@cache
def run() -> Run:
    """All kinds at once, as the columns of one row."""
    kinds = gradients()
    table = np.stack(list(kinds.values()), axis=1)  # (STEPS, kinds) f4
    rates = np.array([0.0 if name == "at_rate_zero" else RATE for name in kinds], np.float32)
    state, parameters = Adan(1, len(kinds), SETTINGS), np.zeros((1, len(kinds)), np.float32)
    path = np.zeros((STEPS + 1, len(kinds)), np.float32)
    inputs, outputs = {}, {}
    for k in range(STEPS):
        if k in SAMPLED:
            inputs[k] = {
                "parameters": parameters.copy(), "gradients": table[k : k + 1], **_averages(state), "rates": rates,
                "units": np.ones(len(kinds), np.float32), "beta1": SETTINGS.beta1, "beta2": SETTINGS.beta2,
                "beta3": SETTINGS.beta3, "epsilon": SETTINGS.epsilon,
            }  # fmt: skip
        state.step(parameters, table[k : k + 1], rates)
        if k in SAMPLED:
            outputs[k] = {"parameters": parameters.copy(), **_averages(state)}
        path[k + 1] = parameters[0]
    return Run(path, inputs, outputs)


def _averages(state: Adan) -> dict[str, Any]:
    return {name: getattr(state, name).copy() for name in ("m", "v", "n", "previous", "steps")}
