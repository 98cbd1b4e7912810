"""``gsvc-conformance export --fluster``: a suite in fluster's format, and fluster itself runs it."""

import hashlib
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gsvc_conformance import fluster
from gsvc_conformance.__main__ import main
from gsvc_conformance.cases.faults import overview
from gsvc_conformance.fluster import DECODER, FORMATS, raw_video
from gsvc_conformance.vector import VECTORS, sums_of
from gsvc_ref import decode_stream_deterministic

CHOSEN = ("bit_depth_8", "bit_depth_10", "bit_depth_16", "overview")
RUN = """\
import sys
sys.path.insert(0, sys.argv.pop(1))
import gsvc
from fluster.main import fluster_main
fluster_main()
"""
"""Fluster with the decoder class from beside it, and not from its own folder, so that no installation is changed."""


@pytest.fixture(scope="module")
def some_vectors(tmp_path_factory) -> Path:
    """A few of the golden vectors."""
    folder = tmp_path_factory.mktemp("vectors")
    homes = {f"core/decode_stream_deterministic/{name}": None for name in CHOSEN}
    files = {name: {path.name: path.read_bytes() for path in (VECTORS / name).iterdir()} for name in homes}
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


def test_the_suite_has_the_fields_of_fluster(suite):
    data = json.loads((suite / "test_suites/GSVC.json").read_text())
    assert data.keys() == {"name", "codec", "description", "test_method", "test_vectors"}
    assert (data["name"], data["codec"], data["test_method"]) == ("GSVC", "None", "md5")
    found = {test["name"]: test for test in data["test_vectors"]}
    assert list(found) == [f"core-{name}" for name in sorted(CHOSEN)]
    for test in found.values():
        assert test.keys() == {"name", "source", "source_checksum", "input_file", "output_format", "result"}
        stream = (suite / test["source"]).read_bytes()
        assert suite / "resources/GSVC" / test["name"] / test["input_file"] == suite / test["source"]
        assert hashlib.md5(stream).hexdigest() == test["source_checksum"]
        assert hashlib.md5(raw_video(decode_stream_deterministic(stream))).hexdigest() == test["result"]
    formats = {name.removeprefix("core-"): test["output_format"] for name, test in found.items()}
    assert formats == {"bit_depth_8": "gbrp", "bit_depth_10": "gbrp10le", "bit_depth_16": "Unknown", "overview": "gbrp"}
    assert (suite / "decoders/gsvc.py").read_text() == DECODER.read_text()


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


def test_a_folder_with_something_in_it_is_left_alone(some_vectors, tmp_path, capsys):
    (tmp_path / "mine").write_text("x")
    assert main(["export", "--vectors", str(some_vectors), "--fluster", str(tmp_path)]) == 2
    assert "is not empty; give the name of a new folder" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]


def run_fluster(suite: Path, tmp_path: Path, monkeypatch, decoder: str, command: str = "") -> str:
    """What fluster prints of a run."""
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
        "GSVC",
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


def test_fluster_passes_the_decoder_inside_spec_md(suite, tmp_path, monkeypatch):
    assert f"Ran {len(CHOSEN)}/{len(CHOSEN)} tests successfully" in run_fluster(
        suite, tmp_path, monkeypatch, "GSVC-spec"
    )


def test_fluster_fails_a_wrong_decoder_and_hears_what_is_unsupported(suite, tmp_path, monkeypatch):
    program = tmp_path / "wrong.py"
    program.write_text(
        "import sys; open(sys.argv[2], 'wb').write(bytes(9)); sys.exit(77 if 'bit_' in sys.argv[1] else 0)"
    )
    said = run_fluster(suite, tmp_path, monkeypatch, "GSVC", f"{sys.executable} {program}")
    assert "Ran 0/4 tests successfully, 3 not supported" in said
    assert re.search(r"core-overview +\.\.\. Fail", said)
