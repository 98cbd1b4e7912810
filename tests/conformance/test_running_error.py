"""Running error analysis: it covers every rounding that the error model allows, and exact arithmetic has no error."""

import math

import numpy as np
import pytest
from hypothesis import given as any_of
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from gsvc_base.exact.running_error import given, rounded_once, stack

F4 = np.float32

NUMBERS = hnp.arrays(
    np.float32, 6, elements=st.floats(-(2.0**40), 2.0**40, width=32).map(lambda v: v if abs(v) > 1e-18 or v == 0 else 0)
)


def exactly_within(computed, actual):
    return np.all(abs(np.asarray(actual, np.float64) - computed.value) <= computed.error)


def directed(value, error, towards):
    """One binary32 number next to a value that was computed in binary64, upwards or downwards."""
    narrow = np.asarray(value, np.float32)
    wrong = narrow < value if towards > 0 else narrow > value
    return np.where(wrong, np.nextafter(narrow, F4(towards * np.inf)), narrow).astype(np.float64)


@any_of(NUMBERS, NUMBERS, st.sampled_from([-1, 1]))
def test_each_operation_covers_directed_rounding(a, b, towards):
    x, y = given(a), given(b)
    wide_a, wide_b = a.astype(np.float64), b.astype(np.float64)
    assert exactly_within(x + y, directed(wide_a + wide_b, 0, towards))
    assert exactly_within(x * y, directed(wide_a * wide_b, 0, towards))
    assert exactly_within(given(abs(a)).sqrt(), directed(np.sqrt(abs(wide_a)), 0, towards))
    if b.all():
        assert exactly_within(x / y, directed(wide_a / wide_b, 0, towards))


@any_of(NUMBERS, st.permutations(range(6)))
def test_a_total_covers_any_order(a, order):
    running = F4(0)
    for place in order:
        running = running + a[place]
    assert exactly_within(given(a).total(), running)


@any_of(NUMBERS, NUMBERS, NUMBERS)
def test_errors_are_carried_through_expressions(a, b, c):
    narrow = (a * b + c) * (a - c)
    x, y, z = given(a), given(b), given(c)
    assert exactly_within((x * y + z) * (x - z), narrow)


def test_exact_arithmetic_has_no_error():
    x, y = given([1.5, 0.25, -3.0]), given([0.25, 4.0, 0.5])
    assert not ((x + y) * (x - y)).error.any()
    assert not (x / y).error.any()
    assert not x.total().error.any()
    assert not stack(x, y).total(0).error.any()
    assert not rounded_once(0.75).error


@pytest.mark.parametrize(
    "inexact",
    [
        given(F4(0.1)) * given(F4(0.1)),
        given(1.0) + given(2.0**-60),
        given(1.0) / given(3.0),
        given(2.0).sqrt(),
        rounded_once(0.1),
        given(2.0**-140),
        given(2.0**-100) * given(2.0**-40),
        given([2.0**24, 1.0, 1.0, -1.0]).total(),
    ],
)
def test_inexact_arithmetic_has_an_error(inexact):
    assert inexact.error > 0


def test_the_root_of_nearly_nothing_has_the_error_of_its_argument():
    nothing = given(2.0**-60) - given(F4(2.0**-60 * (1 - 2**-24)))
    uncertain = nothing + rounded_once(0.1) - rounded_once(0.1)
    assert uncertain.sqrt().error >= math.sqrt(uncertain.error) * 0.9
    assert np.isinf((given(1.0) / (uncertain - uncertain)).error)
