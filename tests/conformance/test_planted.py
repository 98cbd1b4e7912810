"""What the report says of planted bugs: a sample of the list, which `python -m planted` goes through as a whole."""

import zlib
from typing import get_args

import planted
import pytest

from conformance.mutants import all_mutants

MIN_RIGHT, MAX_WRONG = 0.9, 0.04
"""Of the bugs of the sample that are caught: of those tuned on first so many are named or located rightly, and of each
part so many wrongly. The other parts are too few here to tell; `python -m planted` holds all against its demands."""

SAMPLE = 48
"""One in so many is tried here, by a rule that has nothing to do with what is said of it."""


def test_the_lists_are_large_and_parts_were_held_back():
    bugs = planted.all_bugs()
    assert len(bugs) >= 100
    assert len({bug.name for bug in bugs}) == len(bugs)
    older, newer = ([bug for bug in bugs if bug.new == new] for new in (False, True))
    assert 0.25 <= sum(bug.held_back for bug in older) / len(older) <= 0.42
    assert 0.4 <= sum(bug.held_back for bug in newer) / len(newer) <= 0.6


def test_every_planted_bug_can_be_made():
    for bug in planted.all_bugs():
        assert set(bug.functions()) == set(bug.operations)


def test_planted_bugs_are_named_rightly(capsys):
    sample = [bug for bug in planted.all_bugs() if zlib.crc32(bug.name.encode()) // 3 % SAMPLE == 0]
    found = [planted.said(bug) for bug in sample]
    told = "\n".join([*planted.table(found), *(f"{one.verdict}: {one.bug.name}: {one.lines}" for one in found)])
    for part in get_args(planted.Part):
        caught = [one for one in found if one.verdict != "not caught" and one.bug.part == part]
        right, wrong = (sum(one.verdict == verdict for one in caught) for verdict in ("right", "wrong"))
        with capsys.disabled():
            print(f"\n{right} of {len(caught)} planted bugs are named or located rightly, {wrong} wrongly"
                  f" ({part}, a sample)")  # fmt: skip
        assert part != "tuned" or right >= MIN_RIGHT * len(caught), told
        assert wrong <= max(1, MAX_WRONG * len(caught)), told


@pytest.mark.parametrize("bug", planted.all_bugs(), ids=lambda bug: bug.name)
def test_a_planted_bug_is_none_of_the_catalogue_by_name(bug):
    assert bug.name not in {mutant.name for mutant in all_mutants()}
