"""Causes of failures: layouts first, then mutants, then two mutants at once."""

import numpy as np
import pytest

from gsvc_conformance.diagnosis import catalogue, diagnose, hedged
from gsvc_conformance.diagnosis.catalogue import both as _both
from gsvc_conformance.diagnosis.places import common_condition
from gsvc_conformance.mutants import MUTANTS, answer, called, kills
from gsvc_conformance.vector import VECTORS
from gsvc_conformance.vector_folder import VectorFolder

FOLDER = VectorFolder(VECTORS)
MIDDLE = "core/render_sum/a_splat_in_the_middle"
CORNERS = "core/render_sum/corners_of_tiles"


def vector_of(name):
    (vector,) = FOLDER.read([name])
    return vector


def mutant_called(name):
    return next(mutant for mutant in MUTANTS if mutant.name == name)


def test_a_layout_comes_before_the_mutants():
    vector = vector_of(CORNERS)
    mirrored = vector.expected["sum"].value.astype(np.float32)[::-1]
    assert diagnose([(vector, {"sum": mirrored})]) == {CORNERS: ["the y axis upwards"]}


def test_one_empty_picture_among_others_may_be_a_mutant():
    names = ["core/render_sum/a_determinant_that_cancels", MIDDLE, CORNERS]
    dropping = mutant_called("determinant-by-cancellation")
    failures = [(v, answer(dropping, v.operation, v.inputs)) for v in FOLDER.read(names[:1])]
    shifted = mutant_called("pixel-centre-at-integer")
    failures += [(v, answer(shifted, v.operation, v.inputs)) for v in FOLDER.read(names[1:])]
    assert not failures[0][1]["sum"].any()
    told = diagnose(failures)
    assert not any("nothing was written to" in sentence for sentence in told[names[0]])
    assert shifted.sentence in told[CORNERS]


def test_what_explains_more_is_preferred_to_what_explains_a_pixel():
    shifted = mutant_called("pixel-centre-at-integer")
    names = ["core/render_sum/a_determinant_that_cancels", CORNERS]
    failures = [(v, answer(shifted, v.operation, v.inputs)) for v in FOLDER.read(names)]
    alone = diagnose(failures[:1], [vector_of(MIDDLE)])[names[0]]
    assert shifted.sentence not in alone
    assert diagnose(failures)[names[0]] == [shifted.sentence]


@pytest.mark.parametrize("pair", [("pixel-centre-at-integer", "support-without-end"), ("l21-sign", "sigma-not-halved")])
def test_two_mutants_at_once(pair):
    both = _both(*map(mutant_called, pair))
    vector = vector_of(CORNERS)
    (sentences,) = diagnose([(vector, answer(both, vector.operation, vector.inputs))]).values()
    assert set(sentences[0].split(", and ")) == {mutant_called(name).sentence for name in pair}


def test_few_wrong_elements_are_no_pair():
    vector = vector_of(CORNERS)
    right = vector.expected["sum"].value.astype(np.float32)
    both = _both(mutant_called("pixel-centre-at-integer"), mutant_called("support-without-end"))
    theirs = answer(both, vector.operation, vector.inputs)["sum"]
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
    waves = np.random.default_rng(3).uniform(-1, 1, right.shape)
    (sentence,) = diagnose([(vector, {"sum": (right * (1 + 1e-3 * waves)).astype(np.float32)})])[CORNERS]
    assert "few bits: about 10 bits" in sentence
    coarse = {"sum": (right * (1 + 0.1 * waves)).astype(np.float32)}
    absolute = {"sum": (right + 1e-4 * waves * (right != 0)).astype(np.float32)}
    one_sided = {"sum": (right * (1 + 1e-3 * abs(waves))).astype(np.float32)}
    for other in (coarse, absolute, one_sided):
        assert not any("few bits" in sentence for sentence in diagnose([(vector, other)])[CORNERS])


def test_not_a_number():
    vector = vector_of(CORNERS)
    broken = vector.expected["sum"].value.astype(np.float32)
    broken[3, 4] = np.nan
    (sentence,) = diagnose([(vector, {"sum": broken})])[CORNERS]
    assert "infinity" in sentence


def failures_of(mutant, operation):
    """The failures of an implementation with this mutant, and the vectors of the operation that it passes."""
    failures, passed = [], []
    for vector in FOLDER.read([name for name in FOLDER.names if name.split("/")[1] == operation]):
        if called(vector.operation, vector.inputs) & mutant.touched() and kills(vector, mutant):
            failures.append((vector, answer(mutant, vector.operation, vector.inputs)))
        else:
            passed.append(vector)
    return failures, passed


@pytest.mark.exhaustive
def test_refusals_that_many_mutants_share_name_none_of_them_alone():
    mutant = mutant_called("crc-not-inverted")
    failures, passed = failures_of(mutant, "reconstruct_stream")
    told = diagnose(failures[:3], passed)
    assert len(told) == 3
    for (sentence,) in told.values():
        assert sentence.startswith(catalogue.ALIKE)
        assert mutant.sentence in sentence


