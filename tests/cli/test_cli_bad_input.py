"""The bad inputs that the commands must meet with a clear message, the right exit code and no half-written file."""

import stat
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import QUICK, video_format, write_clip
from PIL import Image

import gsvc_ref
from gsvc_base.errors import UsageError
from gsvc_ref.cli import main

FULL_DISK = Path("/dev/full")


@pytest.fixture
def fails(capsys, tmp_path):
    """Run a command that must fail: its message. Nothing may be left behind in the test's folder."""

    def run(status, *arguments):
        before = set(tmp_path.rglob("*"))
        assert main([str(argument) for argument in arguments]) == status
        assert set(tmp_path.rglob("*")) == before
        lines = capsys.readouterr().err.splitlines(keepends=True)
        error = "".join(line for line in lines if ": compiling kernels for this command" not in line)
        assert error.startswith(f"gsvc {arguments[0]}: ")
        assert error.count("\n") == 1
        return error

    return run


@pytest.mark.parametrize("command", ["encode", "decode", "info", "compare"])
def test_missing_file(fails, tmp_path, command):
    missing = tmp_path / "missing.gsvc"
    targets = [] if command == "info" else [tmp_path / "out"]
    assert str(missing) in fails(2, command, missing, *targets)


def test_folder_without_pictures(fails, tmp_path):
    folder = tmp_path / "folder"
    folder.mkdir()
    assert ".png" in fails(1, "encode", folder, tmp_path / "out.gsvc")


@pytest.mark.parametrize("command", ["decode", "info"])
def test_folder_where_a_stream_must_be(fails, tmp_path, command):
    targets = [] if command == "info" else [tmp_path / "out"]
    assert "is a folder" in fails(2, command, tmp_path, *targets)


@pytest.mark.parametrize("command", ["encode", "decode", "info"])
def test_text_file(fails, tmp_path, command):
    if command == "encode":
        pytest.importorskip("av")
    text = tmp_path / "text.txt"
    text.write_text("Dear reader,\nthis is no video.\n")
    targets = [] if command == "info" else [tmp_path / ("out.gsvc" if command == "encode" else "out.y4m")]
    assert "text.txt" in fails(1, command, text, *targets)


def test_zero_frames(fails, tmp_path):
    empty = write_clip(tmp_path / "empty.y4m", frames=1)
    empty.write_bytes(empty.read_bytes().splitlines(keepends=True)[0])
    assert "no frames" in fails(1, "encode", empty, tmp_path / "out.gsvc", "--quiet")


def test_empty_file(fails, tmp_path):
    (tmp_path / "empty.mp4").touch()
    assert "is empty" in fails(1, "encode", tmp_path / "empty.mp4", tmp_path / "out.gsvc")
    assert "empty.mp4" in fails(1, "info", tmp_path / "empty.mp4")


@pytest.mark.parametrize(("width", "height"), [(1, 1), (7, 5)])
def test_smallest_and_odd_sizes_work(tmp_path, width, height):
    source = write_clip(tmp_path / "odd.y4m", frames=2, width=width, height=height)
    stream, decoded = tmp_path / "odd.gsvc", tmp_path / "odd_decoded.y4m"
    assert main(["encode", str(source), str(stream), "--splats", "1", "--quiet"]) == 0
    assert main(["decode", str(stream), str(decoded), "--quiet"]) == 0
    assert decoded.stat().st_size == source.stat().st_size


def picture(path, width, height, channels=3):
    rng = np.random.default_rng(width)
    Image.fromarray(rng.integers(0, 256, (height, width, channels), dtype=np.uint8)).save(path)


def test_frames_that_change_size_end_the_stream(capsys, tmp_path):
    folder = tmp_path / "frames"
    folder.mkdir()
    picture(folder / "1.png", 16, 12)
    picture(folder / "2.png", 16, 14)
    assert main(["encode", str(folder), str(tmp_path / "out.gsvc"), *QUICK]) == 1
    message = capsys.readouterr().err
    assert "16x12" in message
    assert "16x14" in message
    assert message.endswith("saved: 1 complete frame, as a valid stream\n")
    assert main(["info", str(tmp_path / "out.gsvc")]) == 0


def test_alpha_channel(fails, tmp_path):
    picture(tmp_path / "alpha.png", 16, 12, channels=4)
    message = fails(1, "encode", tmp_path / "alpha.png", tmp_path / "out.gsvc")
    assert "alpha" in message or "transparen" in message


def test_twelve_bits_stay_twelve_bits(tmp_path):
    source = write_clip(tmp_path / "deep.y4m", frames=2, bit_depth=12)
    stream, decoded = tmp_path / "deep.gsvc", tmp_path / "deep_decoded.y4m"
    assert main(["encode", str(source), str(stream), *QUICK]) == 0
    assert main(["decode", str(stream), str(decoded), "--quiet"]) == 0
    with gsvc_ref.open(stream) as opened:
        assert opened.header.bit_depth == 12
    assert b" C420p12 " in decoded.read_bytes()[:200]


