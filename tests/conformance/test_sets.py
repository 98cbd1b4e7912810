"""Sets of vectors: what an id means never changes, a withdrawn vector stays for the sets that list it."""

import hashlib
import json
import shutil
import zipfile

import pytest
from toy_operations import INPUTS

from gsvc_base.errors import UsageError
from gsvc_conformance.__main__ import main
from gsvc_conformance.sets import changed, check_made, digest, list_of, missing, next_list, read_sets, withdrawn
from gsvc_conformance.vector import SUMS, files_in, load, manifests_in
from gsvc_conformance.vector_folder import Selection, VectorFolder

GONE = "core/scale/by_two"


@pytest.fixture
def with_sets(folder):
    """Vectors with set 1, of all of them, and set 2, from which one is withdrawn."""
    digests = {name: digest(manifest) for name, manifest in manifests_in(files_in(folder)).items()}
    (folder / "sets").mkdir()
    (folder / "sets" / "1.txt").write_bytes(list_of(digests))
    (folder / "sets" / "2.txt").write_bytes(list_of({n: d for n, d in digests.items() if n != GONE}))
    return folder


def change(folder, name, **fields):
    """Change a manifest and the sum of it."""
    path = folder / name / "manifest.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **fields}))
    lines = (folder / SUMS).read_text().splitlines()
    sums = {line[66:]: line[:64] for line in lines} | {
        f"{name}/manifest.json": hashlib.sha256(path.read_bytes()).hexdigest()
    }
    (folder / SUMS).write_text("".join(f"{value}  {key}\n" for key, value in sums.items()))


def test_a_set_is_what_its_list_says(with_sets):
    first, second = VectorFolder(with_sets, 1), VectorFolder(with_sets, "newest")
    assert sorted(first.names) == sorted(INPUTS)
    assert set(first.names) - set(second.names) == {GONE}
    assert VectorFolder(with_sets).names == second.names  # a withdrawn vector belongs to its sets alone
    assert second.sha256 == hashlib.sha256((with_sets / "sets" / "2.txt").read_bytes()).hexdigest()
    assert VectorFolder(with_sets).sha256 == hashlib.sha256((with_sets / SUMS).read_bytes()).hexdigest()
    assert [vector.id for vector in first.read([GONE])] == [GONE]


@pytest.mark.parametrize("wanted", ["newest", "all"])
def test_a_folder_of_ones_own_has_no_sets(folder, wanted):
    vectors = VectorFolder(folder, wanted)
    assert vectors.set is None
    assert len(vectors.select(Selection())) == len(INPUTS)
    with pytest.raises(UsageError, match="has no set 1; it has none: leave out --set"):
        VectorFolder(folder, 1)


def test_words_may_change_and_what_is_judged_may_not(with_sets):
    name = "core/halve/one_to_six"
    change(with_sets, name, title="Another title.", rules=[], kills=["x"])
    assert [vector.id for vector in VectorFolder(with_sets, 1).read([name])] == [name]
    outputs = json.loads((with_sets / name / "manifest.json").read_text())["outputs"]
    change(with_sets, name, outputs={**outputs, "count": {**outputs["count"], "check": "decision"}})
    with pytest.raises(UsageError, match="is not the vector that set 1 lists by this name"):
        list(VectorFolder(with_sets, 1).read([name]))
    files = files_in(with_sets)
    found = list(changed(read_sets(files), manifests_in(files)))
    assert found == [f"{name} is not what set {n} means by this name, which never changes" for n in (1, 2)]


def test_a_vector_of_a_set_that_is_lost_is_named(with_sets):
    sums = [line for line in (with_sets / SUMS).read_text().splitlines(keepends=True) if GONE not in line]
    (with_sets / SUMS).write_text("".join(sums))
    shutil.rmtree(with_sets / GONE)
    files = files_in(with_sets)
    assert list(missing(read_sets(files), manifests_in(files))) == [f"{GONE} of set 1 is missing"]
    with pytest.raises(UsageError, match=f"lacks {GONE} of set 1"):
        VectorFolder(with_sets, 1)
    assert GONE not in VectorFolder(with_sets, 2).names


