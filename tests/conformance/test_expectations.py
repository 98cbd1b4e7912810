"""The comparators: what they must never let pass."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from gsvc_conformance.expectations import RELATIVE_BIAS, RELATIVE_L2, Bounded, Decision, Exact, Interval, Refusal

VALUES = np.array([[0.5, -2.0, 3.25], [1.0, 0.0, 7.5]], "<f4")
INTEGERS = np.array([[3, 1, 4], [1, 5, 9]], "<u2")


def bounded(bound=1e-3, **more) -> Bounded:
    return Bounded(VALUES.astype("f8"), np.full(VALUES.shape, bound), **more)


EXPECTATIONS = {
    "exact": (Exact(VALUES), VALUES),
    "exact-integers": (Exact(INTEGERS), INTEGERS),
    "decision": (Decision(INTEGERS, INTEGERS + 1), INTEGERS),
    "bounded": (bounded(), VALUES),
    "bounded-groups": (bounded(groups=((0, 2), (2, 3))), VALUES),
    "interval": (Interval(INTEGERS, INTEGERS - 1, INTEGERS + 1), INTEGERS),
}
each = pytest.mark.parametrize(("expectation", "right"), EXPECTATIONS.values(), ids=EXPECTATIONS)


@each
def test_the_expected_passes(expectation, right):
    assert expectation.judge(right.copy()).passed


@each
def test_another_dtype_fails(expectation, right):
    for dtype in {"<f8", "<i8", "<f4", "<u2", ">f4", ">u2"} - {right.dtype.str}:
        judgement = expectation.judge(right.astype(dtype))
        assert not judgement.passed
        assert "type" in judgement.message


@each
def test_another_shape_fails(expectation, right):
    for shaped in (right[:1], right.T, right.ravel(), right[None], right[..., :0], np.empty((), right.dtype)):
        judgement = expectation.judge(shaped)
        assert not judgement.passed
        assert "shape" in judgement.message


@each
def test_what_is_no_array_fails(expectation, right):
    for value in (None, right.tolist(), 1.0, "", right.tobytes(), Exception(), right.view(np.ndarray)[0, 0]):
        assert not expectation.judge(value).passed


@each
def test_a_judgement_does_not_depend_on_those_before(expectation, right):
    wrong = right + right.dtype.type(5)
    first = expectation.judge(wrong)
    for _ in range(20):
        assert expectation.judge(right.copy()).passed
        again = expectation.judge(wrong)
        assert again == first
        assert not again.passed


@each
def test_neither_side_is_changed(expectation, right):
    actual = right + right.dtype.type(5)
    before = actual.copy(), {name: part.copy() for name, part in expectation.parts().items()}
    expectation.judge(actual)
    assert np.array_equal(actual, before[0])
    assert all(np.array_equal(part, before[1][name]) for name, part in expectation.parts().items())


@each
def test_one_wrong_element_is_enough_and_is_named(expectation, right):
    for place in np.ndindex(right.shape):
        actual = right.copy()
        actual[place] += 50
        judgement = expectation.judge(actual)
        assert not judgement.passed
        assert judgement.place == place
        assert judgement.wrong == 1
        assert str(list(place)) in judgement.message


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize(
    "make", [lambda: Exact(VALUES), bounded, lambda: bounded(np.inf), lambda: bounded(groups=((0, 3),))]
)
def test_what_is_not_finite_fails(make, bad):
    for place in np.ndindex(VALUES.shape):
        actual = VALUES.copy()
        actual[place] = bad
        assert not make().judge(actual).passed
    assert not make().judge(np.full_like(VALUES, bad)).passed


def test_an_infinite_expectation_is_met_by_the_same_infinity_alone():
    value = np.array([np.inf, -np.inf, 1.0])
    expectation = Bounded(value, np.array([1.0, np.inf, 0.5]), groups=((0, 3),))
    judgement = expectation.judge(value.astype("<f4"))
    assert judgement.passed
    assert judgement.ratio == 0
    for place, bad in itertools.product((0, 1), (np.nan, 3e38, -3e38, 0.0)):
        actual = value.astype("<f4")
        actual[place] = bad
        judgement = expectation.judge(actual)
        assert not judgement.passed
        assert judgement.place == (place,)
        assert judgement.wrong == 1
        assert "inf" in judgement.message
    assert not expectation.judge(-value.astype("<f4")).passed
    assert not expectation.judge(np.array([np.inf, -np.inf, np.inf], "<f4")).passed
    assert not expectation.judge(np.array([np.inf, -np.inf, 2.0], "<f4")).passed
    single = Bounded(np.array(np.inf), np.array(0.0))
    assert single.judge(np.array(np.inf, "<f4")).passed
    assert single.judge(np.array(1.0, "<f4")).message == "is 1.0, expected inf"
    assert single.parts()[""] == np.inf


def test_an_exact_nan_is_compared_by_its_bits():
    quiet = np.array([0x7FC00000, 0x7FC00001], "<u4").view("<f4")
    assert Exact(quiet).judge(quiet.copy()).passed
    assert not Exact(quiet).judge(quiet[::-1].copy()).passed
    assert not Exact(np.zeros(2, "<f4")).judge(quiet).passed


def test_signed_zeros():
    plus, minus = np.array([0.0, 1.0], "<f4"), np.array([-0.0, 1.0], "<f4")
    assert not Exact(plus).judge(minus).passed
    assert not Exact(minus).judge(plus).passed
    assert Bounded(plus.astype("f8"), np.zeros(2)).judge(minus).passed


def test_single_numbers():
    for expectation in (
        Exact(np.asarray(3)),
        Decision(np.asarray(3)),
        Bounded(np.asarray(3.0), np.asarray(0.1), "<i8"),
    ):
        assert expectation.judge(np.asarray(3)).passed
        judgement = expectation.judge(np.asarray(4))
        assert judgement.place == ()
        assert judgement.message.startswith("is 4, expected 3")


def test_a_number_that_flushes_to_zero_is_no_zero():
    tiny = np.array([1e-45], "<f4")
    assert not Exact(np.zeros(1, "<f4")).judge(tiny).passed


@given(
    hnp.arrays("<f4", 6, elements=st.floats(-(2.0**100), 2.0**100, width=32)), st.floats(0, 1e30), st.floats(0, 1e30)
)
def test_bounded_is_monotone_in_the_bound(actual, one, other):
    low, high = sorted((one, other))
    actual = actual.reshape(VALUES.shape)
    small, large = bounded(low).judge(actual), bounded(high).judge(actual)
    assert large.passed or not small.passed
    assert large.ratio <= small.ratio
    assert large.wrong <= small.wrong


def test_bounded_at_its_bound():
    exact = Bounded(np.zeros(2), np.array([0.25, 0.5]))
    assert exact.judge(np.array([0.25, -0.5], "<f4")).passed
    judgement = exact.judge(np.array([0.25, np.nextafter(np.float32(0.5), np.float32(1))], "<f4"))
    assert not judgement.passed
    assert judgement.place == (1,)


def test_bounded_tells_the_worst_element_by_its_own_bound():
    judgement = Bounded(np.zeros(3), np.array([1.0, 1e-3, 1e-6])).judge(np.array([5, 5e-2, 1e-6], "<f4"))
    assert judgement.place == (1,)
    assert judgement.ratio == pytest.approx(50)
    assert judgement.wrong == 2
    assert "50 times the bound" in judgement.message


def test_a_bound_of_zero_or_nan_lets_nothing_else_pass():
    for bound in (0.0, np.nan):
        expectation = Bounded(np.ones(2), np.full(2, bound))
        assert expectation.judge(np.ones(2, "<f4")).passed
        assert not expectation.judge(np.array([1, 1 + 2.0**-20], "<f4")).passed


def test_stored_bounds_are_never_smaller():
    bound = np.array([1 / 3, 1e-40, 1e39])
    stored = Bounded(np.zeros(3), bound).parts()["bound"]
    assert stored.dtype == np.dtype("<f4")
    assert np.all(stored >= bound)


def test_groups_find_what_elements_hide():
    rng = np.random.default_rng(5)
    value = rng.normal(size=(4000, 2))
    loose = Bounded(value, np.full(value.shape, 1e-3), "<f8", groups=((0, 1), (1, 2)))
    assert loose.judge(value).passed
    factor = value.copy()
    factor[:, 1] *= 1 + 5 * RELATIVE_L2
    judgement = loose.judge(factor)
    assert "relative L2" in judgement.message
    assert "columns 1..1" in judgement.message
    assert judgement.ratio == pytest.approx(5, rel=1e-3)
    shifted = value.copy()
    shifted[:, 0] += 3 * RELATIVE_BIAS * np.mean(abs(value[:, 0]))
    assert "signed bias" in loose.judge(shifted).message


def test_nothing_passes_only_as_nothing():
    empty = Bounded(np.zeros((0, 3)), np.zeros((0, 3)), groups=((0, 3),))
    assert empty.judge(np.zeros((0, 3), "<f4")).passed
    assert not empty.judge(np.zeros((0, 2), "<f4")).passed
    assert not empty.judge(np.zeros((1, 3), "<f4")).passed


def test_a_decision_has_two_values_where_it_may_go_either_way_and_no_third():
    value, other = np.array([4, 4], "<u2"), np.array([4, 5], "<u2")
    decision = Decision(value, other)
    assert decision.judge(value).passed
    assert decision.judge(other).passed
    assert not decision.judge(other[::-1].copy()).passed
    assert not decision.judge(np.array([4, 6], "<u2")).passed
    assert not Decision(value).judge(other).passed


def test_an_interval_ends_where_it_says():
    interval = Interval(np.array([0, 255], "|u1"), np.array([0, 254], "|u1"), np.array([1, 255], "|u1"))
    assert interval.judge(np.array([1, 254], "|u1")).passed
    for wrong in ([2, 255], [0, 253]):
        assert not interval.judge(np.array(wrong, "|u1")).passed


def test_refusals():
    kind = Refusal("malformed R-6.2-2 412")
    for text in ("malformed", "malformed R-6.2-2 412", "malformed R-9.9-9 1", " malformed "):
        assert kind.judge(text).passed
    for text in ("", "invalid R-6.2-2 412", "Malformed", None, b"malformed", 1):
        assert not kind.judge(text).passed
    full = Refusal(kind.value, in_full=True)
    assert full.judge(kind.value).passed
    for text in ("malformed", "malformed R-6.2-2 413", "malformed R-6.2-3 412"):
        assert not full.judge(text).passed
    assert Refusal("").judge("").passed
    assert not Refusal("").judge("malformed").passed
