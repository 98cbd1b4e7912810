"""The walk by L-BFGS: free and held attributes, the pull and its derivative, and the fit of a frame by descent."""

import numpy as np
import pytest
from codec_cases import faint_splats

from gsvc_base.errors import UsageError
from gsvc_base.splats import Splats
from gsvc_ref.rendering import Objective, render_sum
from gsvc_ref.training import KEPT_WEIGHT, NEW, DescentSettings, Growth, Population, PruningSchedule, fit, image_start
from gsvc_ref.training.coarse import Sizes
from gsvc_ref.training.coordinates import moved, to_coordinates, to_parameters
from gsvc_ref.training.loop import MIN_FACTOR
from gsvc_ref.training.psnr import psnr_of_loss
from gsvc_ref.training.walk import MOST_SHEAR, FreeSplats, Walk, add_pull, hold_at_bounds, keep_shapes, pull_plain

SIDE = 48
FEW = DescentSettings(iterations=12, pull=0.0, least_gain=0.0)


def some_splats(count: int = 40, seed: int = 1) -> np.ndarray:
    return faint_splats(count, seed, SIDE)


def a_picture(side: int = SIDE) -> np.ndarray:
    return np.clip(render_sum(Splats.from_array(some_splats(60, 9)), side, side), 0, 1)


def shaken(p: np.ndarray) -> np.ndarray:
    z = to_coordinates(p)
    return to_parameters(moved(z, np.random.default_rng(5).normal(0, 0.1, z.shape)))


def population_of(p: np.ndarray, origins: np.ndarray | None = None) -> Population:
    return Population(
        Splats.from_array(p), KEPT_WEIGHT, np.full(len(p), NEW, np.int64) if origins is None else origins, FEW
    )


def test_held_attributes_keep_their_bits_and_free_ones_bring_the_picture_closer():
    p, start = some_splats(), shaken(some_splats())
    objective = Objective(np.clip(render_sum(Splats.from_array(p), SIDE, SIDE), 0, 1), 1)
    free = np.random.default_rng(3).random((40, 3)) < 0.6
    splats = FreeSplats(objective, start, free, SIDE * SIDE)
    z = splats.start()
    walk = Walk(len(z))
    losses = []
    for _ in range(10):
        loss, error, gradient = splats.evaluate(z)
        losses.append(loss)
        held = np.repeat(~free, (2, 3, 3), axis=1)
        assert np.array_equal(splats.parameters[held], start[held])
        z = walk.next(z, error, gradient)
    assert min(losses) < 0.5 * losses[0]


@pytest.mark.parametrize("column", range(8))
def test_the_gradient_of_what_is_free_is_its_derivative(column):
    """With colours held, a larger splat keeps its colour; with a shape held, a colour does not change the size."""
    rng = np.random.default_rng(1)
    p = some_splats(6)
    p[:, :2] *= np.float32(0.5)
    p[:, 2:5] *= np.float32(8)  # every pixel is in the support of all
    p[:, 5:] *= np.float32(0.5)  # and none is clamped
    objective = Objective(np.full((24, 24, 3), 0.4, np.float32), 1)
    free = rng.random((6, 3)) < 0.5
    free[0] = True, True, False
    free[1] = True, False, True
    splats = FreeSplats(objective, p, free, 24 * 24)
    z = splats.start()
    _, _, gradient = splats.evaluate(z)
    columns = np.repeat(free[splats.rows], (2, 3, 3), axis=1)
    for row in range(len(z)):
        if not columns[row, column]:
            assert gradient[row, column] == 0
            continue
        step = np.zeros_like(z)
        step[row, column] = 0.02 if column < 5 else 2.0
        rise = splats.evaluate(moved(z, step))[1] - splats.evaluate(moved(z, -step))[1]
        scale = np.abs(gradient[:, column]).max()
        assert gradient[row, column] == pytest.approx(rise / (2 * step[row, column]), rel=0.02, abs=0.01 * scale)


