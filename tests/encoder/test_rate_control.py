"""Constant rate and constant quality: which splats go, how many stay, and what a frame must reach."""

import math
from dataclasses import replace

import numpy as np
import pytest
from codec_cases import encoded, flat, paper_fast, paper_quick, waves
from hypothesis import given
from hypothesis import strategies as st

from gsvc_base.splats import Splats
from gsvc_ref.encoder import Settings
from gsvc_ref.encoder import frame as frame_module
from gsvc_ref.encoder.rate import (
    GRADIENT_PART,
    add_where_wrong,
    hold_quality,
    make_room,
    most_visible,
    removal_errors,
    visibility,
)
from gsvc_ref.metrics import psnr
from gsvc_ref.rendering import Objective, render, render_sum
from gsvc_ref.stream import decode
from gsvc_ref.training import KEPT_WEIGHT, NEW, Population, fit, image_start, loss_of_psnr, psnr_of_loss

WIDTH, HEIGHT = 32, 24
PICTURE = waves(WIDTH, HEIGHT, 1)[0].astype(np.float32) / 255
EVERYWHERE = np.ones((HEIGHT, WIDTH), bool)
TUNE = paper_fast(iterations=30).intra.short_fit


def population(count, picture=PICTURE, iterations=15) -> tuple[Population, Objective]:
    chosen, rng = paper_fast(iterations=iterations), np.random.default_rng(0)
    splats = image_start(picture, count, rng)
    made = Population(splats, KEPT_WEIGHT, np.full(count, NEW, np.int64), chosen.intra.fit)
    objective = Objective(picture, 1)
    fit(made, objective, replace(chosen.intra.fit, growth=None), rng)
    return made, objective


def test_psnr_and_loss_are_each_others_inverse():
    assert psnr_of_loss(3.0) == 0  # black against white: the loss adds the three channels
    assert psnr_of_loss(0.0) == math.inf
    assert psnr_of_loss(0.003) == pytest.approx(30)
    for goal in (1.0, 20.0, 33.3, 70.0):
        assert psnr_of_loss(loss_of_psnr(goal)) == pytest.approx(goal)


def test_visibility_is_what_the_removal_of_a_splat_adds():
    """Eight splats far from each other: the sum of squares of each alone, by the exact renderer."""
    x, y = np.meshgrid(np.arange(25, 200, 50), np.arange(25, 100, 50))
    rng = np.random.default_rng(0)
    parameters = np.column_stack(
        [
            x.ravel(),
            y.ravel(),
            rng.uniform(2, 5, 8),
            rng.uniform(-2, 2, 8),
            rng.uniform(2, 5, 8),
            rng.normal(0, 0.5, (8, 3)),
        ]
    ).astype(np.float32)
    whole = render_sum(Splats.from_array(parameters), 200, 100, precision="exact")
    added = []
    for n in range(8):
        rest = Splats.from_array(np.delete(parameters, n, axis=0))
        added.append(np.square(whole - render_sum(rest, 200, 100, precision="exact")).sum())
    np.testing.assert_allclose(math.pi * visibility(parameters), added, rtol=2e-3)
    assert list(most_visible(parameters, 3)) == sorted(np.argsort(added)[-3:])


def test_a_splat_with_a_negative_factor_is_not_visible():
    parameters = np.array(
        [[5, 5, -1, 0, 2, 1, 1, 1], [5, 5, 1, 0, -2, 1, 1, 1], [5, 5, -1, 0, -2, 1, 1, 1]], np.float32
    )
    assert not visibility(parameters).any()


def test_of_equally_visible_splats_the_first_stay():
    parameters = np.tile(np.array([5, 5, 1, 0, 2, 1, 1, 1], np.float32), (5, 1))
    parameters[3, 5] = 2
    for count, expected in ((-1, []), (0, []), (1, [3]), (3, [0, 1, 3]), (5, [0, 1, 2, 3, 4]), (9, [0, 1, 2, 3, 4])):
        assert list(most_visible(parameters, count)) == expected


@given(st.integers(0, 12), st.integers(1, 30))
def test_an_exchange_never_exceeds_the_total(new, total):
    made, objective = population(12, iterations=1)
    made.origins = np.arange(12)
    add_where_wrong(made, objective, make_room(made, objective, new, total), np.random.default_rng(0), EVERYWHERE)
    old = made.origins[made.origins != NEW]
    assert len(made) - len(old) == new
    assert len(made) <= max(total, new)
    assert len(old) == (12 if 12 + new <= total else max(0, total - new))
    assert np.array_equal(old, np.sort(old))
    assert (made.origins[len(old) :] == NEW).all()
    assert len(made.optimizer.steps) == len(made)


