"""Files of others cost no more than a limit and end no run: archives, npy, TOML, JSON, and folders that nest."""

import hashlib
import json
import os
import shutil
import struct
import sys
import tempfile
import time
import zipfile
from fnmatch import fnmatchcase
from random import Random

import numpy as np
import pytest
from toy_operations import INPUTS, write_program

from gsvc_base.errors import UsageError
from gsvc_conformance import globs, scratch
from gsvc_conformance.__main__ import main
from gsvc_conformance.features import read_features
from gsvc_conformance.globs import Names
from gsvc_conformance.reading import (
    MAX_BYTES,
    MAX_DIMENSIONS,
    MAX_DOTS,
    MAX_TEXT,
    Folder,
    elements_of,
    parse_npy,
    read_bytes,
    read_toml,
)
from gsvc_conformance.report.comparison import read_speeds
from gsvc_conformance.report.json import read
from gsvc_conformance.vector import SUMS, VECTORS, npy
from gsvc_conformance.vector_folder import VectorFolder
from gsvc_conformance.waivers import read_waivers

NESTING = """
import os
os.chdir({place!r})
for _ in range(1100):
    os.mkdir("deep")
    os.chdir("deep")
"""
"""Makes folders inside each other: their path is longer than a path may be, and deeper than Python calls itself."""


def nested(place):
    """Make a folder with many inside each other."""
    home = os.getcwd()
    try:
        exec(NESTING.format(place=str(place)))
    finally:
        os.chdir(home)


# Folders of programs


def test_an_implementation_that_nests_folders_costs_its_own_vectors_alone(folder, tmp_path, monkeypatch, capsys):
    """It ended the run with a fault, without a file of results, and left its folder behind."""
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    text = f"import sys\nif sys.argv[1] != 'halve':\n    sys.exit(77)\nexec({NESTING!r}.format(place=sys.argv[3]))\n"
    command = write_program(tmp_path, text)
    report, page = tmp_path / "report.json", tmp_path / "page.html"
    words = ["--vectors", str(folder), "--quiet", "--json", str(report), "--html", str(page)]
    assert main(["run", "--impl", command, *words]) == 1
    results = {result.id: result for result in read(report).results}
    assert results.keys() == INPUTS.keys()
    assert [result.outcome for result in results.values() if result.operation != "halve"] == ["unsupported"] * 8
    assert results["core/halve/one_to_six"].outcome == "error"
    assert page.is_file()
    assert list((tmp_path / "tmp").iterdir()) == []
    assert capsys.readouterr().out.endswith("FAILED\n")


def test_a_program_that_nests_folders_is_ended(tmp_path):
    nested(tmp_path)
    with pytest.raises(scratch.TooMuchError, match="made more than 64 folders inside each other"):
        scratch.held_bytes(tmp_path, 1 << 30)
    scratch.remove(tmp_path)
    assert not tmp_path.exists()


def test_what_is_removed_is_the_folder_alone(tmp_path):
    precious, folder = tmp_path / "precious", tmp_path / "folder"
    precious.mkdir()
    (precious / "file").write_text("kept")
    (folder / "a" / "b").mkdir(parents=True)
    (folder / "a" / "link").symlink_to(precious)
    (folder / "a" / "b" / "file").write_text("x")
    (folder / "a" / "b" / "closed").mkdir()
    (folder / "a" / "b" / "closed").chmod(0)
    (folder / "a").chmod(0o500)
    os.mkfifo(folder / "pipe")
    assert scratch.held_bytes(tmp_path / "precious", 1 << 20) == scratch.MIN_FILE
    scratch.remove(folder)
    assert not folder.exists()
    assert (precious / "file").read_text() == "kept"
    folder.symlink_to(precious)
    scratch.remove(folder)
    assert (precious / "file").read_text() == "kept"


