"""Adan, the optimiser of all splat parameters (Xie et al., "Adan: Adaptive Nesterov Momentum", 2022).

For a learned value theta with gradient g, k counting its steps from 1, and g_prev = g at k = 1::

    d = g - g_prev
    m = b1 m + (1 - b1) g
    v = b2 v + (1 - b2) d
    n = b3 n + (1 - b3) (g + b2 d)^2                                                                  (10-13)
    theta -= rate * (m / (1 - b1^k) + b2 v / (1 - b2^k)) / (sqrt(n) / sqrt(1 - b3^k) + epsilon)             (10-14)

No weight decay, no clipping, no restart. A learned value may have another unit than the parameter it stands for:
parameter = unit * theta, so g = unit * dL/dparameter, and the parameter moves by unit times the step.

This is R-10.4-2 of spec.md. `adan_step_plain` states every binary32 operation; the compiled step gives the same bits.

All numbers stay finite for gradients g of up to 2^62: (1 + 2 b2)^2 2^124 is below 2^128. Past that n becomes infinite,
which `Adan.step` refuses. Where b1^2, b2^2 and (b2 / (1 + b2))^2 are below b3, no sequence of gradients makes a step
longer than a fixed multiple of the rate: 1.21 for the defaults, 2.33 for those of preset `quick`.
"""

import copy
import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_base.arrays import F4, I8
from gsvc_base.checks import check_types
from gsvc_base.errors import UsageError
from gsvc_base.portable import log2
from gsvc_ref._jit import kernel

State = tuple[F4, F4, F4, F4, I8]

ROWS_AT_ONCE: Final = 16
"""Maximum number of rows that the compiled step takes together, to fill vector lanes."""


@dataclass(frozen=True)
class AdanSettings:
    """Decay rates b1, b2, b3 in [0, 1), and epsilon > 0 outside the root; the defaults are the authors'."""

    beta1: float = 0.98
    beta2: float = 0.92
    beta3: float = 0.99
    epsilon: float = 1e-8

    def __post_init__(self) -> None:
        check_types(self)
        if not all(0 <= beta < 1 for beta in (self.beta1, self.beta2, self.beta3)) or not self.epsilon > 0:
            raise UsageError(f"{self} is out of range: each beta must be in [0, 1) and epsilon above 0")


