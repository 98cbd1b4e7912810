"""Outputs of another length than expected: how far they are right, and where they are wrong first."""

import numpy as np
import pytest

from gsvc_conformance.diagnosis import diagnose, is_place
from gsvc_conformance.diagnosis.coded import same_symbols
from gsvc_conformance.diagnosis.failures import Failure
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


def so_far(patches, stream):
    """What a decoder has decoded of a stream before it finds a fault."""
    names, runs, frames = namespace(patches), [], []
    read_parts = names["read_parts"]
    names["read_parts"] = lambda run, parts: runs.append(run) or read_parts(run, parts)
    s, state = names["open_stream"](stream)
    try:
        frames.extend(names["read_frames"](s, state))
    except names["Fault"]:
        pass
    symbols = [symbol for run in runs for symbol in run.decoded]
    return np.array(symbols, np.uint16).reshape(-1, 4)


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
    assert general == "first wrong: symbols of modes"
    number = len(symbols) - 4
    assert precise.startswith(f"first wrong: symbols {number} of {len(right)} (frame 2, pass 3, lane ")
    assert f"c(s)): {symbols[number, 0]}, expected {right[number, 0]}; header, " in precise
    assert is_place(general)
    assert is_place(precise)


def test_all_that_is_there_may_be_right():
    vector = vector_of(STREAM)
    right = vector.expected["symbols"].value
    (sentence,) = diagnose([cut(vector, right[:-3])])[STREAM]
    assert sentence == f"right as far as it goes: {len(right) - 3} of {len(right)} items of symbols"


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
    failure = cut(vector, so_far(ours.patches, vector.inputs["stream"]))
    assert same_symbols(failure, ours)
    assert not same_symbols(failure, other)