@pytest.mark.parametrize("error", [RecursionError("deep"), MemoryError(), ArithmeticError("x"), GeneratorExit()])
def test_no_exception_of_one_answer_ends_a_run(folder, toy_module, tmp_path, error):
    class Odd:
        def __array__(self, *_arguments, **_named):
            raise error

    def halve(values):
        return {"half": Odd(), "count": np.asarray(values.size)}

    report = tmp_path / "report.json"
    words = ["--vectors", str(folder), "--quiet", "--json", str(report)]
    assert main(["run", "--module", toy_module(halve=halve), *words]) == 1
    assert [result.id for result in read(report).faults] == ["core/halve/one_to_six"]
    assert len(read(report).results) == len(INPUTS)


def test_one_file_of_a_report_that_cannot_be_made_costs_no_other(folder, toy_module, tmp_path, monkeypatch):
    def fails(_report):
        raise RuntimeError("a bug of the kit")

    monkeypatch.setattr("gsvc_conformance.report.badge.badge_json", fails)
    monkeypatch.setattr("gsvc_conformance.report.json.to_text", fails)
    files = [f"--{kind}={tmp_path / kind}" for kind in ("json", "junit", "html", "markdown", "badge")]
    assert main(["run", "--vectors", str(folder), "--quiet", "--module", toy_module(), *files]) == 70
    assert {kind for kind in ("json", "junit", "html", "markdown", "badge") if (tmp_path / kind).exists()} == {
        "junit", "html", "markdown",
    }  # fmt: skip


# Vectors


def archive_of(folder, path, method=zipfile.ZIP_DEFLATED):
    """An archive of the vectors of a folder."""
    with zipfile.ZipFile(path, "w", method) as packed:
        for name, data in Folder(folder).items():
            packed.writestr(name, data)
    return path


def with_declared_size(path, member, size):
    """Let an archive say that a member has another size when it is unpacked."""
    data = bytearray(path.read_bytes())
    for at, mark, field in ((30, b"PK\3\4", 22), (46, b"PK\1\2", 24)):
        begin = data.index(mark)
        while data[begin + at : begin + at + len(member)] != member.encode():
            begin = data.index(mark, begin + 1)
        struct.pack_into("<I", data, begin + field, size)
    path.write_bytes(data)


def refused(capsys, *words):
    """The message of a command that is wrong use, which must not take long."""
    begin = time.process_time()
    assert main([*map(str, words)]) == 2
    assert time.process_time() - begin < 10
    return " ".join(capsys.readouterr().err.split())


PART = "core/scale/by_two/values.npy"


@pytest.mark.parametrize(
    ("member", "size", "words"),
    [
        (PART, MAX_BYTES + 1, "by_two together has 268,43"),
        (SUMS, MAX_TEXT + 1, "SHA256SUMS has 33,554,433 bytes; at most 33,554,432 are read"),
        ("core/scale/by_two/manifest.json", MAX_BYTES + 1, "has 268,435,457 bytes; at most 268,435,456 are read"),
        (PART, (1 << 32) - 2, "archive.zip together has 4,294,9"),
        (PART, 3, "core/scale/by_two/values.npy of"),
    ],
)
def test_sizes_of_an_archive_are_held_against_a_limit_before_it_is_read(
    folder, tmp_path, capsys, monkeypatch, member, size, words
):
    path = archive_of(folder, tmp_path / "archive.zip")
    with_declared_size(path, member, size)
    asked = []
    unpacked = zipfile.ZipFile.open
    monkeypatch.setattr(zipfile.ZipFile, "open", lambda *a, **n: asked.append(a[1].filename) or unpacked(*a, **n))
    said = refused(capsys, "run", "--vectors", path, "--impl", "true", "--case", "*/by_two")
    assert words in said
    assert size < MAX_TEXT or member not in asked


def test_a_method_of_compression_whose_memory_the_file_chooses_is_refused(folder, tmp_path, capsys):
    path = archive_of(folder, tmp_path / "archive.zip", zipfile.ZIP_LZMA)
    assert "by another method than deflate" in refused(capsys, "run", "--vectors", path, "--impl", "true")


