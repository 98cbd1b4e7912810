"""GSP: when splats are removed, how many, and which."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from gsvc_base.errors import UsageError
from gsvc_ref.training import PruningSchedule
from gsvc_ref.training.pruning import SETTLING, prune


def test_an_i_frame_loses_a_tenth_between_100_and_4000() -> None:
    assert PruningSchedule.intra().counts(50_000, 50_000) == dict.fromkeys(range(100, 4001, 100), 125)
    counts = PruningSchedule.intra().counts(10_110, 50_000)
    assert counts == dict.fromkeys(range(100, 4000, 100), 25) | {4000: 1011 - 39 * 25}


def test_a_p_frame_loses_a_tenth_between_500_and_1000() -> None:
    assert PruningSchedule.inter().counts(11_000, 50_000) == {
        500: 183, 600: 183, 700: 183, 800: 183, 900: 183, 1000: 1100 - 5 * 183
    }  # fmt: skip


@given(st.integers(0, 10**6))
def test_p_frames_lose_as_many_as_their_i_frame(total: int) -> None:
    """So a P-frame that adds what its I-frame lost, back to the total, ends where it began."""
    pruned = PruningSchedule.intra().counts(total, 50_000).values()
    assert sum(PruningSchedule.inter().counts(total, 50_000).values()) == sum(pruned)


def test_too_few_splats_for_every_removal_go_at_the_end() -> None:
    assert PruningSchedule.intra().counts(100, 50_000) == {4000: 10}
    assert PruningSchedule.intra().counts(4, 50_000) == {}


@given(
    st.integers(0, 10_000),
    st.integers(0, 6000),
    st.floats(0, 0.99),
    st.integers(1, 50),
    st.integers(0, 1000),
    st.integers(1, 200),
)
def test_counts_add_up_and_come_in_time(
    splats: int, iterations: int, fraction: float, first: int, length: int, interval: int
) -> None:
    counts = PruningSchedule(fraction, first, first + length, interval).counts(splats, iterations)
    assert sum(counts.values()) == (round(fraction * splats) if iterations else 0)
    assert list(counts) == sorted(counts)
    assert all(1 <= iteration <= max(1, SETTLING * iterations) for iteration in counts)
    assert all(count > 0 for count in counts.values())


def test_a_short_training_moves_all_removals_forward() -> None:
    assert PruningSchedule(0.5, 100, 400, 100).counts(80, 50) == {10: 10, 20: 10, 30: 10, 40: 10}
    assert PruningSchedule(0.5, 100, 400, 100).counts(80, 500) == {100: 10, 200: 10, 300: 10, 400: 10}
    assert PruningSchedule(0.5, 100, 400, 100).counts(80, 1) == {1: 40}


weights = hnp.arrays(
    np.float32, st.integers(0, 30), elements=st.one_of(st.sampled_from([-1.0, 0.0, 1.0]), st.floats(-4, 4, width=32))
)


@given(weights, st.data())
def test_the_largest_magnitudes_survive_in_order(w: np.ndarray, data: st.DataObject) -> None:
    removed = data.draw(st.integers(0, len(w)))
    ranked = sorted(range(len(w)), key=lambda n: (-abs(w[n]), n))
    assert prune(w, removed).tolist() == sorted(ranked[: len(w) - removed])


def test_of_equal_weights_the_lower_index_survives() -> None:
    assert prune(np.array([0.5, -0.5, 2.0, 0.5]), 2).tolist() == [0, 2]
    assert prune(np.zeros(4), 1).tolist() == [0, 1, 2]
    assert prune(np.array([0.0, -0.0]), 1).tolist() == [0]


@pytest.mark.parametrize("removed", [-1, 3])
def test_impossible_numbers_are_refused(removed: int) -> None:
    with pytest.raises(UsageError, match="cannot remove"):
        prune(np.ones(2), removed)


def test_weights_of_nan_are_refused() -> None:
    with pytest.raises(UsageError, match="NaN"):
        prune(np.array([1.0, np.nan]), 1)


@pytest.mark.parametrize(
    "wrong", [{"fraction": 1.0}, {"fraction": -0.1}, {"first": 0}, {"first": 5000}, {"interval": 0}]
)
def test_schedules_out_of_range_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(UsageError, match="must"):
        PruningSchedule(**wrong)
