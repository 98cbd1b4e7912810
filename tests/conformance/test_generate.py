"""Vectors are compared byte for byte; the number of processes does not matter, and one that cannot start is told."""

import json
import subprocess
import sys

import pytest

from gsvc_base.errors import UsageError
from gsvc_conformance import generate
from gsvc_conformance.__main__ import main
from gsvc_conformance.coverage import coverage_page
from gsvc_conformance.sets import digest, list_of
from gsvc_conformance.vector import SUMS, VECTORS, set_hash, write

NAMES = (
    "core/render_sum/a_splat_in_the_middle",
    "core/reconstruct_inter/none_survives",
    "core/lsq_quantize/codes_at_the_ends",
    "faulty/reconstruct_stream/r_3_1_1_chunk_length_six_bytes",
    "core/render_frame/no_splats_8_bits",
)

FROM_STANDARD_INPUT = """
from gsvc_conformance import generate

names = [name for name in generate.cases() if name.startswith("faulty/")][:9]
cases = {name: generate.cases()[name] for name in names}
generate.cases = lambda: cases
made = generate.make(["faulty"], jobs=JOBS)
print(len(made), "made")
"""


@pytest.fixture(autouse=True)
def few_cases(monkeypatch):
    """Only some of the cases, of all kinds of expectations."""
    real = generate.cases()
    monkeypatch.setattr(generate, "cases", lambda: {name: real[name] for name in NAMES})


@pytest.fixture(scope="module")
def made():
    return dict(generate.vector_files(name, kills_in=VECTORS) for name in NAMES)


@pytest.fixture
def folder(made, tmp_path):
    """Their vectors in a folder."""
    write(tmp_path, made)
    (tmp_path / "COVERAGE.md").write_text(coverage_page(tmp_path), encoding="utf-8")
    return tmp_path


@pytest.mark.exhaustive
def test_the_number_of_processes_does_not_matter(folder, made):
    assert generate.make(jobs=2, kills_in=folder) == generate.make(jobs=1, kills_in=folder) == made
    assert generate.differences(folder, made) == []


@pytest.mark.exhaustive
def test_a_bit_of_any_file_is_a_difference(folder, made):
    for name, files in made.items():
        for part, data in files.items():
            other = {**made, name: {**files, part: data[:-2] + bytes([data[-2] ^ 1]) + data[-1:]}}
            found = generate.differences(folder, other)
            assert found[:2] == [f"{name}/{part} differs", f"{SUMS} is not that of what the cases make"]
            assert found[-1] == "to write them again: gsvc-conformance generate"


def test_files_without_a_case_and_cases_without_a_file(folder, made):
    first, *rest = made
    found = generate.differences(folder, {name: made[name] for name in rest})
    assert f"{first}/manifest.json is not made by any case" in found
    (folder / first / "manifest.json").unlink()
    assert f"{first}/manifest.json is missing" in generate.differences(folder, made)


@pytest.mark.parametrize("more", [["--without-kills"], pytest.param([], marks=pytest.mark.exhaustive)])
def test_the_command_prints_the_hash_of_the_set(folder, capsys, more):
    assert main(["generate", "--check", "--jobs", "1", "--vectors", str(folder), "--quiet", *more]) == 0
    assert f"SHA-256 of the SHA256SUMS that they make: {set_hash(folder)}\n" in capsys.readouterr().out


def test_without_kills_the_stored_ones_count(folder, made, capsys):
    name = next(name for name, files in made.items() if b'"kills": []' not in files["manifest.json"])
    path = folder / name / "manifest.json"
    path.write_bytes(path.read_bytes().replace(b'"kills": [', b'"kills": ["no-such-bug", ', 1))
    assert any(f"{name}/manifest.json differs" == line for line in generate.differences(folder, made))
    kept = generate.make(jobs=1, kills_in=folder)
    assert b"no-such-bug" in kept[name]["manifest.json"]
    assert main(["generate", "--without-kills", "--vectors", str(folder), "--quiet"]) == 2
    assert "--without-kills goes with --check" in capsys.readouterr().err


@pytest.mark.exhaustive
@pytest.mark.parametrize(("jobs", "said"), [(1, "9 made"), (2, "not from standard input; `gsvc-conformance")])
def test_processes_that_cannot_start_end_with_a_sentence(jobs, said):
    script = FROM_STANDARD_INPUT.replace("JOBS", str(jobs))
    done = subprocess.run(
        [sys.executable, "-"], input=script, capture_output=True, text=True, timeout=120, cwd=VECTORS.parent
    )
    assert said in (done.stderr if done.returncode else done.stdout)
    assert done.returncode == (0 if jobs == 1 else 1)


def test_a_vector_of_a_set_stays_without_its_case(folder, made, monkeypatch):
    write_set(folder, 1, made)
    first, *rest = made
    fewer = {name: made[name] for name in rest}
    monkeypatch.setattr(generate, "make", lambda **_: dict(fewer))
    assert generate.generate(folder) == len(rest)
    assert (folder / first / "manifest.json").read_bytes() == made[first]["manifest.json"]
    assert generate.differences(folder, fewer) == []
    write_set(folder, 2, fewer)
    assert generate.generate(folder) == len(rest)
    assert (folder / first / "manifest.json").exists()
    assert first not in (folder / "COVERAGE.md").read_text()  # a withdrawn vector covers nothing
    with pytest.raises(UsageError, match=f"{first} was withdrawn, and its id is never used again"):
        generate.differences(folder, made)


def test_another_vector_under_an_id_of_a_set_is_not_written(folder, made, monkeypatch):
    write_set(folder, 1, made)
    manifest = json.loads(made[NAMES[0]]["manifest.json"])
    manifest["inputs"]["width"] = {"value": 3}
    other = {**made, NAMES[0]: {**made[NAMES[0]], "manifest.json": json.dumps(manifest).encode()}}
    monkeypatch.setattr(generate, "make", lambda **_: dict(other))
    with pytest.raises(UsageError, match="is not what set 1 means by this name, which never changes: give the case"):
        generate.generate(folder)
    assert (folder / NAMES[0] / "manifest.json").read_bytes() == made[NAMES[0]]["manifest.json"]


def write_set(folder, number, made):
    """Write the list of a set of these vectors."""
    (folder / "sets").mkdir(exist_ok=True)
    digests = {name: digest(json.loads(files["manifest.json"])) for name, files in made.items()}
    (folder / "sets" / f"{number}.txt").write_bytes(list_of(digests))
