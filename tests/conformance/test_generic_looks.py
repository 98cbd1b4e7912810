"""Looks that know no mutant: places, factors, terms of sums, what was left behind; also on outputs of 70,000 rows."""

import time

import numpy as np
import pytest

from gsvc_conformance.diagnosis import diagnose
from gsvc_conformance.diagnosis.curves import curve_candidates
from gsvc_conformance.diagnosis.cutoffs import cutoff_candidates
from gsvc_conformance.diagnosis.failures import Failure, parts
from gsvc_conformance.diagnosis.ratios import factor_name
from gsvc_conformance.diagnosis.regions import region_candidates, size_hint
from gsvc_conformance.diagnosis.terms import pixel_gradients
from gsvc_conformance.expectations import Bounded
from gsvc_conformance.names import element, with_names
from gsvc_conformance.operation import operations
from gsvc_conformance.spec import complexity, namespace
from gsvc_conformance.vector import VECTORS, Vector
from gsvc_conformance.vector_folder import VectorFolder

FOLDER = VectorFolder(VECTORS)
CORNERS = "core/render_sum/corners_of_tiles"
ROWS = 70_000
RNG = np.random.default_rng(5)


def vector_of(name):
    (vector,) = FOLDER.read([name])
    return vector


def large(operation="weighted_parameters", rows=ROWS):
    """A vector of many rows, as the flag `capacity` marks them."""
    values = RNG.uniform(0.5, 2, (rows, 9)).astype(np.float32)
    right = namespace()["weighted_parameters"](values)["parameters"].astype(np.float64)
    expected = {"parameters": Bounded(right, abs(right) * 2.0**-22)}
    manifest = {"id": f"stress/{operation}/large", "title": "Large.", "flags": ["capacity"]}
    return Vector(f"stress/{operation}/large", manifest, operations()[operation], {"values": values}, expected)


@pytest.mark.parametrize(
    "capacity", [32, 96, 65_536, *(pytest.param(more, marks=pytest.mark.exhaustive) for more in (64, 1024, 40_000))]
)
def test_rows_from_a_capacity_on(capacity):
    vector = large()
    mine = vector.expected["parameters"].value.astype(np.float32)
    mine[capacity:] = 0
    start = time.perf_counter()
    (sentence,) = diagnose([(vector, {"parameters": mine})])[vector.id]
    assert time.perf_counter() - start < 20
    assert sentence.startswith(f"splats from {capacity} on are 0")
    assert ("one block" in sentence) == (capacity & (capacity - 1) == 0)


@pytest.mark.parametrize(
    ("lost", "words"),
    [
        (np.s_[-1:], "the last of the splats are 0"),
        (np.s_[ROWS // 128 * 128 :], "the last partial block of 128 of the splats are 0"),
        (np.s_[31::32], "every 32th of the splats are 0 (number 31 of each 32)"),
        (np.s_[:1], "the first of the splats are 0"),
    ],
)
def test_parts_of_many_rows(lost, words):
    vector = large()
    mine = vector.expected["parameters"].value.astype(np.float32)
    mine[lost] = 0
    (part,) = parts(Failure(vector, {"parameters": mine}))
    assert words in [candidate.sentence for candidate in region_candidates(part)]


def test_what_the_vector_before_left():
    vector = vector_of(CORNERS)
    right = vector.expected["sum"].value.astype(np.float32)
    old = RNG.uniform(0.1, 1, right.size).astype(np.float32)
    added = right + old.reshape(right.shape)
    (sentence,) = diagnose([Failure(vector, {"sum": added}, {"sum": old})])[CORNERS]
    assert "a buffer that is not cleared" in sentence
    kept = right.copy()
    kept[-3:] = old.reshape(right.shape)[-3:]
    (sentence,) = diagnose([Failure(vector, {"sum": kept}, {"sum": old})])[CORNERS]
    assert "elements that are not written" in sentence
    assert not any("before" in sentence for sentence in diagnose([(vector, {"sum": added})])[CORNERS])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda p: p[:-1], "the last of the splats left out"),
        (lambda p: p[::2], "only every second of the splats taken"),
        (lambda p: np.concatenate([p, p[3:4]]), "splats 3 taken twice"),
        (lambda p: np.delete(p, [2, 5], axis=0), "splats 2, 5 left out"),
    ],
)
def test_splats_that_are_missing_or_drawn_twice(change, words):
    parameters = RNG.uniform(4, 28, (11, 8)).astype(np.float32)
    parameters[:, 2:5] = RNG.uniform(1, 3, (11, 3))
    draw, oracle = namespace()["render_sum"], operations()["render_sum"].oracle
    inputs = {"parameters": parameters, "width": 37, "height": 29}
    vector = Vector("core/render_sum/some", {}, operations()["render_sum"], inputs, oracle(**inputs))
    outputs = draw(change(parameters), 37, 29)
    told_of = diagnose([(vector, outputs)])[vector.id]
    assert words in told_of[0]


