"""Attribution of an error to the mutants that remove most of it, one after the other."""

import numpy as np
import pytest

from gsvc_conformance.diagnosis import diagnose, is_place
from gsvc_conformance.diagnosis.attribution import attributed, together
from gsvc_conformance.diagnosis.failures import Failure
from gsvc_conformance.mutants import MUTANTS, answer
from gsvc_conformance.spec import namespace
from gsvc_conformance.vector import VECTORS
from gsvc_conformance.vector_folder import VectorFolder

FOLDER = VectorFolder(VECTORS)
SIZES = [name for name in FOLDER.names if name.startswith("core/render_sum/size_") and not name.endswith("1x1")]
BY_NAME = {mutant.name: mutant for mutant in MUTANTS}
RNG = np.random.default_rng(7)


def failures_of(change, names=SIZES):
    """The failures of an implementation whose sums are `change(vector)`."""
    return [Failure(vector, {"sum": change(vector).astype(np.float32)}) for vector in FOLDER.read(names)]


def drawn_by(*names, noise=0.0):
    """The sums of some mutants at once, with relative noise."""
    mutant = together([BY_NAME[name] for name in names])

    def change(vector):
        sums = answer(mutant, vector.operation, vector.inputs)["sum"].astype(np.float64)
        return sums * (1 + noise * RNG.standard_normal(sums.shape))

    return change


@pytest.mark.parametrize(
    "names",
    [
        ("pixel-centre-at-integer", "support-without-end"),
        ("pixel-centre-at-integer", "sum-clamped"),
        ("pixel-centre-at-integer", "support-without-end", "sum-clamped"),
    ],
)
def test_several_mutants_are_named_together(names):
    found = attributed(failures_of(drawn_by(*names)))
    assert set(found.sentence.split(", and ")) == {BY_NAME[name].sentence for name in names}
    assert found.sure
    assert found.ids == set(SIZES)


def test_noise_hides_no_mutant_and_its_share_is_told():
    """No element is given to the bit."""
    found = attributed(failures_of(drawn_by("pixel-centre-at-integer", noise=0.01)))
    assert found.sentence.startswith("pixel centres at integer positions (99")
    assert found.sentence.endswith(" % of the squared error)")


def test_what_removes_a_part_only_could_be_it():
    """Half of the error is that of a mutant; what is left is like none."""

    def change(vector):
        right = vector.expected["sum"].value
        error = drawn_by("pixel-centre-at-integer")(vector) - right
        size = np.sqrt(np.mean(error**2))
        return right + error + 0.7 * size * RNG.standard_normal(right.shape)

    (sentence,) = {sentences[0] for sentences in diagnose(failures_of(change)).values() if sentences}
    assert sentence.startswith("could be pixel centres at integer positions (")
    assert is_place(sentence)


def test_noise_alone_is_no_mutant():
    assert attributed(failures_of(lambda vector: RNG.standard_normal(vector.expected["sum"].value.shape))) is None


def test_few_numbers_name_nothing():
    (vector,) = FOLDER.read(["core/render_sum/size_1x1"])
    shifted = BY_NAME["pixel-centre-at-integer"]
    assert attributed([Failure(vector, answer(shifted, vector.operation, vector.inputs))]) is None


def test_a_mutant_that_spoils_another_output_explains_nothing():
    """The residual is stopped by the clamp, and the loss is right: no mutant that changes both."""
    names = [name for name in FOLDER.names if name.startswith("core/loss/")]
    failures = []
    for vector in FOLDER.read(names):
        right = namespace()["loss"](**vector.inputs)
        picture = vector.inputs["picture"]
        stopped = np.where((picture > 0) & (picture < 1), right["residual"], 0).astype(np.float32)
        if not np.array_equal(stopped, right["residual"]):
            failures.append(Failure(vector, {**right, "residual": stopped}))
    assert attributed(failures).sentence == BY_NAME["residual-stopped-by-clamp"].sentence
