"""The command ``gsvc accuracy``."""

import json

import numpy as np
import pytest
from PIL import Image

from gsvc_lab.accuracy.tables import BEGIN, END
from gsvc_ref.cli import main

QUICK = ["--group", "cutoff", "--seconds", "0.1", "--repeats", "1", "--quiet"]


@pytest.fixture(scope="module")
def picture(tmp_path_factory):
    path = tmp_path_factory.mktemp("picture") / "small.png"
    rng = np.random.default_rng(0)
    Image.fromarray(rng.integers(0, 256, (16, 24, 3), dtype=np.uint8)).save(path)
    return path


def test_a_table(picture, capsys):
    assert main(["accuracy", str(picture), *QUICK]) == 0
    out = capsys.readouterr().out
    assert "1/255 (reference)" in out
    assert "small.png, 24x16, 9 splats" in out
    assert "Threads" not in out


def test_json_alone(picture, capsys):
    assert main(["accuracy", str(picture), *QUICK, "--json"]) == 0
    captured = capsys.readouterr()
    found = json.loads(captured.out)
    assert [group["name"] for group in found["groups"]] == ["cutoff"]
    assert captured.err == ""


def test_a_page_and_markdown(picture, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "page.md").write_text(f"{BEGIN}\n{END}\n", encoding="utf-8")
    assert main(["accuracy", str(picture), *QUICK, "--plot", "--markdown", "page.md"]) == 0
    assert "accuracy.html: " in capsys.readouterr().out
    assert "--group cutoff --plot" in (tmp_path / "accuracy.html").read_text(encoding="utf-8")
    assert "| none |" in (tmp_path / "page.md").read_text(encoding="utf-8")
    assert main(["accuracy", str(picture), *QUICK, "--json", "-o", "other.html"]) == 0
    json.loads(capsys.readouterr().out)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["accuracy.html", "other.html", "page.md"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--scene", "dog"], "there is no scene 'dog'; there are demo, astronaut"),
        (["--group", "speed"], "there is no group 'speed'; there are precision, threads"),
        (["--group", ","], "names no group"),
        (["missing.png"], "there is no file 'missing.png'"),
        (["small.png", "--scene", "demo"], "give one of them"),
        (["small.png", "--frame", "7"], "has no frame 7"),
        (["--frame", "-1"], "frames are counted from 0"),
        (["--seconds", "0"], "not above 0"),
        (["--repeats", "0"], "repeats 0"),
        (["-o", "-"], "-o accuracy.html"),
        (["-o", "no/page.html"], "mkdir -p no"),
        (["--plot", "--markdown", "small.png.md"], "small.png.md"),
        (["--markdown", "plain.md"], "gsvc accuracy --markdown"),
    ],
)
def test_wrong_use(picture, tmp_path, monkeypatch, capsys, arguments, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.png").write_bytes(picture.read_bytes())
    (tmp_path / "plain.md").write_text("no markers\n", encoding="utf-8")
    assert main(["accuracy", "--quiet", *arguments]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.startswith("gsvc accuracy: ")
    assert error.count("\n") == 1
    assert not (tmp_path / "accuracy.html").exists()