def test_gradients_of_pixels_add_up_to_those_of_spec_md():
    vector = vector_of("core/render_gradients/size_17x33")
    residual = vector.inputs["residual"].astype(np.float64)
    for splat, right in zip(vector.inputs["parameters"], vector.expected["gradients"].value, strict=True):
        assert np.allclose(pixel_gradients(splat.astype(np.float64), residual).sum(axis=0), right, rtol=1e-5, atol=1e-6)


def test_factors_have_names():
    sizes = {"H W": 1645.0, "W/2": 17.5}
    assert factor_name(-1.0, sizes) == "numbers with the other sign"
    assert factor_name(1 / 1645, sizes) == "1/(H W) times the right numbers"
    assert factor_name(-17.5, sizes) == "-W/2 times the right numbers"
    assert factor_name(0.777, sizes) == "numbers times 0.777"


def test_sizes_have_hints():
    assert "2^6" in size_hint(64)
    assert "3 x 32" in size_hint(96)
    assert size_hint(61) == ""


@pytest.mark.parametrize(
    ("operation", "output", "place", "shape", "name"),
    [
        ("render_gradients", "gradients", (2, 3), (9, 8), "splat 2, l21"),
        ("weighted_gradients", "gradients", (2, 8), (9, 9), "splat 2, w"),
        ("read_stream", "header", (6,), (22,), "frame_rate_denominator"),
        ("read_stream", "quantizers", (0, 1, 1), (1, 3, 2), "quantiser 0, l21, offset"),
        ("render_sum", "sum", (5, 3, 1), (9, 9, 3), "pixel (x 3, y 5), green"),
        ("decode_stream", "frames", (4, 5, 3, 2), (9, 9, 9, 3), "frame 4, pixel (x 3, y 5), blue"),
        ("frame_to_planes", "cb", (1, 2), (3, 4), "pixel (x 2, y 1)"),
        ("lsq_quantize", "codes", (7, 0), (9, 3), "splat 7, l11"),
        ("lsq_quantize", "codes", (7, 0), (9, 2), "splat 7, column 0"),
        ("rvq_assign", "indices", (7, 1), (9, 2), "splat 7, stage 1"),
        ("rvq_update", "sums", (7, 1), (9, 3), "codeword 7, green"),
        ("metrics", "mse", (), (), "mse"),
        ("to_half", "bits", (4,), (9,), "element 4"),
    ],
)
def test_elements_have_names(operation, output, place, shape, name):
    assert element(operations()[operation], output, place, shape) == name


def test_sentences_have_names_in_place_of_indices():
    operation = operations()["render_gradients"]
    said = with_names(operation, "gradients", "is 1 at [2, 3], expected 2", (9, 8))
    assert said == "is 1 at splat 2, l21, expected 2"
    assert with_names(operation, "gradients", "the relative L2 error of columns 2..4 is", (9, 8)).endswith(
        "l11, l21, l22 is"
    )


def test_leaf_operations_are_the_simplest():
    order = ["to_frame", "render_frame", "decode_stream"]
    assert sorted(order, key=complexity) == order
    assert complexity("decode_plane") < complexity("read_stream")
    assert complexity("no_operation") == 0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda s: s.astype(np.float16), "binary16"),
        (lambda s: np.rint(np.clip(s, 0, 1) * 255) / 255, "steps of 1/255"),
        (lambda s: np.maximum(s, 0) ** (1 / 2.2), "a gamma of 1/2.2"),
        (np.square, "squares of the right numbers"),
    ],
)
def test_numbers_that_are_a_function_of_the_right_ones(change, words):
    failure = failure_of(CORNERS, change)
    (part,) = parts(failure)
    (candidate,) = curve_candidates(part)
    assert words in candidate.sentence


def test_right_numbers_of_few_bits_are_no_format():
    """Weights of 1/2 and 1 are such as binary16 has: it is no account of them."""
    (part,) = parts(failure_of(CORNERS, lambda s: np.rint(s * 4) / 4))
    assert not any("fit" in candidate.sentence for candidate in curve_candidates(part))


def failure_of(name, change):
    vector = vector_of(name)
    mine = np.asarray(change(vector.expected["sum"].value.astype(np.float64)), np.float32)
    return Failure(vector, {"sum": mine})


@pytest.mark.parametrize("operation", ["render_sum", "render_gradients"])
def test_a_support_that_ends_elsewhere(operation):
    """Patched spec.md is another arithmetic than the look's."""
    old = "sigma <= LN_255, np.exp" if operation == "render_sum" else "covered = sigma <= LN_255"
    function = namespace([(old, old.replace("LN_255", "4.0"))])[operation]
    told = []
    for vector in FOLDER.read([name for name in FOLDER.names if name.startswith(f"core/{operation}/")][:12]):
        failure = Failure(vector, function(**vector.inputs))
        told += [c.sentence for part in parts(failure) if part.wrong.any() for c in cutoff_candidates(failure, part)]
    assert set(told) == {"a support that ends at sigma 4"}
