"""``gsvc-conformance export --fluster``: suites in fluster's format, and fluster itself runs them."""

import hashlib
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gsvc_base.draws import Draws
from gsvc_conformance import fluster
from gsvc_conformance.__main__ import main
from gsvc_conformance.case import TIERS, cases
from gsvc_conformance.cases.faults import overview
from gsvc_conformance.fluster import DECODER, FORMATS, OPERATIONS, SUITES, raw_video
from gsvc_conformance.profiles import PROFILES, profile_of
from gsvc_conformance.vector import files_of, sums_of
from gsvc_ref import decode_stream_deterministic
from gsvc_ref.stream import decode

CHOSEN = {
    "GSVC-paper": ("bit_depth_8", "bit_depth_10", "bit_depth_16", "overview"),
    "GSVC-main": ("main_bit_depth_12", "main_picture_of_one_splat", "main_picture_of_the_base"),
    "GSVC-layers": ("quality_0", "quality_2"),
}
"""Some vectors of each suite."""
RUN = """\
import sys
sys.path.insert(0, sys.argv.pop(1))
import gsvc
from fluster.main import fluster_main
fluster_main()
"""
"""Fluster with the decoder class from beside it, and not from its own folder, so that no installation is changed."""


def operation_of(suite: str) -> str:
    """The operation whose vectors make a suite."""
    return OPERATIONS[suite == "GSVC-layers"]


@pytest.fixture(scope="module")
def some_vectors(tmp_path_factory) -> Path:
    """A few of the golden vectors."""
    folder = tmp_path_factory.mktemp("vectors")
    chosen = [f"core/{operation_of(suite)}/{name}" for suite, names in CHOSEN.items() for name in names]
    files = {name: files_of(cases()[name], *cases()[name].run()) for name in chosen}
    for name, parts in files.items():
        (folder / name).mkdir(parents=True)
        for part, data in parts.items():
            (folder / name / part).write_bytes(data)
    (folder / "SHA256SUMS").write_bytes(sums_of(files))
    return folder


@pytest.fixture(scope="module")
def suite(some_vectors, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("fluster") / "new"
    assert main(["export", "--vectors", str(some_vectors), "--fluster", str(folder)]) == 0
    return folder


def listed(folder: Path, suite: str) -> dict[str, dict]:
    """The test vectors of a suite, by name."""
    return {
        test["name"].removeprefix("core-"): test
        for test in json.loads((folder / f"test_suites/{suite}.json").read_text())["test_vectors"]
    }


@pytest.mark.parametrize("name", SUITES)
def test_a_suite_has_the_fields_of_fluster(suite, name):
    data = json.loads((suite / f"test_suites/{name}.json").read_text())
    assert data.keys() == {"name", "codec", "description", "test_method", "test_vectors"}
    assert (data["name"], data["codec"], data["test_method"]) == (name, "None", "md5")
    found = listed(suite, name)
    assert list(found) == sorted(CHOSEN[name])
    fields = {"name", "source", "source_checksum", "input_file", "output_format", "result"}
    for test in found.values():
        assert test.keys() == fields | ({"optional_params"} if name == "GSVC-layers" else set())
        layer = test.get("optional_params", {"layer": 0})["layer"]
        stream = (suite / test["source"]).read_bytes()
        assert suite / "resources" / name / test["name"] / test["input_file"] == suite / test["source"]
        assert hashlib.md5(stream).hexdigest() == test["source_checksum"]
        frames = np.stack(list(decode(stream, precision="deterministic", layer=layer)))
        assert hashlib.md5(raw_video(frames)).hexdigest() == test["result"]
    assert (suite / "decoders/gsvc.py").read_text() == DECODER.read_text()


def test_formats_and_layers_of_listed(suite):
    formats = {name: test["output_format"] for name, test in listed(suite, "GSVC-paper").items()}
    assert formats == {"bit_depth_8": "gbrp", "bit_depth_10": "gbrp10le", "bit_depth_16": "Unknown", "overview": "gbrp"}
    layers = {name: test["optional_params"] for name, test in listed(suite, "GSVC-layers").items()}
    assert layers == {"quality_0": {"layer": 0}, "quality_2": {"layer": 2}}
    same = listed(suite, "GSVC-layers")
    assert same["quality_0"]["source_checksum"] == same["quality_2"]["source_checksum"]
    assert same["quality_0"]["result"] != same["quality_2"]["result"]


@pytest.mark.parametrize("profile", PROFILES)
def test_each_profile_has_thirty_streams(profile):
    of_suite = [case for case in cases().values() if case.operation.name == OPERATIONS[0] and case.tier in TIERS]
    assert sum(profile_of(case.operation, next(made(case))) == profile for case in of_suite) >= 30


def made(case):
    """The steps of a case, of which the first gives its inputs."""
    extra = {} if case.seed is None else {"rng": Draws(case.seed)}
    return case.function(**case.arguments, **extra)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_raw_video_is_planes_of_green_blue_and_red(dtype):
    frames = np.arange(2 * 2 * 3 * 3).reshape(2, 2, 3, 3).astype(dtype)
    data = np.frombuffer(raw_video(frames), np.dtype(dtype).newbyteorder("<"))
    green, blue, red = data[:6], data[6:12], data[12:18]
    assert green.tolist() == frames[0, ..., 1].ravel().tolist()
    assert blue.tolist() == frames[0, ..., 2].ravel().tolist()
    assert red.tolist() == frames[0, ..., 0].ravel().tolist()
    assert data[18:24].tolist() == frames[1, ..., 1].ravel().tolist()


def test_the_module_decodes_to_raw_video(tmp_path):
    source, target = tmp_path / "a.gsvc", tmp_path / "a.raw"
    said: list[str] = []
    source.write_bytes(overview())
    assert fluster.main([str(source), str(target)], said.append) == 0
    assert target.read_bytes() == raw_video(decode_stream_deterministic(overview()))
    source.write_bytes(overview()[:-1])
    assert fluster.main([str(source), str(target)], said.append) == 1
    assert said == [f"{source}: malformed R-6.2-4 {8 * (len(overview()) - 4)}"]
    assert fluster.main([], said.append) == 2
    assert fluster.main([str(source), str(target), "4"], said.append) == 2


def test_the_module_decodes_up_to_a_layer(suite, tmp_path):
    for name, test in listed(suite, "GSVC-layers").items():
        target = tmp_path / f"{name}.raw"
        words = [str(suite / test["source"]), str(target), str(test["optional_params"]["layer"])]
        assert fluster.main(words) == 0
        assert hashlib.md5(target.read_bytes()).hexdigest() == test["result"]


def test_a_folder_with_something_in_it_is_left_alone(some_vectors, tmp_path, capsys):
    (tmp_path / "mine").write_text("x")
    assert main(["export", "--vectors", str(some_vectors), "--fluster", str(tmp_path)]) == 2
    assert "is not empty; give the name of a new folder" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]


