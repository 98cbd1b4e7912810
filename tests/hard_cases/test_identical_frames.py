"""Frames that come back identical have an infinite PSNR, which strict JSON cannot hold and pages have to name."""

import json
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from gsvc_ref.cli import main
from gsvc_ref.video import ColorDescription, VideoFormat, open_writer

COLOR = ColorDescription(primaries=1, transfer=1, matrix=1, full_range=False, chroma_location=0)
QUICK = ["--splats", "4", "--key-frames", "2", "--quiet"]


def refuse(constant: str) -> None:
    raise AssertionError(f"{constant} is not strict JSON")


def printed(capsys: pytest.CaptureFixture[str], *command: str | Path) -> dict:
    capsys.readouterr()
    assert main([str(part) for part in command]) == 0
    return json.loads(capsys.readouterr().out, parse_constant=refuse)


@pytest.fixture(scope="module")
def black(tmp_path_factory) -> Path:
    """Three black frames, which splats of any kind without light show exactly."""
    path = tmp_path_factory.mktemp("black") / "black.y4m"
    with open_writer(path, VideoFormat(16, 12, Fraction(24), 8, "420", COLOR)) as writer:
        for _ in range(3):
            writer.write(np.zeros((12, 16, 3), np.uint8))
    return path


def test_reports_of_commands_are_strict_json(black, tmp_path, capsys):
    stream = tmp_path / "black.gsvc"
    report = printed(capsys, "encode", black, stream, *QUICK, "--json")
    assert report["mean_psnr"] is None
    assert [frame["psnr"] for frame in report["frames"]] == [None] * 3
    scores = printed(capsys, "compare", black, stream, "--no-vmaf", "--quiet", "--json")
    assert scores["identical_frames"] == 3
    assert scores["mean"]["psnr"] is scores["mean"]["psnr_of_mean_mse"] is None
    assert scores["mean"]["ms_ssim"] == 1
    assert [(frame["mse"], frame["psnr"], frame["identical"]) for frame in scores["frames"]] == [(0, None, True)] * 3
    assert len(printed(capsys, "info", stream, "--json")["frames"]) == 3


def test_people_read_that_frames_are_identical(black, tmp_path, capsys):
    stream = tmp_path / "black.gsvc"
    assert main(["encode", str(black), str(stream), *QUICK[:-1]]) == 0
    assert "infinite (identical frames)" in capsys.readouterr().out
    assert main(["compare", str(black), str(stream), "--no-vmaf"]) == 0
    assert "identical: 3 frames equal in every sample" in capsys.readouterr().out
