"""The golden vectors: they are what the cases make, nothing is uncovered, and they find what is wrong."""

import re

import numpy as np
import pytest

from gsvc_conformance import spec
from gsvc_conformance.case import cases
from gsvc_conformance.coverage import _requirements, verify
from gsvc_conformance.diagnosis import EXAMINED, diagnose
from gsvc_conformance.expectations import Bounded, Refusal
from gsvc_conformance.generate import differences, make, vector_files
from gsvc_conformance.implementations import Unsupported, from_namespace
from gsvc_conformance.mutants import MUTANTS, Mutant, answer, killed_by, mutant
from gsvc_conformance.pairs import PAIRS, Free
from gsvc_conformance.reference import namespace as reference
from gsvc_conformance.runner import run_suite
from gsvc_conformance.vector import VECTORS
from gsvc_conformance.vector_folder import VectorFolder
from gsvc_conformance.verdicts import Report


@pytest.fixture(scope="module")
def vectors():
    """Those of the newest set, and new ones that no set lists yet; withdrawn ones belong to older sets alone."""
    folder = VectorFolder(VECTORS)
    return list(folder.read(folder.names))


def failures(implementation, vectors):
    results = run_suite(implementation, vectors)
    assert len(results) == len(vectors)
    return [f"{result.id}: {result.message}" for result in results if result.outcome != "pass"]


def verdicts(implementation, vectors):
    report = Report({}, "", "", (), run_suite(implementation, vectors))
    assert not report.passed
    return {group.name: group.verdict for group in report.groups()}


def test_some_cases_make_these_vectors():
    """Every twentieth, of those that are small."""
    small = [name for name in cases() if (VECTORS / name).is_dir() and size(VECTORS / name) < 20_000]
    for name in small[::20]:
        made = vector_files(name, kills_in=VECTORS)[1]
        assert made == {part: (VECTORS / name / part).read_bytes() for part in made}


def size(folder):
    return sum(path.stat().st_size for path in folder.iterdir())


@pytest.mark.exhaustive
def test_the_cases_make_these_vectors():
    """To the byte; which mutants each finds is as it is stored (`python -m tests.machines` runs all mutants again)."""
    assert differences(made=make(kills_in=VECTORS)) == []


@pytest.mark.exhaustive
def test_nothing_is_uncovered():
    assert verify() == []


@pytest.mark.parametrize("operation", ["render_sum", "render_frame", "render_gradients"])
def test_a_third_of_the_core_has_colours_of_0_to_1(vectors, operation):
    """What code that clamps colours, or makes them by a sigmoid, can be asked."""
    colours = [v.inputs["parameters"][:, 5:] for v in vectors if v.operation.name == operation and v.tier == "core"]
    assert 3 * sum(((of >= 0) & (of <= 1)).all() for of in colours) >= len(colours)


def test_half_of_the_steps_have_rows_of_one_age(vectors):
    """What an optimiser with one count of steps can be asked."""
    steps = [v.inputs["steps"] for v in vectors if v.operation.name == "adan_step"]
    assert 2 * sum(len(set(of.tolist())) <= 1 for of in steps) >= len(steps)


def test_obeying_and_breaking_a_requirement_are_counted_apart_and_by_profile():
    def manifest(name, profile, error, *rules):
        outputs = {"error": {"check": "refusal", "value": error}}
        return {"id": name, "profile": profile, "rules": rules, "outputs": outputs}

    there = [
        manifest("core/reconstruct_stream/a", "main", "", "R-5-1", "R-5-2"),
        manifest("faulty/reconstruct_stream/b", "main", "limit R-5-1 9", "R-5-1", "R-5-2", "R-12-1"),
        manifest("faulty/reconstruct_stream/c", "paper", "limit R-5-2 9", "R-5-2", "R-12-1"),
    ]
    head, _, *rows = [
        line.split(" | ")[:-1] for line in _requirements(["R-5-1", "R-5-2", "R-12-1"], there).splitlines()
    ]
    assert head == ["| requirement", "obeyed", "broken: paper", "broken: main", "broken: any"]
    assert rows == [
        ["| R-5-1", "1", "", "1", ""],
        ["| R-5-2", "1", "1", "", ""],
        ["| R-12-1", "2", "", "", ""],
    ]


