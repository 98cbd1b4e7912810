"""Expansions: every result lies within its radius, the radius is tiny, and what is exact has none; against mpmath."""

import math

import mpmath
import numpy as np
import pytest

from gsvc_base.exact.distinct import distinct
from gsvc_base.exact.expansions import (
    COMPONENT_COUNTS,
    Expansion,
    certain,
    exact,
    joined,
    settled,
    sums_of,
    two_product,
    two_sum,
    where,
)
from gsvc_conformance.elementary import exp, log, power
from gsvc_conformance.operation import operations

COUNT = 40
BITS = 1500
LOST = 12
"""Bits of 53 per component that an operation may lose."""


def value(number, place=()):
    return sum(mpmath.mpf(float(part[place])) for part in number.parts)


def numbers(rng, most, *, positive=False):
    """Numbers with digits in all components, which count as exact."""
    made = exact(rng.normal(size=COUNT) * 2.0 ** rng.integers(-60, 60, COUNT), most)
    made = made / exact(rng.uniform(1, 2, COUNT)) + exact(rng.normal(size=COUNT))
    return Expansion((abs(made) if positive else made).parts, np.zeros(COUNT), most)


OPERATIONS = {
    "sum": (lambda a, b: a + b, lambda a, b: a + b),
    "difference": (lambda a, b: a - b, lambda a, b: a - b),
    "product": (lambda a, b: a * b, lambda a, b: a * b),
    "quotient": (lambda a, b: a / b, lambda a, b: a / b),
    "root": (lambda a, b: abs(a).sqrt(), lambda a, b: mpmath.sqrt(abs(a))),
    "logarithm": (lambda a, b: log(abs(a)), lambda a, b: mpmath.log(abs(a))),
    "exponential": (
        lambda a, b: exp(a.scaled(4 - np.frexp(a.near)[1])),  # of numbers in 8..16 and -16..-8
        lambda a, b: mpmath.exp(mpmath.ldexp(a, 4 - math.frexp(float(a))[1])),
    ),
    "power": (lambda a, b: power(abs(a), exact(0.3)), lambda a, b: abs(a) ** mpmath.mpf(0.3)),
    "cube": (lambda a, b: a.raised(np.full(COUNT, 3)), lambda a, b: a**3),
}


@pytest.mark.parametrize("most", [1, *COMPONENT_COUNTS])
@pytest.mark.parametrize("operation", OPERATIONS)
def test_operations_are_within_their_radius_and_round_as_the_truth_does(operation, most):
    of_numbers, of_truth = OPERATIONS[operation]
    rng = np.random.default_rng(most)
    a, b = numbers(rng, most), numbers(rng, most)
    result = of_numbers(a, b)
    rounded, sure = result.rounded()
    assert sure.all() or most == 1
    with mpmath.workprec(BITS):
        for k in range(COUNT):
            truth = of_truth(value(a, k), value(b, k))
            assert abs(value(result, k) - truth) <= result.radius[k]
            assert not sure[k] or rounded[k] == float(truth)
            scale = abs(truth) + (abs(value(a, k)) + abs(value(b, k)) if operation in ("sum", "difference") else 0)
            assert result.radius[k] <= scale * mpmath.mpf(2) ** (LOST - 53 * most)


def test_what_is_exact_has_no_radius():
    a, b = exact([0.1, 3.0, 2.0**-140]), exact([0.7, -3.0, 2.0**-149])
    for result in (a + b, a * b, (a * b) / b, (a * a).sqrt(), a - a, a.raised(np.array([2, 3, 2]))):
        assert not result.radius.any()
    assert (a + b).sign().tolist() == [1, 0, 1]
    assert (exact(1.0) / exact(3.0)).radius > 0


