"""`assert_within_bound` judges as the kit does, takes what the fast code computes, and says what is wrong."""

from functools import cache
from itertools import islice

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.vendor.pretty import pretty

import gsvc_ref
from gsvc_base.errors import UsageError
from gsvc_base.splats import Splats
from gsvc_conformance.vector import load
from gsvc_ref.testing import assert_same_splats, assert_within_bound, random_stream, splat_sets
from gsvc_ref.testing.assertions import OPERATIONS

WIDTH, HEIGHT = 16, 12
ONE = np.array([[8, 6, 2, 0.5, 1, 0.5, 0.25, 0]], np.float32)
RESIDUAL = np.linspace(-1, 1, HEIGHT * WIDTH * 3).reshape(HEIGHT, WIDTH, 3).astype(np.float32)
ADAN = {
    "parameters": ONE,
    "gradients": 0.5 * ONE,
    "m": 0.25 * ONE,
    "v": 0 * ONE,
    "n": ONE * ONE,
    "previous": ONE,
    "steps": [1],
    "rates": np.full(8, 0.01, np.float32),
    "units": np.ones(8, np.float32),
    "beta1": 0.98,
    "beta2": 0.92,
    "beta3": 0.99,
    "epsilon": 1e-8,
}
CALLS = {
    "render_sum": ((ONE, WIDTH, HEIGHT), {}),
    "render_frame": ((ONE, WIDTH, HEIGHT, 10), {}),
    "render_gradients": ((ONE, RESIDUAL), {}),
    "loss": ((RESIDUAL, RESIDUAL[::-1].copy()), {}),
    "weighted_gradients": ((np.append(ONE, [[0.5]], 1).astype(np.float32), ONE), {}),
    "adan_step": ((), ADAN),
}
INPUTS = {
    "render_sum": {"parameters": ONE, "width": WIDTH, "height": HEIGHT},
    "render_frame": {"parameters": ONE, "width": WIDTH, "height": HEIGHT, "bit_depth": 10},
    "render_gradients": {"parameters": ONE, "residual": RESIDUAL},
    "loss": {"picture": RESIDUAL, "target": RESIDUAL[::-1]},
    "weighted_gradients": {"values": CALLS["weighted_gradients"][0][0], "gradients": ONE},
    "adan_step": ADAN,
}


def computed(operation):
    """What gsvc_ref gives for `INPUTS`, its outputs as a list."""
    arguments, named = CALLS[operation]
    outputs = getattr(gsvc_ref, operation)(*arguments, **named)
    return [np.array(output) for output in (outputs if isinstance(outputs, tuple) else (outputs,))]


def test_there_is_an_example_of_each_operation():
    assert set(INPUTS) == set(OPERATIONS)


@pytest.mark.parametrize("operation", OPERATIONS)
def test_what_gsvc_ref_computes_is_within_bounds_and_what_is_off_is_not(operation):
    outputs = computed(operation)
    assert_within_bound(operation, outputs if len(outputs) > 1 else outputs[0], **INPUTS[operation])
    for place, output in enumerate(outputs):
        wrong = [part.astype(np.float64) for part in outputs]
        at = np.unravel_index(int(np.argmax(abs(output))), output.shape)
        wrong[place][at] = output[at] * 1.001 + (operation == "render_frame" or output.dtype.kind == "i")
        with pytest.raises(AssertionError, match=r"times the bound|must be none"):
            assert_within_bound(operation, wrong if len(wrong) > 1 else wrong[0], **INPUTS[operation])
        wrong[place][at] = np.nan
        with pytest.raises(AssertionError, match="nan, expected"):
            assert_within_bound(operation, wrong if len(wrong) > 1 else wrong[0], **INPUTS[operation])


@cache
def core():
    return tuple(load(tiers=("core",)))


@pytest.mark.parametrize("operation", OPERATIONS)
@pytest.mark.parametrize("most", [2, pytest.param(None, marks=pytest.mark.exhaustive)])
def test_numbers_and_bounds_are_those_of_the_vectors(operation, most):
    """Values by binary64 alone may differ from those by 106 bits, far below the bound; bounds are the same."""
    own = (vector for vector in core() if vector.operation.name == operation)
    seen = 0
    for seen, vector in enumerate(islice(own, most), 1):  # noqa: B007
        for name, legal in OPERATIONS[operation](**vector.inputs).items():
            expected = vector.expected[name]
            if expected.check == "interval":
                assert np.array_equal(legal.lowest, expected.lowest), vector.id
                assert np.array_equal(legal.highest, expected.highest), vector.id
                continue
            bound = expected.bound if expected.check == "bounded" else 0.0
            rounding = 1e-6 * bound + 1e-15 * abs(legal.value)  # those of vectors are rounded up to binary32
            assert np.all(abs(legal.value - expected.value) <= 1e-6 * bound), vector.id
            assert np.all(abs(legal.highest - legal.value - bound) <= rounding), vector.id
            assert np.all(abs(legal.value - legal.lowest - bound) <= rounding), vector.id
    assert seen >= 2


