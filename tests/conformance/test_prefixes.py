"""Outputs of another length than expected: how far they are right, and where they are wrong first."""

import numpy as np
import pytest
from planted.main_profile import as_far_as_it_goes

from gsvc_conformance.diagnosis import diagnose, is_place
from gsvc_conformance.diagnosis.coded import same_symbols
from gsvc_conformance.diagnosis.failures import Failure
from gsvc_conformance.diagnosis.prefixes import prefix_sentences
from gsvc_conformance.expectations import Bounded, Exact
from gsvc_conformance.mutants import MUTANTS
from gsvc_conformance.names import with_names
from gsvc_conformance.operation import operations
from gsvc_conformance.spec import namespace
from gsvc_conformance.vector import VECTORS
from gsvc_conformance.vector_folder import VectorFolder

STREAM = "core/read_main_stream/main_nothing_changes"
RULES = "core/reconstruct_stream/main_nothing_changes"
NUMBERS = np.arange(12, dtype=np.int64).reshape(6, 2)


def vector_of(name):
    (vector,) = VectorFolder(VECTORS).read([name])
    return vector


def cut(vector, symbols):
    """A wrong answer: all right, but the symbols."""
    return Failure(vector, {name: e.value for name, e in vector.expected.items()} | {"symbols": symbols})


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (NUMBERS[:4], "has shape (4, 2); it must be (6, 2); the first 4 are right"),
        (np.concatenate([NUMBERS, NUMBERS]), "has shape (12, 2); it must be (6, 2); the first 6 are right"),
        (NUMBERS[1:], "has shape (5, 2); it must be (6, 2); the first 5 are wrong: it is 2 at [0, 0], expected 0"),
        (NUMBERS[:0], "has shape (0, 2); it must be (6, 2)"),
        (NUMBERS[:, :1], "has shape (6, 1); it must be (6, 2)"),
    ],
)
def test_another_number_of_items(given, words):
    message = Exact(NUMBERS).judge(given).message
    assert message.startswith(words)
    assert ("first" in message) == ("first" in words)


def test_bounds_hold_for_the_items_that_both_have():
    expected = Bounded(np.arange(6.0), np.full(6, 0.5))
    assert "the first 4 are right" in expected.judge(np.arange(4, dtype=np.float32) + np.float32(0.25)).message
    assert "the first 4 are wrong: it is 1.0 at [0]" in expected.judge(np.arange(1, 5, dtype=np.float32)).message


def test_the_largest_error_and_a_tiny_bound_are_told():
    expected = Bounded(np.array([0.0, 1.0]), np.array([1e-38, 1e-3]))
    message = expected.judge(np.array([1e-22, 2.0], np.float32)).message
    assert "1e+16 times the bound 1e-38 (2 of 2 are wrong); the largest error is 1: 2.0 at [1], expected 1" in message
    said = with_names(operations()["to_half"], "bits", message, (2,))
    assert "at element 0" in said
    assert "at element 1" in said


def test_a_desync_is_told_as_a_place_with_frame_pass_and_lane():
    vector = vector_of(STREAM)
    right = vector.expected["symbols"].value
    symbols = right[:-3].copy()
    symbols[-4:, 0] ^= 5
    general, precise = diagnose([cut(vector, symbols)])[STREAM][:2]
    assert general.startswith(
        "first wrong: symbols of modes, by a table that is wrong; it depends on the model, the past"
    )
    number = len(symbols) - 4
    assert precise.startswith(f"first wrong: symbols {number} of {len(right)} (frame 2, pass 3, lane ")
    assert f"c(s)): {symbols[number, 0]}, expected {right[number, 0]}; header, " in precise
    assert is_place(general)
    assert is_place(precise)


def test_all_that_is_there_may_be_right():
    vector = vector_of(STREAM)
    right = vector.expected["symbols"].value
    general, precise = diagnose([cut(vector, right[:-3])])[STREAM]
    assert general == "right as far as it goes: a run ends inside of the symbols of modes"
    assert precise.startswith(
        f"right as far as it goes: {len(right) - 3} of {len(right)} items of symbols, up to frame 2, "
    )


def test_a_refusal_that_any_desync_gives_is_a_place():
    vector = vector_of(RULES)
    nothing = {name: e.value[:0] for name, e in vector.expected.items() if name != "error"}
    for error in ("malformed", "malformed R-7-1", "malformed R-7-1 1000"):
        place, *others = diagnose([Failure(vector, {**nothing, "error": error})])[RULES]
        assert place.startswith("a legal stream refused")
        assert all(map(is_place, others))


def test_symbols_behind_the_first_wrong_one_tell_mutants_apart():
    vector = vector_of("core/read_main_stream/main_past_of_splats")
    by_name = {mutant.name: mutant for mutant in MUTANTS}
    ours, other = by_name["past-exchanged"], by_name["new-splats-forgotten"]
    failure = cut(vector, as_far_as_it_goes(namespace(ours.patches))(vector.inputs["stream"])["symbols"])
    assert same_symbols(failure, ours)
    assert not same_symbols(failure, other)


def test_what_is_wrong_with_the_first_wrong_symbol():
    vector = vector_of("core/read_main_stream/main_models_adapt")
    right = vector.expected["symbols"].value
    rows = np.flatnonzero((right[:, 2] == 4) & (right[:, 3] == 0))

    def said(change):
        symbols = right[:-1].copy()
        symbols[rows[-1]] = change
        return prefix_sentences([cut(vector, symbols)])[vector.id][0]

    (*_, turn, lane) = right[rows[-1]]
    assert said((*right[rows[-1], :2], turn, lane + 1)) == "first wrong: lane of symbols of first components"
    assert "by a table that is wrong" in said((3, 3, turn, lane))
    others = [row for row in right[rows] if (row[:2] != right[rows[-1], :2]).any()]
    assert any("its table is right" in said(row) for row in others)
    assert any("by the table of another context" in said(row) for row in others)


def test_where_a_decoder_ends_whose_symbols_are_right():
    vector = vector_of("core/read_main_stream/main_lanes_64")
    right = vector.expected["symbols"].value

    def said(count, frames):
        whole = cut(vector, right[:count])
        whole.outputs["frame_types"] = whole.outputs["frame_types"][:frames]
        return prefix_sentences([whole])[vector.id][0]

    fall = int(np.flatnonzero(np.diff(right[:, 2].astype(np.int64)) < 0)[0]) + 1
    assert said(fall, 0).endswith("a run is refused behind its last symbol (words, final states or raw bits)")
    assert said(fall, 1).endswith("a frame is refused in front of its symbols")
    assert said(fall - 3, 0).endswith("a run ends inside of the symbols of size, aspect and shear")


def test_passes_of_components_are_told_from_those_of_new_splats():
    vector = vector_of("core/read_main_stream/main_quantizer_kept")
    right = vector.expected["symbols"].value
    starts = np.flatnonzero(np.diff(right[:, 2].astype(np.int64), prepend=99))
    passes = [start for start in starts if right[start, 2] == 4 and 3 in right[:start, 2][-40:]]
    told = set()
    for start in passes:
        symbols = right[:-1].copy()
        symbols[start, 3] += 1
        told.add(prefix_sentences([cut(vector, symbols)])[vector.id][0])
    assert "first wrong: lane of symbols of first components" in told
