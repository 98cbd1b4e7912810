"""The training objective: loss and gradient by the definition, bits, buffers and misuse."""

import math
import threading

import numpy as np
import pytest
from hypothesis import given, settings
from render_cases import EXAMPLES, HEIGHT, JIT, NAMED, WIDTH, ordinary, population, single, splat_sets

from gsvc_base.errors import UsageError
from gsvc_base.splats import Splats
from gsvc_ref.rendering import Objective, render, render_gradients, render_sum
from gsvc_ref.rendering.fast import batches

pytestmark = [] if JIT else [pytest.mark.filterwarnings("ignore:.*encountered:RuntimeWarning")]

TARGET = np.random.default_rng(11).random((HEIGHT, WIDTH, 3), np.float32)


def exact_objective(splats, target):
    """L2 and its straight-through gradient in binary64."""
    height, width, _ = target.shape
    residual = np.clip(render_sum(splats, width, height, precision="exact"), 0, 1) - target
    scale = 1 / (height * width)
    return np.sum(residual**2) * scale, render_gradients(splats, 2 * scale * residual, precision="exact")


@settings(max_examples=EXAMPLES, deadline=None)
@given(splat_sets(ordinary))
def test_loss_and_gradient_equal_the_definition(splats):
    loss, gradient = Objective(TARGET).evaluate(splats.to_array())
    expected_loss, expected = exact_objective(splats, TARGET)
    # A pixel on the edge of a splat's support may flip: 1/255 of colours up to 2 in some of the 1665 pixels.
    assert loss == pytest.approx(expected_loss, abs=1e-4 * expected_loss)
    assert gradient.shape == (len(splats), 8)
    assert gradient.dtype == np.float32
    assert np.linalg.norm(gradient - expected) <= 2e-3 * np.linalg.norm(expected) + 1e-7


def test_a_dense_set_equals_the_definition_closely():
    splats = population(60 if JIT else 8, WIDTH, HEIGHT)
    loss, gradient = Objective(TARGET).evaluate(splats.to_array())
    expected_loss, expected = exact_objective(splats, TARGET)
    assert loss == pytest.approx(expected_loss, rel=1e-6)
    assert np.linalg.norm(gradient - expected) <= 2e-6 * np.linalg.norm(expected)


@pytest.mark.parametrize("name", NAMED)
def test_named_cases_stay_finite(name):
    loss, gradient = Objective(TARGET).evaluate(NAMED[name].to_array())
    expected_loss, _ = exact_objective(NAMED[name], TARGET)
    assert loss == pytest.approx(expected_loss, rel=1e-6)
    assert np.isfinite(gradient).all()


def test_the_loss_is_summed_over_the_channels():
    """Black against white is 3 (not 1) whatever the size: the paper's norm is over the three channels."""
    for shape in ((1, 1, 3), (5, 19, 3), (40, 16, 3)):
        loss, gradient = Objective(np.ones(shape)).evaluate(np.zeros((0, 8)))
        assert loss == 3
        assert gradient.shape == (0, 8)


@pytest.mark.parametrize("width", [1, 15, 16, 17, 45])
def test_what_lies_outside_the_frame_does_not_count(width):
    """The last tile has lanes and the last rows have neighbours that are no pixels."""
    target = np.random.default_rng(0).random((5, width, 3), np.float32)
    splats = population(9, width, 5)
    loss, gradient = Objective(target).evaluate(splats.to_array())
    expected_loss, expected = exact_objective(splats, target)
    assert loss == pytest.approx(expected_loss, rel=1e-6)
    np.testing.assert_allclose(gradient, expected, atol=1e-5 * abs(expected).max())


def test_bits_do_not_depend_on_the_number_of_threads():
    parameters = population(50 if JIT else 6, WIDTH, HEIGHT).to_array()
    results = [Objective(TARGET, threads).evaluate(parameters) for threads in (1, 2, 3, 8)]
    for loss, gradient in results:
        assert loss == results[0][0]
        assert gradient.tobytes() == results[0][1].tobytes()


def test_loss_alone_has_the_same_bits():
    objective = Objective(TARGET)
    parameters = population(10, WIDTH, HEIGHT).to_array()
    assert objective.loss(parameters) == objective.evaluate(parameters)[0]


