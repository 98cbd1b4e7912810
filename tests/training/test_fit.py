"""The fit of a frame: its gradients, what is added and removed when, and what survivors keep."""

from dataclasses import replace

import numpy as np
import pytest
from codec_cases import adan_fast

from gsvc_base.errors import UsageError
from gsvc_base.splats import Splats
from gsvc_ref.encoder.initialization import image_start
from gsvc_ref.rendering import Objective, render_sum
from gsvc_ref.training import (
    MIN_FACTOR,
    NEW,
    Constant,
    Convergence,
    FitSettings,
    Population,
    PruningSchedule,
    Rates,
    StepDecay,
    fit,
    random_splats,
    uniform_numbers,
)
from gsvc_ref.training.loop import keep_factors, learned_unit, step_factors
from gsvc_ref.training.pruning import prune

WIDTH, HEIGHT = 24, 16
Y, X = np.mgrid[:HEIGHT, :WIDTH]
PICTURE = np.stack(
    [0.5 + 0.3 * np.sin((X + 3 * c) / 4) * np.cos(Y / 3 + c) for c in range(3)], axis=2
).astype(np.float32)  # fmt: skip
NO_STEPS = Rates(0, 0, 0, 0)
BARE = FitSettings(iterations=10, convergence=None, pruning=None)
QUICK = adan_fast(iterations=40)


def population(count=12, weight=1.0, settings=BARE, seed=0) -> Population:
    splats = image_start(PICTURE, count, np.random.default_rng(seed))
    return Population(splats, weight, np.arange(count), settings.optimizer)


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def unclamped_loss(values: np.ndarray) -> float:
    """The paper's L2 in binary64, by the exact renderer, of (N, 9) f8 values; colours enter linearly."""
    picture = np.zeros((HEIGHT, WIDTH, 3))
    for row in values:
        unit = Splats.from_array(np.append(row[:5], [1, 1, 1])[None])
        picture += render_sum(unit, WIDTH, HEIGHT, precision="exact") * (row[8] * row[5:8])
    return float(np.square(picture - PICTURE).sum() / (WIDTH * HEIGHT))


def test_gradients_by_weight_and_colour_equal_central_differences():
    """The loss is quadratic in both, so that central differences of any step are exact."""
    made = population()
    made.values[:, 8] = np.random.default_rng(1).uniform(-0.5, 1.5, 12)
    made.values[:, 5:8] *= 0.5
    values = made.values.astype(np.float64)
    picture = render_sum(made.splats(), WIDTH, HEIGHT, precision="exact")
    assert picture.min() > -0.2
    assert picture.max() < 1  # where it is clamped below, differences see what the straight-through gradient does not
    made.values[:, 5:8] = np.abs(made.values[:, 5:8])
    made.values[:, 8] = np.abs(made.values[:, 8])
    values = made.values.astype(np.float64)
    loss, gradient = made.evaluate(Objective(PICTURE, 1))
    assert gradient.shape == (12, 9)
    assert gradient.dtype == np.float32
    assert loss == pytest.approx(unclamped_loss(values), rel=1e-5)
    for column in (5, 6, 7, 8):
        for n in (0, 5, 11):
            ahead, behind = values.copy(), values.copy()
            ahead[n, column] += 0.125
            behind[n, column] -= 0.125
            expected = (unclamped_loss(ahead) - unclamped_loss(behind)) / 0.25
            assert gradient[n, column] == pytest.approx(expected, rel=1e-4, abs=1e-6)


def test_gradients_of_geometry_are_those_of_the_rendered_splats():
    made = population(weight=0.5)
    loss, gradient = made.evaluate(Objective(PICTURE, 1))
    plain_loss, plain = Objective(PICTURE, 1).evaluate(made.parameters())
    assert loss == plain_loss
    assert np.array_equal(gradient[:, :5], plain[:, :5])


@pytest.mark.parametrize(
    "settings",
    [
        replace(BARE, iterations=60),
        replace(BARE, iterations=60, rates=Rates(1e-2, 1e-2, 1e-2), learn_pixels=True),
        replace(BARE, iterations=60, pruning=PruningSchedule(0.1, 5, 20, 5)),
        replace(QUICK.intra.fit, iterations=40),
        replace(QUICK.inter.fit, iterations=40),
    ],
    ids=["paper's rates", "pixels", "pruning", "quick intra", "quick inter"],
)
def test_the_loss_falls(settings):
    made, objective = population(settings=settings), Objective(PICTURE, 1)
    before = objective.loss(made.parameters())
    losses = []
    loss, done = fit(made, objective, settings, on_iteration=lambda i, n, loss: losses.append(loss))
    assert done == settings.iterations == len(losses)
    assert losses[0] == before
    assert loss < 0.95 * before
    assert loss == objective.loss(made.parameters())


