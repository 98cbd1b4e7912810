"""``gsvc encode``: goals of a whole clip, another size and frame rate, and dry runs."""

import json

import pytest

from gsvc_base.cli.arguments import amount, amount_of_bytes, scale
from gsvc_ref.cli import main

FEW = ["--key-frames", "2", "--threads", "1"]


@pytest.mark.parametrize(
    ("text", "value"),
    [("500k", 500e3), ("1.5M", 1.5e6), ("2Mi", 2 << 20), ("3Ki", 3072), ("800", 800), ("1G", 1e9), ("0.5K", 500)],
)
def test_amounts(text, value):
    assert amount(text) == value
    assert amount_of_bytes(text) == value


@pytest.mark.parametrize(("text", "value"), [("0.5", 0.5), ("2", 2.0), ("640x360", (640, 360))])
def test_scales(text, value):
    assert scale(text) == value


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--bitrate", "0"], "not an amount above 0"),
        (["--bitrate", "-5k"], "expected one argument"),
        (["--size", "2T"], "not an amount above 0"),
        (["--size", "1e6"], "not an amount above 0"),
        (["--scale", "0"], "neither a factor above 0"),
        (["--scale", "4y3"], "neither a factor above 0"),
        (["--scale", "0x9"], "not a size"),
        (["--scale", "100"], "the scale is 100"),
        (["--fps", "0"], "not a frame rate"),
        (["--fps", "90000"], "times the 24 of the source"),
        (["--bitrate", "1M", "--psnr", "30"], "bitrate is a goal of the whole clip, and psnr is another"),
        (["--size", "1M", "--live"], "a live stream is written at once"),
        (["--psnr-mean", "0"], "mean_psnr is 0"),
        (["--vmaf", "101"], "vmaf is 101"),
    ],
)
def test_what_cannot_be_is_refused_with_a_sentence(clip, tmp_path, capsys, options, message):
    output = tmp_path / "out.gsvc"
    assert main(["encode", str(clip), str(output), *options]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not output.exists()


def test_a_size_at_another_size_and_rate(clip, tmp_path, capsys):
    output = tmp_path / "out.gsvc"
    options = ["--size", "750", "--scale", "24x18", "--fps", "12", *FEW]
    assert main(["encode", str(clip), str(output), *options]) == 0
    said = capsys.readouterr().out
    assert "24x18, 2 frames, 12 frames/s" in said
    assert said.count("scaled from 32x24 to 24x18") == said.count("from 24 to 12 frames per second") == 1
    assert "750 bytes with at most about" in said
    assert f"asked for 750 bytes, got {output.stat().st_size:,}" in said
    assert abs(output.stat().st_size / 750 - 1) <= 0.03


def test_a_scaled_file_is_compared_with_its_source(clip, tmp_path, capsys):
    output, page = tmp_path / "out.gsvc", tmp_path / "page.html"
    options = ["--scale", "0.5", "--splats", "8", "--report", str(page), *FEW]
    assert main(["encode", str(clip), str(output), *options]) == 0
    said = capsys.readouterr().out
    assert f"  next: gsvc view {output} {clip}\n" in said
    assert "x264 is not compared with a file that was resampled" in page.read_text()
    assert main(["compare", str(clip), str(output), "--json"]) == 0
    compared = [frame["psnr"] for frame in json.loads(capsys.readouterr().out)["frames"]]
    assert main(["encode", str(clip), str(output), *options, "--json"]) == 0
    encoded = [frame["psnr"] for frame in json.loads(capsys.readouterr().out)["frames"]]
    assert compared == pytest.approx(encoded, abs=1e-3)


@pytest.mark.parametrize("jobs", ["0", "-3", "1025"])
def test_a_dry_run_refuses_the_jobs_that_an_encode_refuses(clip, capsys, jobs):
    assert main(["encode", str(clip), "--dry-run", f"--jobs={jobs}"]) == 2
    assert f"jobs is {jobs}; it must be a whole number in 1..1024" in capsys.readouterr().err


def test_a_dry_run_writes_nothing(clip, capsys):
    before = sorted(clip.parent.iterdir())
    assert main(["encode", str(clip), "--dry-run", "--splats", "12", *FEW]) == 0
    said = capsys.readouterr().out
    assert "likely, by 4 frames that were encoded and thrown away" in said
    assert main(["encode", str(clip), "--dry-run", "--splats", "12", "--json", *FEW]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["frames"] == 4
    assert found["file_bytes"]["low"] < found["file_bytes"]["likely"] < found["file_bytes"]["high"]
    assert found["level"] == 1
    assert sorted(clip.parent.iterdir()) == before
