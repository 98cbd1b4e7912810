"""The report on planted faults: a sample of the lists, which `python -m planted` goes through as a whole."""

import zlib
from typing import get_args

import planted
import pytest
from planted import main_profile, peers
from planted.page import BEGIN, END, PAGE, kept, page, to_json

from gsvc_base.errors import UsageError
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
    older, newer = ([mutant for mutant in mutants if mutant.known == known] for known in ("older", "newer"))
    assert 0.25 <= sum(mutant.held_back for mutant in older) / len(older) <= 0.42
    assert 0.4 <= sum(mutant.held_back for mutant in newer) / len(newer) <= 0.6
    assert [len(part) for part in (main_profile.REPORTED, main_profile.THIRD, main_profile.FRESH)] == [21, 30, 10]
    assert len(main_profile.RAISING) == len(main_profile.HARD)
    assert [len(part) for part in (peers.IMPLEMENTATIONS, peers.AUTOGRAD)] == [13, 6]


def test_every_planted_fault_can_be_made():
    for mutant in planted.all_planted():
        if mutant.name != "taichi-splatting":
            assert set(mutant.functions()) == set(mutant.operations)


def test_a_module_that_cannot_be_imported_says_why():
    with pytest.raises(UsageError, match="CUDA_HOME"):
        peers.no_device()


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


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    "mutant", [*main_profile.PLANTED[: -len(main_profile.RAISING)]], ids=lambda mutant: mutant.name
)
def test_a_fault_of_main_is_caught(mutant):
    assert any(entry.result.outcome in ("fail", "error") for entry in planted.judged(mutant))


@pytest.mark.parametrize("mutant", planted.all_planted(), ids=lambda mutant: mutant.name)
def test_a_planted_mutant_is_none_of_the_catalogue_by_name(mutant):
    assert mutant.name not in {mutant.name for mutant in MUTANTS}


@pytest.mark.parametrize("mutant", [*main_profile.THIRD, *main_profile.FRESH], ids=lambda mutant: mutant.name)
def test_what_was_made_up_later_is_none_of_the_catalogue_by_its_code(mutant):
    (patches,) = mutant.functions.args
    assert not {patches, patches[::-1]} & {mutant.patches for mutant in MUTANTS}


LINES = ("errors in S alone (main_inter: 3 of 3 examined)", "a g_s that has no maximum (main_inter: 2 of 3 examined)")


@pytest.mark.parametrize(
    ("right", "near", "lines", "verdict"),
    [
        ("g_s", "", LINES[::-1], "right"),
        ("g_s", "(?!)", LINES, "place"),
        ("(?i)shear", "(?i)errors in s", LINES, "wrong"),
        ("shear", "errors in S", LINES[:1], "place"),
        ("shear", "", LINES, "place"),
        ("shear", "main_inter", (), "place"),
        ("shear", "(?!)", ("could be a g_s that has no maximum",), "nothing"),
        ("shear", "size", ("could be a size of 0",), "nothing"),
        ("shear", "(?!)", ("only vectors with width 9 fail",), "wrong"),
        ("shear", "", ("only vectors with width 9 fail",), "place"),
    ],
)
def test_a_verdict(right, near, lines, verdict):
    fault = planted.Planted("a fault", "main", (), right, dict, near=near)
    assert planted.verdict(fault, lines, "begin with: main_inter/a_vector") == verdict


def test_the_page_has_what_was_found_between_its_marks():
    faults = [fault for fault in planted.all_planted() if fault.known == "autograd"]
    written = page([planted.Said(fault, "right", ("a cause of |a| (loss: 1 of 2 examined)",)) for fault in faults])
    before, _, found = written.partition(BEGIN)
    assert PAGE.read_text(encoding="utf-8").startswith(before + BEGIN)
    assert "| autograd, all | 6 | 6 | 6 | 0 | 0 | 0 |" in found
    assert "| clamp | right | a cause of \\|a\\| |" in found
    assert found.endswith(END)


def test_what_was_found_is_kept_for_the_next_run(tmp_path):
    file = tmp_path / "found.json"
    assert kept(file) == []
    (fault,) = (fault for fault in planted.all_planted() if fault.name == "g_s of any size")
    file.write_text(to_json([planted.Said(fault, "right", ("a cause",), "begin with: it")]), encoding="utf-8")
    (one,) = kept(file)
    assert (one.mutant.name, one.mutant.part, one.verdict, one.lines) == (fault.name, "reported", "right", ("a cause",))


def test_a_decoder_answers_as_far_as_it_got():
    vector = next(vector for vector in planted.vectors_of("read_main_stream", "main") if "/main_lanes_64" in vector.id)
    (fault,) = (fault for fault in main_profile.THIRD if fault.name == "contexts of V_y from 0, 2 and 7 on")
    given = fault.functions()["read_main_stream"](**vector.inputs)
    right = {name: expectation.value for name, expectation in vector.expected.items()}
    assert len(given["frame_types"]) < len(given["bodies"]) <= len(right["bodies"])
    assert 0 < len(given["symbols"]) < len(right["symbols"])
    assert given["bodies"].tolist() == right["bodies"][: len(given["bodies"])].tolist()
