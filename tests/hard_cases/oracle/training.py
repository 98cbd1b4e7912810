"""A step of Adan and learning rates in 60 digits: (10-12) to (10-14)."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from mpmath import mpf, sqrt
from numpy.typing import NDArray

from tests.hard_cases.measuring import Objects, Truth, exactly, precise

F4 = NDArray[np.float32]


def adan_row(theta: Any, g: Any, p: Any, m: Any, v: Any, n: Any, k: int, rate: Any, unit: Any, betas: Any) -> list[Any]:
    """Parameter, m, v, n and the scaled gradient of one number after its step k."""
    b1, b2, b3, epsilon = betas
    scaled = unit * g
    d = scaled - p if k > 1 else mpf(0)
    m = b1 * m + (1 - b1) * scaled
    v = b2 * v + (1 - b2) * d
    n = b3 * n + (1 - b3) * (scaled + b2 * d) ** 2
    update = (m / (1 - b1**k) + b2 * v / (1 - b2**k)) / (sqrt(n) / sqrt(1 - b3**k) + epsilon)
    return [theta - unit * rate * update, m, v, n, scaled]


@precise
def adan_step(
    parameters: F4,
    gradients: F4,
    m: F4,
    v: F4,
    n: F4,
    previous: F4,
    steps: NDArray[np.int64],
    rates: F4,
    units: F4,
    beta1: float,
    beta2: float,
    beta3: float,
    epsilon: float,
) -> Mapping[str, Truth]:
    """(10-13) and (10-14)."""
    betas = [mpf(number) for number in (beta1, beta2, beta3, epsilon)]
    result: Objects = np.empty((5, *parameters.shape), object)
    arrays = [exactly(array) for array in (parameters, gradients, previous, m, v, n)]
    of_rate, of_unit = exactly(rates), exactly(units)
    for row, column in np.ndindex(*parameters.shape):
        numbers = [array[row, column] for array in arrays]
        k = int(steps[row]) + 1
        result[:, row, column] = adan_row(*numbers, k, of_rate[column], of_unit[column], betas)
    names = ("parameters", "m", "v", "n", "previous")
    return {name: Truth(part) for name, part in zip(names, result, strict=True)}


@precise
def learning_rates(iterations: NDArray[np.int64], rate: float, factor: float, interval: int) -> Mapping[str, Truth]:
    """(10-12)."""
    rates = [mpf(rate) * mpf(factor) ** (int(iteration) // interval) for iteration in iterations]
    return {"rates": Truth(np.array(rates, object))}