@pytest.mark.parametrize("precision", ["fast", "deterministic"])
def test_weights_that_find_no_room_are_found_again(precision, monkeypatch):
    target, parameters = np.full((HEIGHT, WIDTH, 3), 0.5, np.float32), population(30, WIDTH, HEIGHT).to_array()
    results = []
    for kept in (batches.KEPT, 5000, 0):  # all, some, none
        monkeypatch.setattr(batches, "KEPT", kept)
        results.append(Objective(target, 1, precision=precision).evaluate(parameters))
    for loss, gradient in results[1:]:
        assert loss == results[0][0]
        if precision == "deterministic":
            assert gradient.tobytes() == results[0][1].tobytes()
        np.testing.assert_allclose(gradient, results[0][1], rtol=1e-4, atol=1e-6)


def test_evaluations_do_not_disturb_each_other():
    """The buffers are reused from call to call, and the number of splats and entries grows and shrinks."""
    objective = Objective(TARGET)
    sets = [population(count, WIDTH, HEIGHT, seed=count).to_array() for count in (3, 12, 1, 12, 0, 5)]
    kept = [objective.evaluate(parameters) for parameters in sets]
    for parameters, (loss, gradient) in zip(sets, kept, strict=True):
        fresh_loss, fresh_gradient = Objective(TARGET).evaluate(parameters)
        assert loss == fresh_loss
        assert gradient.tobytes() == fresh_gradient.tobytes()


def test_picture_and_residual_are_those_of_the_last_evaluation():
    objective = Objective(TARGET)
    assert not objective.picture().any()
    splats = population(10, WIDTH, HEIGHT)
    parameters = splats.to_array()
    objective.evaluate(parameters)
    parameters[:] = 1  # the caller may change its array in place
    picture = render(splats, WIDTH, HEIGHT)
    assert np.array_equal(objective.picture(), picture)
    assert np.array_equal(objective.residual(), picture - TARGET)


@pytest.mark.parametrize("precision", ["fast", "deterministic"])
def test_a_picture_that_was_drawn_on_the_way_is_the_one_that_would_be_rendered(precision):
    objective = Objective(TARGET, 2, precision=precision)
    for count in (10, 0):
        parameters = population(count, WIDTH, HEIGHT).to_array()
        parameters[:, 5:] *= 3  # so that the clamp has work to do
        loss, gradient = objective.evaluate(parameters)
        picture = objective.picture()
        same_loss, same_gradient = objective.evaluate(parameters, drawn=True)
        assert (loss, gradient.tobytes()) == (same_loss, same_gradient.tobytes())
        objective.picture()[:] = 7  # that is the caller's own
        assert objective.picture().tobytes() == picture.tobytes()
        assert np.array_equal(objective.residual(), picture - TARGET)
    parameters = population(5, WIDTH, HEIGHT).to_array()
    assert objective.loss(parameters, drawn=True) == objective.loss(parameters)
    objective.loss(parameters, drawn=True)
    before = objective.picture()
    objective.hold(parameters[:2])
    objective.loss(parameters[2:])
    assert np.array_equal(objective.picture(), before)  # now with the held ones below
    objective.loss(parameters[2:], drawn=True)
    objective.thaw()
    objective.loss(parameters[2:])
    assert np.array_equal(
        objective.picture(), render(Splats.from_array(parameters[2:]), WIDTH, HEIGHT, precision=precision)
    )


def test_the_clamp_lets_the_gradient_through():
    """Overshoot over a saturated target is free; over an unsaturated one it is pulled back by clamp(C) - target."""
    bright = single(0.5, 0.5, 1.0, 0.0, 1.0, (3.0, 3.0, -2.0)).to_array()
    target = np.array([[[1.0, 0.25, 0.5]]])
    loss, gradient = Objective(target).evaluate(bright)
    assert loss == 0.75**2 + 0.5**2
    assert gradient[0, 5:].tolist() == [0.0, 2 * 0.75, -2 * 0.5]


def test_descent_reaches_the_target():
    """A few hundred plain steps along the gradient recover a splat's own picture: all signs and scales fit together."""
    truth = single(20.0, 17.0, 5.0, 2.0, 4.0, (0.8, 0.6, 0.4))
    objective = Objective(render(truth, WIDTH, HEIGHT))
    parameters = single(22.0, 15.0, 4.0, 1.0, 5.0, (0.5, 0.5, 0.5)).to_array()
    first = objective.loss(parameters)
    rates = np.float32([300, 300, 150, 150, 150, 2, 2, 2])
    for _ in range(300 if JIT else 30):
        parameters -= rates * objective.evaluate(parameters)[1]
    assert objective.loss(parameters) < first * (1e-4 if JIT else 0.5)


