"""docs/splats-in-and-out.md: its blocks of Python run, its commands are commands."""

import re
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np

import gsvc_ref
from gsvc_ref.cli import build_parser, main
from gsvc_ref.metrics import psnr

PAGE = (Path(__file__).parents[1] / "docs" / "splats-in-and-out.md").read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)


class Tensor:
    """What the page asks of a tensor."""

    def __init__(self, values):
        self.values = np.asarray(values, np.float32)

    def double(self):
        return self

    def numpy(self):
        return self.values.astype(np.float64)


def checkpoint(frames):
    """Splats of frames of 160 x 120 as GSVC's authors save them: `frame_10` is last, signs are open."""
    states = {}
    for number, rows in frames.items():
        signs = np.where(np.arange(len(rows)) % 3 == 0, -1, 1)[:, None]
        states[f"frame_{number}"] = {
            "_xyz": Tensor(np.arctanh((rows[:, :2] - 0.5) / (160, 120) * 2 - 1)),
            "_cholesky": Tensor(rows[:, 2:5] * signs - (0.5, 0, 0.5)),
            "cholesky_bound": Tensor([[0.5, 0, 0.5]]),
            "_features_dc": Tensor(rows[:, 5:]),
            "_opacity": Tensor(np.ones((len(rows), 1))),
        }
    return states


THEIRS = {
    number: np.random.default_rng(number).uniform(
        [9, 9, 2, -2, 2, 0, 0, 0], [150, 110, 9, 2, 9, 0.4, 0.4, 0.4], (50, 8)
    )
    for number in (1, 2, 10)
}


def test_the_blocks_of_python_run_one_after_the_other(tmp_path, monkeypatch, capsys):
    """The checkpoint is handed over without PyTorch, which would read it."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "torch", SimpleNamespace(load=lambda name, **_: checkpoint(THEIRS)))
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
    assert main(["import", "theirs.npz", "theirs.gsvc", "--degenerate", "turn", "--quiet"]) == 0
    for rows, frame in zip(THEIRS.values(), gsvc_ref.decode("theirs.gsvc"), strict=True):
        assert psnr(gsvc_ref.render_frame(rows, 160, 120, 8), frame, 255) >= 48


def test_the_commands_parse():
    lines = [line.split()[1:] for line in "".join(blocks("sh")).splitlines() if line.startswith("gsvc ")]
    assert {build_parser().parse_args(line).command for line in lines} == {"import", "export"}
