"""Vectors of somebody's own inputs: what is made judges, what does not fit is refused in words."""

import hashlib
import json

import numpy as np
import pytest

from gsvc_conformance.__main__ import main
from gsvc_conformance.expectations import Bounded
from gsvc_conformance.making import add_vectors, make_vector
from gsvc_conformance.operation import operations
from gsvc_conformance.vector import VECTORS, load, read
from gsvc_conformance.vector_folder import VectorFolder
from gsvc_ref import UsageError
from gsvc_ref.testing import OVERVIEW_HEADER, overview_frames, write_stream

SPLATS = np.array([[9.5, 4, 3, 0.5, 2, 0.9, 0.5, 0.1], [20, 11, 2, -1, 1.5, 0.2, -0.4, 1.0]], np.float32)
INPUTS = {"parameters": SPLATS, "width": 32, "height": 16}

BUGGY = """
import gsvc_ref

def render_sum(parameters, width, height):
    parameters[:, :2] += 0.5
    return {"sum": gsvc_ref.render_sum(parameters, width, height)}
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def stream():
    return write_stream(OVERVIEW_HEADER, overview_frames())


def run(capsys, *words):
    """The exit code, and what was printed."""
    code = main([str(word) for word in words])
    text = capsys.readouterr()
    return code, text.out, text.err


def test_a_vector_is_that_of_the_oracle():
    vector = make_vector("render_sum", INPUTS, id="two")
    assert (vector.id, vector.tier, vector.level) == ("own/render_sum/two", "own", 1)
    assert vector.manifest["title"] == "Own inputs: N = 2, width = 32, height = 16"
    (expected,) = operations()["render_sum"].oracle(**INPUTS).values()
    assert isinstance(expected, Bounded)
    assert np.array_equal(vector.expected["sum"].value, expected.value)
    bound = vector.expected["sum"].bound  # stored in binary32, rounded up
    assert ((bound >= expected.bound) & (bound <= expected.bound * (1 + 2**-22) + 2**-149)).all()
    assert "kills" not in vector.manifest


def test_golden_vectors_come_out_again():
    """The same expectations as those of the golden vector, for the smallest vector of every operation."""
    for name in operations():
        home = min(VECTORS.glob(f"core/{name}/*"), key=size)
        golden = read(home)
        files = make_vector(name, golden.inputs).files
        for file in home.iterdir():
            if file.name != "manifest.json":
                assert files[file.name] == file.read_bytes(), (golden.id, file.name)


def size(home):
    return sum(file.stat().st_size for file in home.iterdir())


def test_a_name_without_one_is_that_of_the_inputs():
    first, again = (make_vector("prune", {"weights": [0.5, 0.25], "removed": 1}) for _ in range(2))
    other = make_vector("prune", {"weights": [0.5, 0.125], "removed": 1})
    assert first.id == again.id != other.id


def test_the_command_makes_what_run_judges(here, capsys, monkeypatch):
    monkeypatch.syspath_prepend(here)
    np.savez("two.npz", **INPUTS)
    (here / "mine_that_shifts.py").write_text(BUGGY)
    code, out, _ = run(capsys, "make", "render_sum", "two.npz", "own")
    assert code == 0
    assert "own/render_sum/two: Own inputs: N = 2" in out
    assert "sum: bounded, (16, 32, 3), bounds 0 to " in out
    assert "gsvc_ref's own answer: at most 0." in out
    assert "added to the folder own; judge an implementation with:\n" in out
    assert "gsvc-conformance run --vectors own --module mine" in out

    (here / "my.gsvc").write_bytes(stream())
    (here / "cut.gsvc").write_bytes(stream()[:60])
    assert run(capsys, "make", "decode_stream", "my.gsvc", "own", "--title", "A stream of mine.")[0] == 0
    assert "malformed R-6.2-4" in run(capsys, "make", "reconstruct_stream", "cut.gsvc", "own")[1]

    code, out, _ = run(capsys, "run", "--vectors", "own", "--reference", "--json", "r.json")
    assert (code, "PASSED" in out, "sha256" in out) == (0, True, False)
    digest = hashlib.sha256((here / "own/SHA256SUMS").read_bytes()).hexdigest()
    assert json.loads((here / "r.json").read_text())["environment"]["vectors"] == digest
    words = ["run", "--vectors", "own", "--tier", "own", "--module", "mine_that_shifts", "--keep", "kept"]
    code, out, err = run(capsys, *words)
    assert code == 1, err
    assert "FAIL own/render_sum/two" in out
    assert "Probable cause: pixel centres at integer positions" in out
    assert run(capsys, "verify", "--vectors", "own")[1].endswith("nothing is wrong\n")

    code, out, _ = run(capsys, "make", "render_sum", "kept/own/render_sum/two/in", "again")
    assert (code, "own/render_sum/two" in out) == (0, True)
    for file in (here / "again/own/render_sum/two").iterdir():
        if file.name != "manifest.json":
            assert file.read_bytes() == (here / "own/own/render_sum/two" / file.name).read_bytes()


def test_mutants_are_named(here, capsys):
    np.savez("three.npz", weights=np.float32([0.5, -0.25, 0.25]), removed=1)
    code, out, _ = run(capsys, "make", "prune", "three.npz", "own", "--mutants")
    found = json.loads((here / "own/own/prune/three/manifest.json").read_text())["kills"]
    assert found
    assert (code, f"mutants: {', '.join(found)}" in out) == (0, True)


def test_vectors_are_added_and_replaced(here, capsys):
    np.savez("two.npz", **INPUTS)
    assert run(capsys, "make", "render_sum", "two.npz", "own")[0] == 0
    code, _, err = run(capsys, "make", "render_sum", "two.npz", "own")
    assert (code, "own has a vector own/render_sum/two already: give another --id, or --replace" in err) == (2, True)
    np.savez("two.npz", **{**INPUTS, "width": 31})
    assert run(capsys, "make", "render_sum", "two.npz", "own", "--replace")[0] == 0
    assert run(capsys, "make", "render_sum", "two.npz", "own", "--id", "own/render_sum/more")[0] == 0
    folder = VectorFolder(here / "own")
    assert folder.names == ["own/render_sum/more", "own/render_sum/two"]
    assert [vector.inputs["width"] for vector in folder.read(folder.names)] == [31, 31]
    assert [vector.id for vector in load(here / "own", ("own",))] == folder.names
    for line in (here / "own/SHA256SUMS").read_text().splitlines():
        digest, name = line.split("  ")
        assert hashlib.sha256((here / "own" / name).read_bytes()).hexdigest() == digest


def test_python_adds_vectors_and_is_answered_in_its_words(here):
    one, two = (make_vector("render_sum", INPUTS, id=name) for name in ("one", "two"))
    add_vectors("own", [one])
    with pytest.raises(UsageError, match=r"own has a vector own/render_sum/one already: make it with another id=, or"):
        add_vectors("own", [two, one])
    assert VectorFolder(here / "own").names == [one.id]
    assert not (here / "own" / two.id).exists()
    with pytest.raises(UsageError, match="has a vector own/render_sum/two already"):
        add_vectors("own", [two, two])
    add_vectors("own", (vector for vector in [one, two]), replace=True)
    assert VectorFolder(here / "own").names == [one.id, two.id]
    golden = read(next(VECTORS.glob("core/prune/*")))
    for folder, given, words in (
        ("own", two, r"vectors is of the type OwnVector; it must be a list: \[vector\]"),
        ("own", None, "vectors is of the type NoneType; it must be a list"),
        ("own", ["two"], "vectors has a str; each must be a vector of make_vector"),
        ("own", [golden], "vectors has a Vector; each must be a vector of make_vector"),
        (3, [two], "folder is of the type int; it must be a str or a Path"),
    ):
        with pytest.raises(UsageError, match=words):
            add_vectors(folder, given)


def test_the_advice_about_a_folder_is_that_of_its_owner(here, capsys):
    add_vectors("mine/own ones", [make_vector("render_sum", INPUTS, id="two")])
    folder = here / "mine/own ones"
    (folder / "own/render_sum/two/parameters.npy").write_bytes(b"")
    code, _, err = run(capsys, "run", "--vectors", "mine/own ones", "--reference")
    words = "make it again with: gsvc-conformance make render_sum INPUTS 'mine/own ones' --id two --replace"
    assert (code, words in err) == (2, True), err
    np.savez("two.npz", **INPUTS)
    assert run(capsys, "make", "render_sum", "two.npz", "mine/own ones", "--id", "two", "--replace")[0] == 0
    assert run(capsys, "run", "--vectors", "mine/own ones", "--reference")[0] == 0

    (folder / "SHA256SUMS").write_text("nothing")
    for name, advice in {"mine/own ones": "make them again", "nowhere": "that `gsvc-conformance make` wrote"}.items():
        code, _, err = run(capsys, "run", "--vectors", name, "--reference")
        assert (code, advice in err) == (2, True), err


def test_folders_of_others_are_left_alone(here):
    vector = make_vector("render_sum", INPUTS)
    (here / "full").mkdir()
    (here / "full/notes.txt").write_text("mine")
    with pytest.raises(UsageError, match="is not empty and holds no vectors"):
        add_vectors(here / "full", [vector])
    with pytest.raises(UsageError, match="is a file"):
        add_vectors(here / "full/notes.txt", [vector])
    before = (VECTORS / "SHA256SUMS").read_bytes()
    with pytest.raises(UsageError, match="vectors that are not yours, such as core/"):
        add_vectors(VECTORS, [vector])
    assert (VECTORS / "SHA256SUMS").read_bytes() == before


def test_own_vectors_judge_no_claim(here, capsys):
    add_vectors(here / "own", [make_vector("render_sum", INPUTS)])
    code, _, err = run(capsys, "run", "--vectors", "own", "--reference", "--claim", "rendering,paper,1")
    assert (code, "no claim is judged by the tiers full and own" in err) == (2, True)
    code, _, err = run(capsys, "run", "--tier", "own", "--reference")
    assert (code, "gsvc-conformance make OPERATION INPUTS DIR" in err) == (2, True)


F4 = np.float32
N4 = np.zeros((4, 8), np.float32)
ADAN = {
    **dict.fromkeys(("parameters", "gradients", "m", "v", "n", "previous"), N4),
    "steps": np.arange(4), "rates": np.zeros(8), "units": np.ones(8),
    "beta1": 0.98, "beta2": 0.92, "beta3": 0.99, "epsilon": 1e-8,
}  # fmt: skip

WRONG = [
    ("render_sums", INPUTS, "no operation 'render_sums'; did you mean render_sum"),
    ("render_sum", {**INPUTS, "widht": 3}, "widht is none of its inputs: its inputs are parameters, width, height"),
    ("render_sum", {"parameters": SPLATS, "widht": 3, "height": 4}, "widht is none of its inputs: did you mean width?"),
    ("render_sum", {"parameters": SPLATS, "width": 3}, "height is missing, a whole number"),
    ("render_sum", {**INPUTS, "width": 3.5}, "width is 3.5; it must be a whole number"),
    ("render_sum", {**INPUTS, "width": [3]}, "width must be a whole number; it is an array of shape (1,)"),
    ("render_sum", {**INPUTS, "width": "3"}, "width must be a whole number, not str"),
    ("render_sum", {**INPUTS, "parameters": SPLATS[:, :7]}, "parameters has the shape (2, 7); it must be (N, 8)"),
    ("render_sum", {**INPUTS, "parameters": SPLATS[0]}, "parameters has the shape (8,); it must be (N, 8)"),
    ("render_sum", {**INPUTS, "parameters": SPLATS + 0.1j}, "it has the type complex64"),
    ("render_sum", {**INPUTS, "parameters": SPLATS.astype("f8") + 0.1}, "must be f4, and is float64: "),
    ("render_sum", {**INPUTS, "parameters": SPLATS * np.float32(np.inf)}, "(spec.md section 4.3): parameters must be"),
    ("adan_step", {**ADAN, "m": N4[:3]}, "N is 4 in parameters (4, 8) and 3 in m (3, 8)"),
    ("adan_step", {**ADAN, "rates": np.zeros(9)}, "P is 8 in parameters (4, 8) and 9 in rates (9,)"),
    ("adan_step", {**ADAN, "steps": np.full(4, 0.5)}, "steps must be i8, and is float64: 0.5 at [0] is no such number"),
    ("adan_step", {**ADAN, "beta1": 1}, "beta1 must be at least 0 and below 1"),
    ("select_key_frames", {"losses_i": [1, 2], "losses_p": [1, 2], "window": 1, "threshold": 1, "guard_ratio": 1,
                           "robust": 0}, "T is 2 in losses_i (2,) and 3 in losses_p (2,)"),
    ("metrics", {"a": np.zeros((2, 2, 3), int), "b": np.full((2, 2, 3), 300), "bit_depth": 8}, "b must be u1"),
    ("decode_stream", {"stream": b"no stream"}, "stream must be legal"),
    ("decode_stream", {"stream": [1, 2]}, "stream must be the bytes of a stream"),
    ("rvq_assign", {"x": F4([[0.3, 0, 0]]), "codebook_sizes": [2], "codebooks": F4([[0.1, 0, 0], [0.5, 0, 0]])},
     "no certain answer to these inputs: a vector lies too close to the border"),
]  # fmt: skip


@pytest.mark.parametrize(("operation", "inputs", "words"), WRONG)
def test_what_does_not_fit_is_refused(operation, inputs, words):
    with pytest.raises(UsageError) as refused:
        make_vector(operation, inputs)
    assert words in str(refused.value)


def test_each_wrong_input_has_its_sentence():
    with pytest.raises(UsageError) as refused:
        make_vector("render_sum", {"parameters": SPLATS[:, :3], "width": 1.5, "depth": 8})
    assert str(refused.value).count(";") == 5
    for words in ("depth is none", "height is missing", "width is 1.5", "parameters has the shape"):
        assert words in str(refused.value)


def test_numbers_that_stay_are_converted():
    plain = make_vector("render_sum", INPUTS)
    for given in ({"parameters": SPLATS.astype("f8")}, {"width": np.int32(32)}, {"width": 32.0, "height": np.array(16)},
                  {"parameters": SPLATS.astype(">f4")}, {"parameters": np.asfortranarray(SPLATS)}):  # fmt: skip
        assert make_vector("render_sum", {**INPUTS, **given}).files == plain.files
    assert make_vector("prune", {"weights": [1, 2], "removed": True}).inputs["weights"].dtype == np.float32


def test_a_bad_name_is_refused():
    for name in ("../other", "", "a b", ".hidden"):
        with pytest.raises(UsageError, match="names no vector"):
            make_vector("render_sum", INPUTS, id=name)


def test_files_that_are_no_inputs_are_refused(here, capsys):
    (here / "text.npz").write_text("no archive")
    (here / "table.csv").write_text("1,2")
    (here / "empty").mkdir()
    (here / "kept/in").mkdir(parents=True)
    np.savez("objects.npz", parameters=np.array([{}], object))
    for file, words in (
        ("text.npz", "cannot be read as an .npz file of plain arrays"),
        ("objects.npz", "cannot be read as an .npz file of plain arrays"),
        ("table.csv", "is neither an .npz file, nor a .gsvc file, nor a folder"),
        ("nothing.npz", "there is no nothing.npz"),
        ("empty", "empty has no .npy or .gsvc files; render_sum takes parameters, width, height"),
        ("kept", "give its folder in/"),
    ):  # fmt: skip
        code, _, err = run(capsys, "make", "render_sum", file, "own")
        assert (code, words in err) == (2, True), err
    (here / "s.gsvc").write_bytes(stream())
    code, _, err = run(capsys, "make", "seek", "s.gsvc", "own")
    assert (code, "a stream alone is not enough" in err) == (2, True)
    assert not (here / "own").exists()
    np.save("empty/first.npy", 0)
    np.save("empty/last.npy", 1)
    (here / "empty/stream.gsvc").write_bytes(stream())
    assert run(capsys, "make", "seek", "empty", "own")[0] == 0
    assert json.loads((here / "own/own/seek/empty/manifest.json").read_text())["inputs"]["last"] == {"value": 1}
