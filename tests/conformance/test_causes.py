"""The search for causes in a whole run: what is said first, what is said of the search, and when it fails."""

import numpy as np
import pytest

from gsvc_conformance import diagnosis
from gsvc_conformance.causes import Causes, Search, added, mend_first
from gsvc_conformance.commands.judging import _unusual_notes
from gsvc_conformance.diagnosis import is_place
from gsvc_conformance.implementations import ModuleImplementation
from gsvc_conformance.mutants import MUTANTS
from gsvc_conformance.profiles import ANY
from gsvc_conformance.report.console import cause_lines
from gsvc_conformance.report.element_tables import _relation
from gsvc_conformance.results import OutputResult, Result, simplest_first
from gsvc_conformance.runner import judge_vector
from gsvc_conformance.side_by_side import _cell
from gsvc_conformance.spec import namespace
from gsvc_conformance.vector import VECTORS
from gsvc_conformance.vector_folder import VectorFolder
from gsvc_conformance.verdicts import Report


def searched(functions, names):
    """The causes of an implementation by id, and the notes."""
    causes, results = Causes(), []
    for vector in VectorFolder(VECTORS).read(names):
        judged = judge_vector(ModuleImplementation("mine", functions), vector)
        causes.add(judged)
        results.append(judged.result)
    found, notes = causes.find(results)
    return {result.id: list(result.causes) for result in found}, notes


def every_third_row(operation, output):
    """A function whose every third row is wrong, by another number in each picture."""

    def wrong(**inputs):
        array = np.array(namespace()[operation](**inputs)[output])
        array[::3] += np.arange(1, array[::3].size + 1).reshape(array[::3].shape).astype(array.dtype)
        return {output: array}

    return wrong


SUM, FRAME = "core/render_sum/a_splat_off_the_middle", "core/render_frame/"


@pytest.mark.exhaustive
def test_an_operation_inside_that_is_wrong_is_named_in_place_of_places():
    frame = next(name for name in VectorFolder(VECTORS).names if name.startswith(FRAME))
    wrong_frame = {"render_frame": every_third_row("render_frame", "frame")}
    both = {**wrong_frame, "render_sum": every_third_row("render_sum", "sum")}
    said, _ = searched(both, [SUM, frame])
    assert said[frame] == ["render_sum is wrong: mend that first"]
    assert "mend" not in " ".join(said[SUM])
    right_sum = {**wrong_frame, "render_sum": namespace()["render_sum"]}
    alone, _ = searched(right_sum, [SUM, frame])
    assert alone[frame] != said[frame]


def first_of(operation, *wrong):
    return mend_first(operation, ANY, {name: {ANY} for name in wrong}).removesuffix(" wrong: mend that first")


def test_only_the_leaves_of_what_is_wrong_are_to_be_mended_first():
    assert first_of("render_frame", "render_frame", "render_gradients") == ""
    assert first_of("decode_stream", "render_frame", "to_frame", "decode_stream") == "to_frame is"
    assert set(first_of("render_frame", "render_sum", "to_frame").removesuffix(" are").split(" and ")) == {
        "render_sum",
        "to_frame",
    }


def test_a_reader_of_streams_is_made_of_what_shares_its_code():
    wrong = {"main_inter": {"main"}, "read_main_stream": {"main"}, "decode_plane": {"paper"}}
    assert mend_first("seek", "main", wrong) == "main_inter is wrong: mend that first"
    assert mend_first("seek", "paper", wrong) == "decode_plane is wrong: mend that first"
    assert mend_first("read_main_stream", "main", {"encode_plane": {ANY}, "render_sum": {ANY}}) == ""


def test_a_search_that_fails_ends_nothing(monkeypatch):
    def failing(failures, passed, errors):
        raise ZeroDivisionError("a mutant divides")

    monkeypatch.setattr(diagnosis, "diagnose", failing)
    said, notes = searched({"render_sum": every_third_row("render_sum", "sum")}, [SUM])
    assert said == {SUM: []}
    assert notes == ["render_sum: the search for causes failed: ZeroDivisionError: a mutant divides"]


