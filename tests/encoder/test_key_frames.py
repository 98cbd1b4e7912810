"""DKS: the paper's rule to the letter, its blind spots, and the robust rule for what it cannot see."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gsvc_base.errors import UsageError
from gsvc_ref.encoder.key_frames import WINDOW, KeyFrameSelector, exceeds, select_key_frames

FLAT = 0.25
"""Loss of an ordinary frame, from scratch and predicted alike, so that its difference is zero."""


def sequence(frames: int, cuts: dict[int, float]) -> tuple[list[float], list[float]]:
    """Losses I and P of `frames` frames; a cut adds its height to the loss P of its frame (from 0)."""
    return [FLAT] * frames, [FLAT + cuts.get(frame, 0.0) for frame in range(1, frames)]


def scene_transitions(differences: list[float], window: int = WINDOW) -> list[bool]:
    """The paper's rule and nothing else: whether D_t exceeds the mean of its window by more than 3 deviations."""
    exact = [Fraction(difference) for difference in differences]
    return [exceeds(d, exact[max(0, t - window) : t + window + 1], Fraction(3)) for t, d in enumerate(exact)]


losses = st.floats(0, 1, allow_subnormal=False)


@st.composite
def sequences(draw: st.DrawFn) -> tuple[list[float], list[float]]:
    frames = draw(st.integers(1, 40))
    some = st.one_of(losses, st.sampled_from([0.0, FLAT, 1.0]))
    losses_i = draw(st.lists(some, min_size=frames, max_size=frames))
    return losses_i, draw(st.lists(some, min_size=frames - 1, max_size=frames - 1))


@given(st.lists(st.floats(-1, 1), max_size=40), st.integers(0, 12))
def test_the_papers_rule_is_the_papers_equation(differences: list[float], window: int) -> None:
    decisions = scene_transitions(differences, window=window)
    for t, decision in enumerate(decisions):
        around = np.array(differences[max(0, t - window) : t + window + 1])
        margin = differences[t] - (around.mean() + 3 * around.std())
        if abs(margin) > 1e-12:  # nearer than that, binary64 cannot tell
            assert decision == (margin > 0)


@pytest.mark.parametrize("frames", [1, 2, 11, 12, 40])
@pytest.mark.parametrize("rule", ["paper", "robust"])
@pytest.mark.parametrize("causal", [False, True])
def test_equal_losses_give_the_first_frame_only(frames: int, rule: str, causal: bool) -> None:
    for value in (FLAT, 0.1, 0.0):  # sums of 0.1 are not exact in binary64
        assert select_key_frames([value] * frames, [value] * (frames - 1), robust=rule == "robust", causal=causal) == [
            0
        ]
        assert select_key_frames(
            [value] * frames, [1.1 * value] * (frames - 1), robust=rule == "robust", causal=causal
        ) == [0]


@pytest.mark.parametrize("cut", [1, 2, 7, 15, 29])
@pytest.mark.parametrize("rule", ["paper", "robust"])
@pytest.mark.parametrize("causal", [False, True])
def test_a_single_cut_is_found_anywhere(cut: int, rule: str, causal: bool) -> None:
    assert select_key_frames(*sequence(30, {cut: 0.5}), robust=rule == "robust", causal=causal) == [0, cut]


@pytest.mark.parametrize("frames", [2, 3, 6, 11])
def test_short_sequences_find_a_cut_in_their_last_frame(frames: int) -> None:
    assert select_key_frames(*sequence(frames, {frames - 1: 0.5})) == [0, frames - 1]


def test_up_to_ten_values_cannot_exceed_three_deviations() -> None:
    for values in range(1, 11):
        assert not any(scene_transitions([1.0] + [0.0] * (values - 1)))
    assert scene_transitions([1.0] + [0.0] * 10)[0]


def test_with_two_frames_the_guard_decides() -> None:
    assert select_key_frames([FLAT] * 2, [2 * FLAT]) == [0]
    assert select_key_frames([FLAT] * 2, [2 * FLAT + 0.01]) == [0, 1]
    assert select_key_frames([FLAT] * 2, [1.6 * FLAT], guard_ratio=1.5) == [0, 1]


def test_the_guard_keeps_noise_from_being_a_cut() -> None:
    losses_i, losses_p = sequence(8, {5: 0.2})  # far out of the statistics, but 1.8 times the loss I only
    assert select_key_frames(losses_i, losses_p) == [0]
    assert select_key_frames(losses_i, losses_p, guard_ratio=1.0) == [0, 5]


def test_two_equal_cuts_in_a_window_of_twenty_hide_each_other_from_the_paper() -> None:
    """n = 20, two values of v: mean v/10 and deviation 3v/10, so v is exactly 3.0 deviations above, not more."""
    differences = [0.0] * 20
    differences[9] = differences[10] = 0.1  # both windows hold all 20
    assert not any(scene_transitions(differences))
    cuts = {10: 0.5, 11: 0.5}
    assert select_key_frames(*sequence(21, cuts)) == [0]
    assert select_key_frames(*sequence(21, cuts), robust=True) == [0, 10, 11]
    assert select_key_frames(*sequence(21, cuts), causal=True) == [0, 10, 11]