def test_every_iteration_is_reported():
    seen = []
    settings = replace(BARE, iterations=7)
    fit(population(), Objective(PICTURE, 1), settings, on_iteration=lambda *report: seen.append(report[:2]))
    assert seen == [(i, 7) for i in range(1, 8)]


def test_no_iterations_change_nothing():
    made, objective = population(), Objective(PICTURE, 1)
    before = made.values.copy()
    assert fit(made, objective, replace(BARE, iterations=0)) == (objective.loss(made.parameters()), 0)
    assert np.array_equal(made.values, before)


def test_the_least_weights_are_removed_and_the_order_stays():
    """With rates of zero nothing moves, so that it is known which splats go."""
    settings = replace(BARE, iterations=5, rates=NO_STEPS, pruning=PruningSchedule(0.5, 2, 4, 2))
    made = population(10, settings=settings)
    made.values[:, 8] = [0.5, -0.1, 0.9, 0.2, -0.8, 0.05, 1.0, 0.3, -0.4, 0.7]
    values, counts = made.values.copy(), []
    fit(made, Objective(PICTURE, 1), settings, on_iteration=lambda *_: counts.append(len(made)))
    assert counts == [10, 8, 8, 5, 5]  # 2 of the 5 first, the rest last
    assert list(made.origins) == [0, 2, 4, 6, 9]
    assert np.array_equal(made.values, values[[0, 2, 4, 6, 9]])
    assert list(made.optimizer.steps) == [5] * 5


@pytest.mark.parametrize(("count", "iterations"), [(40, 4000), (40, 50), (40, 3), (15, 20), (4, 20), (1, 20)])
def test_the_papers_schedule_leaves_nine_tenths(count, iterations):
    for pruning in (PruningSchedule.intra(), PruningSchedule.inter()):
        settings = replace(BARE, iterations=min(iterations, 60), pruning=pruning)
        made = population(count, 0.01, settings)
        fit(made, Objective(PICTURE, 1), settings)
        assert len(made) == count - round(0.1 * count)


def test_survivors_keep_their_optimiser_state():
    """Removing after iteration 4 of 5 is the same, bit for bit, as 4 iterations, then taking, then another one."""
    rates = Rates(1e-2, 1e-2, 1e-2, 1e-2)
    pruned = replace(BARE, iterations=5, rates=rates, pruning=PruningSchedule(0.3, 4, 4, 1), schedule=Constant())
    one, objective = population(10, settings=pruned), Objective(PICTURE, 1)
    fit(one, objective, pruned)

    other = population(10, settings=pruned)
    all_stay = replace(pruned, pruning=PruningSchedule(0.0))  # the weights are learned all the same
    fit(other, objective, replace(all_stay, iterations=4))
    other.take(prune(other.weights, 3))
    fit(other, objective, replace(all_stay, iterations=1))
    assert len(one) == 7
    assert np.array_equal(one.origins, other.origins)
    assert one.values.tobytes() == other.values.tobytes()
    for name in ("steps", "m", "v", "n", "previous"):
        assert np.array_equal(getattr(one.optimizer, name), getattr(other.optimizer, name))
    assert one.optimizer.m.any()


def test_weights_are_learned_for_pruning_alone():
    for pruning, learned in ((PruningSchedule(0.0), True), (None, False)):
        settings = replace(BARE, iterations=5, pruning=pruning)
        made = population(weight=0.5, settings=settings)
        fit(made, Objective(PICTURE, 1), settings)
        assert (made.weights != 0.5).any() == learned


def test_weights_are_folded_into_what_is_handed_on():
    settings = replace(BARE, iterations=20, pruning=PruningSchedule.intra())
    made, objective = population(20, 0.01, settings), Objective(PICTURE, 1)
    loss, _ = fit(made, objective, settings)
    expected = made.values[:, 5:8] * made.values[:, 8:9]
    assert np.array_equal(made.parameters()[:, 5:8], expected)
    assert np.array_equal(made.splats().colors, expected)
    assert np.array_equal(made.parameters()[:, :5], made.values[:, :5])
    assert objective.loss(made.splats().to_array()) == loss


@pytest.mark.parametrize("intra", [True, False])
def test_the_same_seed_gives_the_same_bits(intra):
    settings = QUICK.intra.fit if intra else replace(BARE, iterations=20, pruning=PruningSchedule.intra())
    runs = []
    for threads, seed in ((1, 0), (2, 0), (1, 1)):
        made = population(4, settings=settings, seed=seed)
        loss, _ = fit(made, Objective(PICTURE, threads), settings)
        runs.append((loss, made.values.tobytes()))
    assert runs[0] == runs[1]
    assert runs[0] != runs[2]