def test_the_pull_has_the_value_and_the_derivative_of_its_definition():
    start = to_coordinates(some_splats())
    z = moved(start, np.random.default_rng(2).normal(0, 0.2, start.shape))
    weights = np.random.default_rng(3).uniform(0, 0.1, len(z))
    weights[::4] = 0
    gradient = np.zeros_like(z)
    pull = add_pull(z, start, weights, gradient)
    expected, by_definition = pull_plain(z, start, weights)
    assert pull == pytest.approx(expected, rel=1e-12)
    assert gradient == pytest.approx(by_definition, rel=1e-9, abs=1e-9)
    for column in range(8):
        step = np.zeros_like(z)
        step[:, column] = 1e-4
        slope = (pull_plain(moved(z, step), start, weights)[0] - pull_plain(moved(z, -step), start, weights)[0]) / 2e-4
        assert gradient[:, column].sum() == pytest.approx(slope, rel=1e-4, abs=1e-5)


def test_the_pull_of_a_small_change_is_the_error_that_it_makes():
    p = some_splats(1)
    p[:, :2] = SIDE / 2
    before = render_sum(Splats.from_array(p), SIDE, SIDE).astype(float)
    start = to_coordinates(p)
    step = np.array([[0.02, -0.03, 0.02, 0.03, 0.02, 1.0, -0.5, 0.3]])
    z = moved(start, step)
    after = render_sum(Splats.from_array(to_parameters(z)), SIDE, SIDE).astype(float)
    pull = add_pull(z, start, np.ones(1), np.zeros((1, 8)))
    assert pull == pytest.approx(255**2 * ((after - before) ** 2).sum(), rel=0.1)


def test_shapes_are_kept_in_bounds():
    z, step = to_coordinates(some_splats(4)), np.full((4, 8), 0.1)
    step[0, 2] = -9
    step[1, 4] = 300
    step[3, 2:5] = 0
    z[3, 2] = -9  # smaller than any may become, but its shape does not move
    intended = moved(z, step)
    following, made = intended.copy(), step.copy()
    keep_shapes(z, following, made)
    q = to_parameters(following)
    assert q[0, 2] == pytest.approx(MIN_FACTOR)
    assert q[0, 4] == pytest.approx(MIN_FACTOR)
    assert following[1, 4] == MOST_SHEAR
    assert np.array_equal(following[2:], intended[2:])
    assert np.array_equal(made[2:], step[2:])
    assert moved(z, made)[:, 2:] == pytest.approx(following[:, 2:], rel=1e-12)


def test_what_pushes_over_a_bound_is_no_gradient():
    z = to_coordinates(some_splats(4))
    z[0, 2:4] = np.log(float(MIN_FACTOR)) * 2**0.5, 0.0  # both factors at their least
    z[1, 4] = -MOST_SHEAR
    gradient = np.ones((4, 8))
    hold_at_bounds(z, gradient)  # m and r are to fall alike: l11 is to shrink, l22 to stay
    assert gradient[0, 2:4] == pytest.approx(0, abs=1e-12)
    assert gradient[1, 4] == 0
    assert np.array_equal(gradient[2:], np.ones((2, 8)))
    z[1, 4], gradient[1, 4] = MOST_SHEAR, 1.0
    hold_at_bounds(z, gradient)
    assert gradient[1, 4] == 1  # that leads back


def test_a_fit_brings_the_picture_closer_and_tells_each_evaluation():
    start = shaken(some_splats(60, 9))
    objective, told = Objective(a_picture(), 1), []
    population = population_of(start)
    loss, done = fit(population, objective, FEW, np.random.default_rng(0), on_iteration=lambda *a: told.append(a))
    assert done == 12
    assert [part[:2] for part in told] == [(i, 12) for i in range(1, 13)]
    assert loss == objective.loss(population.parameters())
    assert loss <= min(part[2] for part in told) * (1 + 1e-6)
    assert psnr_of_loss(loss) > psnr_of_loss(objective.loss(start)) + 6


def test_a_fit_ends_once_it_gains_too_little():
    objective = Objective(a_picture(), 1)
    counts = []
    for gain in (0.0, 0.2, 100.0):
        population = population_of(shaken(some_splats(60, 9)))
        settings = FEW.with_(iterations=60, least_gain=gain)
        counts.append(fit(population, objective, settings, np.random.default_rng(0))[1])
    assert counts[0] == 60
    assert counts[2] == 4  # the first, and three in a row that gain too little
    assert 4 < counts[1] < 60


