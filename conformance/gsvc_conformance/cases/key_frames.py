"""Cases of key-frame selection and convergence."""

from collections.abc import Mapping

import numpy as np

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.operation import Values

# --- Key frames ------------------------------------------------------------------------------------------------------


PAPER = {"window": 10, "threshold": 3.0, "guard_ratio": 2.0, "robust": 0}
ROBUST = {**PAPER, "robust": 1}


def losses(frames: int, differences: Mapping[int, float], floor: float = 0.0, loss_i: float = 8.0) -> Values:
    """Losses I and P of a sequence whose P exceeds I by `floor`, but at some frames by something else."""
    excess = np.full(frames - 1, floor)
    for frame, difference in differences.items():
        excess[frame - 1] = difference
    return {"losses_i": np.full(frames, loss_i), "losses_p": loss_i + excess}


@case("core", "select_key_frames", flags=["window"])
def one_cut(rng: Draws) -> Inputs:
    """One clear cut among frames that differ a little."""
    loss_i = 8 + np.round(rng.random(40), 3)
    loss_p = loss_i[1:] + np.round(rng.random(39), 3)
    loss_p[22] += 12
    expected = yield {"losses_i": loss_i, "losses_p": loss_p, **PAPER}
    assert expected["key_frames"].value.tolist() == [0, 23]


@case("core", "select_key_frames", flags=["window"],
      each={"10_after": 10, "11_after": 11, "10_before": -10, "11_before": -11},
      said={f"{n}_{side}": f"{n} frames {side} it" for n in (10, 11) for side in ("before", "after")})  # fmt: skip
def cut_beside_a_larger_one(value: int) -> Inputs:
    """A cut is hidden by a ten times larger one if inside its window; here the larger one is {key}.

    The window reaches ten frames to either side and includes both ends.
    """
    expected = yield {**losses(70, {30: 8, 30 + value: 80}), **PAPER}
    assert (30 in expected["key_frames"].value) == (abs(value) == 11)


@case("core", "select_key_frames", flags=["ties"])
def two_equal_cuts_among_twenty() -> Inputs:
    """Two equal cuts in a window of 20 frames are exactly three deviations high, which is not more than three."""
    expected = yield {**losses(21, {10: 7, 11: 7}), **PAPER}
    assert expected["key_frames"].value.tolist() == [0]


@case("core", "select_key_frames", flags=["window"])
def two_equal_cuts_among_twenty_one() -> Inputs:
    """One frame more in both windows: now they are 3.08 deviations high."""
    expected = yield {**losses(40, {18: 7, 19: 7}), **PAPER}
    assert expected["key_frames"].value.tolist() == [0, 18, 19]


@case("core", "select_key_frames", flags=["factor"])
def deviation_of_the_population() -> Inputs:
    """Cuts of 100 and 103 in one window: 3.03 deviations dividing by n, 2.96 dividing by n - 1."""
    expected = yield {**losses(40, {18: 100, 20: 103}), **PAPER}
    assert expected["key_frames"].value.tolist() == [0, 18, 20]


@case("core", "select_key_frames", flags=["factor"])
def cut_on_a_high_floor() -> Inputs:
    """All frames are hard to predict and one a little harder: what counts are deviations, not multiples of the mean."""
    expected = yield {**losses(40, {20: 60}, floor=50), **PAPER}
    assert expected["key_frames"].value.tolist() == [0, 20]


@case("core", "select_key_frames", flags=["window"])
def cut_at_the_first_difference() -> Inputs:
    """Frame 1 is a cut on a high floor: frame 0 has no difference, and takes no part as a 0."""
    expected = yield {**losses(40, {1: 60}, floor=50), **PAPER}
    assert expected["key_frames"].value.tolist() == [0, 1]


@case("core", "select_key_frames", flags=["window"])
def cut_at_the_last_frame() -> Inputs:
    """The last frame is a cut: its window ends with it."""
    expected = yield {**losses(30, {29: 9}), **PAPER}
    assert expected["key_frames"].value.tolist() == [0, 29]


