"""Fine-tuning with quantisation: never worse than where it began, and what a decoder keeps is used when that pays."""

from dataclasses import replace

import numpy as np
import pytest
from codec_cases import adan_fast, encoded, flat, paper_quick, waves

from gsvc_base.splats import Splats
from gsvc_ref.encoder import Settings
from gsvc_ref.encoder.initialization import image_start
from gsvc_ref.paper import FrameCodes, Kept, State, reconstruct
from gsvc_ref.rendering import Objective, render_sum
from gsvc_ref.stream import Stream
from gsvc_ref.training import (
    KEPT_WEIGHT,
    NEW,
    BlockSettings,
    FrameQuantizer,
    Population,
    fine_tune,
    fit,
    loss_of_psnr,
)
from gsvc_ref.training.block_quantizer import BlockQuantizer
from gsvc_ref.training.frame_quantizer import BITS_OF_ATTRIBUTES, REUSE_LOSS, changed, inter_quantizer, with_steps_for

WIDTH, HEIGHT = 32, 24
SIZE = np.array([WIDTH / 2, HEIGHT / 2], np.float32)
NONE = np.zeros(0, np.bool_)
PICTURES = [frame.astype(np.float32) / 255 for frame in waves(WIDTH, HEIGHT, 3)]


def fitted(picture=PICTURES[0], count=30, iterations=15, chosen=None) -> tuple[Population, Objective]:
    """A population of new splats that resembles a picture."""
    chosen = chosen or adan_fast(iterations=iterations)
    rng = np.random.default_rng(0)
    population = Population(
        image_start(picture, count, rng), KEPT_WEIGHT, np.full(count, NEW, np.int64), chosen.intra.fit.optimizer
    )
    objective = Objective(picture, 1)
    fit(population, objective, chosen.intra.fit)
    return population, objective


def tuned(population, objective, chosen, before, iterations=None) -> tuple:
    """Codes, state, iterations made, and the loss at each iteration."""
    quantizer = FrameQuantizer(population, objective, *blocks(chosen), before, np.random.default_rng(1))
    losses = []
    tune = chosen.intra.tune if iterations is None else replace(chosen.intra.tune, iterations=iterations)
    result = fine_tune(population.parameters(), quantizer, objective, tune, lambda i, n, loss: losses.append(loss))
    return *result, losses


def blocks(chosen) -> tuple[BlockSettings, BlockSettings]:
    """The quantisers of values and of differences."""
    return chosen.intra.quantizer, chosen.inter.quantizer


def second_frame(state: State, chosen, iterations=10) -> tuple[Population, Objective]:
    """The decoded splats of a frame, fitted to the next picture."""
    population = Population(state.splats, KEPT_WEIGHT, np.arange(len(state.splats)), chosen.inter.fit.optimizer)
    objective = Objective(PICTURES[1], 1)
    fit(population, objective, replace(chosen.inter.fit, iterations=iterations))
    return population, objective


@pytest.mark.parametrize("chosen", [adan_fast(iterations=30), Settings.paper(iterations=100)], ids=["quick", "paper"])
def test_the_best_of_all_iterations_is_returned(chosen):
    population, objective = fitted()
    codes, state, made, losses = tuned(population, objective, chosen, State.initial(WIDTH, HEIGHT), 20)
    assert made == 20
    assert len(losses) == 21
    assert objective.loss(state.splats.to_array()) == min(losses) <= losses[0]
    assert reconstruct(codes, State.initial(WIDTH, HEIGHT)).splats == state.splats
    assert codes.type == "I"


def test_fine_tuning_wins_back_what_quantisation_lost():
    population, objective = fitted(iterations=60)
    chosen = adan_fast(cholesky_bits=5, color_stages=1, color_codewords=12)
    *_, losses = tuned(population, objective, chosen, State.initial(WIDTH, HEIGHT), 40)
    assert min(losses) < 0.7 * losses[0]


