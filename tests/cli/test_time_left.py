"""How long an encode will still take."""

import pytest

from gsvc_ref.cli.time_left import INTER_SHARE, GroupsTimeLeft, TimeLeft


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