@case("core", "select_key_frames", flags=["factor"])
def frame_that_is_easier_to_predict() -> Inputs:
    """A frame far below the mean of its window is not a cut; the square of its distance forgets the sign."""
    expected = yield {**losses(40, {20: -6}), **PAPER}
    assert expected["key_frames"].value.tolist() == [0]


@case("core", "select_key_frames", flags=["ties"])
def all_frames_alike() -> Inputs:
    """All differences are equal: nothing is more than zero deviations above the mean."""
    expected = yield {**losses(25, {}, floor=3), **PAPER}
    assert expected["key_frames"].value.tolist() == [0]


@case("core", "select_key_frames", flags=["window"])
def difference_and_not_loss() -> Inputs:
    """A frame that is hard to train from scratch as well is not a cut: P is large there, P - I is not."""
    loss_i = np.full(40, 8.0)
    loss_p = loss_i[1:] + np.resize([0, 0.25, 0.5], 39)
    loss_i[20] += 100
    loss_p[19] += 100
    expected = yield {"losses_i": loss_i, "losses_p": loss_p, **PAPER}
    assert expected["key_frames"].value.tolist() == [0]


@case("core", "select_key_frames", flags=["window"], each={"of_10": 9, "of_11": 10})
def short_window(value: int) -> Inputs:
    """A cut whose P is less than twice I, in a window {key} values.

    Ten values can never be more than three deviations high, so the robust rule decides, and its guard says no. Eleven
    can: the paper's rule decides.
    """
    expected = yield {**losses(30, {1: 4}), **PAPER, "window": value}
    assert expected["key_frames"].value.tolist() == ([0] if value == 9 else [0, 1])


@case("core", "select_key_frames", flags=["window"])
def short_sequence() -> Inputs:
    """Eleven frames: ten differences, of which the paper's rule could choose none; the robust rule finds the cut."""
    expected = yield {**losses(11, {6: 30, 3: 1}), **PAPER}
    assert expected["key_frames"].value.tolist() == [0, 6]


@case("core", "select_key_frames", flags=["empty"])
def one_frame() -> Inputs:
    """A sequence of one frame."""
    expected = yield {"losses_i": np.ones(1), "losses_p": np.zeros(0), **PAPER}
    assert expected["key_frames"].value.tolist() == [0]


@case("core", "select_key_frames", flags=["empty", "ties"], each={"more_than_twice": 2.5, "exactly_twice": 2.0})
def two_frames(value: float) -> Inputs:
    """Two frames: without others to compare with, the guard alone decides; P is {key} I."""
    expected = yield {"losses_i": np.array([5.0, 3.0]), "losses_p": np.array([3 * value]), **PAPER}
    assert expected["key_frames"].value.tolist() == ([0, 1] if value > 2 else [0])


@case("core", "select_key_frames", flags=["window"])
def robust_rule_finds_neighbours() -> Inputs:
    """The robust rule on three cuts in one window: each leaves itself and the key frames before it out.

    The first two are hidden by what follows, since only key frames that are already found are left out.
    """
    expected = yield {**losses(40, {18: 20, 19: 400, 20: 20}), **ROBUST}
    assert expected["key_frames"].value.tolist() == [0, 19, 20]


@case("core", "select_key_frames", flags=["window"])
def robust_rule_and_its_guard() -> Inputs:
    """Cuts far above all others, but with P below twice I: noise, says the robust rule."""
    expected = yield {**losses(40, {10: 7.5, 28: 8.5}), **ROBUST}
    assert expected["key_frames"].value.tolist() == [0, 28]


@case("uncommon", "select_key_frames", flags=["window"])
def other_settings() -> Inputs:
    """A window of 3, a threshold of 3/2 and a guard of 4, which few frames suffice for."""
    settings = {"window": 3, "threshold": 1.5, "guard_ratio": 4.0, "robust": 0}
    expected = yield {**losses(24, {1: 20, 2: 25, 9: 5, 14: 5, 15: 5, 23: 30}), **settings}
    assert expected["key_frames"].value.tolist() == [0, 9, 14, 15, 23]  # 1 and 2 hide each other