@pytest.mark.exhaustive
def test_refusals_at_another_bit_are_another_mutant():
    failures, passed = failures_of(mutant_called("words-backwards"), "reconstruct_stream")
    mutant = mutant_called("words-backwards").sentence
    told = diagnose(failures, passed)
    assert all(any(mutant in sentence for sentence in sentences) for sentences in told.values())
    vector, outputs = next(failure for failure in failures if failure[0].id.endswith("rich_stream"))
    without_bit = {**outputs, "error": "malformed R-7-1"}
    place, *_, sentence = diagnose([(vector, without_bit)])[vector.id]
    assert place == "a legal stream refused by R-7-1"
    assert sentence.startswith(catalogue.ALIKE)


def test_a_number_that_is_near_that_of_a_mutant_is_not_its_answer(monkeypatch):
    """A work of 2^29 in place of 9 2^29 is nearer to the 0 of "the sign of l21" than to the right one."""
    mutant = mutant_called("work-in-32-bits")
    failures, passed = failures_of(mutant, "rendering_work")
    failures = [failure for failure in failures if "capacity" not in failure[0].manifest["flags"]]
    (told,) = diagnose(failures, passed).values()
    assert told == [mutant.sentence]
    without = tuple(other for other in MUTANTS if other != mutant)
    monkeypatch.setattr(catalogue, "MUTANTS", without)
    (told,) = diagnose(failures, passed).values()
    assert not any("sign" in sentence for sentence in told)


def test_errors_in_place_of_outputs_are_named_by_the_vectors_that_end_so():
    mutant = mutant_called("renormalised-at-2-16-too")
    failures, passed = failures_of(mutant, "decode_plane")
    errors = [vector for vector, outputs in failures if outputs is None]
    told = diagnose([failure for failure in failures if failure[1] is not None], passed, errors)
    assert len(errors) > 20
    assert all(told[vector.id] == [mutant.sentence] for vector in errors)


def test_nothing_but_errors_names_the_smallest_vector():
    vectors = [vector_of(f"core/parameter_checksum/checksum_{name}") for name in ("many", "one")]
    told = diagnose([], [], vectors)
    assert told.keys() == {vector.id for vector in vectors}
    for sentences in told.values():
        assert sentences == [
            "every answer is an error, that to the smallest vector too, which is core/parameter_checksum/checksum_one"
        ]


def test_a_checksum_agrees_with_no_mutant_by_chance():
    mutant = mutant_called("checksum-by-splat")
    failures, passed = failures_of(mutant, "parameter_checksum")
    told = diagnose(failures, passed)
    assert told["core/parameter_checksum/checksum_many"] == [mutant.sentence]


def test_two_conditions_together_tell_which_vectors_fail():
    vectors = list(FOLDER.read([name for name in FOLDER.names if name.startswith("core/decode_plane/")]))
    lanes = [v for v in vectors if v.inputs["lane_count"] > 1 and v.inputs["count"] > 1]
    others = [vector for vector in vectors if vector not in lanes]
    assert common_condition(lanes, others) == "only vectors with count above 1 and with lane_count above 1 fail"
    assert common_condition(lanes, [*others, lanes[0]]) == ""


def test_every_error_of_one_kind():
    names = [name for name in FOLDER.names if name.startswith("faulty/reconstruct_stream/")]
    vectors = FOLDER.read(names[::8])
    wrong, right = [], []
    for vector in vectors:
        kind = vector.expected["error"].value.split()[0]
        given = {name: getattr(e, "value", None) for name, e in vector.expected.items()} | {"error": "invalid"}
        (right if kind == "invalid" else wrong).append((vector, given))
    told = diagnose(wrong, [vector for vector, _ in right])
    assert {tuple(sentences) for sentences in told.values()} == {
        ("every error reported as of the kind invalid, whatever it is",)
    }
    unseen = [(vector, given | {"error": ""}) for vector, given in wrong[:1]]
    told = diagnose([*unseen, *wrong[1:]], [vector for vector, _ in right])
    assert not any("every error" in sentence for sentences in told.values() for sentence in sentences)


def test_no_two_mutants_are_the_same():
    """The report could not tell them apart, and would have to name both."""
    assert len({frozenset(mutant.patches) for mutant in MUTANTS}) == len(MUTANTS)


def test_the_numbers_of_an_input_tell_where_an_output_is_wrong():
    vector = vector_of("core/codes_of_classes/every_class")
    codes = vector.expected["codes"].value + 3 * (vector.inputs["classes"] == 4)
    assert diagnose([(vector, {"codes": codes})])[vector.id][0] == "errors only where classes is 4"


def test_a_mutant_that_would_fail_what_passed_is_hedged():
    mutant = mutant_called("sheared-by-a-alone")
    names = [name for name in FOLDER.names if name.startswith("core/main_inter/")]
    vector = next(vector for vector in FOLDER.read(names) if mutant.name in vector.manifest["kills"])
    assert hedged(mutant.sentence, [vector]) == f"could be {mutant.sentence}"
    assert hedged(mutant.sentence, []) == mutant.sentence
    assert hedged("errors in S alone", [vector]) == "errors in S alone"


def test_one_integer_beside_another_wrong_output_is_no_account():
    mutant = mutant_called("window-below-512")
    vectors = FOLDER.read([name for name in FOLDER.names if "/window_frequencies/" in name])
    failures = [(v, answer(mutant, v.operation, v.inputs)) for v in vectors if kills(v, mutant)]
    assert len(failures) > 1
    assert all(told == [mutant.sentence] for told in diagnose(failures).values())