def test_an_exchange_keeps_what_the_error_rises_without_and_adds_where_the_error_is():
    picture = PICTURE.copy()
    made, _ = population(20)
    made.origins = np.arange(20)
    picture[2:7, 20:26] = 1 - picture[2:7, 20:26]
    objective = Objective(picture, 1)
    _, gradient = objective.evaluate(made.parameters())
    added = removal_errors(made.parameters(), gradient, WIDTH * HEIGHT)
    add_where_wrong(made, objective, make_room(made, objective, 5, 20), np.random.default_rng(0), EVERYWHERE)
    assert np.array_equal(made.origins, [*np.sort(np.argsort(added)[5:]), *[NEW] * 5])
    new = made.values[15:, :2]
    inside = (new[:, 0] >= 20) & (new[:, 0] < 26) & (new[:, 1] >= 2) & (new[:, 1] < 7)
    assert inside.sum() >= 3


def test_the_terms_of_removal_errors_are_those_of_the_error_without_a_splat():
    """A splat alone, nowhere beyond 0 or 1, against the sums of the exact renderer."""
    parameters = np.array([[40, 30, 4, 1, 3, 0.5, 0.2, 0.3]], np.float32)
    picture = np.random.default_rng(0).random((60, 80, 3), np.float32)
    shown = render_sum(Splats.from_array(parameters), 80, 60, precision="exact")
    _, gradient = Objective(picture, 1).evaluate(parameters)
    square, product = np.square(shown).sum(), 2 * (shown * (shown - picture)).sum()
    expected = square - GRADIENT_PART * product
    assert removal_errors(parameters, gradient, 80 * 60)[0] == pytest.approx(expected, rel=1e-2)


def test_a_splat_left_behind_is_the_first_to_go():
    """The brighter of two equal splats stands where the new picture is black."""
    stays, left_behind = [10, 12, 3, 0, 3, 0.5, 0.5, 0.5], [24, 12, 3, 0, 3, 0.8, 0.8, 0.8]
    parameters = np.array([stays, left_behind], np.float32)
    picture = render(Splats.from_array(parameters[:1]), WIDTH, HEIGHT)
    made = Population(Splats.from_array(parameters), KEPT_WEIGHT, np.arange(2), TUNE)
    assert make_room(made, Objective(picture, 1), 1, 2) == 1
    assert list(made.origins) == [0]


@pytest.mark.parametrize("profile", ["paper", "main"])
def test_a_picture_that_jumps_comes_back_to_the_quality_of_its_i_frame(profile):
    """The source is the same from frame 1 on; a pass over one frame is too short to draw it anew."""
    before, after = waves(frames=1)[0], np.ascontiguousarray(waves(frames=1)[0][::-1, ::-1])
    report, _ = encoded([before, *[after] * 8], Settings.quick(profile=profile, splats=80, key_frames=100, threads=1))
    first, jump, *later = report.frames
    assert jump.psnr < first.psnr - 1  # otherwise there is nothing to catch up with
    why = "equal to the frame before, which is not yet as good as its I-frame"
    assert (later[0].type, later[0].reason) == ("P", why)
    assert next(one for one in later[0].decisions if one.effect == "frames").reason == why
    assert (later[-1].type, later[-1].reason) == ("R", "equal to the frame before")
    assert later[-1].psnr > jump.psnr + 1


def held(count, goal, most, iterations=30) -> tuple[Population, float, int]:
    made, objective = population(count)
    done = hold_quality(made, objective, loss_of_psnr(goal), most, TUNE, np.random.default_rng(0))
    return made, psnr_of_loss(objective.loss(made.parameters())), done


def test_quality_that_is_missing_costs_splats():
    made, reached, done = held(10, 28, 400)
    assert reached >= 28
    assert 10 < len(made) < 400
    assert done % TUNE.iterations == 0
    assert done > 0


def test_quality_to_spare_saves_splats():
    made, reached, done = held(60, 18, 400)
    assert reached >= 18
    assert len(made) < 40
    assert done > 0


def test_what_fits_stays_as_it_is():
    made, objective = population(30)
    before = made.values.copy()
    goal = objective.loss(made.parameters())
    assert hold_quality(made, objective, goal, 400, TUNE, np.random.default_rng(0)) == 0
    assert np.array_equal(made.values, before)


@pytest.mark.parametrize("most", [10, 13, 20])
def test_no_more_splats_than_allowed(most):
    made, reached, _ = held(10, 60, most)
    assert len(made) == most
    assert reached < 60


