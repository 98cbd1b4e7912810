"""The paper's rule for stopping early."""

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gsvc_base.errors import UsageError
from gsvc_ref.training import Convergence


def test_the_paper_stops_after_100_small_changes() -> None:
    assert Convergence() == Convergence(patience=100, tolerance=1e-7)
    test = Convergence().start()
    answers = [test.update(0.25) for _ in range(102)]
    # The first loss has none before it; the 100th difference is that of the 101st loss.
    assert answers == [False] * 100 + [True, True]


def test_one_larger_change_starts_the_count_again() -> None:
    test = Convergence(patience=3, tolerance=0.5).start()
    losses = [8.0, 7.5, 7.0, 5.0, 5.5, 5.0, 4.5]
    assert [test.update(loss) for loss in losses] == [False] * 6 + [True]


def test_a_change_of_exactly_the_tolerance_is_small_in_both_directions() -> None:
    test = Convergence(patience=2, tolerance=0.25).start()
    assert [test.update(loss) for loss in (1.0, 1.25, 1.0)] == [False, False, True]


@given(st.lists(st.sampled_from([1.0, 1.5, 2.5]), max_size=30), st.integers(1, 5), st.sampled_from([0.0, 0.5, 1.0]))
def test_it_stops_where_the_last_changes_are_all_small(losses: list[float], patience: int, tolerance: float) -> None:
    test = Convergence(patience, tolerance).start()
    for end, loss in enumerate(losses, 1):
        recent = losses[max(0, end - patience - 1) : end]
        small = all(abs(b - a) <= tolerance for a, b in itertools.pairwise(recent))
        assert test.update(loss) == (len(recent) == patience + 1 and small)


def test_a_loss_of_nan_is_refused() -> None:
    with pytest.raises(UsageError, match="diverged"):
        Convergence().start().update(math.nan)


@pytest.mark.parametrize(("patience", "tolerance"), [(0, 1e-7), (1, -1.0), (1, math.nan)])
def test_parameters_out_of_range_are_refused(patience: int, tolerance: float) -> None:
    with pytest.raises(UsageError, match=r"at least|Convergence\.tolerance is nan"):
        Convergence(patience, tolerance)