def test_what_is_said_of_a_search():
    assert Search("loss", 3, 3, 0, 0).notes() == []
    assert Search("encode_video", 11, 11, 11, 0).notes() == []
    assert Search("loss", 3, 3, 1, 7).notes() == ["loss: no mutant gives exactly what 1 of 3 failures gave (7 tried)"]
    parts = [Search("loss", 3, 3, 1, 7), Search("augment", 1, 1, 0, 0), Search("loss", 14, 12, 1, 9)]
    loss, augment = added(parts)
    assert augment == parts[1]
    assert loss.notes() == [
        "loss: no mutant gives exactly what 2 of 15 failures gave (9 tried)",
        "causes were looked for in 15 of 17 failures of loss, of all sizes",
    ]


def results_like(*causes):
    """Failures of one operation, each like one of some causes."""
    return [
        Result(f"core/render_sum/v{number}", "", "rendering", "fail", causes=(cause,) if cause else ())
        for number, cause in enumerate(causes)
    ]


@pytest.mark.parametrize(
    ("causes", "said"),
    [
        (["a gamma"] * 6 + [""] * 6, "a gamma (render_sum: 6 of 12 examined)"),
        (["a gamma"] * 4 + [""] * 8, "could be a gamma (render_sum: 4 of 12 examined)"),
        (["a gamma"] * 3 + [""] * 9, "could be a gamma (render_sum: 3 of 12 examined)"),
        (["errors in red alone"] * 4 + [""] * 8, "errors in red alone (render_sum: 4 of 12 examined)"),
    ],
)
def test_a_cause_of_few_failures_is_hedged(causes, said):
    assert cause_lines(Report({}, "", "", [], results_like(*causes))) == [said]


def test_a_cause_of_two_failures_of_many_is_not_told():
    assert cause_lines(Report({}, "", "", [], results_like(*["a gamma"] * 2, *[""] * 10))) == []


def test_a_plain_failure_comes_before_an_error_of_degenerate_splats():
    degenerate = "core/render_sum/degenerate_l11_zero"

    def render_sum(parameters, width, height):
        if (parameters[:, 2] == 0).any():
            raise ZeroDivisionError
        return {"sum": namespace()["render_sum"](parameters, width, height)["sum"] + np.float32(1)}

    vectors = VectorFolder(VECTORS).read([degenerate, SUM])
    results = [
        judge_vector(ModuleImplementation("mine", {"render_sum": render_sum}), vector).result for vector in vectors
    ]
    assert [result.outcome for result in results] == ["error", "fail"]
    assert [result.id for result in simplest_first(results)] == [SUM, degenerate]
    assert 0 < results[0].size < results[1].size + 1


def test_errors_beyond_a_third_of_the_bound_are_a_note():
    passed = [
        Result(
            f"core/render_sum/v{n}",
            "",
            "rendering",
            "pass",
            outputs=(OutputResult("sum", "bounded", True, ratio=ratio),),
        )
        for n, ratio in enumerate((0.1, 0.3, 0.34, 0.75))
    ]
    (note,) = _unusual_notes(passed)
    assert note == (
        "render_sum: 2 of 4 vectors pass with more than a third of the error that is allowed, core/render_sum/v3 with "
        "0.75 of it: allowed, and unusual (on an H200 it was at most 0.16)"
    )
    assert list(_unusual_notes(passed[:2])) == []


@pytest.mark.parametrize(
    ("sentence", "place"),
    [
        ("every second of the tiles of 32x32 are wrong (number 1 of each 2)", True),
        ("rows of pixels from 16 on are 0 (16 = 2^4: one block, table or grid of 16?)", True),
        ("the last row and column of pixels are NaN", True),
        ("columns of pixels from 3 on are all -1.5", True),
        ("errors in red alone", True),
        ("an output that nothing was written to: every element is 0", False),
        ("twice the right numbers, everywhere", False),
    ],
)
def test_places(sentence, place):
    assert is_place(sentence) == place


def test_few_mutants_sound_like_places():
    alike = [mutant.name for mutant in MUTANTS if is_place(mutant.sentence)]
    assert alike == ["gradient-partial-tiles"]


def test_a_ratio_of_zero_has_no_sign():
    assert _cell(-2.0, 0.0, good=False) == "0"
    assert _relation(np.float32(0.0), np.float32(-2.0)) == "× 0"