@pytest.mark.skipif(not FULL_DISK.exists(), reason="the system has no /dev/full")
@pytest.mark.parametrize("command", ["encode", "decode"])
def test_full_disk(fails, request, command):
    source = request.getfixturevalue("clip" if command == "encode" else "stream")
    options = QUICK if command == "encode" else ["--quiet"]
    assert "No space left" in fails(1, command, source, FULL_DISK, *options)
    assert stat.S_ISCHR(FULL_DISK.stat().st_mode)


@pytest.mark.parametrize("command", ["encode", "decode"])
def test_output_folder_that_does_not_exist(fails, request, tmp_path, command):
    source = request.getfixturevalue("clip" if command == "encode" else "stream")
    message = fails(2, command, source, tmp_path / "no" / "out.y4m")
    assert f"mkdir -p {tmp_path / 'no'}" in message


def test_output_that_is_a_folder_or_the_input(fails, clip, tmp_path):
    (tmp_path / "folder").mkdir()
    assert "is a folder" in fails(2, "encode", clip, tmp_path / "folder")
    assert "the input itself" in fails(2, "encode", clip, clip)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--splats", "0"], "splats is 0"),
        (["--splats", "-3"], "splats is -3"),
        (["--splats", "769"], "768 pixels"),
        (["--psnr", "nan"], "finite"),
        (["--psnr", "0"], "psnr is 0"),
        (["--profile", "paper", "--iterations", "0"], "iterations is 0"),
        (["--iterations", "9"], "iterations is a setting of profile paper"),
        (["--cholesky-bits", "9"], "cholesky_bits is a setting of profile paper"),
        (["--profile", "paper", "--quality", "9"], "quality is a setting of profile main"),
        (["--quality", "80"], "quality is 80; it must be in 0..79"),
        (["--quality", "30", "--psnr", "30"], "give one of them"),
        (["--preset", "slow", "--profile", "paper"], "preset slow writes profile main only"),
        (["--preset", "paper", "--profile", "main"], "preset paper writes profile paper only"),
        (["--effects", "all"], "regions=all is of profile paper"),
        (["--effects", "auto,gsp=off"], "gsp=off is of profile paper"),
        (["--key-frames", "0"], "key_frames is 0"),
        (["--key-frames", "never"], "'never'"),
        (["--frames", "9-12"], "'9-12'"),
        (["--lanes", "4097"], "lane_count is 4097"),
        (["--lanes", "by-size:x%"], "by-size:P% with P below 100"),
        (["--lanes", "by-size", "--profile", "paper"], "in profile paper it is a number"),
        (["--preset", "best"], "'best'"),
        (["--spalts", "9"], "--spalts"),
    ],
)
def test_settings_out_of_range(fails, clip, tmp_path, options, words):
    assert words in fails(2, "encode", clip, tmp_path / "out.gsvc", *options)


def test_frames_beyond_the_end(fails, clip, stream, tmp_path):
    said = fails(1, "encode", clip, tmp_path / "out.gsvc", "--frames", "9:12", "--quiet")
    assert "the source ends before frame 9" in said
    assert "4 frames" in fails(2, "decode", stream, tmp_path / "out.y4m", "--frames", "9:12")


def test_a_stream_is_not_encoded_again(fails, stream, tmp_path):
    assert "decode it first" in fails(2, "encode", stream, tmp_path / "out.gsvc")


def test_a_video_is_not_decoded(fails, clip, tmp_path):
    assert "encode it first" in fails(1, "decode", clip, tmp_path / "out.y4m")


def test_videos_that_cannot_be_compared(fails, clip, tmp_path):
    small = write_clip(tmp_path / "small.y4m", frames=1, width=16, height=16)
    deep = write_clip(tmp_path / "deep.y4m", frames=1, bit_depth=10)
    assert "32x24" in fails(1, "compare", clip, small)
    assert "10" in fails(2, "compare", clip, deep)
    assert "standard input" in fails(2, "compare", "-", "-")


def test_a_report_and_a_stream_cannot_share_standard_output(fails, clip):
    assert "--json" in fails(2, "encode", clip, "-", "--json")


def test_nan_in_a_picture_is_refused_by_the_api(tmp_path):
    frame = np.full((24, 32, 3), np.nan, np.float32)
    with pytest.raises(UsageError, match="frame 0"):
        gsvc_ref.encode(([frame], video_format()), tmp_path / "out.gsvc")
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_command(capsys):
    assert main(["encod"]) == 2
    assert "'encod'" in capsys.readouterr().err


def test_what_is_read_is_not_written_over(fails, clip, tmp_path, monkeypatch):
    source = tmp_path / "same.y4m"
    source.write_bytes(clip.read_bytes())
    with source.open() as file:
        monkeypatch.setattr(sys, "stdin", file)
        assert "the input itself" in fails(2, "encode", "-", source, "--live")
    assert source.read_bytes() == clip.read_bytes()
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    Image.new("RGB", (8, 8)).save(pictures / "1.png")
    assert "the input itself" in fails(2, "encode", pictures, pictures / "1.png")