def test_without_iterations_values_are_quantised_as_they_are():
    population, objective = fitted()
    before = State.initial(WIDTH, HEIGHT)
    codes, _, made, losses = tuned(population, objective, adan_fast(), before, 0)
    assert made == 0
    assert len(losses) == 1
    fresh = FrameQuantizer(population, objective, *blocks(adan_fast()), before, np.random.default_rng(1))
    assert codes == fresh.codes(population.parameters())


def test_fine_tuning_stops_when_it_has_converged():
    population, objective = fitted()
    chosen = Settings.paper(iterations=100)
    soon = replace(chosen.intra.tune.convergence, patience=3, tolerance=10.0)
    tune = replace(chosen.intra.tune, iterations=50, convergence=soon)
    before = State.initial(WIDTH, HEIGHT)
    quantizer = FrameQuantizer(population, objective, *blocks(chosen), before, np.random.default_rng(1))
    assert fine_tune(population.parameters(), quantizer, objective, tune)[2] == 3


def test_the_given_values_are_not_changed():
    population, objective = fitted()
    values = population.parameters()
    kept = values.copy()
    before = State.initial(WIDTH, HEIGHT)
    quantizer = FrameQuantizer(population, objective, *blocks(adan_fast()), before, np.random.default_rng(1))
    fine_tune(values, quantizer, objective, adan_fast().intra.tune)
    assert np.array_equal(values, kept)


def test_a_p_frame_codes_survivors_new_splats_and_who_is_gone():
    chosen = adan_fast(iterations=15)
    population, objective = fitted()
    _, state, _, _ = tuned(population, objective, chosen, State.initial(WIDTH, HEIGHT))
    population, objective = second_frame(state, chosen)
    stay = np.delete(np.arange(30), [0, 7, 29])
    population.take(stay)
    population.append(image_start(PICTURES[1], 4, np.random.default_rng(2)), KEPT_WEIGHT)
    codes, after, _, losses = tuned(population, objective, chosen, state)
    assert codes.type == "P"
    assert np.array_equal(np.flatnonzero(codes.survivors), stay)
    assert codes.intra_count == 4
    assert len(after.splats) == 31
    assert reconstruct(codes, state).splats == after.splats
    assert objective.loss(after.splats.to_array()) == min(losses)


def test_a_p_frame_without_survivors_or_without_new_splats():
    chosen = adan_fast()
    population, objective = fitted()
    _, state, _, _ = tuned(population, objective, chosen, State.initial(WIDTH, HEIGHT))
    still, objective = second_frame(state, chosen, iterations=0)
    codes, after, _, _ = tuned(still, objective, chosen, state, 0)
    assert codes.intra is None
    assert codes.survivors.all()
    fresh, _ = fitted(PICTURES[1], 5)
    codes, after, _, _ = tuned(fresh, objective, chosen, state, 3)
    assert codes.type == "P"
    assert codes.inter is None
    assert not codes.survivors.any()
    assert len(after.splats) == 5


def test_a_quantiser_of_differences_is_kept_from_frame_to_frame():
    chosen = adan_fast(iterations=15)
    population, objective = fitted()
    _, state, _, _ = tuned(population, objective, chosen, State.initial(WIDTH, HEIGHT))
    population, objective = second_frame(state, chosen)
    reference = state.splats.to_array()
    active = np.ones((30, 3), np.bool_)

    def quantizer(values, block, kept):
        return inter_quantizer(values, reference, active, SIZE, block, kept, np.random.default_rng(0))

    values, block = population.parameters(), chosen.inter.quantizer
    fresh = quantizer(values, block, Kept())
    sent = fresh.codes(values)
    assert sent.quantizer is not None
    assert sent.codebooks is not None
    kept = Kept().after(sent)
    again = quantizer(values, block, kept).codes(values)
    assert again.quantizer is None
    assert again.codebooks is None
    other_step = quantizer(values, replace(block, cholesky_step=block.cholesky_step / 2), kept).codes(values)
    assert other_step.quantizer is not None
    assert other_step.codebooks is None
    other_colors = values.copy()
    other_colors[:, 5:8] += np.random.default_rng(0).normal(0, 1, (30, 3)).astype(np.float32)
    new_books = quantizer(other_colors, block, kept).codes(other_colors)
    assert new_books.quantizer is None
    assert new_books.codebooks is not None
    learned = quantizer(values, replace(block, cholesky_step=None), kept).codes(values)
    assert learned.quantizer is not None


