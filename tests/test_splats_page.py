"""docs/splats-in-and-out.md: its blocks of Python run, its commands are commands."""

import re
from pathlib import Path

import numpy as np

import gsvc_ref
from gsvc_ref.cli import build_parser, main

PAGE = (Path(__file__).parents[1] / "docs" / "splats-in-and-out.md").read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)


def test_the_blocks_of_python_run_one_after_the_other(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    for block in blocks("python"):
        exec(compile(block, "splats-in-and-out.md", "exec"), names)
    said = capsys.readouterr().out.splitlines()
    assert [line.split()[:2] for line in said[:2]] == [["I", "200"], ["P", "200"]]
    assert said[2] == "[('I', 0), ('P', 1)]"
    assert [picture.shape for picture in names["pictures"]] == [(120, 160, 3)] * 2
    assert np.allclose(names["pictures"][0], gsvc_ref.render(names["splats"], 160, 120), atol=0.05)
    assert main(["import", "mine.npz", "mine.gsvc", "--quiet"]) == 0
    assert len(list(gsvc_ref.decode("mine.gsvc"))) == 2


def test_the_commands_parse():
    lines = [line.split()[1:] for line in "".join(blocks("sh")).splitlines() if line.startswith("gsvc ")]
    assert {build_parser().parse_args(line).command for line in lines} == {"import", "export"}