def test_objectives_work_side_by_side():
    parameters = population(30, WIDTH, HEIGHT).to_array()
    expected = Objective(TARGET, 1).evaluate(parameters)
    results = []

    def work():
        objective = Objective(TARGET, 2)
        results.extend(objective.evaluate(parameters) for _ in range(20 if JIT else 1))

    workers = [threading.Thread(target=work) for _ in range(3)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert len(results) == (60 if JIT else 3)
    assert all(loss == expected[0] and np.array_equal(gradient, expected[1]) for loss, gradient in results)


@pytest.mark.parametrize(
    "target", [np.zeros((4, 5)), np.zeros((4, 5, 4)), np.zeros((0, 5, 3)), np.full((4, 5, 3), np.inf)]
)
def test_a_target_that_is_no_picture_is_refused(target):
    with pytest.raises(UsageError, match="target"):
        Objective(target)


@pytest.mark.parametrize("threads", [0, -1])
def test_a_wrong_number_of_threads_is_refused(threads):
    with pytest.raises(UsageError, match="at least 1"):
        Objective(TARGET, threads)


@pytest.mark.parametrize("shape", [(8,), (3, 7), (2, 3, 8)])
def test_parameters_of_another_shape_are_refused(shape):
    with pytest.raises(UsageError, match="must be \\(N, 8\\)"):
        Objective(TARGET).evaluate(np.zeros(shape))


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("column", range(8))
def test_parameters_that_are_not_finite_are_refused(value, column):
    parameters = population(3, WIDTH, HEIGHT).to_array()
    parameters[1, column] = value
    with pytest.raises(UsageError, match="splat 1 has a parameter that is NaN or infinite"):
        Objective(TARGET).evaluate(parameters)


def test_a_background_is_in_every_picture():
    """Splats of the background count like frozen ones, whatever the number of the others."""
    target = np.random.default_rng(0).random((20, 30, 3))
    parameters = np.random.default_rng(1).random((9, 8)).astype(np.float32) * 9 + 2
    parameters[:, 5:] = 0.1
    objective, frozen = Objective(target, background=parameters[:4]), Objective(target)
    assert np.array_equal(objective.picture(), render(parameters[:4], 30, 20))
    for count in (9, 6, 4):
        frozen.freeze(parameters[:count], np.arange(count) < 4)
        loss, gradient = frozen.evaluate(parameters[:count])
        ours = objective.evaluate(parameters[4:count])
        assert ours[0] == loss
        assert np.array_equal(ours[1], gradient[4:])
    objective.freeze(parameters[4:], np.arange(5) < 2)
    frozen.freeze(parameters, np.arange(9) < 6)
    assert objective.loss(parameters[4:]) == frozen.loss(parameters)
    objective.thaw()
    assert objective.loss(parameters[4:4]) == Objective(target).loss(parameters[:4])


@pytest.mark.parametrize("precision", ["fast", "deterministic"])
def test_held_splats_are_like_more_of_a_background(precision):
    target = np.random.default_rng(0).random((20, 30, 3))
    parameters = np.random.default_rng(1).random((9, 8)).astype(np.float32) * 9 + 2
    parameters[:, 5:] = 0.1
    objective = Objective(target, precision=precision, background=parameters[:2])
    alone = objective.loss(parameters[5:])
    for first in (5, 3, 5):
        behind = Objective(target, precision=precision, background=parameters[:first])
        objective.hold(parameters[2:first])
        ours, theirs = objective.evaluate(parameters[first:]), behind.evaluate(parameters[first:])
        assert ours[0] == theirs[0]
        assert np.array_equal(ours[1], theirs[1])
        assert np.array_equal(objective.picture(), behind.picture())
    assert ours[0] != alone
    objective.hold(parameters[:0])
    assert objective.loss(parameters[5:]) == alone
    with pytest.raises(UsageError, match="NaN or infinite"):
        objective.hold(np.full((1, 8), np.nan))