class Adan:
    """Optimiser state of an (N, P) array of parameters; every row counts its own steps."""

    def __init__(self, rows: int, columns: int, settings: AdanSettings | None = None) -> None:
        if rows < 0 or columns < 1:
            raise UsageError(f"Adan for {rows} rows and {columns} columns; give at least 0 rows and 1 column")
        self.settings = settings or AdanSettings()
        self.steps = np.zeros(rows, np.int64)  # (N,) i8
        self.m, self.v, self.n, self.previous = np.zeros((4, rows, columns), np.float32)  # (N, P) f4 each
        self._coefficients = _coefficients(self.settings)
        self._corrections = _corrections(self.settings, 64)
        self._settled = _settled(self.settings)

    def step(
        self,
        parameters: F4,  # (N, P) f4 in C order; changed
        gradients: F4,  # (N, P) f4, dL/dparameter
        rates: ArrayLike,  # (P,), in units of the learned values
        *,
        units: ArrayLike = 1.0,  # (P,) or a number: parameter = unit * learned value
        row_factors: ArrayLike | None = None,  # (N,) f4 on the rate of each row, such as a splat's size; None is 1
        row_columns: ArrayLike = True,  # (P,) bool: the columns that row_factors apply to
    ) -> None:
        """Move the parameters by one step, in place."""
        rows, columns = self.m.shape
        grad = np.ascontiguousarray(gradients, np.float32)
        if parameters.dtype != np.float32 or not parameters.flags.c_contiguous:
            raise UsageError(
                f"parameters are {parameters.dtype}; they must be float32 in C order, to be changed in place"
            )
        if parameters.shape != self.m.shape or grad.shape != self.m.shape:
            shapes = f"parameters have shape {parameters.shape} and gradients {grad.shape}"
            raise UsageError(f"{shapes}; this state is for {self.m.shape}: use take and append")
        unit = _row(units, columns, np.float32)
        rate = _row(rates, columns, np.float32) * unit  # (P,) f4
        scaled = _row(row_columns, columns, np.bool_)
        factors = np.ones(rows, np.float32) if row_factors is None else np.ascontiguousarray(row_factors, np.float32)
        if factors.shape != (rows,):
            raise UsageError(f"row_factors have shape {factors.shape}; they must be ({rows},)")

        oldest = int(self.steps.max(initial=0)) + 1
        if len(self._corrections) <= min(oldest, self._settled):
            self._corrections = _corrections(self.settings, min(2 * oldest, self._settled))
        zero = np.float32(0)
        _step(
            parameters.reshape(-1), grad, self.m.reshape(-1), self.v.reshape(-1), self.n.reshape(-1),
            self.previous.reshape(-1), unit, np.where(scaled, rate, zero), np.where(scaled, zero, rate), factors,
            self.steps, self._coefficients, self._corrections,
        )  # fmt: skip
        if not self.n.max(initial=0) < np.inf:
            raise UsageError("a gradient is NaN or too large to be squared; training has diverged, lower the rates")

    @property
    def state(self) -> State:
        """The arrays m, v, n, previous and steps of all rows."""
        return self.m, self.v, self.n, self.previous, self.steps

    def with_state(self, m: F4, v: F4, n: F4, previous: F4, steps: I8) -> "Adan":
        """The same optimiser with the state of other rows."""
        other = copy.copy(self)
        other.m, other.v, other.n, other.previous, other.steps = m, v, n, previous, steps
        return other

    def append(self, count: int) -> "Adan":
        """The state with `count` rows at its end that have not taken a step."""
        new = np.zeros((count, self.m.shape[1]), np.float32)
        m, v, n, previous = (np.append(rows, new, axis=0) for rows in (self.m, self.v, self.n, self.previous))
        return self.with_state(m, v, n, previous, np.append(self.steps, np.zeros(count, np.int64)))


def _row(value: ArrayLike, columns: int, dtype: type[np.generic]) -> NDArray[Any]:
    """A number or a row, as a row (P,)."""
    row = np.empty(columns, dtype)
    row[:] = value
    return row


def _coefficients(settings: AdanSettings) -> F4:
    """b1, 1 - b1, b2, 1 - b2, b3, 1 - b3, epsilon: (7,) f4, each rounded once."""
    betas = (settings.beta1, settings.beta2, settings.beta3)
    return np.array([*(part for beta in betas for part in (beta, 1 - beta)), settings.epsilon], np.float32)


def _settled(settings: AdanSettings) -> int:
    """A number of steps from which 1 - b^k is 1 in binary64 for all three b, so that corrections stay as they are."""
    slowest = max(settings.beta1, settings.beta2, settings.beta3)
    return math.ceil(-60 / float(log2(slowest))) if slowest > 0 else 1


def _corrections(settings: AdanSettings, steps: int) -> F4:
    """1 / (1 - b1^k), b2 / (1 - b2^k), 1 / sqrt(1 - b3^k) of k = 0..steps: (steps + 1, 3) f4, each rounded once.

    The powers are running products, since those of a machine's library may differ from another's in the last bit.
    """
    betas = np.array([settings.beta1, settings.beta2, settings.beta3])
    powers = np.cumprod(np.tile(betas, (steps, 1)), axis=0)  # (steps, 3) f8
    table = np.ones((steps + 1, 3), np.float32)  # no row has k = 0
    table[1:, 0] = 1 / (1 - powers[:, 0])
    table[1:, 1] = settings.beta2 / (1 - powers[:, 1])
    table[1:, 2] = 1 / np.sqrt(1 - powers[:, 2])
    return table