def test_a_cut_stays_in_the_papers_statistics_and_leaves_the_robust_ones() -> None:
    cuts = {6: 1.0, 12: 0.5}
    assert select_key_frames(*sequence(40, cuts)) == [0, 6]
    assert select_key_frames(*sequence(40, cuts), causal=True) == [0, 6, 12]
    assert select_key_frames(*sequence(40, cuts), robust=True, causal=True) == [0, 6, 12]


def test_a_window_that_holds_nothing_but_cuts_leaves_the_guard() -> None:
    cuts = dict.fromkeys(range(1, 6), 0.5)
    assert select_key_frames(*sequence(6, cuts), causal=True) == [0, 1, 2, 3, 4, 5]


def test_the_window_ends_where_it_says() -> None:
    """A larger cut hides a smaller one exactly as far as the window reaches."""
    for distance, expected in ((10, [0, 20]), (11, [0, 20, 31])):
        assert select_key_frames(*sequence(60, {20: 1.0, 20 + distance: 0.3})) == expected


@given(sequences(), st.integers(0, 12), st.sampled_from(["paper", "robust"]), st.booleans())
def test_streaming_equals_the_whole_sequence(
    case: tuple[list[float], list[float]], window: int, rule: str, causal: bool
) -> None:
    losses_i, losses_p = case
    selector = KeyFrameSelector(window=window, rule=rule, causal=causal)
    decided: list[bool] = []
    for frame, loss_i in enumerate(losses_i):
        decided += selector.push(loss_i, losses_p[frame - 1] if frame else None)
        assert len(decided) == (frame + 1 if causal else max(1, frame + 1 - window))
    decided += selector.flush()
    expected = select_key_frames(losses_i, losses_p, window=window, robust=rule == "robust", causal=causal)
    assert [frame for frame, is_key in enumerate(decided) if is_key] == expected
    assert len(decided) == len(losses_i)
    assert selector.flush() == []


@given(sequences(), st.integers(4, 12))
def test_long_windows_of_the_selector_are_the_papers(case: tuple[list[float], list[float]], window: int) -> None:
    losses_i, losses_p = case
    keys = select_key_frames(losses_i, losses_p, window=window)
    exact = [p - i for i, p in zip(losses_i[1:], losses_p, strict=True)]
    for t, decision in enumerate(scene_transitions(exact, window=window)):
        around = exact[max(0, t - window) : t + window + 1]
        margin = exact[t] - (np.mean(around) + 3 * np.std(around))
        if len(around) > 10 and abs(margin) > 1e-12:
            assert (t + 1 in keys) == decision


@given(sequences(), st.integers(0, 12))
def test_robust_decisions_follow_their_definition(case: tuple[list[float], list[float]], window: int) -> None:
    losses_i, losses_p = case
    keys = select_key_frames(losses_i, losses_p, window=window, robust=True)
    exact = [p - i for i, p in zip(losses_i[1:], losses_p, strict=True)]
    for t, difference in enumerate(exact):
        others = [
            exact[o]
            for o in range(max(0, t - window), min(len(exact), t + window + 1))
            if o != t and not (o < t and o + 1 in keys)
        ]
        margin = difference - (np.mean(others) + 3 * np.std(others)) if others else math.inf
        if abs(margin) > 1e-12:
            assert (t + 1 in keys) == (margin > 0 and losses_p[t] > 2 * losses_i[t + 1])


def test_memory_does_not_grow_with_the_sequence() -> None:
    selector = KeyFrameSelector(window=3)
    selector.push(FLAT)
    for _ in range(100):
        selector.push(FLAT, FLAT)
    assert len(selector._decided) + len(selector._waiting) == 6


def test_losses_that_do_not_fit_are_refused() -> None:
    with pytest.raises(UsageError, match="every frame but the first"):
        KeyFrameSelector().push(FLAT, FLAT)
    selector = KeyFrameSelector()
    selector.push(FLAT)
    with pytest.raises(UsageError, match="every frame but the first"):
        selector.push(FLAT)
    for loss_i, loss_p in ((math.nan, FLAT), (FLAT, math.inf), (-1.0, FLAT)):
        with pytest.raises(UsageError, match="finite and at least 0"):
            selector.push(loss_i, loss_p)
    with pytest.raises(UsageError, match="3 losses I and 1 losses P"):
        select_key_frames([FLAT] * 3, [FLAT])


def test_no_frames_have_no_key_frames() -> None:
    assert select_key_frames([], []) == []


@pytest.mark.parametrize(
    "wrong", [{"window": -1}, {"threshold": -1.0}, {"threshold": math.nan}, {"guard_ratio": -1.0}, {"rule": "median"}]
)
def test_parameters_out_of_range_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(UsageError, match="must be"):
        KeyFrameSelector(**wrong)