def test_a_damaged_archive_is_refused(folder, tmp_path, capsys):
    path = archive_of(folder, tmp_path / "archive.zip", zipfile.ZIP_STORED)
    data = path.read_bytes()
    path.write_bytes(data.replace(b"NUMPY", b"MUMPY"))
    said = refused(capsys, "run", "--vectors", path, "--impl", "true", "--case", "*/by_two")
    assert "core/scale/by_two/" in said
    assert "cannot be read (Bad CRC-32" in said


def changed(folder, change):
    """Change the manifest of core/scale/by_two, and SHA256SUMS with it."""
    path = folder / "core/scale/by_two/manifest.json"
    manifest = json.loads(path.read_bytes())
    change(manifest)
    path.write_text(json.dumps(manifest))
    lines = [f"{hashlib.sha256(data).hexdigest()}  {name}" for name, data in Folder(folder).items() if name != SUMS]
    (folder / SUMS).write_text("\n".join(lines) + "\n")


RUNS = {"runs": [[1 << 40, 0, 1, 0]], "shape": [1 << 40]}
CHANGES = {
    "runs that stand for terabytes": (lambda m: m["inputs"]["values"].update(RUNS), "with its arrays, has"),
    "a negative shape": (
        lambda m: m["inputs"]["values"].update(runs=[[6, 0, 6, 0]], shape=[-2, -3]), "do not fit its 6 elements"
    ),
    "a type with commas": (lambda m: m["outputs"]["scaled"].update(dtype="f8,("), ""),
    "a number of 400 digits": (lambda m: m.update(level=10**400), "level of manifest.json is 10"),
    "an output that is a list": (lambda m: m["outputs"].update(scaled=[]), "output 'scaled' of manifest.json is []"),
}  # fmt: skip


@pytest.mark.parametrize(("change", "words"), CHANGES.values(), ids=CHANGES)
def test_a_manifest_that_asks_for_too_much(folder, capsys, change, words):
    data = np.arange(6, dtype="<f4")
    (folder / PART).write_bytes(b"")
    np.save(folder / PART, data)
    digest = hashlib.sha256((folder / PART).read_bytes()).hexdigest()
    changed(folder, lambda m: (m["inputs"]["values"].update(sha256=digest), change(m)))
    if words:
        assert words in refused(capsys, "run", "--vectors", folder, "--impl", "true", "--case", "*/by_two")
    assert main(["list", "--json", "--vectors", str(folder)]) in (0, 2)


def test_a_manifest_without_a_profile_is_of_any(folder, capsys):
    changed(folder, lambda manifest: manifest.pop("profile"))
    words = ["--vectors", str(folder), "--impl", "true", "--quiet"]
    assert main(["run", *words, "--claim", "training,paper,1"]) in (1, 2)
    assert "stopped by a fault" not in capsys.readouterr().err


def test_an_export_of_inputs_that_do_not_fit_their_operation(tmp_path, capsys):
    home = tmp_path / "core/render_sum/a_splat_in_the_middle"
    shutil.copytree(VECTORS / "core/render_sum/a_splat_in_the_middle", home)
    np.save(home / "parameters.npy", np.ones(8, "f4"))
    manifest = json.loads((home / "manifest.json").read_bytes())
    manifest["inputs"]["parameters"]["sha256"] = hashlib.sha256((home / "parameters.npy").read_bytes()).hexdigest()
    (home / "manifest.json").write_text(json.dumps(manifest))
    lines = [f"{hashlib.sha256(data).hexdigest()}  {name}" for name, data in Folder(tmp_path).items()]
    (tmp_path / SUMS).write_text("\n".join(lines) + "\n")
    said = refused(capsys, "export", "--gltf", tmp_path / "out", "--vectors", tmp_path)
    assert "the inputs of core/render_sum/a_splat_in_the_middle do not fit render_sum" in said


