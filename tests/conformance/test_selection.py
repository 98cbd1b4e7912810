"""Which vectors are run, and that they are what SHA256SUMS and the schema say."""

import json
import os

import numpy as np
import pytest
import toy_stages
from toy_stages import INPUTS

from conformance.expectations import Exact
from conformance.selection import Selection, VectorFolder, check_manifest
from conformance.vectors import SUMS, files_of, from_files
from gsvc_ref.errors import UsageError


def test_missing_or_empty_vectors_are_refused(toys, tmp_path):
    with pytest.raises(UsageError, match="there are no vectors"):
        VectorFolder(tmp_path)
    (tmp_path / SUMS).write_text("")
    with pytest.raises(UsageError, match="lists no vectors"):
        VectorFolder(tmp_path).select(Selection())


def test_selections(folder):
    vectors = VectorFolder(folder)
    assert len(vectors.select(Selection())) == len(INPUTS)
    assert len(vectors.select(Selection(levels=("uncommon",)))) == 2
    assert vectors.select(Selection(groups=("training",), levels=("stress",))) == ["stress/scale/nothing"]
    assert vectors.select(Selection(patterns=("by_*",))) == ["core/scale/by_a_third", "core/scale/by_two"]
    assert vectors.select(Selection(patterns=("*/halve/*",))) == ["core/halve/one_to_six"]
    with pytest.raises(UsageError, match="case nothing_like_it"):
        vectors.select(Selection(patterns=("nothing_like_it",)))


def test_a_vector_that_was_changed_or_lost_is_refused(folder):
    vectors = VectorFolder(folder)
    part = folder / "core/scale/by_two/values.npy"
    data = part.read_bytes()
    part.write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
    with pytest.raises(UsageError, match=r"values\.npy is not the file"):
        list(vectors.read(["core/scale/by_two"]))
    os.unlink(part)
    with pytest.raises(UsageError, match=r"values\.npy is missing"):
        list(vectors.read(["core/scale/by_two"]))


def test_a_vector_of_an_unknown_stage_is_refused(folder):
    sums = folder / SUMS
    sums.write_text(sums.read_text() + f"{'0' * 64}  core/teleport/far/manifest.json\n")
    with pytest.raises(UsageError, match="core/teleport/far"):
        VectorFolder(folder)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (lambda m: m | {"tolerance": 3}, "the field tolerance"),
        (lambda m: m["inputs"]["factor"].update(unit="px"), "the field unit of factor"),
        (lambda m: m["outputs"]["scaled"].update(slack=2), "the field slack of scaled"),
        (lambda m: m["outputs"]["scaled"].update(check="fuzzy"), "check fuzzy"),
    ],
)
def test_unknown_manifest_fields_are_refused(folder, change, named):
    manifest = json.loads((folder / "core/scale/by_two/manifest.json").read_text())
    check_manifest(manifest["id"], manifest)
    with pytest.raises(UsageError, match=named):
        check_manifest(manifest["id"], change(manifest) or manifest)


def test_an_output_may_have_the_name_of_an_input(toys):
    inputs = INPUTS["core/scale/by_two"]
    expected = {"values": Exact(inputs["values"] * np.float32(2))}
    vector = from_files(files_of(toy_stages.case_of("core/scale/by_two"), inputs, expected))
    assert np.array_equal(vector.inputs["values"], inputs["values"])
    assert vector.expected["values"].judge(inputs["values"] * np.float32(2)).passed