def test_an_id_that_was_withdrawn_is_never_used_again(with_sets):
    files = files_in(with_sets)
    sets, manifests = read_sets(files), manifests_in(files)
    assert withdrawn(sets) == {GONE}
    with pytest.raises(UsageError, match=f"{GONE} was withdrawn, and its id is never used again: give"):
        check_made(sets, manifests)
    with pytest.raises(UsageError, match="set 2 has just these vectors"):
        next_list(sets, {name: manifest for name, manifest in manifests.items() if name != GONE})
    number, text = next_list(sets, {"core/scale/new": manifests[GONE]})
    assert (number, text) == (3, f"core/scale/new {digest(manifests[GONE])}\n".encode())


@pytest.mark.parametrize(("name", "text"), [("3.txt", "core/scale/by_two\n"), ("new.txt", "")])
def test_a_damaged_list_is_named(with_sets, name, text):
    (with_sets / "sets" / name).write_text(text)
    with pytest.raises(UsageError, match=rf"sets/{name} is damaged: it must be NUMBER\.txt"):
        VectorFolder(with_sets)


def test_commands_take_a_set(with_sets, toy_module, capsys):
    words = ["run", "--module", toy_module(), "--vectors", str(with_sets), "--quiet"]
    many = len(INPUTS)
    for more, number, count in ([], 2, many - 1), (["--set", "newest"], 2, many - 1), (["--set", "1"], 1, many):
        assert main([*words, *more, "--class", "training"]) in (0, 1)
        out = capsys.readouterr().out
        assert f"passes GSVC vectors {number} (sha256 " in out
        assert main(["list", "--cases", "--vectors", str(with_sets), *more]) == 0
        assert len(capsys.readouterr().out.splitlines()) == count
    assert main([*words, "--set", "all", "--class", "training"]) in (0, 1)
    assert "passes vectors of no set (sha256 " in capsys.readouterr().out
    assert main([*words, "--set", "7"]) == 2
    assert "has no set 7; its sets are 1, 2" in capsys.readouterr().err
    assert main(["sets", "--vectors", str(with_sets)]) == 0
    assert f"(0 new; withdrawn: {GONE})" in capsys.readouterr().out


def test_the_command_to_judge_again_names_the_set(with_sets, toy_module, capsys):
    wrong = toy_module(halve=lambda values: {})
    assert main(["run", "--module", wrong, "--vectors", str(with_sets), "--set", "1", "--quiet"]) == 1
    assert f"--vectors {with_sets} --set 1" in capsys.readouterr().out


def test_an_archive_stands_for_the_folder(with_sets, tmp_path, toy_module, capsys):
    packed = tmp_path / "packed.zip"
    with zipfile.ZipFile(packed, "w") as archive:
        for name, data in files_in(with_sets).items():
            archive.writestr(name, data)
    folder, vectors = VectorFolder(with_sets, 1), VectorFolder(packed, 1)
    assert vectors.names == folder.names
    assert vectors.sha256 == folder.sha256
    assert [v.manifest for v in vectors.read(vectors.names)] == [v.manifest for v in folder.read(folder.names)]
    assert sorted(v.id for v in load(packed)) == sorted(INPUTS)
    assert main(["run", "--module", toy_module(), "--vectors", str(packed), "--quiet"]) == 0
    assert main(["sets", "--new", "--vectors", str(packed)]) == 2
    assert main(["generate", "--vectors", str(packed)]) == 2
    packed.write_bytes(b"no zip")
    capsys.readouterr()
    assert main(["list", "--cases", "--vectors", str(packed)]) == 2
    assert "is neither a folder of vectors nor an archive (zip) of one" in capsys.readouterr().err
