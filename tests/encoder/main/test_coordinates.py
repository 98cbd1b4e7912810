"""Coordinates of splats: there and back, the gradient's chain rule, the metric, and the compiled twins."""

import numpy as np
import pytest

from gsvc_base.splats import Splats
from gsvc_ref.encoder.main import coordinates
from gsvc_ref.rendering import Objective, render_sum


def some_splats(count: int = 40, seed: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    p = np.empty((count, 8), np.float32)
    p[:, :2] = rng.uniform(8, 40, (count, 2))
    p[:, 2], p[:, 4] = np.exp(rng.normal(0.8, 0.4, (2, count)))
    p[:, 3] = rng.normal(0, 0.7, count) * p[:, 4]
    p[:, 5:] = rng.normal(0, 0.2, (count, 3))
    return p


def test_there_and_back() -> None:
    p = some_splats()
    assert coordinates.to_parameters(coordinates.to_coordinates(p)) == pytest.approx(p, rel=1e-6, abs=1e-7)


def test_gradient_is_the_derivative() -> None:
    p = some_splats(12)
    z = coordinates.to_coordinates(p)
    weights = np.random.default_rng(4).normal(0, 1, p.shape).astype(np.float32)
    by_z = coordinates.gradient_by_coordinates(p, weights)
    for column in range(8):
        step = np.zeros_like(z)
        step[:, column] = 1e-2
        rise = [coordinates.to_parameters(coordinates.moved(z, sign * step)).astype(float) for sign in (1, -1)]
        slope = ((rise[0] - rise[1]) * weights).sum(1) / 2e-2
        assert by_z[:, column] == pytest.approx(slope, rel=2e-2, abs=2e-3)


def test_a_unit_of_every_coordinate_is_worth_the_same() -> None:
    p = some_splats(1)
    p[:, :2] = 32.3, 31.9
    p[:, 2:5] = 3.0, 0.8, 4.0
    p[:, 5:] = 0.5, 0.4, 0.3
    z = coordinates.to_coordinates(p)
    d = 0.02 * float(np.sqrt((z[:, 5:] ** 2).sum()))
    before = render_sum(Splats.from_array(p), 64, 64).astype(float)
    for column in range(8):
        step = np.zeros_like(z)
        step[:, column] = coordinates.units(z, d)[:, column]
        q = coordinates.to_parameters(coordinates.moved(z, step))
        error = 255**2 * ((render_sum(Splats.from_array(q), 64, 64).astype(float) - before) ** 2).sum()
        assert error == pytest.approx(d * d, rel=0.15)


def test_objective_descends_along_the_gradient() -> None:
    p = some_splats()
    target = np.full((48, 48, 3), 0.4, np.float32)
    objective = Objective(target, 1)
    loss, gradient = objective.evaluate(p)
    z = coordinates.to_coordinates(p)
    u = coordinates.units(z, 10.0)
    by_z = coordinates.gradient_by_coordinates(p, gradient)
    scale = 1e-2 / float(np.abs(by_z * u).max())
    after = objective.loss(coordinates.to_parameters(coordinates.moved(z, -scale * u * u * by_z)))
    assert after < loss


def test_the_metric_is_the_gauss_newton_matrix_of_a_splat() -> None:
    """J^T J by central differences of a Gaussian in binary64, all 64 entries of it, without cut-off and frame."""
    p = some_splats(1)
    p[:, :2], p[:, 2:5], p[:, 5:] = 30.3, (2.5, 1.3, 3.5), (0.5, 0.4, -0.3)
    z = coordinates.to_coordinates(p)
    y, x = np.mgrid[:64, :64] + 0.5

    def picture(at: np.ndarray) -> np.ndarray:
        q = coordinates.to_parameters(at)[0].astype(float)
        u = (x - q[0]) / q[2]
        v = (y - q[1] - q[3] * u) / q[4]
        return 255 * np.exp(-(u * u + v * v) / 2)[..., None] * q[5:]

    energy = float((z[:, 5:] ** 2).sum())
    widths = np.array([0.01] * 5 + [0.01 * np.sqrt(energy)] * 3)
    columns = []
    for column in range(8):
        step = np.zeros_like(z)
        step[:, column] = widths[column]
        rise = picture(coordinates.moved(z, step)) - picture(coordinates.moved(z, -step))
        columns.append((rise / (2 * widths[column])).ravel())
    found = np.array(columns) @ np.array(columns).T
    metric = np.diag([energy / 2] * 4 + [energy / 4] + [1.0] * 3)
    scale = np.sqrt(np.outer(np.diag(metric), np.diag(metric)))
    assert np.abs((found - metric) / scale).max() < 2e-3
