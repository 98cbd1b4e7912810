"""Bounds do not go idle with size: an answer of zero fails, however many terms a sum has."""

import numpy as np
import pytest

from gsvc_base.rendering.error_models import additions, gamma
from gsvc_base.splats import Splats
from gsvc_conformance.operation import operations
from gsvc_ref.rendering import exact_gradients_with_bound, render_gradients

F4 = np.float32
SIZES = {"161x161": (161, 161), "1920x1080": (1080, 1920), "3840x2160": (2160, 3840), "33000x3": (3, 33000)}


def oracle(name, **inputs):
    return operations()[name].oracle(**inputs)


def test_the_most_additions_of_a_term():
    assert additions(1) == 0
    assert additions(80) == 79
    assert additions(10_000) == 264
    assert additions(10_000, rows=10_000, columns=1) == 9_999
    assert additions([0, 5, 10**6]).tolist() == [0, 4, 2064]


@pytest.mark.parametrize("size", SIZES.values(), ids=SIZES)
def test_the_relative_bound_of_a_loss_is_small_at_any_size(size):
    assert gamma(additions(3 * size[0] * size[1], *size) + 11) < 0.005


@pytest.mark.exhaustive
@pytest.mark.parametrize("size", [(161, 161), (1080, 1920)], ids=["161x161", "1920x1080"])
def test_a_loss_of_zero_fails(size):
    picture, target = np.full((*size, 3), 0.5, F4), np.full((*size, 3), 0.3, F4)
    expected = oracle("loss", picture=picture, target=target)["loss"]
    assert expected.value == pytest.approx(3 * (0.5 - float(F4(0.3))) ** 2)
    assert not expected.judge(np.array(0.0)).passed
    assert expected.bound < 0.005 * expected.value


def test_an_mse_of_zero_and_a_psnr_that_is_off_fail():
    rng = np.random.default_rng(1)
    a, b = rng.integers(0, 256, (2, 161, 161, 3)).astype(np.uint8)
    expected = oracle("metrics", a=a, b=b, bit_depth=8)
    assert not expected["mse"].judge(np.array(0.0)).passed
    assert expected["mse"].bound < 2e-4 * expected["mse"].value
    assert not expected["psnr"].judge(np.array(float(expected["psnr"].value) + 0.001)).passed


@pytest.mark.parametrize("size", [64, 256])
def test_no_gradient_of_a_large_splat_may_be_zero(size):
    """White noise cancels in the sums of such a splat but for one part in the root of its pixels."""
    residual = np.random.default_rng(2).normal(size=(size, size, 3)).astype(F4)
    one = np.array([[size / 2 + 1.3, size / 2 - 2.1, 0.24 * size, 7.5, 0.2 * size, 0.3, 0.7, 0.45]], F4)
    splat = Splats.from_array(one)
    gradients, bound = exact_gradients_with_bound(splat, residual)
    assert np.all(abs(gradients) > bound)
    assert np.all(abs(render_gradients(splat, residual) - gradients) <= bound)


def test_no_sum_over_many_splats_may_be_zero():
    rng = np.random.default_rng(3)
    count, period = 70_001, 701
    x = np.resize(rng.normal(2, 1, (period, 3)).astype(F4), (count, 3))
    indices = np.zeros((count, 1), np.uint16)
    sizes, books = np.array([1]), np.zeros((1, 3), F4)
    commitment = oracle("commitment", x=x, indices=indices, codebook_sizes=sizes, codebooks=books)["loss"]
    assert commitment.bound < 2e-4 * commitment.value
    grad = np.resize(rng.normal(0.1, 1, (period, 3)).astype(F4), (count, 3))
    scale, offset = np.full(3, 0.5, F4), np.full(3, 1.0, F4)
    inside = np.floor(2 * x) / 2 + F4(0.1875)  # clear of ties
    lsq = oracle("lsq_gradients", x=inside, scale=scale, offset=offset, bits=4, grad_output=grad)
    for name in ("grad_scale", "grad_offset"):
        assert np.all(abs(lsq[name].value) > lsq[name].bound)
    updated = oracle(
        "rvq_update", x=x, indices=indices, codebook_sizes=sizes, codebooks=books, counts=np.ones(1),
        sums=np.ones((1, 3)), uniforms=np.zeros(1), decay=0.8, smoothing=1e-5, dead_count=0.0,
    )["sums"]  # fmt: skip
    assert np.all(updated.bound < 2e-4 * abs(updated.value))