def test_ties_are_rounded_to_even_and_numbers_beside_them_are_not():
    half = 2.0**-53
    tie, above, below = exact(1.0) + exact(half), exact(1.0) + exact(half + 2.0**-105), exact(1.0) + exact(half * 0.999)
    assert [float(certain(number)) for number in (tie, above, below)] == [1.0, 1 + 2 * half, 1.0]
    close = tie + exact(2.0**-300)
    assert certain(close) == 1 + 2 * half
    assert exact([0.5, 1.5, 2.5, -0.5, 7.0]).rint().tolist() == [0, 2, 2, 0, 7]
    assert (exact(2.5) + exact(2.0**-200)).rint() == 3
    assert np.isnan((exact(1.0) / exact(3.0) * exact(1.5)).rint())


def test_rounding_to_odd_makes_a_second_rounding_harmless():
    number = exact(1.0 + 2.0**-11) + exact(2.0**-80)  # a hair above a tie of binary16
    assert number.odd().astype(np.float16) == 1 + 2.0**-10
    assert number.near.astype(np.float16) == 1


def test_sums_without_an_error():
    rng = np.random.default_rng(2)
    a, b = rng.normal(size=(2, 1000)) * 2.0 ** rng.integers(-40, 40, (2, 1000))
    for transformed, truth in ((two_sum(a, b), lambda x, y: x + y), (two_product(a, b), lambda x, y: x * y)):
        with mpmath.workprec(BITS):
            for x, y, high, low in zip(a, b, *transformed, strict=True):
                assert mpmath.mpf(float(high)) + float(low) == truth(mpmath.mpf(float(x)), float(y))


def test_sums_by_key_are_those_of_all_terms():
    rng = np.random.default_rng(3)
    terms, keys = rng.normal(size=(10_000, 2)) * 1e10 ** rng.normal(size=(10_000, 1)), rng.integers(0, 7, 10_000)
    keys = np.sort(keys)
    sums = certain(sums_of(lambda chunk: exact(terms[chunk]), keys, 8))
    assert sums.tolist() == [[math.fsum(terms[keys == key, c]) for c in (0, 1)] for key in range(8)]
    assert certain(exact(terms).total()).tolist() == [math.fsum(column) for column in terms.T]
    assert certain(exact(terms.T).total(1)).tolist() == [math.fsum(column) for column in terms.T]


def test_uncertain_rows_are_settled_with_more_components():
    asked = []

    def evaluate(most, rows):
        asked.append((most, rows.tolist()))
        one = exact(np.ones(4), most)
        third = one / exact(3.0) - one / exact([4.0, 3.0, 3.0, 5.0])  # rows 1 and 2 cancel
        little = exact([0.0, 2.0**-120, 0.0, 0.0], most)
        return (((third + little) * exact(1.0))[rows],)

    (found,) = settled(evaluate, 4)
    assert found.tolist() == [1 / 12, 2.0**-120, 0.0, float(mpmath.mpf(2) / 15)]
    assert asked == [(2, [0, 1, 2, 3]), (4, [1, 2]), (8, [2])]


def test_where_and_joined_keep_all_components():
    a, b = exact([1.0, 2.0]) / exact(3.0), exact([5.0, 6.0])
    mixed = where(np.array([True, False]), a, b)
    assert np.array_equal(mixed.near, [1 / 3, 6])
    assert len(mixed.parts) == len(a.parts)
    both = joined(a, b)
    assert both.shape == (4,)
    assert both.radius[2:].tolist() == [0, 0]


def test_distinct_rows_come_in_the_order_of_their_first():
    a = np.array([[1, 2], [0, 0], [1, 2], [-0.0, 0]], np.float32)
    b = np.array([7, 7, 7, 7], np.int64)
    first, inverse, counts = distinct(a, b)
    assert first.tolist() == [0, 1, 3]
    assert inverse.tolist() == [0, 1, 0, 2]
    assert counts.tolist() == [2, 1, 1]
    assert [part.tolist() for part in distinct(np.zeros((0, 3)))] == [[], [], []]


def test_a_learning_rate_that_underflows_has_a_bound():
    rates = operations()["learning_rates"].oracle(
        iterations=np.array([0, 2**40]), rate=1e-3, factor=0.999, interval=1000
    )["rates"]  # fmt: skip
    assert rates.value[1] == 0
    assert rates.judge(np.array([1e-3, 0.0])).passed
    assert rates.bound[1] < 1e-37