@case("uncommon", "select_key_frames", flags=["window"])
def window_of_nothing() -> Inputs:
    """A window of 0: no frame has neighbours, and the guard decides."""
    expected = yield {**losses(6, {2: 8, 4: 8.5}), **PAPER, "window": 0}
    assert expected["key_frames"].value.tolist() == [0, 4]


@case("uncommon", "select_key_frames", flags=["ties"], each={"sums": (0.1, 0.7), "deviations": (0.7, 0.1)})
def tie_in_decimal_fractions(value: tuple[float, float]) -> Inputs:
    """Two equal cuts among 20 in decimal fractions: still a tie, though binary64 misses it with its {key}.

    Rounded sums of differences and squares, or means and deviations, find two cuts that are not there.
    """
    loss_i, cut = value
    expected = yield {**losses(21, {4: cut, 11: cut}, loss_i=loss_i), **PAPER, "window": 20}
    assert expected["key_frames"].value.tolist() == [0]


# --- Convergence -----------------------------------------------------------------------------------------------------


@case("core", "converged", flags=["schedule"])
def convergence_of_the_paper(rng: Draws) -> Inputs:
    """The paper's rule: 100 calm changes in a row, after a fall and with one change that is too large on the way."""
    falling = 0.5 * np.cumprod(np.full(60, 0.9))
    falling = np.concatenate([falling, falling[-1] - 1e-3 + 4e-8 * rng.random(220)])
    falling[90:] -= 1e-5
    expected = yield {"losses": falling, "patience": 100, "tolerance": 1e-7}
    assert expected["iteration"].value == 191


@case("core", "converged", flags=["schedule"])
def calm_changes_in_a_row() -> Inputs:
    """A patience of 3: two calm changes, a jump up, two more, a jump down, and then three."""
    sequence = [8.0, 8, 8, 9, 9, 9, 3, 3, 3, 3, 3]
    expected = yield {"losses": np.array(sequence), "patience": 3, "tolerance": 0.25}
    assert expected["iteration"].value == 10


@case("core", "converged", flags=["ties"])
def changes_of_exactly_the_tolerance() -> Inputs:
    """Changes of exactly the tolerance are calm, up or down; a little more is not."""
    sequence = [4.0, 4.25, 4.5625, 4.3125, 4.5625, 9]
    expected = yield {"losses": np.array(sequence), "patience": 2, "tolerance": 0.25}
    assert expected["iteration"].value == 5


@case("core", "converged", flags=["first-step"])
def first_iteration_has_none_before() -> Inputs:
    """The first loss is below the tolerance, but has nothing to be compared with."""
    expected = yield {"losses": np.array([0.125, 0.125, 0.125]), "patience": 1, "tolerance": 0.5}
    assert expected["iteration"].value == 2


@case("core", "converged", flags=["schedule"])
def slow_descent_converges() -> Inputs:
    """A descent in steps below the tolerance: each is compared with the one before, not with the start or the best."""
    expected = yield {"losses": 8 - np.arange(12) / 8, "patience": 5, "tolerance": 0.125}
    assert expected["iteration"].value == 6


@case("core", "converged", flags=["schedule"])
def oscillation_does_not_converge() -> Inputs:
    """Losses that jump up and down never improve, and never calm down."""
    expected = yield {"losses": np.resize([1.0, 2.0], 20), "patience": 3, "tolerance": 0.5}
    assert expected["iteration"].value == 0


@case("core", "converged", flags=["schedule"], each={"one_short": 5, "just_enough": 6},
      said={"one_short": "one too few"})  # fmt: skip
def end_of_training(value: int) -> Inputs:
    """Equal losses until training ends, {key} for a patience of 5."""
    expected = yield {"losses": np.ones(value), "patience": 5, "tolerance": 0.0}
    assert expected["iteration"].value == (6 if value == 6 else 0)


@case("uncommon", "converged", flags=["empty"])
def convergence_of_nothing() -> Inputs:
    """No iteration at all."""
    expected = yield {"losses": np.zeros(0), "patience": 1, "tolerance": 1.0}
    assert expected["iteration"].value == 0
