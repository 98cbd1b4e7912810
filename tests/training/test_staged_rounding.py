"""Rounding in stages: feedback never makes it worse, what may not change stays, and codes give the state."""

from dataclasses import replace

import numpy as np
import pytest
from codec_cases import faint_splats

from gsvc_base.errors import UsageError
from gsvc_base.splats import Splats
from gsvc_ref.encoder.settings import Settings
from gsvc_ref.paper import State, reconstruct, rvq
from gsvc_ref.rendering import Objective, render_sum
from gsvc_ref.training import KEPT_WEIGHT, NEW, FrameQuantizer, Population, RoundingSettings, round_in_stages
from gsvc_ref.training.gram import gram, squared_change
from gsvc_ref.training.staged_rounding import round_with_feedback

SIDE = 48
QUICK = Settings.quick(profile="paper")


def some_splats(count: int = 50, seed: int = 1) -> np.ndarray:
    return faint_splats(count, seed, SIDE)


def population_of(p: np.ndarray, origins: np.ndarray | None = None) -> Population:
    origins = np.full(len(p), NEW, np.int64) if origins is None else origins
    return Population(Splats.from_array(p), KEPT_WEIGHT, origins, QUICK.intra.fit)


def quantizer_of(population: Population, objective: Objective, before: State) -> FrameQuantizer:
    blocks = QUICK.intra.quantizer, QUICK.inter.quantizer
    return FrameQuantizer(population, objective, *blocks, before, np.random.default_rng(0), in_stages=True)


def i_frame(iterations: int = 3, seed: int = 1, noise: float = 0.0):
    """Splats with their own picture, to which noise is added: the more, the coarser are the steps."""
    p = some_splats(seed=seed)
    picture = render_sum(Splats.from_array(p), SIDE, SIDE)
    picture = np.clip(picture + np.random.default_rng(5).normal(0, noise, picture.shape), 0, 1).astype(np.float32)
    objective = Objective(picture, 1)
    population = population_of(p)
    quantizer = quantizer_of(population, objective, State.initial(SIDE, SIDE))
    settings = RoundingSettings(iterations=iterations, before=0.0)
    return objective, quantizer, round_in_stages(p, quantizer, objective, settings)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("sizes", [(4,), (8, 8), (3, 5, 2)])
def test_feedback_never_raises_the_quadratic_form_over_plain_rounding(seed, sizes):
    rng = np.random.default_rng(seed)
    p = some_splats(80, seed)
    matrix = gram(p)
    wanted = rng.normal(0, 0.2, (60, 3)).astype(np.float32)
    books = [rng.normal(0, 0.2, (size, 3)).astype(np.float32) for size in sizes]
    plain = rvq.rvq_assign(wanted, *rvq.flat(books))
    errors = np.zeros((80, 3))
    errors[:10] = rng.normal(0, 0.02, (10, 3))  # what another block left
    errors[10:70] = rvq.dequantize(plain, *rvq.flat(books)) - wanted
    before, outside = squared_change(matrix, errors), errors.copy()
    for _ in range(2):
        chosen = plain.copy()
        round_with_feedback(matrix, wanted, 10, *rvq.joined(books), chosen, errors)
        after = squared_change(matrix, errors)
        assert after <= before * (1 + 1e-12)
        before = after
    assert after < 0.95 * squared_change(matrix, outside)
    assert np.array_equal(errors[:10], outside[:10])
    assert np.array_equal(errors[70:], outside[70:])


def test_the_errors_kept_are_those_of_the_codewords_chosen():
    rng = np.random.default_rng(4)
    p = some_splats(40)
    wanted = rng.normal(0, 0.2, (40, 3)).astype(np.float32)
    books = [rng.normal(0, 0.2, (8, 3)).astype(np.float32) for _ in range(2)]
    chosen = rvq.rvq_assign(wanted, *rvq.flat(books))
    errors = (rvq.dequantize(chosen, *rvq.flat(books)) - wanted).astype(np.float64)
    round_with_feedback(gram(p), wanted, 0, *rvq.joined(books), chosen, errors)
    assert errors == pytest.approx(rvq.dequantize(chosen, *rvq.flat(books)) - wanted, abs=1e-6)


def test_codes_reconstruct_to_the_state_and_come_close():
    objective, quantizer, (codes, state, done) = i_frame(noise=0.1)
    assert np.array_equal(reconstruct(codes, quantizer.before).splats.to_array(), state.splats.to_array())
    assert done == 4
    plain = reconstruct(quantizer.codes(some_splats()), quantizer.before)
    assert objective.loss(state.splats.to_array()) < objective.loss(plain.splats.to_array())