def test_documents_name_vectors_that_exist():
    named = re.findall(r"`((?:core|uncommon|stress|faulty)/\w+/\w+)`", spec.SPEC.read_text(encoding="utf-8"))
    assert named
    assert [name for name in named if not (VECTORS / name / "manifest.json").exists()] == []


def test_gsvc_ref_passes(vectors):
    assert failures(from_namespace("gsvc_ref", reference()), vectors) == []


@pytest.mark.exhaustive
def test_the_code_of_the_spec_passes(vectors):
    coded = [vector for vector in vectors if not isinstance(PAIRS[vector.operation.name], Free)]
    assert failures(from_namespace("spec.md", spec.namespace()), coded) == []


class Careless:
    """Answers every operation with zeros of the right form, and accepts every stream."""

    name, in_full = "careless", False

    def __init__(self, expected):
        self.expected = expected

    def run(self, operation, inputs, turn=0, name=""):
        return {name: zeros(expectation) for name, expectation in next(self.expected).items()}


def zeros(expectation):
    if isinstance(expectation, Refusal):
        return ""
    return np.zeros_like(expectation.value, expectation.dtype if isinstance(expectation, Bounded) else None)


class Refusing:
    """Supports nothing, or refuses every stream."""

    name, in_full = "refusing", False

    def run(self, operation, inputs, turn=0, name=""):
        if operation.name == "reconstruct_stream":
            return {"counts": np.zeros(0, np.int64), "parameters": np.zeros((0, 8), np.float32), "error": "malformed"}
        return Unsupported("nothing is")


@pytest.mark.exhaustive
def test_zeros_pass_in_no_class(vectors):
    careless = Careless(iter([vector.expected for vector in vectors]))
    assert set(verdicts(careless, vectors).values()) == {"failed"}


def test_who_refuses_everything_passes_in_no_class(vectors):
    found = verdicts(Refusing(), vectors)
    assert found.pop("bitstream") == "failed"
    assert set(found.values()) == {"not claimed"}


@pytest.mark.parametrize(
    ("name", "vector"),
    [
        ("pixel-centre-at-integer", "core/render_sum/corners_of_tiles"),
        ("adan-epsilon-inside-root", None),
        ("survivors-misaligned", None),
        ("strict-horner", None),
        ("bt601-for-bt709", None),
        ("r-6.2-2-unchecked", None),
    ],
)
def test_a_mutant_is_recognised(vectors, name, vector):
    mutant = next(mutant for mutant in MUTANTS if mutant.name == name)
    found = [v for v in vectors if name in v.manifest["kills"] and vector in (None, v.id)]
    operation = found[0].operation.name
    answers = [(v, answer(mutant, v.operation, v.inputs)) for v in found if v.operation.name == operation]
    failures = [(v, outputs) for v, outputs in answers if outputs is not None]
    passed = [v for v in vectors if v.operation.name == operation and name not in v.manifest["kills"]]
    told = diagnose(failures, passed)
    named = [any(mutant.sentence in sentence for sentence in sentences) for sentences in told.values()]
    assert named == [True] * min(len(failures), EXAMINED)


def test_an_unknown_mutant_is_not_given_a_name(vectors):
    vector = next(v for v in vectors if v.id == "core/render_sum/corners_of_tiles")
    rng = np.random.default_rng(1)
    noise = rng.normal(0, 1, vector.expected["sum"].value.shape).astype(np.float32)
    assert diagnose([(vector, {"sum": noise})]) == {vector.id: []}


def test_a_patch_that_changes_nothing_is_found_by_no_vector(vectors):
    same_code = mutant("test", "none", "nothing", ("LOWEST_STATE = 2**16", "LOWEST_STATE = 1 << 16"))
    assert same_code.touched() == frozenset()
    assert killed_by(vectors[:3], [same_code]) == {vector.id: [] for vector in vectors[:3]}


def test_a_patch_that_does_not_fit_is_an_error():
    with pytest.raises(LookupError, match="occurs 0 times"):
        Mutant("lost", "test", "nothing", (("this text is not in spec.md", ""),)).namespace()


def test_names_of_mutants_are_unique():
    names = [mutant.name for mutant in MUTANTS]
    assert len(names) == len(set(names))
