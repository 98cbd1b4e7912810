"""Steps of Adan and learning rates as they get written, in binary32."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gsvc_conformance.operation import Values
from tests.hard_cases.measuring import Variant

F4 = NDArray[np.float32]


def adan(form: str) -> Variant:
    """A step of Adan in binary32 that differs from (10-13) and (10-14) in one thing."""

    def step(
        parameters: F4, gradients: F4, m: F4, v: F4, n: F4, previous: F4, steps: NDArray[np.int64], rates: F4,
        units: F4, beta1: float, beta2: float, beta3: float, epsilon: float,
    ) -> Values:  # fmt: skip
        b1, b2, b3, eps = (np.float32(number) for number in (beta1, beta2, beta3, epsilon))
        c1, c2, c3 = (np.float32(1 - beta) for beta in (beta1, beta2, beta3))
        k: Any = steps[:, None] + 1
        of_m, of_v, of_n = (np.float32(1 - np.float64(beta) ** k) for beta in (beta1, beta2, beta3))
        if form == "powers of rounded decay rates":
            of_m, of_v, of_n = (np.float32(1 - np.float64(b) ** k) for b in (b1, b2, b3))
        g = units * gradients
        d = np.where(k == 1, np.float32(0), g - previous)
        new_m, new_v = b1 * m + c1 * g, b2 * v + c2 * d
        if form == "gradients averaged one by one":
            new_v = (b2 * v + c2 * g) - c2 * np.where(k == 1, g, previous)
        ahead = g + b2 * d
        new_n = b3 * n + c3 * (ahead * ahead)
        if form == "plain sums":
            new_n = (b3 * (n / c3) + ahead * ahead) * c3
        root = np.sqrt(new_n) / np.sqrt(of_n)
        update = (new_m / of_m + b2 * new_v / of_v) / (root + eps)
        moved = parameters - units * rates * update
        if form == "parameters in units of their rate":
            moved = (parameters / rates - units * update) * rates
        return {"parameters": moved, "m": new_m, "v": new_v, "n": new_n, "previous": g, "steps": steps + 1}

    return step


def rates_in_binary32(iterations: NDArray[np.int64], rate: float, factor: float, interval: int) -> Values:
    """The number of intervals as a quotient of binary32 numbers."""
    intervals = np.floor(iterations.astype(np.float32) / np.float32(interval))
    return {"rates": rate * factor ** intervals.astype(np.float64)}
