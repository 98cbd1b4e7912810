"""The exact picture with another support cut-off."""

import math

import numpy as np
import pytest

from gsvc_base.splats import Splats
from gsvc_lab.accuracy.cutoff import cut_sum, support_sigma
from gsvc_ref.rendering import LN_255, render_sum

WIDTH, HEIGHT = 45, 37


def population(count=60, width=WIDTH, height=HEIGHT, seed=0):
    """Sheared splats of natural sizes, some over the edges."""
    rng = np.random.default_rng(seed)
    radius = math.sqrt(width * height / max(count, 1))
    columns = [
        rng.random((count, 2)) * (width + 8, height + 8) - 4,
        radius * rng.lognormal(-0.4, 0.5, (count, 1)),
        radius * rng.normal(0, 0.7, (count, 1)),
        radius * rng.lognormal(-0.4, 0.5, (count, 1)),
        rng.normal(0.1, 0.25, (count, 3)),
    ]
    return Splats.from_array(np.concatenate(columns, axis=1).astype(np.float32))


def test_the_cut_of_the_definition_gives_its_sum():
    splats = population(seed=4)
    assert support_sigma(1 / 255) == LN_255
    exact = render_sum(splats, WIDTH, HEIGHT, precision="exact")
    np.testing.assert_allclose(cut_sum(splats, WIDTH, HEIGHT, 1 / 255), exact, atol=1e-14, rtol=0)


def test_without_a_cut_every_splat_is_summed_over_every_pixel():
    splats = population(12, seed=5)
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
    wanted = np.zeros((HEIGHT, WIDTH, 3))
    for mu_x, mu_y, l11, l21, l22, *color in splats.to_array().astype(np.float64):
        u1 = (x - mu_x) / l11
        u2 = (y - mu_y - l21 * u1) / l22
        wanted += np.exp(-(u1**2 + u2**2) / 2)[..., None] * color
    np.testing.assert_allclose(cut_sum(splats, WIDTH, HEIGHT, 0), wanted, atol=1e-14, rtol=0)


@pytest.mark.parametrize("cutoff", [1 / 1024, 1 / 4096])
def test_a_cutoff_leaves_out_the_weights_below_it_and_no_others(cutoff):
    for splat in population(12, seed=3).to_array():
        weight_only = splat.copy()
        weight_only[5:] = 1
        one = Splats.from_array(weight_only[None])
        weights = cut_sum(one, WIDTH, HEIGHT, 0)
        wanted = np.where(weights >= cutoff, weights, 0)
        np.testing.assert_allclose(cut_sum(one, WIDTH, HEIGHT, cutoff), wanted, atol=1e-15, rtol=0)
    narrow = cut_sum(population(seed=3), WIDTH, HEIGHT, 1 / 255)
    assert abs(cut_sum(population(seed=3), WIDTH, HEIGHT, cutoff) - narrow).max() > 1e-3


def test_splats_that_cover_nothing():
    rows = [[500, -300, 4, 1, 4], [20, 20, 0, 0, 3], [20, 20, 3, 0, -1], [11, 10, 0.1, 0, 0.1]]
    splats = Splats.from_array(np.array([[*row, 0.5, 0.5, 0.5] for row in rows], np.float32))
    assert not cut_sum(splats, WIDTH, HEIGHT, 1 / 255).any()
    assert not cut_sum(Splats.empty(), WIDTH, HEIGHT, 0).any()
