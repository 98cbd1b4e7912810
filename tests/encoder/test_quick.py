"""Preset `quick` of profile `paper`: its fit by L-BFGS, and which splats a P-frame exchanges."""

import numpy as np
import pytest
from codec_cases import faint_splats

from gsvc_base.splats import Splats
from gsvc_ref.encoder.main.coordinates import moved, to_coordinates, to_parameters
from gsvc_ref.encoder.main.target import Target
from gsvc_ref.encoder.quick import PRUNED_GRADIENT_SHARE, exchanged, grown, refitted
from gsvc_ref.rendering import Objective, render, render_sum
from gsvc_ref.training import MIN_FACTOR, NEW, loss_of_psnr, psnr_of_loss

SIDE = 48


def a_picture(side: int = SIDE) -> np.ndarray:
    return np.clip(render_sum(Splats.from_array(faint_splats(60, 9, side)), side, side), 0, 1)


def shaken(p: np.ndarray) -> np.ndarray:
    z = to_coordinates(p)
    return to_parameters(moved(z, np.random.default_rng(5).normal(0, 0.1, z.shape)))


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def psnr_of(p: np.ndarray, picture: np.ndarray) -> float:
    return psnr_of_loss(Objective(picture, 1).loss(p))


def test_psnr_and_loss_are_each_others_inverse():
    assert psnr_of_loss(3.0) == 0  # black against white: the loss adds the three channels
    assert psnr_of_loss(0.0) == np.inf
    for goal in (1.0, 20.0, 33.3, 70.0):
        assert psnr_of_loss(loss_of_psnr(goal)) == pytest.approx(goal)


@pytest.mark.parametrize("side", [48, 96])
def test_a_picture_is_grown_with_the_splats_asked_for(side):
    picture = a_picture(side)
    p = grown(Target(picture, threads=1), 60, 60, rng())
    assert p.shape == (60, 8)
    assert p[:, [2, 4]].min() > MIN_FACTOR
    assert psnr_of(p, picture) > 30


@pytest.mark.parametrize("iterations", [1, 2, 3, 10])
def test_with_few_evaluations_all_splats_are_there(iterations):
    assert len(grown(Target(a_picture(), threads=1), 20, iterations, rng())) == 20


@pytest.mark.parametrize("value", [0.0, 1.0, 0.5])
def test_flat_pictures_bring_no_nan(value):
    picture = np.full((SIDE, SIDE, 3), value, np.float32)
    p = grown(Target(picture, threads=1), 40, 20, rng())
    assert np.isfinite(p).all()
    assert psnr_of(p, picture) > 25


def test_a_refit_brings_the_picture_closer_and_tells_each_evaluation():
    picture, start, told = a_picture(), shaken(faint_splats(60, 9, SIDE)), []
    p = refitted(Target(picture, threads=1, on_evaluation=told.append), start, 12)
    assert len(told) == 12
    assert Objective(picture, 1).loss(p) == min(told)
    assert psnr_of(p, picture) > psnr_of(start, picture) + 6


@pytest.mark.parametrize(("kept", "new"), [(20, 0), (15, 5), (0, 20), (12, 3)])
def test_an_exchange_keeps_the_order_of_the_frame_before(kept, new):
    before = faint_splats(20, 1, SIDE)
    p, origins = exchanged(Target(a_picture(), threads=1), before, kept, new, rng())
    assert p.shape == (kept + new, 8)
    assert np.array_equal(origins[:kept], np.unique(origins[:kept]))
    assert (origins[kept:] == NEW).all()
    assert np.array_equal(p[:kept], before[origins[:kept]])


def test_new_splats_come_where_the_picture_is_wrong():
    before = faint_splats(60, 9, SIDE)
    picture = a_picture()
    picture[2:9, 30:38] = 1 - picture[2:9, 30:38]
    p, _ = exchanged(Target(picture, threads=1), before, 55, 5, rng())
    x, y = p[55:, :2].T
    assert ((x >= 30) & (x < 38) & (y >= 2) & (y < 9)).sum() >= 3


def test_the_worth_of_a_splat_is_the_error_without_it():
    """Splats far from each other: the order is that of the errors of exact pictures, with that share of a term."""
    x, y = np.meshgrid(np.arange(25, 200, 50), np.arange(25, 100, 50))
    draws, picture = np.random.default_rng(0), np.random.default_rng(1).random((100, 200, 3), np.float32)
    p = np.column_stack(
        [x.ravel(), y.ravel(), draws.uniform(2, 5, 8), draws.uniform(-2, 2, 8), draws.uniform(2, 5, 8),
         draws.uniform(0.1, 0.5, (8, 3))]
    ).astype(np.float32)  # fmt: skip
    rises = []
    for n in range(8):
        alone = render_sum(Splats.from_array(p[n : n + 1]), 200, 100, precision="exact")
        rises.append(np.square(alone).sum() - PRUNED_GRADIENT_SHARE * 2 * (alone * (alone - picture)).sum())
    for kept in range(1, 8):
        _, origins = exchanged(Target(picture, threads=1), p, kept, 0, rng())
        assert list(origins) == sorted(np.argsort(rises)[8 - kept :])


def test_a_splat_left_behind_is_the_first_to_go():
    """The brighter of two equal splats stands where the new picture is black."""
    stays, left_behind = [10, 12, 3, 0, 3, 0.5, 0.5, 0.5], [24, 12, 3, 0, 3, 0.8, 0.8, 0.8]
    p = np.array([stays, left_behind], np.float32)
    picture = render(Splats.from_array(p[:1]), 32, 24)
    _, origins = exchanged(Target(picture, threads=1), p, 1, 1, rng())
    assert list(origins) == [0, NEW]