def test_new_splats_use_what_is_kept():
    chosen = adan_fast(iterations=15)
    population, objective = fitted()
    _, state, _, _ = tuned(population, objective, chosen, State.initial(WIDTH, HEIGHT))
    frame, objective = second_frame(state, chosen)
    frame.append(state.splats.take(np.arange(3)), KEPT_WEIGHT)
    quantizer = FrameQuantizer(frame, objective, *blocks(chosen), state, np.random.default_rng(1))
    block = quantizer.codes(frame.parameters()).intra
    assert block.quantizer is None
    assert block.codebooks is None


def test_new_splats_get_a_quantiser_of_their_own_where_the_kept_one_spoils_them():
    chosen = adan_fast(iterations=15)
    dark, objective = fitted(np.full_like(PICTURES[0], 0.1))
    _, state, _, _ = tuned(dark, objective, chosen, State.initial(WIDTH, HEIGHT))
    new, objective = fitted()
    quantizer = FrameQuantizer(new, objective, *blocks(chosen), state, np.random.default_rng(1))
    block = quantizer.codes(new.parameters()).intra
    assert block.quantizer is not None
    assert block.codebooks is not None
    kept = BlockQuantizer(new.parameters(), None, None, SIZE, chosen.intra.quantizer, quantizer.intra.rng, state.intra)
    spoilt = replace(state, splats=Splats.empty())
    losses = [
        objective.loss(reconstruct(FrameCodes.predicted_frame(NONE, None, codes), spoilt).splats.to_array())
        for codes in (block, kept.codes(new.parameters()))
    ]
    assert losses[1] > REUSE_LOSS * losses[0]


def test_a_picture_that_appears_after_an_even_one_can_be_coded():
    """What suits the splats of an even I-frame would spoil all new ones, however many there are."""
    clip = [*flat(30, 24, 30), *flat(30, 24, 30)]
    clip[1][10:16, 5:11] = (250, 120, 20)
    report, _ = encoded(clip, paper_quick(iterations=50, psnr=26.0, key_frames=(), threads=1))
    assert [frame.type for frame in report.frames] == ["I", "P"]
    assert min(frame.psnr for frame in report.frames) >= 26
    assert report.frames[1].splats < 20


def test_an_i_frame_sends_its_own_quantisers_and_the_next_p_frame_too():
    report, data = encoded(waves(frames=8), adan_fast(iterations=20, key_frames=4))
    with Stream(data) as stream:
        frames = list(stream)
    assert report.frame_types == {"I": 2, "P": 6}
    for first in (0, 4):
        assert frames[first].codes.intra.quantizer is not None
        assert frames[first].codes.intra.codebooks is not None
        block = frames[first + 1].codes.inter
        assert block.colors is None or block.codebooks is not None
        assert block.cholesky is None or block.quantizer is not None
    reused = [frame.codes.inter for frame in frames if frame.type == "P"]
    assert any(block.cholesky is not None and block.quantizer is None for block in reused)


@pytest.mark.parametrize(
    ("psnr", "factor"), [(35, 1), (37.9, 1), (38.2, 0.5), (41, 0.5), (29, 2), (23, 4), (5, 4), (47, 0.25), (90, 0.25)]
)
def test_fixed_steps_follow_the_error(psnr, factor):
    block = BlockSettings(position_step=0.1, cholesky_step=0.2)
    steps = with_steps_for(loss_of_psnr(psnr), block)
    assert steps == replace(block, position_step=0.1 * factor, cholesky_step=0.2 * factor)
    alone = with_steps_for(loss_of_psnr(psnr), replace(block, position_step=None))
    assert alone.position_step is None
    assert alone.cholesky_step == 0.2 * factor


def test_learned_steps_do_not_follow_the_error():
    block = BlockSettings(position_step=0.1, cholesky_step=None)
    assert with_steps_for(1.0, block) is block
    fixed = BlockSettings(cholesky_step=0.2)
    assert with_steps_for(0.0, fixed) is fixed


