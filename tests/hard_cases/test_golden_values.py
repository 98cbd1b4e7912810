"""Golden values are the truth, rounded once: every expected number of small cases against the oracle of 60 digits."""

from math import prod

import numpy as np
import pytest

from gsvc_base.draws import Draws
from gsvc_conformance.case import TIERS, of_operation
from gsvc_conformance.expectations import Bounded
from tests.hard_cases.oracle import losses, metrics, quantization, rendering, training

TRUTHS = {
    "render_sum": rendering.render_sum,
    "render_gradients": rendering.render_gradients,
    "loss": losses.loss,
    "weighted_gradients": losses.weighted_gradients,
    "adan_step": training.adan_step,
    "learning_rates": training.learning_rates,
    "lsq_gradients": quantization.lsq_gradients,
    "commitment": quantization.commitment,
    "metrics": metrics.metrics,
}
WORK = {"render_sum": 1200, "render_gradients": 1200, "metrics": 2000}
"""Maximum work of a case: splats times pixels, or numbers of its inputs; 60 digits are slow."""
FEWEST = {"learning_rates": 10, "metrics": 30}
"""Fewest numbers compared, where 100 would take long."""
NOTHING = 1e-45
"""Error of 60 digits in terms that cancel, relative to the bound."""


def work(inputs):
    arrays = {name: value for name, value in inputs.items() if isinstance(value, np.ndarray)}
    if "parameters" in arrays and ("width" in inputs or "residual" in inputs):
        pixels = prod(inputs["residual"].shape[:2]) if "residual" in inputs else inputs["width"] * inputs["height"]
        return len(arrays["parameters"]) * pixels
    return sum(array.size for array in arrays.values())


@pytest.mark.exhaustive
@pytest.mark.parametrize("operation", TRUTHS)
def test_expected_values_are_the_true_ones_rounded_once(operation):
    compared = 0
    for case in of_operation(operation):
        if case.tier not in TIERS or compared > 300:
            continue
        inputs = next(case.function(**case.arguments, **({} if case.seed is None else {"rng": Draws(case.seed)})))
        if work(inputs) > WORK.get(operation, 400) or any(np.size(value) == 0 for value in inputs.values()):
            continue
        truths = TRUTHS[operation](**inputs)
        for name, expectation in case.operation.oracle(**inputs).items():
            if isinstance(expectation, Bounded):
                truth = truths[name].parts[0]
                cancels = (expectation.value == 0) & (abs(truth) <= NOTHING * expectation.bound)
                wrong = (expectation.value != truth) & ~cancels
                assert not wrong.any(), f"{case.id} {name}: {expectation.value[wrong]} for {truth[wrong]}"
                compared += truth.size
    assert compared >= FEWEST.get(operation, 100)