def test_an_npy_file_is_not_believed(tmp_path):
    head = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1099511627776,), }\n"
    with pytest.raises(
        UsageError, match=r"^x has 8 bytes of data, which do not fit its type float64 and shape \(1099511627776,\)"
    ):
        parse_npy(b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head + bytes(8), "x")
    with pytest.raises(UsageError, match=r"^x has elements of type complex128; they must be integers or floating"):
        parse_npy(npy(np.zeros(2, "c16")), "x")


def test_a_shape_of_many_dimensions_is_not_multiplied():
    assert elements_of([2] * MAX_DIMENSIONS) == 1 << MAX_DIMENSIONS
    assert elements_of([2] * (MAX_DIMENSIONS + 1)) == -1


def test_a_folder_of_vectors_is_read_as_deep_as_vectors_stand(folder, capsys):
    nested(folder)
    assert sum(name.endswith("manifest.json") for name in Folder(folder)) == len(INPUTS)
    assert main(["sets", "--vectors", str(folder)]) == 0
    scratch.remove(folder / "deep")


def test_the_limits_are_far_above_the_largest_vector():
    files = Folder(VECTORS)
    assert max(map(files.size, files)) < MAX_TEXT / 16


def test_a_report_of_vectors_that_are_not_there_has_no_pictures(folder, toy_module, tmp_path, capsys):
    report = tmp_path / "report.json"
    words = ["--vectors", str(folder), "--quiet", "--json", str(report), "--keep", str(tmp_path / "kept")]
    wrong = toy_module(halve=lambda values: {"half": values, "count": np.asarray(0)})
    assert main(["run", "--module", wrong, *words]) == 1
    for name in ("core/halve/other", "core/../halve"):
        text = report.read_text().replace("core/halve/one_to_six", name)
        (tmp_path / "edited.json").write_text(text)
        (tmp_path / "kept" / name / "out").mkdir(parents=True, exist_ok=True)
        again = ["--keep", tmp_path / "kept", "--html", tmp_path / "page.html", "--vectors", folder]
        assert f"there is no vector {name} in" in refused(capsys, "report", tmp_path / "edited.json", *again)


def test_inputs_for_a_vector_of_ones_own_are_measured(tmp_path, capsys):
    path = tmp_path / "inputs.npz"
    np.savez_compressed(path, values=np.zeros(3, "f4"))
    with_declared_size(path, "values.npy", (1 << 32) - 2)
    assert "at most 268,435,456 are read" in refused(capsys, "make", "to_half", path, tmp_path / "own")
    os.mkfifo(tmp_path / "pipe.npz")
    assert main(["make", "to_half", str(tmp_path / "pipe.npz"), str(tmp_path / "own")]) == 2
    np.savez(path, values=np.zeros(3, ">f4"))
    assert main(["make", "to_half", str(path), str(tmp_path / "own"), "--id", "swapped"]) == 0


def test_a_stream_that_has_no_end_is_not_checked(tmp_path, capsys, monkeypatch):
    assert "is not an ordinary file" in refused(capsys, "check", "/dev/zero")
    monkeypatch.setattr("gsvc_conformance.commands.check.MAX_STREAM", 1 << 21)
    with open("/dev/zero") as endless:
        monkeypatch.setattr(sys, "stdin", endless)
        assert "standard input has 3,145,728 bytes; at most 2,097,152 are read" in refused(capsys, "check", "-")


# Waivers and other texts


def test_what_is_no_ordinary_file_is_not_waited_for(tmp_path, capsys):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", "/dev/zero"):
        for reader in (read_waivers, read_features, read, read_speeds, read_bytes):
            with pytest.raises(UsageError, match="is not an ordinary file; write its contents to one and give that"):
                reader(type(tmp_path)(path))


def test_a_text_that_is_too_large_is_not_read(tmp_path):
    path = tmp_path / "large"
    with path.open("wb") as file:
        file.truncate(1 << 40)
    for reader in (read_waivers, read_features, read, read_speeds):
        with pytest.raises(UsageError, match="has 1,099,511,627,776 bytes; at most 33,554,432 are read"):
            reader(path)


