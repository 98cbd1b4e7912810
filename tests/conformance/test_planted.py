"""The report on planted mutants: a sample of the list, which `python -m planted` goes through as a whole."""

import zlib
from typing import get_args

import planted
import pytest

from gsvc_conformance.mutants import MUTANTS

MIN_RIGHT, MAX_WRONG = 0.9, 0.04
"""Fraction of the caught mutants of the sample tuned on first that are named or located rightly, at least, and fraction
of each part that is named wrongly, at most. The other parts are too few here; `python -m planted` judges all."""

SAMPLE = 48
"""One in so many is tried here, by a rule that has nothing to do with what is said of it, and one of an operation."""


def test_the_lists_are_large_and_parts_were_held_back():
    mutants = planted.all_planted()
    assert len(mutants) >= 100
    assert len({mutant.name for mutant in mutants}) == len(mutants)
    older, newer = ([mutant for mutant in mutants if mutant.new == new] for new in (False, True))
    assert 0.25 <= sum(mutant.held_back for mutant in older) / len(older) <= 0.42
    assert 0.4 <= sum(mutant.held_back for mutant in newer) / len(newer) <= 0.6


def test_every_planted_mutant_can_be_made():
    for mutant in planted.all_planted():
        assert set(mutant.functions()) == set(mutant.operations)


@pytest.mark.exhaustive
def test_planted_mutants_are_named_rightly(capsys):
    sample = [mutant for mutant in planted.all_planted() if zlib.crc32(mutant.name.encode()) // 3 % SAMPLE == 0]
    found = [planted.said(mutant) for mutant in {mutant.operations: mutant for mutant in sample}.values()]
    told = "\n".join([*planted.table(found), *(f"{one.verdict}: {one.mutant.name}: {one.lines}" for one in found)])
    for part in get_args(planted.Part):
        caught = [one for one in found if one.verdict != "not caught" and one.mutant.part == part]
        right, wrong = (sum(one.verdict == verdict for one in caught) for verdict in ("right", "wrong"))
        with capsys.disabled():
            print(f"\n{right} of {len(caught)} planted mutants are named or located rightly, {wrong} wrongly"
                  f" ({part}, a sample)")  # fmt: skip
        assert part != "tuned" or right >= MIN_RIGHT * len(caught), told
        assert wrong <= max(1, MAX_WRONG * len(caught)), told


@pytest.mark.parametrize("mutant", planted.all_planted(), ids=lambda mutant: mutant.name)
def test_a_planted_mutant_is_none_of_the_catalogue_by_name(mutant):
    assert mutant.name not in {mutant.name for mutant in MUTANTS}
