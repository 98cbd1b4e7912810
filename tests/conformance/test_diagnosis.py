"""Causes of failures: layouts first, then bugs, then two bugs at once."""

import numpy as np
import pytest

from conformance.diagnosis import _both, diagnose
from conformance.mutants import all_mutants, answer
from conformance.selection import VectorFolder
from conformance.vectors import VECTORS

FOLDER = VectorFolder(VECTORS)
MIDDLE = "core/render_sum/a_splat_in_the_middle"
CORNERS = "core/render_sum/corners_of_tiles"


def vector_of(name):
    (vector,) = FOLDER.read([name])
    return vector


def mutant(name):
    return next(mutant for mutant in all_mutants() if mutant.name == name)


def test_a_layout_comes_before_the_bugs():
    vector = vector_of(CORNERS)
    mirrored = vector.expected["sum"].value.astype(np.float32)[::-1]
    assert diagnose([(vector, {"sum": mirrored})]) == {CORNERS: ["the y axis upwards"]}


def test_one_empty_picture_among_others_may_be_a_bug():
    names = ["core/render_sum/a_determinant_that_cancels", MIDDLE, CORNERS]
    dropping = mutant("small-splats-dropped")
    failures = [(v, answer(dropping, v.stage, v.inputs)) for v in FOLDER.read(names[:1])]
    shifted = mutant("pixel-centre-at-integer")
    failures += [(v, answer(shifted, v.stage, v.inputs)) for v in FOLDER.read(names[1:])]
    assert not failures[0][1]["sum"].any()
    told = diagnose(failures)
    assert dropping.sentence in told[names[0]]
    assert shifted.sentence in told[CORNERS]


@pytest.mark.parametrize("pair", [("pixel-centre-at-integer", "support-without-end"), ("l21-sign", "sigma-not-halved")])
def test_two_bugs_at_once(pair):
    both = _both(*map(mutant, pair))
    vector = vector_of(CORNERS)
    (sentences,) = diagnose([(vector, answer(both, vector.stage, vector.inputs))]).values()
    assert set(sentences[0].split(", and ")) == {mutant(name).sentence for name in pair}


def test_few_wrong_elements_are_no_pair():
    vector = vector_of(CORNERS)
    right = vector.expected["sum"].value.astype(np.float32)
    both = _both(mutant("pixel-centre-at-integer"), mutant("support-without-end"))
    theirs = answer(both, vector.stage, vector.inputs)["sum"]
    place = np.unravel_index(abs(theirs - right).argmax(), right.shape)
    right[place] = theirs[place]
    told = diagnose([(vector, {"sum": right})])[CORNERS]
    assert not any(", and " in sentence for sentence in told)


def test_a_picture_that_may_be_empty_for_another_reason():
    vector, writes = FOLDER.read(["core/render_sum/a_determinant_that_cancels", CORNERS])
    empty = [(vector, {"sum": np.zeros(vector.expected["sum"].value.shape, np.float32)})]
    assert "nothing was written to" in diagnose(empty)[vector.id][0]
    assert not any("nothing was written to" in sentence for sentence in diagnose(empty, [writes])[vector.id])


def test_few_bits():
    vector = vector_of(CORNERS)
    right = vector.expected["sum"].value
    waves = np.sin(np.arange(right.size)).reshape(right.shape)
    (sentence,) = diagnose([(vector, {"sum": (right + 1e-4 * waves).astype(np.float32)})])[CORNERS]
    assert "few bits" in sentence
    coarse = {"sum": (right + 0.02 * waves).astype(np.float32)}
    assert diagnose([(vector, coarse)])[CORNERS] == []


def test_not_a_number():
    vector = vector_of(CORNERS)
    broken = vector.expected["sum"].value.astype(np.float32)
    broken[3, 4] = np.nan
    (sentence,) = diagnose([(vector, {"sum": broken})])[CORNERS]
    assert "infinity" in sentence
