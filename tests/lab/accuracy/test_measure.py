"""Errors, spreads, turns and what is Pareto-best."""

import math
import time

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gsvc_lab.accuracy import measure
from gsvc_lab.accuracy.measure import Errors, Spread, pareto, take_turns, visit

# Few values, so that ties are common.
points = st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), min_size=1, max_size=12)


def dominates(a, b):
    return a[0] <= b[0] and a[1] <= b[1] and a != b


def test_pareto_of_known_points():
    known = {(1.0, 9.0): True, (2.0, 5.0): True, (2.0, 6.0): False, (3.0, 5.0): False, (4.0, 4.0): True,
             (0.0, 90.0): True, (9.0, 4.5): False}  # fmt: skip
    assert pareto(list(known)) == list(known.values())


def test_pareto_keeps_equals_and_single_points():
    assert pareto([(1.0, 2.0), (1.0, 2.0), (1.0, 3.0)]) == [True, True, False]
    assert pareto([(0.0, 0.0)]) == [True]
    assert pareto([]) == []


@given(points)
def test_best_points_are_not_dominated_and_all_others_are_by_a_best_one(found):
    marks = pareto(found)
    best = [point for point, mark in zip(found, marks, strict=True) if mark]
    assert best
    for point, mark in zip(found, marks, strict=True):
        assert mark != any(dominates(other, point) for other in best)


@given(points, st.randoms())
def test_marks_do_not_depend_on_the_order(found, random):
    order = list(range(len(found)))
    random.shuffle(order)
    marks = pareto(found)
    assert pareto([found[i] for i in order]) == [marks[i] for i in order]


def test_errors_of_known_pictures():
    reference = np.zeros((2, 2, 3))
    picture = reference.copy()
    picture[0, 0, 0] = -3 / 255
    errors = Errors.between(picture, reference)
    assert math.isclose(errors.largest, 3)
    assert math.isclose(errors.rms, 3 / math.sqrt(12))
    assert math.isclose(errors.psnr, 10 * math.log10(255**2 * 12 / 9))
    assert 2.99 < errors.quantile <= 3


def test_the_quantile_leaves_out_one_sample_in_a_hundred_thousand():
    picture = np.zeros((1000, 1000, 3))
    picture[0, :7, 0] = 1
    errors = Errors.between(picture, np.zeros_like(picture))
    assert (errors.largest, errors.quantile) == (255, 0)


def test_equal_pictures_have_an_infinite_psnr():
    picture = np.full((2, 3, 3), 0.25)
    assert Errors.between(picture, picture) == Errors(0, 0, 0, math.inf)


def test_spreads():
    assert Spread.of([3, 1, 2, 5, 4]) == Spread(3, 2, 4, 5)
    assert Spread.of([1, 2]) == Spread(1.5, 1, 2, 2)
    assert Spread.of([7]) == Spread(7, 7, 7, 1)
    assert Spread.of([math.inf, math.inf, math.inf]) == Spread(math.inf, math.inf, math.inf, 3)


def test_turns_go_forwards_then_backwards():
    order = []

    def turn(name):
        return lambda number: order.append((number, name)) or float(number)

    seconds = take_turns([turn("a"), turn("b"), turn("c")], 3, math.inf)
    assert "".join(name for _, name in order) == "abccbaabc"
    assert seconds == [[0, 1, 2]] * 3


def test_rounds_end_with_the_time_but_some_are_made():
    assert len(take_turns([lambda number: 0.0], 50, -math.inf)[0]) == measure.MIN_ROUNDS
    assert len(take_turns([lambda number: 0.0], 1, -math.inf)[0]) == 1
    assert len(take_turns([lambda number: 0.0], 50, math.inf)[0]) == 50


def test_a_visit_repeats_what_is_short_and_not_what_is_long(monkeypatch):
    monkeypatch.setattr(measure, "VISIT_S", 0.01)
    runs = []
    visit(lambda: runs.append(1))
    assert 4 <= len(runs) <= 26
    runs.clear()
    assert visit(lambda: (runs.append(1), time.sleep(0.02))) >= 0.02
    assert len(runs) == 1
