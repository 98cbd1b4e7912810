"""Numerically hard cases of a training step: Adan at the ends of its range, late rates, losses that barely change."""

import numpy as np

from gsvc_base.draws import Draws
from gsvc_base.portable import power
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases.adan import BETAS, adan_inputs
from gsvc_conformance.cases.training import f4

SLOW = {"beta1": 0.9999, "beta2": 0.999, "beta3": 0.99999, "epsilon": 1e-8}
LARGEST_GRADIENT = 2.0**62
"""Largest size of a gradient for which every number of a step is finite: (1 + 2 b2)^2 2^124 < 2^128."""

# --- Adan ------------------------------------------------------------------------------------------------------------


@case("stress", "adan_step", flags=["correction"])
def late_steps(rng: Draws) -> Inputs:
    """Averages so slow that their corrections still matter after 100,000 steps; parameters of 0, so only these count.

    A decay rate that is rounded to binary32 before it is raised to such powers gives corrections that are off by 1e-3.
    """
    inputs = adan_inputs(rng, [0, 1, 9_999, 29_999, 99_999], columns=3)
    inputs["parameters"] = np.zeros((5, 3), np.float32)
    inputs |= SLOW
    expected = yield inputs
    k = inputs["steps"][:, None] + 1.0
    true, rounded = (np.sqrt(1 - b**k) for b in (SLOW["beta3"], float(np.float32(SLOW["beta3"]))))
    assert np.all(abs(rounded / true - 1)[2:4] > 1e-4)
    assert np.all(expected["parameters"].bound < 2e-4 * abs(expected["parameters"].value))


@case("stress", "adan_step", flags=["cancellation"])
def gradient_like_the_one_before() -> Inputs:
    """The same gradient again and again: d is exactly 0, and v, which has nearly died out, only fades further.

    Adding (1 - b2) g to the average and taking (1 - b2) p off again leaves the rounding errors of g in its place.
    """
    gradients = f4([1, -0.3, 1e-3], [0.7, 1e4, -11])
    sizes = gradients.astype(np.float64)
    expected = yield {
        "parameters": f4([0, 1, 2], [3, -4, 5]), "gradients": gradients,
        "m": (0.9 * sizes).astype(np.float32), "v": (1e-12 * sizes).astype(np.float32),
        "n": (0.8 * sizes**2).astype(np.float32), "previous": gradients, "steps": np.array([180, 400], np.int64),
        "rates": f4(1e-2, 1e-2, 1e-2), "units": f4(1, 1, 1), **BETAS,
    }  # fmt: skip
    assert np.allclose(expected["v"].value, 0.92e-12 * sizes, rtol=1e-6)
    assert np.all(expected["v"].bound < 1e-18 * abs(sizes))


@case("stress", "adan_step", flags=["epsilon", "subnormal"])
def second_moment_near_zero() -> Inputs:
    """Second moments of 0, of subnormal size and of 2^-126 under averages that are left: epsilon alone divides.

    A splat that has left the frame gets there. Without epsilon the quotient is infinite or of the size 1e10.
    """
    n = f4([0, 1e-45, 1e-40, 2.0**-126], [0, 1e-42, 1e-39, 1e-37])
    m, zeros = f4([1e-12, -1e-12, 1e-10, 3e-9], [0, 1e-9, -1e-11, 2e-9]), np.zeros((2, 4), np.float32)
    expected = yield {
        "parameters": f4([1, 2, 3, 4], [-1, 0, 1, 2]), "gradients": zeros, "m": m, "v": zeros, "n": n,
        "previous": zeros, "steps": np.array([500, 900], np.int64), "rates": np.full(4, 0.5, np.float32),
        "units": np.ones(4, np.float32), **BETAS,
    }  # fmt: skip
    moved = expected["parameters"].value - f4([1, 2, 3, 4], [-1, 0, 1, 2])
    assert np.allclose(moved, -0.5 * 0.98 * m.astype(np.float64) / 1e-8, rtol=1e-2)


@case("stress", "adan_step", flags=["overflow"])
def gradients_at_the_limit() -> Inputs:
    """Gradients of 2^62 after such of the opposite sign, one column with a learning rate of 0: nothing overflows.

    (g + b2 d)^2 is 2^127 then. Averages kept as plain sums, without the factors 1 - b, pass the end of binary32.
    """
    steps = np.array([0, 1, 60, 99_999], np.int64)
    gradients = (np.resize([1, -1], (4, 3)) * LARGEST_GRADIENT).astype(np.float32)
    past = np.where(steps[:, None] > 0, gradients, 0)
    n = (2.84 * past.astype(np.float64)) ** 2 * (1 - power(0.99, steps[:, None]))
    expected = yield {
        "parameters": f4(*[[1, -2, 3]] * 4), "gradients": gradients, "m": (-0.01 * past).astype(np.float32),
        "v": (-0.9 * past).astype(np.float32), "n": n.astype(np.float32), "previous": -past, "steps": steps,
        "rates": f4(1e-2, 0, 1e-3), "units": f4(1, 1, 1), **BETAS,
    }  # fmt: skip
    assert np.all(expected["n"].value < np.finfo(np.float32).max)
    assert expected["parameters"].value[:, 1].tolist() == [-2] * 4


# --- Learning rates and convergence ----------------------------------------------------------------------------------


@case("stress", "learning_rates", flags=["schedule"])
def iterations_beyond_binary32() -> Inputs:
    """Iterations past 2^24, one before, at and after the border of an interval: counted and divided as integers.

    In binary32 the last iteration before a border is the border, and its rate comes an interval early.
    """
    iterations = np.array([16_779_999, 16_780_000, 16_780_001, 33_559_999, 33_560_000, 2**31], np.int64)
    expected = yield {"iterations": iterations, "rate": 1e-3, "factor": 0.999, "interval": 20_000}
    early = np.floor(iterations.astype(np.float32) / np.float32(20_000))
    assert early[0] == iterations[0] // 20_000 + 1
    rates = expected["rates"]
    assert abs(1e-3 * 0.999 ** early[0] - rates.value[0]) > 4 * rates.bound[0]


@case("stress", "learning_rates", flags=["schedule", "overflow"])
def rates_that_vanish() -> Inputs:
    """2^40 and 2^30 iterations: a billion halvings leave a rate of 0, and a million some 10^-470, which is 0."""
    iterations = np.array([2**40, 2**30, 0], np.int64)
    expected = yield {"iterations": iterations, "rate": 1e-3, "factor": 0.999, "interval": 1000}
    assert expected["rates"].value.tolist() == [0, 0, 1e-3]
    assert np.isfinite(expected["rates"].bound).all()


@case("stress", "converged", flags=["cancellation"])
def changes_that_binary32_loses() -> Inputs:
    """Losses of 2.5 that change by 1.1 times the tolerance forever: binary32 holds all of them for equal."""
    losses = 2.5 + np.resize([0, 1.1e-7], 130)
    expected = yield {"losses": losses, "patience": 100, "tolerance": 1e-7}
    assert len(np.unique(losses.astype(np.float32))) == 1
    assert expected["iteration"].value == 0