def test_at_least_one_splat_stays():
    made, objective = population(3, flat(0, WIDTH, HEIGHT)[0].astype(np.float32))
    hold_quality(made, objective, loss_of_psnr(5), 9, replace(TUNE, iterations=1), np.random.default_rng(0))
    assert len(made) == 1


def test_survivors_keep_their_origins_while_quality_is_held():
    made, objective = population(60)
    made.origins = np.arange(60)
    hold_quality(made, objective, loss_of_psnr(18), 400, TUNE, np.random.default_rng(0))
    assert np.array_equal(made.origins, np.unique(made.origins))
    assert len(made.origins) == len(made) == len(made.optimizer.steps)


@pytest.mark.parametrize("goal", [24.0, 28.0, 33.0])
def test_constant_quality_holds_in_every_frame(goal):
    clip = waves(frames=3, cut=2)
    settings = paper_quick(iterations=40, psnr=goal, key_frames=(), threads=1)
    report, _ = encoded(clip, settings)
    assert [frame.type for frame in report.frames] == ["I", "P", "P"]
    assert min(frame.psnr for frame in report.frames) >= goal
    assert max(frame.splats for frame in report.frames) < settings.most_splats(32, 24)


def test_of_all_attempts_at_a_quality_the_best_is_kept(monkeypatch):
    """Where the quantisers are the limit more splats do not help, and the last attempt can be the worst."""
    attempts = []
    finish = frame_module._FrameWork._finish

    def recording(work, codes, state):
        attempts.append(finish(work, codes, state))
        return attempts[-1]

    monkeypatch.setattr(frame_module._FrameWork, "_finish", recording)
    settings = paper_fast(iterations=30, psnr=24.0, cholesky_bits=2, color_stages=1, color_codewords=4)
    report, data = encoded(waves(frames=1), settings)
    qualities = [attempt.psnr for attempt in attempts]
    assert qualities[-1] < max(qualities) < 24
    frame = report.frames[0]
    assert frame.psnr == max(qualities)
    assert frame.psnr == psnr(waves(frames=1)[0], next(decode(data)), 255)
    assert frame.iterations == attempts[-1].iterations  # all the work, not that of the best alone


def test_an_easy_frame_takes_fewer_splats_than_a_hard_one():
    y, x = np.mgrid[:24, :32]
    slope = np.repeat(((3 * x + 4 * y)[:, :, None]).astype(np.uint8), 3, axis=2)
    settings = paper_quick(iterations=40, psnr=26.0, key_frames=1, threads=1)
    report, _ = encoded([slope, *waves(frames=1)], settings)
    easy, hard = report.frames
    assert min(easy.psnr, hard.psnr) >= 26
    assert easy.splats < hard.splats


def test_more_quality_takes_more_splats_and_more_bytes():
    sizes = []
    for goal in (22.0, 27.0, 32.0):
        report, data = encoded(waves(frames=1), paper_quick(iterations=40, psnr=goal, cholesky_bits=8, threads=1))
        sizes.append((report.frames[0].splats, len(data)))
    assert sizes == sorted(sizes)
    assert len({splats for splats, _ in sizes}) == 3


def test_the_most_splats_are_a_bound_for_constant_quality():
    noise = [np.random.default_rng(t).integers(0, 256, (16, 24, 3), np.uint8) for t in range(2)]
    report, _ = encoded(noise, paper_fast(psnr=50.0, splats=14))
    assert [frame.splats for frame in report.frames] == [14, 14]


def test_constant_rate_gives_every_frame_the_same_number_of_splats():
    report, _ = encoded(waves(frames=4, cut=2), paper_fast(splats=33, key_frames=3, effects="auto,gsa=all"))
    assert [frame.splats for frame in report.frames] == [33] * 4
    assert all(frame.new_splats == frame.pruned_splats == 1 for frame in report.frames if frame.type == "P")


@pytest.mark.parametrize(("splats", "left"), [(40, 36), (10, 9), (15, 13), (3, 3), (1, 1)])
def test_the_papers_frames_have_nine_tenths_of_their_splats(splats, left):
    """GSP removes 10 % of an I-frame's; GSA adds as many to a P-frame, and GSP removes them again."""
    report, _ = encoded(waves(frames=4), Settings.paper(iterations=40, splats=splats, key_frames=3, threads=1))
    assert [frame.splats for frame in report.frames] == [left] * 4
    assert [frame.type for frame in report.frames] == ["I", "P", "P", "I"]
