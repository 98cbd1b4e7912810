"""Which vectors are run, and that they are what SHA256SUMS and the schema say."""

import hashlib
import json
import os
from pathlib import Path

import numpy as np
import pytest
import toy_operations
from toy_operations import INPUTS

from gsvc_base.errors import UsageError
from gsvc_conformance import vectors
from gsvc_conformance.__main__ import main
from gsvc_conformance.coverage import listed_problems
from gsvc_conformance.expectations import Exact
from gsvc_conformance.vector import SUMS, files_of, from_files
from gsvc_conformance.vector_folder import Selection, VectorFolder, check_manifest


def test_missing_or_empty_vectors_are_refused(toys, tmp_path):
    with pytest.raises(UsageError, match="there are no vectors"):
        VectorFolder(tmp_path)
    (tmp_path / SUMS).write_text("")
    with pytest.raises(UsageError, match="lists no vectors"):
        VectorFolder(tmp_path).select(Selection())


def test_selections(folder):
    vectors = VectorFolder(folder)
    assert len(vectors.select(Selection())) == len(INPUTS)
    assert len(vectors.select(Selection(tiers=("uncommon",)))) == 2
    assert vectors.select(Selection(groups=("training",), tiers=("stress",))) == ["stress/scale/nothing"]
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


def test_a_vector_of_an_unknown_operation_is_refused(folder):
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


def with_sums(folder, extra=b""):
    """The folder, with the sums of what it holds now."""
    names = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*.*"))
    lines = (f"{hashlib.sha256((folder / name).read_bytes()).hexdigest()}  {name}\n" for name in names)
    (folder / "SHA256SUMS").write_bytes("".join(lines).encode() + extra)
    return folder


def changed(text=None, **change):
    """A function that writes the manifest of a vector anew: a text, or some of its fields."""

    def write(path):
        manifest = json.loads(path.read_text())
        for kind, entries in change.items():
            manifest[kind] = entries(manifest[kind]) if callable(entries) else entries
        path.write_text(json.dumps(manifest) if text is None else text)

    return write


def renamed(old, new):
    return lambda entries: {new if name == old else name: entry for name, entry in entries.items()}


def with_hashes(path):
    """The manifest of a vector, with the SHA-256 of its input as it is now."""
    digest = hashlib.sha256(path.with_name("values.npy").read_bytes()).hexdigest()
    changed(inputs=lambda entries: entries | {"values": entries["values"] | {"sha256": digest}})(path)


def pickled(path):
    np.save(path.with_name("values.npy"), np.array([{}], object), allow_pickle=True)
    with_hashes(path)


def zipped(path):
    with path.with_name("values.npy").open("wb") as file:
        np.savez(file, values=np.zeros(3))
    with_hashes(path)


def with_runs(path):
    changed(inputs=lambda entries: entries | {"values": entries["values"] | {"runs": [[1, 0, 1, 0]]}})(path)


def other(path):
    np.save(path.with_name("values.npy"), np.zeros((3, 2), np.float32))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (changed(inputs=renamed("values", "/tmp/x/evil")), "has the inputs /tmp/x/evil, factor; those of scale are"),
        (changed(inputs=renamed("values", "../../evil")), "those of scale are factor, values"),
        (changed(outputs=renamed("scaled", "other")), "has the outputs other; those of scale are scaled"),
        (changed(operation="halve"), "is that of core/scale/by_two, operation halve"),
        (changed(operation="nothing"), "operation nothing"),
        (changed(id="core/scale/other"), "is that of core/scale/other"),
        (changed(title=5), "core/scale/by_two cannot be read: title of manifest.json is 5; it must be a text"),
        (changed("[]"), "manifest.json is []; it must be an object"),
        (changed("{"), "cannot be read"),
        (changed("[" * 100_000), "cannot be read"),
        (changed(inputs=[]), "cannot be read"),
        (changed(inputs=lambda entries: dict.fromkeys(entries, 5)), "cannot be read"),
        (changed(inputs=lambda entries: {name: {"file": "../../../../etc/hostname"} for name in entries}), "cannot be"),
        (changed(inputs=lambda entries: {name: {"value": "text"} for name in entries}), "is not an array of numbers"),
        (changed(outputs=lambda entries: {name: {} for name in entries}), "cannot be read"),
        (pickled, "core/scale/by_two/values.npy has elements of type object"),
        (zipped, "core/scale/by_two/values.npy is not an .npy file of version 1 or 2"),
        (other, "core/scale/by_two/values.npy is not the file of which its manifest.json has the SHA-256"),
        (with_runs, "core/scale/by_two/values.npy do not fit its 6 elements and the shape (3, 2)"),
    ],
)
def test_a_vector_of_others_is_refused_where_it_is_none(folder, tmp_path, monkeypatch, capsys, change, words):
    """Code 2 and a sentence: names of inputs became names of files, and what was no manifest was a fault of the kit."""
    change(folder / "core/scale/by_two/manifest.json")
    with_sums(folder)
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    assert main(["run", "--vectors", str(folder), "--impl", "true", "--operation", "scale", "--case", "*/by_two"]) == 2
    assert words in " ".join(capsys.readouterr().err.split())
    assert sorted(tmp_path.rglob("*")) == before
    assert not Path("/tmp/x").exists()


def test_verify_and_the_interface_find_a_file_that_is_not_the_manifest_s(folder):
    other(folder / "core/scale/by_two/manifest.json")
    with_sums(folder)
    sentence = "core/scale/by_two/values.npy is not the file of which its manifest.json has the SHA-256"
    assert list(listed_problems(folder)) == [sentence]
    with pytest.raises(UsageError, match="is not the file of which"):
        list(vectors("scale", case="by_two", folder=folder))


@pytest.mark.parametrize(
    ("place", "words"),
    [
        ("nowhere", "there is no folder {}; give"),
        ("foreign", "there are no vectors in {} (no SHA256SUMS); give a folder that"),
        ("checkout", "did you mean {}/vectors?"),
    ],
)
def test_a_folder_without_vectors_gets_advice_that_fits(toys, tmp_path, place, words):
    (tmp_path / "foreign").mkdir()
    (tmp_path / "checkout/vectors").mkdir(parents=True)
    (tmp_path / "checkout/vectors" / SUMS).touch()
    with pytest.raises(UsageError) as error:
        VectorFolder(tmp_path / place)
    assert words.format(tmp_path / place) in str(error.value)
    assert "generate" not in str(error.value)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (b"\xff\n", "SHA256SUMS is damaged"),
        (b"no sum\n", "SHA256SUMS is damaged"),
        (
            b"0  core/scale/../manifest.json\n",
            "core/scale/.. is a vector of a tier or operation that this kit does not",
        ),
        (b"0  core/scale/.hidden/manifest.json\n", "core/scale/.hidden is a vector"),
        (b"0  /core/scale/manifest.json\n", "/core/scale is a vector"),
    ],
)
def test_sums_that_are_none(folder, capsys, line, words):
    with_sums(folder, line)
    assert main(["run", "--vectors", str(folder), "--impl", "true"]) == 2
    assert words in capsys.readouterr().err


def test_an_output_may_have_the_name_of_an_input(toys):
    inputs = INPUTS["core/scale/by_two"]
    expected = {"values": Exact(inputs["values"] * np.float32(2))}
    vector = from_files(files_of(toy_operations.case_of("core/scale/by_two"), inputs, expected))
    assert np.array_equal(vector.inputs["values"], inputs["values"])
    assert vector.expected["values"].judge(inputs["values"] * np.float32(2)).passed