def test_refits_bring_the_codes_closer():
    losses = []
    for iterations in (0, 6):
        objective, _, (_, state, done) = i_frame(iterations, noise=0.1)
        losses.append(objective.loss(state.splats.to_array()))
        assert done == iterations + 1
    assert losses[1] < losses[0]


def test_kept_codebooks_that_do_not_fit_new_splats_are_not_used():
    """A splat that takes light away has no codeword in the codebooks of an I-frame of bright splats."""
    _, _, (_, before, _) = i_frame()
    p = np.concatenate([before.splats.to_array(), some_splats(2, 7)])
    p[-2:, 5:] = -0.3
    objective = Objective(np.clip(render_sum(Splats.from_array(p), SIDE, SIDE) + np.float32(0.002), 0, 1), 1)
    population = population_of(p, np.append(np.arange(50), [NEW, NEW]))
    quantizer = quantizer_of(population, objective, before)
    codes, state, _ = round_in_stages(p, quantizer, objective, RoundingSettings())
    assert codes.intra is not None
    assert codes.intra.codebooks is not None
    assert [len(book) for book in codes.intra.codebooks] == [2]  # a codeword each
    assert state.splats.to_array()[-2:, 5:] == pytest.approx(-0.3, abs=0.05)


def test_kept_codebooks_that_fit_are_used():
    _, _, (_, before, _) = i_frame()
    again = some_splats()[:2]  # colours that the I-frame had
    again[:, :2] = [[10, 40], [40, 10]]
    p = np.concatenate([before.splats.to_array(), again])
    picture = render_sum(Splats.from_array(p), SIDE, SIDE)
    noise = np.random.default_rng(3).normal(0, 0.02, picture.shape)
    objective = Objective(np.clip(picture + noise, 0, 1).astype(np.float32), 1)
    quantizer = quantizer_of(population_of(p, np.append(np.arange(50), [NEW, NEW])), objective, before)
    codes, _, _ = round_in_stages(p, quantizer, objective, RoundingSettings(iterations=0))
    assert codes.intra is not None
    assert codes.intra.codebooks is None
    assert codes.intra.quantizer is None


def test_every_evaluation_is_reported():
    p = some_splats()
    objective = Objective(render_sum(Splats.from_array(p), SIDE, SIDE), 1)
    quantizer = quantizer_of(population_of(p), objective, State.initial(SIDE, SIDE))
    told: list[tuple[int, int]] = []
    settings = RoundingSettings(iterations=6, before=0.5)
    round_in_stages(p, quantizer, objective, settings, lambda done, all_, loss: told.append((done, all_)))
    assert told == [(done, 7) for done in range(1, 8)]


def p_frame(moved_share: float):
    _, _, (_, before, _) = i_frame()
    p = before.splats.to_array()
    moving = np.random.default_rng(2).random(len(p)) < moved_share
    target = p.copy()
    target[moving, :2] += np.float32(0.8)
    noise = np.random.default_rng(3).normal(0, 0.01, (SIDE, SIDE, 3))
    picture = render_sum(Splats.from_array(target), SIDE, SIDE) + noise
    objective = Objective(np.clip(picture, 0, 1), 1)
    population = population_of(target, np.arange(len(p)))
    quantizer = quantizer_of(population, objective, before)
    return p, moving, objective, quantizer, target


def test_splats_that_did_not_change_keep_the_bits_of_the_reference():
    p, moving, objective, quantizer, target = p_frame(0.3)
    _, state, _ = round_in_stages(target, quantizer, objective, RoundingSettings())
    after = state.splats.to_array()
    still = ~quantizer.active.any(axis=1)
    assert still.any()
    assert not still[moving].all()
    assert np.array_equal(after[still], p[still])
    assert objective.loss(after) < 0.5 * objective.loss(p)


def test_a_frame_without_any_change_takes_no_evaluation():
    p, _, objective, quantizer, _ = p_frame(0.0)
    _, state, done = round_in_stages(p, quantizer, objective, RoundingSettings())
    assert done == 0
    assert np.array_equal(state.splats.to_array(), p)


def test_the_objective_holds_no_splat_afterwards():
    _, _, objective, quantizer, target = p_frame(0.3)
    round_in_stages(target, quantizer, objective, RoundingSettings())
    assert objective.evaluate(target[:7])[1].shape == (7, 8)


def test_settings_refuse_what_makes_no_sense():
    for changes in ({"iterations": -1}, {"before": 1.5}, {"before": -0.1}):
        with pytest.raises(UsageError):
            replace(RoundingSettings(), **changes)
