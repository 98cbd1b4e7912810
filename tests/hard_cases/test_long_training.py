"""A hundred thousand steps of Adan: finite, of bounded length, and each as the kit's oracle has it."""

from math import log2

import numpy as np
import pytest

from gsvc_base.errors import UsageError
from gsvc_conformance.operations.training import adan_oracle
from gsvc_ref.training.adan import Adan, AdanSettings
from tests.hard_cases.long_training import RATE, SAMPLED, SETTINGS, gradients, run

LARGEST = 2.0**62


def longest_step(settings: AdanSettings, k: int) -> float:
    """The longest k-th step in units of the rate, over all gradients g_1 .. g_k.

    The update is linear in a_i = g_i + b2 (g_i - g_(i-1)), as y . a, and the corrected n is sum w_i a_i^2: by
    Cauchy-Schwarz their quotient is at most sqrt(sum y_i^2 / w_i), and some gradients reach it.
    """
    b1, b2, b3 = settings.beta1, settings.beta2, settings.beta3
    age = np.arange(k)[::-1]
    of_m, of_v, w = ((1 - b) * b**age / (1 - b**k) for b in (b1, b2, b3))
    of_v = b2 * of_v
    of_v[0] = 0  # the first difference is 0
    by_gradient = of_m + of_v - np.append(of_v[1:], 0)
    y, later = np.empty(k), 0.0
    for i in reversed(range(k)):
        later = y[i] = (by_gradient[i] + b2 * later) / (1 + b2 if i > 0 else 1)
    return float(np.sqrt(np.sum(y * y / w)))


@pytest.mark.parametrize(("settings", "most"), [(AdanSettings(), 1.206), (AdanSettings(0.9, 0.92, 0.99), 2.328)])
def test_no_gradients_make_a_longer_step(settings, most):
    lengths = [longest_step(settings, k) for k in (1, 2, 3, 10, 100, 300, 1000, 2000)]
    assert np.all(np.diff(lengths) >= 0)
    assert lengths[0] == 1
    assert most - 0.001 < lengths[-1] < most


@pytest.mark.exhaustive
@pytest.mark.parametrize("kind", gradients())
def test_every_step_of_100000_is_finite_and_bounded(kind):
    path = run().path[:, list(gradients()).index(kind)].astype(np.float64)
    assert np.isfinite(path).all()
    rounding = 2.0**-24 * abs(path[1:])
    assert np.all(abs(np.diff(path)) <= longest_step(SETTINGS, 2000) * (1 + 1e-4) * RATE + rounding)


def test_a_rate_of_zero_moves_nothing():
    assert not run().path[:, list(gradients()).index("at_rate_zero")].any()
    assert not run().path[:, list(gradients()).index("zero")].any()


@pytest.mark.parametrize("step", SAMPLED)
def test_sampled_steps_are_within_the_bounds_of_one_step(step):
    expected = adan_oracle(**run().inputs[step])
    for name, output in run().outputs[step].items():
        verdict = expected[name].judge(output)
        assert verdict.passed, f"{name} {verdict.message}"


@pytest.mark.parametrize("size", [LARGEST, -LARGEST])
def test_the_largest_gradients_may_change_their_sign_at_every_step(size):
    state, parameters = Adan(3, 2), np.zeros((3, 2), np.float32)
    for k in range(400):
        state.step(parameters, np.full((3, 2), size * (-1) ** k, np.float32), np.full(2, 1e-3))
        assert all(np.isfinite(part).all() for part in (parameters, state.m, state.v, state.n))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 2.0**64])
def test_gradients_past_the_limit_are_refused_and_not_averaged_in_silence(bad):
    state, parameters = Adan(2, 3), np.zeros((2, 3), np.float32)
    gradients_ = np.ones((2, 3), np.float32)
    state.step(parameters, gradients_, np.full(3, 1e-3))
    gradients_[1, 2] = bad
    with pytest.raises(UsageError, match="diverged"):
        state.step(parameters, gradients_, np.full(3, 1e-3))


@pytest.mark.parametrize("settings", [AdanSettings(), AdanSettings(0.0, 0.0, 0.0), AdanSettings(0.999, 0.5, 0.9)])
def test_rows_of_any_age_take_a_step_in_constant_memory(settings):
    state, parameters = Adan(2, 1, settings), np.zeros((2, 1), np.float32)
    state.steps[:] = 0, 10**15
    state.step(parameters, np.ones((2, 1), np.float32), 1.0)
    b1, b2, b3 = settings.beta1, settings.beta2, settings.beta3
    old = (1 - b1 + b2 * (1 - b2)) / (np.sqrt(1 - b3) * (1 + b2) + settings.epsilon)
    assert np.allclose(-parameters.ravel(), [1, old], rtol=1e-6)
    slowest = max(b1, b2, b3)
    assert len(state._corrections) <= 2 + (60 / -log2(slowest) if slowest else 0) + 64
