"""The peers that benchmarks measure against compute the same pictures and gradients."""

import sys
from pathlib import Path

import numpy as np
import pytest

from gsvc_base.splats import Splats
from gsvc_ref.rendering import Objective, render_frame

sys.path.insert(0, str(Path(__file__).parents[2]))
peers = pytest.importorskip("gsvc_lab.benchmarks.peers", reason="gsvc_lab.benchmarks is only in a checkout")

WIDTH, HEIGHT = 40, 27


@pytest.fixture(scope="module")
def splats():
    rng = np.random.default_rng(1)
    positions = rng.uniform(-5, 45, (60, 2))
    cholesky = np.stack([rng.uniform(0.5, 6, 60), rng.normal(0, 2, 60), rng.uniform(0.5, 6, 60)], axis=1)
    return Splats(positions, cholesky, rng.normal(0.1, 0.3, (60, 3)))


@pytest.mark.parametrize("name", ["DensePyTorch", "PairListPyTorch"])
def test_pytorch_has_the_loss_and_the_gradient_of_the_objective(splats, name):
    if (torch := peers.load_torch(1)) is None:
        pytest.skip("PyTorch is not installed: pip install gsvc_ref[peers]")
    target = np.random.default_rng(2).random((HEIGHT, WIDTH, 3), np.float32)
    expected_loss, expected = Objective(target).evaluate(splats.to_array())
    loss, gradient = getattr(peers, name)(torch, target).iteration(splats.to_array())
    assert loss == pytest.approx(expected_loss, rel=1e-5)
    assert np.linalg.norm(gradient - expected) <= 1e-4 * np.linalg.norm(expected)


def test_numpy_has_the_frame(splats):
    frame = peers.numpy_frame(splats.to_array(), WIDTH, HEIGHT)
    difference = np.abs(frame.astype(int) - render_frame(splats, WIDTH, HEIGHT, 8))
    assert difference.max() <= 2  # a pixel on the edge of a splat's support may gain or lose 1/255 of its colour
    assert np.mean(difference > 0) < 0.01


def test_a_folder_without_the_limit_is_told(tmp_path):
    limit = peers.Limit(tmp_path)
    assert limit.stick is None
    assert "does not build here" in limit.reason