REFERENCE = np.array([[30, 25, 4, 1.5, 5, 0.5, 0.3, -0.2], [60, 40, 6, -2, 3, 0.2, 0.6, 0.1]], np.float32)
CHANGES = {
    "x": (0, [0.1, 0, 0, 0, 0, 0, 0, 0]),
    "y": (0, [0, -0.1, 0, 0, 0, 0, 0, 0]),
    "l11": (1, [0, 0, 0.1, 0, 0, 0, 0, 0]),
    "l21": (1, [0, 0, 0, 0.1, 0, 0, 0, 0]),
    "l22": (1, [0, 0, 0, 0, -0.1, 0, 0, 0]),
    "size": (1, [0, 0, 0.1, 0, 0.15, 0, 0, 0]),
    "shape": (1, [0, 0, 0.1, 0.1, -0.1, 0, 0, 0]),
    "color": (2, [0, 0, 0, 0, 0, 0.02, -0.05, 0.03]),
}


@pytest.mark.parametrize("name", CHANGES)
@pytest.mark.parametrize("splat", [0, 1])
def test_a_change_counts_when_it_alters_the_picture_enough(name, splat):
    """The effect is the sum of squared differences of two exact renderings, within a tenth."""
    attribute, change = CHANGES[name]
    bits = BITS_OF_ATTRIBUTES[attribute]
    reference = REFERENCE[splat : splat + 1]
    values = reference + np.array([change], np.float32)
    pictures = [render_sum(Splats.from_array(p), 90, 70, precision="exact") for p in (reference, values)]
    effect = float(np.square(pictures[1] - pictures[0]).sum())
    assert changed(values, reference, 0.9 * effect / bits)[0, attribute]
    assert not changed(values, reference, 1.1 * effect / bits)[0, attribute]
    others = np.delete(np.arange(3), attribute)
    assert not changed(values, reference, 1e-9)[0, others].any()


def test_with_a_threshold_of_zero_everything_counts():
    assert changed(REFERENCE, REFERENCE, 0.0).all()
    assert not changed(REFERENCE, REFERENCE, 1e-12).any()
    assert changed(REFERENCE, REFERENCE, 0.0).dtype == np.bool_


def test_the_paper_codes_every_change_and_quick_leaves_what_is_still():
    population, objective = fitted()
    for chosen, everything in ((Settings.paper(iterations=10), True), (adan_fast(), False)):
        _, state, _, _ = tuned(population, objective, chosen, State.initial(WIDTH, HEIGHT), 0)
        again, objective_again = second_frame(state, chosen, iterations=0)
        quantizer = FrameQuantizer(again, objective_again, *blocks(chosen), state, np.random.default_rng(0))
        assert quantizer.inter.active.all() == everything
        assert quantizer.inter.active.any() == everything


def test_splats_that_fine_tuning_cannot_change_keep_their_bits_and_are_thawed():
    population, objective = fitted()
    _, state, _, _ = tuned(population, objective, adan_fast(), State.initial(WIDTH, HEIGHT), 0)
    still, objective = second_frame(state, adan_fast(), iterations=0)
    still.values[:10, :2] += 2
    quantizer = FrameQuantizer(still, objective, *blocks(adan_fast()), state, np.random.default_rng(0))
    assert quantizer.static.any()
    assert not quantizer.static.all()
    assert np.array_equal(quantizer.static, ~quantizer.inter.active.any(axis=1))
    codes, after, _ = fine_tune(still.parameters(), quantizer, objective, adan_fast().inter.tune)
    reference = state.splats.to_array()
    assert np.array_equal(after.splats.to_array()[quantizer.static], reference[quantizer.static])
    assert reconstruct(codes, state).splats == after.splats
    _, gradient = objective.evaluate(reference)
    assert gradient[quantizer.static].any()
    learned = Settings.paper(iterations=10)  # its zero is not exact
    quantizer = FrameQuantizer(still, objective, *blocks(learned), state, np.random.default_rng(0))
    assert not quantizer.static.any()
