"""Arrays as runs: what is stored stands for the same array, to the bit, and takes few bytes where something repeats."""

import json

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from toy_operations import case_of

from gsvc_base.errors import UsageError
from gsvc_conformance.coverage import SCHEMA
from gsvc_conformance.runs import LEAST, pack, unpack
from gsvc_conformance.vector import files_of, from_files

PERIOD = np.random.default_rng(5).normal(size=(251, 9)).astype(np.float32)


def broken():
    """A period of 251 rows with single elements that break it."""
    rows = np.resize(PERIOD, (70_001, 9))
    rows[[0, 31, 32, 1023, 65_536, 70_000], 3] = [1e30, -0.0, np.nan, 7, 8, 9]
    return rows


REPEATING = {
    "period": np.resize(PERIOD, (70_001, 9)),
    "broken": broken(),
    "constant": np.full((300, 400), 7, np.uint16),
    "zeros_in_the_period": np.resize(np.concatenate([np.zeros(40), np.arange(211)]), 66_000),
    "two_periods": np.concatenate([np.resize(np.arange(97.0), 40_000), np.resize(-np.arange(101.0), 40_000)]),
    "survivors": np.flatnonzero(np.resize(np.arange(251) % 10 > 0, 70_001)),
    "signed_zeros": np.resize(np.array([0.0, -0.0, 0.0], np.float32), LEAST),
}


@pytest.mark.parametrize("name", REPEATING)
def test_what_repeats_takes_few_bytes_and_comes_back(name):
    array = REPEATING[name]
    packed = pack(array)
    assert packed is not None
    assert packed.size < array.nbytes / 15
    assert packed.differences == (name == "survivors")
    back = unpack(packed.elements, {"file": "x.npy", "shape": list(array.shape), **packed.entry})
    assert back.dtype == array.dtype
    assert back.shape == array.shape
    assert back.tobytes() == array.tobytes()


@pytest.mark.parametrize(
    "array", [np.zeros(LEAST - 1), np.random.default_rng(1).normal(size=LEAST), np.zeros((0, 9)), np.zeros(())]
)
def test_small_and_random_arrays_stay_as_they_are(array):
    assert pack(array) is None


@pytest.mark.parametrize(
    "runs",
    [
        [[6, 0, 4, 0]], [[5, 0, 3, 0]], [[5, 2, 1, 0]], [[5, 0, 2, 2]], [[5, -1, 1, 0]], [[5, 0, 0, 0]], [[0, 0, 1, 0]],
        [], [[2**40, 0, 1, 0]],
    ],
)  # fmt: skip
def test_runs_that_do_not_fit_are_refused(runs):
    with pytest.raises(UsageError, match=r"the runs of x\.npy do not fit its 2 elements"):
        unpack(np.array([1.0, 2.0]), {"file": "x.npy", "shape": [5], "runs": runs})


def test_an_array_too_large_for_memory_is_refused():
    with pytest.raises(UsageError, match="do not fit"):
        unpack(np.array([1.0]), {"file": "x.npy", "shape": [2**40], "runs": [[2**40, 0, 1, 0]]})


def test_a_vector_with_runs_is_read_as_it_was_written(toys):
    case = case_of("core/scale/by_two")
    inputs = {"values": broken(), "factor": 2.0}
    files = files_of(case, inputs, case.operation.oracle(**inputs))
    assert sum(map(len, files.values())) < 100_000
    manifest = json.loads(files["manifest.json"])
    assert list(Draft202012Validator(json.loads(SCHEMA.read_text())).iter_errors(manifest)) == []
    assert "runs" in manifest["inputs"]["values"]
    vector = from_files(files)
    assert vector.inputs["values"].tobytes() == inputs["values"].tobytes()
    assert vector.expected["scaled"].value.shape == (70_001, 9)