@pytest.mark.parametrize("reader", [read_waivers, read_features])
@pytest.mark.parametrize(
    ("text", "words"),
    [("a = " + "[" * 50_000, "nested too deep"), ("a = " + "{b=" * 50_000, "nested too deep"),
     (".".join("a" * 100_000) + " = 1", "more than 32 parts"), ("[" + ".".join("a" * 100_000) + "]", "32 parts"),
     ("a = {" + " . ".join(["'a'"] * 100_000) + " = 1}", "more than 32 parts"),
     ("a = 1" + "0" * 5000, "cannot be read as TOML"),
     ('"x\\' * 30_000, "Unescaped"), ('"""\n\\' * 30_000, "Expected '='"),
     ("a = {b = \"\"\"\"\"\"\"\", " + ".".join("a" * 100_000) + " = 1}", "more than 32 parts"),
     ("a = {b = '''''''', " + ".".join("a" * 100_000) + " = 1}", "more than 32 parts")],
)  # fmt: skip
def test_toml_of_a_hostile_form_is_refused_at_once(tmp_path, reader, text, words):
    path = tmp_path / "x.toml"
    path.write_text(text)
    begin = time.process_time()
    with pytest.raises(UsageError, match=words):
        reader(path)
    assert time.process_time() - begin < 5


def test_dots_in_texts_and_comments_are_no_parts_of_keys(tmp_path):
    dots = "." * (MAX_DOTS + 1)
    path = tmp_path / "x.toml"
    lines = [f'a = "{dots}" # {dots}', f"b = '{dots}'", f'c = """{dots}"{dots}"""', f"d = '''{dots}'{dots}'''"]
    path.write_text("\n".join(lines))
    assert len(read_toml(path)) == 4


def test_many_globs_are_each_compiled_once_and_tried_where_they_may_match(tmp_path, monkeypatch):
    """It took 31 s for 3 vectors: each was tried on all names, and then again."""
    names = VectorFolder(VECTORS, "newest").names
    chosen = names[::7]
    globs_of_each = [f"*{number}*nothing?" for number in range(10_000)]
    path = tmp_path / "waivers.toml"
    path.write_text(f'[[waiver]]\nreason = "x"\nvectors = {json.dumps([*globs_of_each, *chosen])}\n')
    compiled = []
    made = globs.matcher
    monkeypatch.setattr(globs, "matcher", lambda glob: compiled.append(glob) or made(glob))
    waivers = read_waivers(path)
    assert waivers.reasons(names) == dict.fromkeys(chosen, "x")
    sentences = waivers.stale([], names)
    assert len(compiled) == len(set(compiled)) < 200
    assert sentences[-1] == "9,990 other ids or globs of waivers match no vector: take them out"
    assert len(sentences) == 11


def test_globs_find_what_fnmatch_finds():
    rng = Random(0)
    names = VectorFolder(VECTORS, "newest").names[::9]
    index = Names(names)
    for _ in range(600):
        glob = rng.choice(names)
        for _ in range(rng.randrange(1, 5)):
            first = rng.randrange(len(glob) + 1)
            part = rng.choice(["*", "?", "[a-z]", "[!a]", "**", "[", "]", "x", "*_*", "\n", ""])
            glob = glob[:first] + part + glob[first + rng.randrange(6) :]
        assert list(index.matching(glob)) == [name for name in names if fnmatchcase(name, glob)], glob


def test_a_glob_longer_than_any_id_is_refused(tmp_path):
    path = tmp_path / "x.toml"
    path.write_text(f'[[waiver]]\nreason = "x"\nvectors = ["{"*a" * 1000}"]\n')
    with pytest.raises(UsageError, match="which is longer than any id: shorten it"):
        read_waivers(path)


if sys.platform == "win32":
    pytest.skip("the files are those of POSIX", allow_module_level=True)
