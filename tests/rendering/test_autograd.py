"""The gradients against PyTorch's automatic differentiation of the definition."""

import numpy as np
import pytest
from render_cases import HEIGHT, NAMED, SMOOTH, WIDTH, population

from gsvc_base.splats import Splats
from gsvc_ref.rendering import LN_255, Objective, render_gradients

torch = pytest.importorskip("torch", reason="PyTorch is not installed: pip install gsvc_ref[peers]")


def autograd(splats, differentiate):
    """The gradient (N, 8) f8 of differentiate(C), with C (H, W, 3) the sum over the splats."""
    parameters = torch.tensor(splats.to_array().astype(np.float64), requires_grad=True)
    x, y, l11, l21, l22 = (parameters[:, k, None, None] for k in range(5))
    dx = torch.arange(WIDTH)[None, None, :] + 0.5 - x
    dy = torch.arange(HEIGHT)[None, :, None] + 0.5 - y
    u1 = dx / l11
    u2 = (dy - l21 * u1) / l22
    sigma = (u1**2 + u2**2) / 2
    g = torch.where(sigma <= LN_255, torch.exp(-sigma), 0.0)
    differentiate(torch.einsum("nhw,nc->hwc", g, parameters[:, 5:])).backward()
    return parameters.grad.numpy()


def cases():
    """All the smooth cases in one set, and a population."""
    named = Splats.from_array(np.concatenate([NAMED[name].to_array() for name in SMOOTH]))
    return {"named": named, "population": population(40, WIDTH, HEIGHT)}


@pytest.mark.parametrize("case", ["named", "population"])
def test_exact_gradients_equal_autograd(case):
    splats = cases()[case]
    residual = np.random.default_rng(4).normal(0, 1, (HEIGHT, WIDTH, 3))
    expected = autograd(splats, lambda C: torch.sum(torch.tensor(residual) * C))
    np.testing.assert_allclose(
        render_gradients(splats, residual, precision="exact"), expected, rtol=1e-9, atol=1e-12 * abs(expected).max()
    )


def test_the_objective_equals_autograd_where_nothing_is_clamped():
    splats = population(40, WIDTH, HEIGHT)
    packed = splats.to_array()
    packed[:, 5:] = abs(packed[:, 5:]) / 40  # all sums inside (0, 1)
    target = np.random.default_rng(6).random((HEIGHT, WIDTH, 3), np.float32)

    def l2(C):
        assert 0 < C.max() < 1
        assert C.min() >= 0
        return torch.sum((C - torch.tensor(target.astype(np.float64))) ** 2) / (HEIGHT * WIDTH)

    expected = autograd(Splats.from_array(packed), l2)
    _, gradient = Objective(target).evaluate(packed)
    assert np.linalg.norm(gradient - expected) <= 2e-6 * np.linalg.norm(expected)
