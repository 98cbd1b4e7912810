"""Random splats of any size at any place: every precision is finite where it is promised, and within its bounds."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from gsvc_base.splats import Splats
from gsvc_conformance.spec import namespace
from gsvc_ref.rendering import (
    exact_gradients_with_bound,
    render_exact_with_bound,
    render_gradients,
    render_sum,
    render_sum_deterministic,
)
from gsvc_ref.testing.strategies import HARD_NUMBERS, painters

F4 = NDArray[np.float32]

WIDTH, HEIGHT = 5, 3
PRECISIONS = ("fast", "deterministic")
LARGEST = float(np.finfo(np.float32).max)


@st.composite
def any_splats(draw: st.DrawFn) -> F4:
    """One to six splats (N, 8) f4: extents 2^-126 to 2^100, half of them near the frame, half up to 1e38 away."""
    count, rng = draw(st.integers(1, 6)), draw(painters())
    extents = 2.0 ** rng.uniform(-126, 100, (count, 3)) * rng.choice([1.0, -1.0], (count, 3), p=[0.9, 0.1])
    usual = 2.0 ** rng.uniform(-3, 4, (count, 3)) * rng.choice([-1, 1], (count, 3))
    extents = np.where(rng.random((count, 3)) < draw(st.sampled_from((0.2, 0.8))), extents, usual)
    extents[:, ::2] = abs(extents[:, ::2])
    near = rng.integers(-2, 2 * WIDTH + 2, (count, 2)) / 2  # centres of pixels, and corners
    away = 10.0 ** rng.uniform(0, 38, (count, 2)) * rng.choice([-1, 1], (count, 2))
    positions = np.where(rng.random((count, 2)) < draw(st.sampled_from((0.1, 0.5))), away, near)
    # Some of those far away are as large as they are far, so that they reach the frame.
    wide = rng.random(count) < 0.5
    extents[wide, 0] = np.maximum(abs(positions[wide, 0]) * rng.uniform(0.25, 0.5), 1)
    extents[wide, 2] = np.maximum(abs(positions[wide, 1]) * rng.uniform(0.25, 0.5), 1)
    colors = rng.normal(0, 1, (count, 3)) * 10.0 ** rng.uniform(-30, 30, (count, 1))
    parameters = np.concatenate([positions, extents, colors], axis=1)
    odd = rng.random(parameters.shape) < 0.03
    parameters[odd] = rng.choice(HARD_NUMBERS, np.count_nonzero(odd))
    return np.clip(parameters, -LARGEST, LARGEST).astype(np.float32)


def within(actual: NDArray, value: NDArray, bound: NDArray, what: str) -> None:
    """Finite and within the bound, wherever what the bound allows fits binary32."""
    bounded = abs(value) + bound < LARGEST
    assert not np.isnan(bound).any(), what
    assert np.isfinite(actual[bounded]).all(), what
    assert np.all(abs(actual.astype(np.float64) - value)[bounded] <= bound[bounded]), what


@given(any_splats())
@example(np.array([[4.5, 3e38, 1, 3e38, 0.5, 1, 1, 1]], np.float32))
@example(np.array([[0.5, 0.5, 2.0**-126, 3e38, 2.0**-126, 1, 1, 1]], np.float32))
def test_sums_of_any_splats(parameters):
    splats = Splats.from_array(parameters)
    with np.errstate(over="ignore", invalid="ignore"):
        value, bound = render_exact_with_bound(splats, WIDTH, HEIGHT)
        of_spec = namespace()["render_sum_deterministic"](parameters, WIDTH, HEIGHT)["sum"]
        in_binary64 = namespace()["render_sum"](parameters, WIDTH, HEIGHT)["sum"]
    for precision in PRECISIONS:
        within(render_sum(splats, WIDTH, HEIGHT, precision=precision), value, bound, precision)
    within(in_binary64, value, bound, "spec.md")
    assert np.array_equal(render_sum(splats, WIDTH, HEIGHT, precision="exact"), value)
    assert of_spec.tobytes() == render_sum_deterministic(parameters, WIDTH, HEIGHT).tobytes()


@given(any_splats(), painters())
def test_gradients_of_any_splats(parameters, rng):
    parameters[:, 5:] = np.clip(parameters[:, 5:], -1e20, 1e20)  # so that no moment leaves the range of binary32
    splats = Splats.from_array(parameters)
    residual = (rng.normal(0, 1, (HEIGHT, WIDTH, 3)) * 10.0 ** rng.uniform(-10, 10)).astype(np.float32)
    with np.errstate(over="ignore", invalid="ignore"):
        value, bound = exact_gradients_with_bound(splats, residual)
    for precision in PRECISIONS:
        within(render_gradients(splats, residual, precision=precision), value, bound, precision)
    with np.errstate(all="ignore"):
        within(namespace()["render_gradients"](parameters, residual)["gradients"], value, bound, "spec.md")


@pytest.mark.parametrize("precision", PRECISIONS)
def test_pixels_that_are_not_covered_have_no_share_however_large_their_products(precision):
    """The product of colour and residual overflows beside the splat, and is 0 on it."""
    parameters = np.array([[0.5, 0.5, 0.25, 0.1, 0.25, 3e38, -3e38, 3e38]], np.float32)
    residual = np.full((HEIGHT, WIDTH, 3), 100, np.float32)
    residual[0, 0] = 0
    gradients = render_gradients(Splats.from_array(parameters), residual, precision=precision)
    assert np.array_equal(gradients, np.zeros((1, 8)))