def test_no_evaluation_changes_nothing():
    p = some_splats()
    population = population_of(p)
    objective = Objective(a_picture(), 1)
    loss, done = fit(population, objective, FEW.with_(iterations=0), np.random.default_rng(0))
    assert done == 0
    assert loss == objective.loss(p)
    assert np.array_equal(population.parameters(), p)


def test_the_pull_keeps_splats_near_their_start():
    objective, start = Objective(a_picture(), 1), shaken(some_splats(60, 9))
    changes = []
    for pull in (0.0, 0.1, 10.0):
        population = population_of(start, np.arange(60))
        fit(population, objective, FEW.with_(pull=pull), np.random.default_rng(0))
        z = to_coordinates(population.parameters())
        changes.append(pull_plain(z, to_coordinates(start), np.ones(60))[0])
    assert changes[0] > changes[1] > changes[2]


def test_new_splats_are_free_of_the_pull():
    objective, start = Objective(a_picture(), 1), shaken(some_splats(60, 9))
    population, free = population_of(start), population_of(start)
    fit(population, objective, FEW.with_(pull=5.0), np.random.default_rng(0))
    fit(free, objective, FEW, np.random.default_rng(0))
    assert np.array_equal(population.parameters(), free.parameters())


def test_frozen_splats_keep_their_bits_and_others_are_fitted():
    start = shaken(some_splats(60, 9))
    population = population_of(start, np.arange(60))
    population.frozen[::3] = True
    objective = Objective(a_picture(), 1)
    loss, _ = fit(population, objective, FEW, np.random.default_rng(0))
    after = population.parameters()
    assert np.array_equal(after[::3], start[::3])
    assert (after[1::3] != start[1::3]).any(axis=1).all()
    assert loss < objective.loss(start)


@pytest.mark.parametrize("with_sizes", [False, True])
def test_growth_ends_with_the_splats_asked_for(with_sizes):
    picture = a_picture(96)
    objective = Objective(picture, 1)
    settings = DescentSettings(iterations=40, pull=0.0, least_gain=0.0, growth=Growth(end=0.4))
    rng = np.random.default_rng(0)
    population = population_of(image_start(picture, settings.growth.start(50), rng).to_array())
    sizes = Sizes(picture, 1, full=objective) if with_sizes else None
    loss, done = fit(population, objective, settings, rng, total=50, sizes=sizes)
    assert (done, len(population)) == (40, 50)
    assert loss == objective.loss(population.parameters())
    assert psnr_of_loss(loss) > 30


def test_pruning_removes_the_faintest():
    p = some_splats(50)
    p[7, 5:] = 0
    population = population_of(p, np.arange(50))
    settings = FEW.with_(pruning=PruningSchedule.late(), iterations=20)
    loss, _ = fit(population, objective := Objective(a_picture(), 1), settings, np.random.default_rng(0))
    assert len(population) == 45
    assert loss == objective.loss(population.parameters())
    assert np.array_equal(population.origins, np.sort(population.origins))


def test_pruning_leaves_frozen_splats_alone():
    population = population_of(some_splats(50), np.arange(50))
    population.frozen[:40] = True
    fit(
        population, Objective(a_picture(), 1), FEW.with_(pruning=PruningSchedule.late(), iterations=20),
        np.random.default_rng(0),
    )  # fmt: skip
    assert len(population) == 45
    assert np.array_equal(population.origins[:40], np.arange(40))


@pytest.mark.parametrize("value", [0.0, 1.0, 0.5])
def test_flat_pictures_bring_no_nan(value):
    picture = np.full((SIDE, SIDE, 3), value, np.float32)
    objective = Objective(picture, 1)
    settings = DescentSettings(iterations=20, pull=0.0, least_gain=0.0, growth=Growth(end=0.4))
    rng = np.random.default_rng(0)
    population = population_of(image_start(picture, settings.growth.start(40), rng).to_array())
    loss, _ = fit(population, objective, settings, rng, total=40, sizes=Sizes(picture, 1, full=objective))
    assert np.isfinite(population.parameters()).all()
    assert psnr_of_loss(loss) > 25


def test_settings_refuse_what_makes_no_sense():
    for changes in ({"iterations": -1}, {"pull": -0.1}, {"least_gain": float("nan")}):
        with pytest.raises(UsageError):
            FEW.with_(**changes)
