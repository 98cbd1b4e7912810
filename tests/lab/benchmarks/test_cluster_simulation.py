"""The simulation of a cluster: what must hold for any film, and cases that can be reckoned by hand."""

import pytest

from gsvc_lab.benchmarks.cluster import Measuring, Task, simulated, table
from gsvc_tools.jobs.side_by_side import GROUPS_AHEAD

FREE = 1e15
"""A link that takes no time."""


def film(*groups: int, seconds: float = 2.0) -> list[list[Task]]:
    """Groups of so many tasks."""
    return [[Task(seconds, 5, 1000, 500)] * count for count in groups]


def test_one_worker_takes_all_the_work():
    found = simulated(film(3, 1, 2), 1, FREE)
    assert found.seconds == pytest.approx(12)
    assert found.moved == 6 * 1500


def test_no_group_is_shared_by_two_workers():
    found = simulated(film(5, 1, 1), 10, FREE)
    assert found.seconds == pytest.approx(10)
    assert found.tail == pytest.approx(10)


def test_long_groups_are_begun_first():
    assert simulated(film(1, 1, 4), 2, FREE).seconds == pytest.approx(8)


def test_groups_are_read_only_so_far_ahead():
    """Here the long one is not known before one of the others is done."""
    ahead = GROUPS_AHEAD * 2 + 1
    assert simulated(film(*[1] * ahead, 5), 2, FREE).seconds == pytest.approx(2 + 10)


def test_groups_are_read_as_those_before_are_written_in_order():
    """Here the last one is not read before the first is written, though one worker has long had nothing to do."""
    ahead = GROUPS_AHEAD * 2 + 1
    assert simulated(film(6, *[1] * ahead), 2, FREE).seconds == pytest.approx(12 + 2)


@pytest.mark.parametrize("workers", [1, 10, 1000])
def test_the_link_is_shared_by_all(workers):
    """Both ways at the same time: the slower one counts, and the other once more at the beginning or at the end."""
    found = simulated(film(*[1] * 100, seconds=0.0), workers, 1000.0)
    assert 100 <= found.seconds <= 100 + 100 * 0.5 * (workers == 1) + 0.5


def test_the_table_has_a_row_for_each_number_of_workers():
    rows = table(film(3, 1, 2), 50, FREE, seed=1).rows
    assert [row[0] for row in rows] == ["1", "10", "100", "1,000"]
    assert rows[0][2:5] == ["1.0", "100%", "0.0 s"]


def test_what_is_measured_is_what_a_worker_is_sent():
    made = Measuring()
    frames = [(b"picture", "I", 0), (b"another", "P", 1)]
    assert made.submit(_pair, "coder", frames).result() == ("coder", 2)
    assert made.submit(_pair, "coder", [(b"x", "P", 2)]).result() == ("coder", 1)
    ((first, second),) = made.groups
    assert (first.frames, second.frames) == (2, 1)
    assert first.sent > second.sent > second.returned


def test_tasks_of_groups_that_take_turns_stay_with_their_groups():
    made = Measuring()
    for kinds, first in (("I", 0), ("I", 10), ("PP", 1), ("I", 20), ("PPP", 11), ("P", 3), ("P", 21)):
        made.submit(_pair, "coder", [(b"x", kind, first + place) for place, kind in enumerate(kinds)])
    assert [[task.frames for task in group] for group in made.groups] == [[1, 2, 1], [1, 3], [1, 1]]


def _pair(coder, frames):
    return coder, len(frames)
