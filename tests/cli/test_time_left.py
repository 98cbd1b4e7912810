"""How long an encode will still take."""

import pytest

from gsvc_ref.encoder import Progress
from gsvc_tools.cli.encode_progress import progress_callback
from gsvc_tools.cli.time_left import INTER_SHARE, GroupsTimeLeft, TimeLeft


def test_the_first_frame_tells_something_while_it_is_in_work():
    left = TimeLeft()
    assert left.update(0, 0.0, 5.0, 11) is None  # what came before was reading
    assert left.update(0, 0.05, 6.0, 11) is None
    assert left.update(0, 0.5, 10.0, 11) == pytest.approx(5 + 10 * 10 * INTER_SHARE)


def test_p_frames_count_as_soon_as_there_are_some():
    left = TimeLeft()
    left.update(0, 0.0, 0.0, 11)
    assert left.update(1, 0.0, 10.0, 11) == pytest.approx(10 * 10 * INTER_SHARE)
    assert left.update(2, 0.0, 11.0, 11) == pytest.approx(9)
    assert left.update(2, 0.5, 11.5, 11) == pytest.approx(8.5)
    assert left.update(10, 1.0, 21.0, 11) == pytest.approx(0, abs=1.3)


def test_without_a_length_there_is_a_pace_alone():
    left = TimeLeft()
    assert left.update(0, 0.5, 0.0, None) is None
    assert left.update(8, 0.0, 4.0, None) is None
    assert left.rate == 2


def test_another_pass_begins_anew():
    left = TimeLeft()
    for frame in range(5):
        left.update(frame, 0.0, 10.0 * frame, 5)
    left.update(0, 0.0, 50.0, 5)
    assert left.update(0, 0.5, 51.0, 5) == pytest.approx(1 + 4 * 2 * INTER_SHARE)


def test_side_by_side_the_pace_counts_from_the_first_frames_on():
    left = GroupsTimeLeft()
    assert left.update(2, 30.0, 12) == pytest.approx(150)  # with the start of the processes
    assert left.update(6, 34.0, 12) == pytest.approx(6)
    assert left.rate == 1
    assert GroupsTimeLeft().update(3, 4.0, None) is None


def test_the_first_frame_that_is_encoded_is_an_i_frame_wherever_it_is():
    left = TimeLeft()
    assert left.update(6, 0.0, 5.0, 11) is None
    assert left.update(6, 0.5, 10.0, 11) == pytest.approx(5 + 10 * 4 * INTER_SHARE)
    assert left.update(7, 0.0, 15.0, 11) == pytest.approx(4 * 10 * INTER_SHARE)
    assert left.rate == pytest.approx(0.1)


class Shown:
    """A display that notes what it is told."""

    active = True

    def __init__(self):
        self.told = []

    def update(self, text, done, total, *, left_s=None, guess=True):
        assert not guess
        self.told.append((done, left_s))


def test_frames_that_were_kept_move_the_bar_and_not_the_estimate():
    display = Shown()
    show = progress_callback(display)
    for frame in range(4):
        show(Progress(frame, 8, "encode", 0, 0, None, 0.1 * frame, kept=frame + 1))
    show(Progress(4, 8, "encode", 0, 10, None, 1.0, kept=4))
    show(Progress(4, 8, "encode", 5, 10, None, 6.0, kept=4))
    assert display.told[:5] == [(frame, None) for frame in range(5)]
    assert display.told[5] == (4.5, pytest.approx(5 + 3 * 10 * INTER_SHARE))


def test_frames_that_were_kept_are_not_of_the_pace_of_groups():
    display = Shown()
    show = progress_callback(display)
    for frame in range(4):
        show(Progress(frame, 8, "groups", 0, 2, None, 0.1 * frame, kept=frame + 1))
    show(Progress(4, 8, "groups", 1, 2, None, 20.0, kept=4))  # with the start of the processes
    show(Progress(5, 8, "groups", 1, 2, None, 22.0, kept=4))
    assert display.told == [(1, None), (2, None), (3, None), (4, None), (5, pytest.approx(60)), (6, pytest.approx(4))]
