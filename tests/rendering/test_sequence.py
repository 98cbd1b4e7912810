"""Only what changed is rendered or evaluated again, and the result is the same."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from render_cases import EXAMPLES, HEIGHT, JIT, WIDTH, ordinary, population, single, splat_sets

from gsvc_base.errors import UsageError
from gsvc_base.splats import Splats
from gsvc_ref.rendering import Objective, Renderer, SequenceRenderer, render, render_gradients

pytestmark = [] if JIT else [pytest.mark.filterwarnings("ignore:.*encountered:RuntimeWarning")]

WIDE, HIGH = 130, 200  # nine tiles of four regions


@st.composite
def sequences(draw):
    """Sets of splats with their origins: some stay, some change, some go, some come."""
    current = draw(splat_sets(ordinary))
    frames = [(current, None)]
    for _ in range(draw(st.integers(1, 3))):
        fate = draw(st.lists(st.sampled_from(["stay", "change", "go"]), min_size=len(current), max_size=len(current)))
        packed = current.to_array()
        for n, name in enumerate(fate):
            if name == "change":
                packed[n, draw(st.integers(0, 7))] += np.float32(draw(st.sampled_from([0.5, 3.0])))
        kept = np.array([n for n, name in enumerate(fate) if name != "go"], np.int64)
        new = draw(splat_sets(ordinary, largest=2))
        current = Splats.from_array(packed[kept]).append(new)
        frames.append((current, np.concatenate([kept, np.full(len(new), -1)])))
    return frames


@settings(max_examples=EXAMPLES, deadline=None)
@given(sequences(), st.sampled_from(["fast", "deterministic"]))
def test_frames_have_the_bits_of_a_whole_rendering(frames, precision):
    sequence, whole = (cls(WIDTH, HEIGHT, precision=precision) for cls in (SequenceRenderer, Renderer))
    for splats, origins in frames:
        assert np.array_equal(sequence.next_frame(splats, 8, origins), whole.frame(splats, 8))


def moved(splats, n, by):
    packed = splats.to_array().copy()
    packed[n, :2] += np.float32(by)
    return Splats.from_array(packed)


@pytest.mark.parametrize("precision", ["fast", "deterministic"])
def test_a_small_change_renders_few_regions(precision):
    count = 400 if JIT else 40
    splats, everyone = population(count, WIDE, HIGH), np.arange(count)
    sequence = SequenceRenderer(WIDE, HIGH, precision=precision)
    sequence.next_frame(splats, 8)
    assert sequence.share == 1
    changed = moved(splats, 7, (1, -2))
    frame = sequence.next_frame(changed, 8, everyone).copy()
    assert 0 < sequence.share <= 0.5
    assert np.array_equal(frame, Renderer(WIDE, HIGH, precision=precision).frame(changed, 8))
    assert np.array_equal(sequence.next_frame(changed, 8, everyone), frame)
    assert sequence.share == 0


def test_what_covers_nothing_costs_nothing():
    splats = single(20.0, 20.0, 3.0, 0.0, 3.0).append(single(-500.0, 20.0, 3.0, 0.0, 3.0))
    sequence = SequenceRenderer(WIDE, HIGH)
    sequence.next_frame(splats, 8)
    sequence.next_frame(moved(splats, 1, (-9, 0)), 8, [0, 1])
    assert sequence.share == 0


def test_another_order_is_another_sum():
    """In binary32 (a + b) + c need not be a + (b + c): a new order renders everything again."""
    splats = population(12, WIDTH, HEIGHT)
    sequence = SequenceRenderer(WIDTH, HEIGHT, precision="deterministic")
    sequence.next_frame(splats, 16)
    turned = splats.take(np.arange(12)[::-1].copy())
    frame = sequence.next_frame(turned, 16, np.arange(12)[::-1])
    assert sequence.share == 1
    assert np.array_equal(frame, Renderer(WIDTH, HEIGHT, precision="deterministic").frame(turned, 16))


def test_another_bit_depth_renders_everything():
    splats = population(12, WIDTH, HEIGHT)
    sequence = SequenceRenderer(WIDTH, HEIGHT)
    sequence.next_frame(splats, 8)
    for bit_depth in (10, 12):  # both in 16 bits
        frame = sequence.next_frame(splats, bit_depth, np.arange(12))
        assert frame.dtype == np.uint16
        assert np.array_equal(frame, Renderer(WIDTH, HEIGHT).frame(splats, bit_depth))


def test_the_exact_precision_renders_everything():
    splats = population(5, WIDTH, HEIGHT)
    sequence = SequenceRenderer(WIDTH, HEIGHT, precision="exact")
    for _ in range(2):
        frame = sequence.next_frame(splats, 8, np.arange(5))
        assert sequence.share == 1
        assert np.array_equal(frame, Renderer(WIDTH, HEIGHT, precision="exact").frame(splats, 8))


@pytest.mark.parametrize("origins", [[0, 1], [[0], [1], [2]]])
def test_origins_of_another_number_are_refused(origins):
    sequence = SequenceRenderer(WIDTH, HEIGHT)
    splats = population(3, WIDTH, HEIGHT)
    sequence.next_frame(splats, 8)
    with pytest.raises(UsageError, match="one number for each splat"):
        sequence.next_frame(splats, 8, origins)


TARGET = np.random.default_rng(11).random((HEIGHT, WIDTH, 3), np.float32)


@pytest.mark.parametrize("precision", ["fast", "deterministic"])
def test_frozen_splats_are_drawn_and_have_no_gradient(precision):
    splats = population(20, WIDTH, HEIGHT)
    frozen = np.arange(20) % 3 > 0
    parameters = splats.to_array()
    objective = Objective(TARGET, precision=precision)
    loss, gradient = objective.evaluate(parameters)
    objective.freeze(parameters, frozen)
    some_loss, some = objective.evaluate(parameters)
    assert some_loss == pytest.approx(loss, rel=1e-6)
    assert not some[frozen].any()
    np.testing.assert_allclose(some[~frozen], gradient[~frozen], rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(objective.picture(), render(splats, WIDTH, HEIGHT), atol=1e-5)
    objective.freeze(parameters, np.zeros(20, bool))
    again_loss, again = objective.evaluate(parameters)
    assert (again_loss, again.tobytes()) == (loss, gradient.tobytes())


def test_frozen_first_is_the_same_sum_to_the_bit():
    """The sum begins with the frozen splats: where they come first anyway, no bit changes."""
    parameters = population(20, WIDTH, HEIGHT).to_array()
    for precision in ("fast", "deterministic"):
        objective = Objective(TARGET, precision=precision)
        loss, gradient = objective.evaluate(parameters)
        objective.freeze(parameters, np.arange(20) < 13)
        some_loss, some = objective.evaluate(parameters)
        assert some_loss == loss
        assert np.array_equal(some[13:], gradient[13:])


def test_frozen_splats_stay_as_they_were():
    parameters = population(6, WIDTH, HEIGHT).to_array()
    frozen = np.array([True, False, True, False, False, False])
    objective = Objective(TARGET)
    objective.freeze(parameters, frozen)
    loss = objective.loss(parameters)
    other = parameters.copy()
    other[frozen] = 1e3
    assert objective.loss(other) == loss


def test_all_frozen():
    parameters = population(6, WIDTH, HEIGHT).to_array()
    objective = Objective(TARGET)
    expected = objective.loss(parameters)
    objective.freeze(parameters, np.ones(6, bool))
    loss, gradient = objective.evaluate(parameters)
    assert loss == expected
    assert not gradient.any()


def test_what_does_not_fit_is_refused():
    parameters = population(6, WIDTH, HEIGHT).to_array()
    objective = Objective(TARGET)
    for frozen in (np.zeros(5, bool), np.zeros(6, int)):
        with pytest.raises(UsageError, match="must be bool of shape"):
            objective.freeze(parameters, frozen)
    objective.freeze(parameters, np.arange(6) < 2)
    with pytest.raises(UsageError, match="some of 6 are frozen"):
        objective.evaluate(parameters[:5])
    with pytest.raises(UsageError, match="must be one of fast, deterministic"):
        Objective(TARGET, precision="exact")


@pytest.mark.parametrize("precision", ["fast", "deterministic", "exact"])
def test_a_renderer_s_gradients_are_those_of_the_function(precision):
    renderer = Renderer(WIDTH, HEIGHT, precision=precision)
    e = np.random.default_rng(0).normal(0, 1, (HEIGHT, WIDTH, 3)).astype(np.float32)
    for count in (3, 9, 0):
        splats = population(count, WIDTH, HEIGHT)
        expected = render_gradients(splats, e, precision=precision).astype(np.float32)
        assert np.array_equal(renderer.gradients(splats, e), expected)
    with pytest.raises(UsageError, match="the residual has shape"):
        renderer.gradients(splats, e[1:])


def test_a_region_below_one_row_is_refused():
    with pytest.raises(UsageError, match="at least 1"):
        Renderer(8, 8, region_rows=0)


def test_pictures_of_many_regions_are_those_of_whole_tiles():
    splats = population(30 if JIT else 5, WIDE, HIGH)
    e = np.random.default_rng(0).normal(0, 1, (HIGH, WIDE, 3)).astype(np.float32)
    assert np.isfinite(render_gradients(splats, e)).all()
    for precision in ("fast", "deterministic"):
        whole = Renderer(WIDE, HIGH, precision=precision).picture(splats)
        for rows in (8, 16, 33, 64):
            assert np.array_equal(Renderer(WIDE, HIGH, precision=precision, region_rows=rows).picture(splats), whole)