def run_fluster(suite: Path, tmp_path: Path, monkeypatch, name: str, decoder: str, command: str = "") -> str:
    """What fluster prints of a run of the suite of a name."""
    pytest.importorskip("fluster")
    monkeypatch.setenv("GSVC_DECODER", command)
    folders = ["-ne", "-tsd", str(suite / "test_suites"), "-r", str(suite / "resources"), "-o", str(tmp_path / "out")]
    words = [
        sys.executable,
        "-c",
        RUN,
        str(suite / "decoders"),
        *folders,
        "run",
        "-ts",
        name,
        "-d",
        decoder,
        "-j",
        "1",
    ]
    return subprocess.run(words, capture_output=True, text=True, timeout=120, cwd=tmp_path).stdout


def test_fluster_knows_the_formats():
    codec = pytest.importorskip("fluster.codec")
    assert {codec.OutputFormat(name) for name in (*FORMATS.values(), fluster.OTHER_FORMAT)}
    assert codec.Codec(fluster.CODEC) is codec.Codec.NONE


@pytest.mark.parametrize("name", SUITES)
def test_fluster_passes_the_decoder_inside_spec_md(suite, tmp_path, monkeypatch, name):
    count = len(CHOSEN[name])
    assert f"Ran {count}/{count} tests successfully" in run_fluster(suite, tmp_path, monkeypatch, name, "GSVC-spec")


def test_fluster_fails_a_decoder_that_shows_the_base_alone(suite, tmp_path, monkeypatch):
    program = tmp_path / "base.py"
    program.write_text("import sys; from gsvc_conformance.fluster import main; sys.exit(main(sys.argv[1:3]))")
    said = run_fluster(suite, tmp_path, monkeypatch, "GSVC-layers", "GSVC", f"{sys.executable} {program}")
    assert re.search(r"core-quality_0 +\.\.\. Success", said)
    assert re.search(r"core-quality_2 +\.\.\. Fail", said)


def test_fluster_fails_a_wrong_decoder_and_hears_what_is_unsupported(suite, tmp_path, monkeypatch):
    program = tmp_path / "wrong.py"
    program.write_text(
        "import sys; open(sys.argv[2], 'wb').write(bytes(9)); sys.exit(77 if 'bit_' in sys.argv[1] else 0)"
    )
    said = run_fluster(suite, tmp_path, monkeypatch, "GSVC-paper", "GSVC", f"{sys.executable} {program}")
    assert "Ran 0/4 tests successfully, 3 not supported" in said
    assert re.search(r"core-overview +\.\.\. Fail", said)