@given(splat_sets(WIDTH, HEIGHT, max_count=6, hard=True))
@settings(max_examples=30)
def test_sums_of_hard_splats_are_within_bounds(splats):
    if np.abs(splats.colors).max(initial=0) > 1e30:  # partial sums would leave the range of binary32
        splats = Splats(splats.positions, splats.cholesky, np.clip(splats.colors, -1e30, 1e30))
    sum_ = gsvc_ref.render_sum(splats, WIDTH, HEIGHT, precision="deterministic")
    assert_within_bound("render_sum", sum_, parameters=splats, width=WIDTH, height=HEIGHT)


def message(operation, outputs, **inputs):
    with pytest.raises(AssertionError) as failure:
        assert_within_bound(operation, outputs, **{**INPUTS[operation], **inputs})
    return str(failure.value)


def test_messages_name_the_place():
    (sum_,) = computed("render_sum")
    sum_[5, 7, 1] += 0.5
    said = message("render_sum", sum_)
    assert said.startswith("render_sum: G of the pixel in column 7, row 5 is 0.7")
    assert "the error is 0.5, " in said
    assert said.endswith("(1 of 576 elements are wrong)")
    (gradients,) = computed("render_gradients")
    gradients[0, 3] = 0
    assert message("render_gradients", gradients).startswith(
        "render_gradients: the gradient of l21 of splat 0 is 0, expected "
    )
    loss, residual = computed("loss")
    assert message("loss", (loss + 1, residual)).startswith("loss: loss: it is 3.49476")
    assert "loss has the outputs loss, residual" in message("loss", loss)
    assert message("loss", {"loss": loss, "residual": residual[0]}) == (
        "loss: residual: the shape is (16, 3), expected (12, 16, 3)"
    )


def test_what_cannot_be_judged_is_wrong_use():
    with pytest.raises(UsageError, match=r"there are no bounds for 'render': choose one of render_sum, "):
        assert_within_bound("render", 0)
    with pytest.raises(UsageError, match=r"missing a required argument: 'height'; name its inputs as in spec.md"):
        assert_within_bound("render_sum", 0, parameters=ONE, width=3)
    with pytest.raises(UsageError, match="both must be"):
        assert_within_bound("loss", (0, 0), picture=RESIDUAL, target=RESIDUAL[0])


def test_splats_that_are_the_same_pass():
    stream = random_stream(0)
    assert_same_splats(stream.splats, stream)
    assert_same_splats([splats.to_array() for splats in stream.splats], stream)


def changed_splats(frame, change):
    """The splats of a random stream, and these with one frame changed."""
    stream = random_stream(0)
    given_splats = [splats.to_array() for splats in stream.splats]
    given_splats[frame] = change(given_splats[frame])
    return given_splats, stream


def with_next_number(array):
    array = array.copy()
    array[1, 3] = np.nextafter(array[1, 3], np.float32(np.inf))
    return array


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (with_next_number, r"frame 1, splat 1: l21 is \S+ \(0x[0-9a-f]{8}\), expected \S+ \(0x[0-9a-f]{8}\)$"),
        (lambda array: array[1:], r"frame 1: the shape is \(\d+, 8\), expected \(\d+, 8\)"),
        (lambda array: array.astype(np.float64), "frame 1: the type is float64, expected float32"),
        (lambda array: -array, r"frame 1, splat 0: x is .* parameters differ\)"),
    ],
)
def test_splats_that_differ_are_named(change, message):
    with pytest.raises(AssertionError, match=message):
        assert_same_splats(*changed_splats(1, change))


def test_another_number_of_frames_is_said():
    stream = random_stream(0)
    with pytest.raises(
        AssertionError, match=f"^{len(stream.splats) + 1} frames were given, expected {len(stream.splats)}$"
    ):
        assert_same_splats([*stream.splats, stream.splats[0]], stream)


def test_a_stream_is_shown_in_a_line():
    stream = random_stream(0)
    shown = repr(stream)
    assert shown.startswith(f"<Stream {stream.header.width}x{stream.header.height}, frames and their splats I(")
    assert shown.endswith(f", {len(stream.data)} bytes>")
    assert len(shown) < 120
    assert pretty(stream) == shown  # as Hypothesis shows a failing example