def adan_step_plain(
    parameters: F4,
    g: F4,
    m: F4,
    v: F4,
    n: F4,
    g_prev: F4,
    rate: F4,
    coefficients: F4,
    corrections: F4,
) -> tuple[F4, F4, F4, F4]:
    """The definition of one step of rows of the same age, as (parameters, m, v, n); arrays (N, P) f4.

    g is unit * dL/dparameter, and rate is (unit * learning rate) * row factor.
    """
    b1, c1, b2, c2, b3, c3, epsilon = coefficients
    over_m, over_v, over_n = corrections
    d = g - g_prev
    m = b1 * m + c1 * g
    v = b2 * v + c2 * d
    ahead = g + b2 * d
    n = b3 * n + c3 * (ahead * ahead)  # (10-13)
    update = (over_m * m + over_v * v) / (np.sqrt(n) * over_n + epsilon)
    return parameters - rate * update, m, v, n  # (10-14)


@kernel()
def _step(
    parameters: F4,  # (N P,) f4, row after row, as m, v, n and previous; changed
    gradients: F4,  # (N, P) f4, dL/dparameter
    m: F4,
    v: F4,
    n: F4,
    previous: F4,  # unit * gradient of the step before
    unit: F4,  # (P,) f4
    by_row: F4,  # (P,) f4, unit * rate of columns that `factors` apply to, else 0
    fixed: F4,  # (P,) f4, unit * rate of the other columns, else 0
    factors: F4,  # (N,) f4
    steps: I8,  # (N,) i8, k - 1; changed to k
    coefficients: F4,  # (7,) f4, see `_coefficients`
    corrections: F4,  # (K, 3) f4, see `_corrections`
) -> None:
    """Twin of `adan_step_plain` for all rows: each binary32 operation in the same order, so the bits are the same."""
    rows, columns = gradients.shape
    b1, c1, b2, c2 = coefficients[0], coefficients[1], coefficients[2], coefficients[3]
    b3, c3, epsilon = coefficients[4], coefficients[5], coefficients[6]
    scaled = np.empty(ROWS_AT_ONCE * columns, np.float32)  # unit * gradient
    rates = np.empty(ROWS_AT_ONCE * columns, np.float32)
    start = 0
    while start < rows:
        stop = start + 1
        while (
            stop < min(rows, start + ROWS_AT_ONCE) and steps[stop] == steps[start]
        ):  # one k, and so one correction, for a block
            stop += 1
        for row in range(stop - start):
            factor = factors[start + row]
            for c in range(columns):
                scaled[row * columns + c] = gradients[start + row, c] * unit[c]
                # One of the two terms is 0, so the sum rounds nothing.
                rates[row * columns + c] = by_row[c] * factor + fixed[c]
        # Slices, because an index that starts at 0 is what the compiler turns into vector lanes.
        part = slice(start * columns, stop * columns)
        x, m_part, v_part, n_part, g_prev = parameters[part], m[part], v[part], n[part], previous[part]
        if steps[start] == 0:  # g_prev = g at k = 1, so d is 0
            for j in range(len(x)):
                g_prev[j] = scaled[j]
        k = steps[start] + 1
        last = min(k, corrections.shape[0] - 1)  # from there on all rows of the table are equal
        over_m, over_v, over_n = corrections[last, 0], corrections[last, 1], corrections[last, 2]
        for j in range(len(x)):
            g = scaled[j]
            d = g - g_prev[j]
            m_part[j] = b1 * m_part[j] + c1 * g
            v_part[j] = b2 * v_part[j] + c2 * d
            ahead = g + b2 * d
            n_part[j] = b3 * n_part[j] + c3 * (ahead * ahead)  # (10-13)
            update = (over_m * m_part[j] + over_v * v_part[j]) / (np.sqrt(n_part[j]) * over_n + epsilon)
            x[j] -= rates[j] * update  # (10-14)
            g_prev[j] = g
        steps[start:stop] = k
        start = stop