def test_convergence_ends_the_fit():
    settings = replace(BARE, iterations=50, rates=NO_STEPS, convergence=Convergence(patience=4, tolerance=0.0))
    assert fit(population(), Objective(PICTURE, 1), settings)[1] == 5  # the first loss has none before it


def test_no_fit_converges_before_its_splats_are_pruned():
    settings = replace(
        BARE, iterations=50, rates=NO_STEPS, convergence=Convergence(2, 1.0), pruning=PruningSchedule(0.2, 5, 20, 5)
    )
    made = population(20, settings=settings)
    _, done = fit(made, Objective(PICTURE, 1), settings)
    assert (done, len(made)) == (20, 16)


def test_divergence_is_reported():
    made = population()
    made.values[0, 5] = np.nan
    with pytest.raises(UsageError):
        fit(made, Objective(PICTURE, 1), BARE)


def test_the_schedule_scales_the_steps():
    """Half the rate moves half as far in the first step, in which Adan's step is the sign of the gradient."""
    moves = []
    for factor in (1.0, 0.5):
        settings = replace(BARE, iterations=1, rates=Rates(*[1e-3 * factor] * 4), schedule=StepDecay(0.5, 1))
        made = population(settings=settings)
        before = made.values.copy()
        fit(made, Objective(PICTURE, 1), settings)
        moves.append((made.values - before)[:, :5])
    np.testing.assert_allclose(moves[1], moves[0] / 2, rtol=2e-2, atol=1e-6)


def test_a_normalised_position_moves_in_units_of_half_the_frame():
    assert list(learned_unit(False, 24, 16)) == [12, 8, *[1] * 7]
    assert list(learned_unit(True, 24, 16)) == [1] * 9
    settings = replace(BARE, iterations=1)
    made = population(settings=settings)
    before = made.values.copy()
    fit(made, Objective(PICTURE, 1), settings)
    moved = np.abs(made.values - before)
    np.testing.assert_allclose(np.median(moved, axis=0)[:3], [12e-3, 8e-3, 1e-3], rtol=2e-2)


def test_relative_steps_grow_with_the_splat_within_limits():
    values = np.zeros((4, 9), np.float32)
    values[:, 2], values[:, 4] = [0.25, 1.0, 16.0, -1.0], [0.25, 4.0, 16.0, 1.0]
    np.testing.assert_allclose(step_factors(values), [0.3, 1.0, 4.0, 0.3])
    assert step_factors(values).dtype == np.float32


def test_factors_never_get_too_small():
    values = np.full((3, 9), -1, np.float32)
    values[1, 2:5] = 5
    keep_factors(values)
    assert list(values[:, 2]) == [MIN_FACTOR, 5, MIN_FACTOR]
    assert list(values[:, 4]) == [MIN_FACTOR, 5, MIN_FACTOR]
    assert list(values[:, 3]) == [-1, 5, -1]
    settings = replace(BARE, iterations=20, rates=Rates(1e-3, 0.5, 1e-3))
    made = population(settings=settings)
    fit(made, Objective(PICTURE, 1), settings)
    assert made.values[:, [2, 4]].min() >= MIN_FACTOR


def test_a_population_grows_and_shrinks_row_by_row():
    made = population(5)
    made.append(random_splats(uniform_numbers(3, rng()), WIDTH, HEIGHT), 0.01)
    assert list(made.origins) == [0, 1, 2, 3, 4, NEW, NEW, NEW]
    np.testing.assert_array_equal(made.weights, np.float32([1] * 5 + [0.01] * 3))
    made.take(np.array([1, 6]))
    assert list(made.origins) == [1, NEW]
    assert len(made.optimizer.steps) == len(made) == 2


def test_a_population_may_be_empty():
    settings = replace(BARE, iterations=3)
    made = Population(Splats.empty(), 1.0, np.empty(0, np.int64))
    loss, done = fit(made, Objective(PICTURE, 1), settings)
    assert (done, len(made)) == (3, 0)
    assert loss == pytest.approx(np.square(PICTURE, dtype=np.float64).sum() / PICTURE[..., 0].size)


@pytest.mark.parametrize("wrong", [-1e-3, np.inf, np.nan])
def test_rates_out_of_range_are_refused(wrong):
    for name in ("position", "cholesky", "color", "weight"):
        with pytest.raises(UsageError, match=f"rates|Rates.{name} is"):
            Rates(**{name: wrong})


def test_negative_iterations_are_refused():
    with pytest.raises(UsageError, match="iterations"):
        FitSettings(iterations=-1)
