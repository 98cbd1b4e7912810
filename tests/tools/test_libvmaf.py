import builtins
import json
import subprocess
from fractions import Fraction

import numpy as np
import pytest

from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.metrics import Vmaf
from gsvc_tools.libvmaf import MIN_SIDE, VmafMeter, ffmpeg_with_libvmaf, vmaf

needs_libvmaf = pytest.mark.skipif(ffmpeg_with_libvmaf()[0] is None, reason="no ffmpeg with libvmaf here")
RATE = Fraction(24)


def clip(count, height=48, width=64, peak=255):
    rng = np.random.default_rng(5)
    walk = rng.normal(size=(height, width + count, 3)).cumsum(axis=0).cumsum(axis=1)
    walk = np.rint((walk - walk.min()) / np.ptp(walk) * peak).astype(np.uint8 if peak <= 255 else np.uint16)
    return [walk[:, shift : shift + width] for shift in range(count)]


def noisy(frames, deviation, peak=255):
    rng = np.random.default_rng(6)
    return [np.clip(f + rng.normal(size=f.shape) * deviation, 0, peak).astype(f.dtype) for f in frames]


@needs_libvmaf
def test_identical_frames_score_high_and_noise_lowers_the_score():
    original = clip(3)
    means = []
    for deviation in (0, 8, 32):
        result = vmaf(iter(original), iter(noisy(original, deviation)), RATE)
        assert result.reason is None
        assert len(result.scores) == 3
        assert result.mean == pytest.approx(sum(result.scores) / 3, abs=1e-12)
        means.append(result.mean)
    assert means[0] > 97
    assert means[0] > means[1] + 1 > means[2] + 2


@needs_libvmaf
def test_scores_are_those_of_ffmpeg_on_two_files(tmp_path):
    original, worse = clip(3), noisy(clip(3), 20)
    inputs = []
    for name, frames in (("worse", worse), ("original", original)):  # libvmaf takes the distorted video first
        (tmp_path / name).write_bytes(b"".join(frame.tobytes() for frame in frames))
        inputs += ["-f", "rawvideo", "-pixel_format", "rgb24", "-video_size", "64x48", "-i", name]
    convert = "scale=out_color_matrix=bt709:out_range=tv:flags=bicubic+accurate_rnd+full_chroma_int,format=yuv420p"
    graph = f"[0]{convert}[a];[1]{convert}[b];[a][b]libvmaf=log_fmt=json:log_path=log.json"
    command = [ffmpeg_with_libvmaf()[0], "-loglevel", "error", *inputs, "-filter_complex", graph, "-f", "null", "-"]
    subprocess.run(command, cwd=tmp_path, check=True, timeout=60, stdin=subprocess.DEVNULL)
    log = json.loads((tmp_path / "log.json").read_text())
    expected = tuple(frame["metrics"]["vmaf"] for frame in log["frames"])
    assert vmaf(original, worse, RATE).scores == expected
    assert vmaf(worse, original, RATE).scores != expected


@needs_libvmaf
def test_ten_bits_of_the_same_picture_score_alike():
    original, worse = clip(2), noisy(clip(2), 10)
    deep = [[f.astype(np.uint16) * 4 for f in frames] for frames in (original, worse)]
    assert vmaf(*deep, RATE, peak=1020).mean == pytest.approx(vmaf(original, worse, RATE).mean, abs=0.5)


@needs_libvmaf
def test_odd_sizes_are_scored():
    assert len(vmaf(clip(2, 33, 37), clip(2, 33, 37), RATE).scores) == 2


def test_videos_of_different_length_are_refused():
    with pytest.raises(GsvcError, match="different numbers of frames") as caught:
        vmaf(clip(2), clip(3), RATE)
    assert caught.value.kind == "invalid"


def test_an_error_of_the_frames_source_passes_through():
    def broken():
        yield clip(1)[0]
        raise ValueError("the source broke")

    with pytest.raises(ValueError, match="the source broke"):
        vmaf(broken(), clip(3), RATE)


def test_without_the_package_the_reason_says_what_to_install(monkeypatch):
    real_import = builtins.__import__

    def no_imageio(name, *rest):
        if name == "imageio_ffmpeg":
            raise ImportError(name)
        return real_import(name, *rest)

    monkeypatch.setattr(builtins, "__import__", no_imageio)
    result = vmaf(clip(1), clip(1), RATE)
    assert (result.scores, result.mean) == (None, None)
    assert "gsvc_ref[bench]" in result.reason


@pytest.mark.parametrize(
    ("script", "words"),
    [
        ("exit 3", "does not run here"),
        ("echo ' .. scale V->V'", "ffmpeg with libvmaf"),
        (
            "case $2 in -filters) echo ' .. libvmaf VV->V';; *) cat >/dev/null; echo no model >&2; exit 1;; esac",
            "no model",
        ),
        ("case $2 in -filters) echo ' .. libvmaf VV->V';; *) cat >/dev/null; exit 7;; esac", "exit status 7"),
        ("case $2 in -filters) echo ' .. libvmaf VV->V';; *) exec 0<&-; echo gone >&2; exit 1;; esac", "gone"),
    ],
)
def test_a_program_that_fails_gives_a_reason(tmp_path, monkeypatch, script, words):
    pytest.importorskip("imageio_ffmpeg")
    program = tmp_path / "ffmpeg"
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o755)
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(program))
    frames = clip(3, 300, 400)  # more than a pipe holds
    result = vmaf(frames, frames, RATE)
    assert result.scores is None
    assert words in result.reason


def test_a_log_with_too_few_scores_is_not_believed(tmp_path, monkeypatch):
    pytest.importorskip("imageio_ffmpeg")
    log = json.dumps({"frames": [{"metrics": {"vmaf": 90.0}}]})
    program = tmp_path / "ffmpeg"
    program.write_text(
        f"#!/bin/sh\ncase $2 in -filters) echo ' .. libvmaf V';; *) cat >/dev/null; echo '{log}' >vmaf.json;; esac\n"
    )
    program.chmod(0o755)
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(program))
    assert vmaf(clip(2), clip(2), RATE) == Vmaf(None, None, "libvmaf scored 1 of 2 frames; VMAF is left out")


def test_small_frames_and_no_frames_have_no_score():
    small = clip(1, MIN_SIDE - 1, 64)
    assert vmaf(small, small, RATE).scores is None
    with VmafMeter(255, RATE) as meter:
        assert meter.finish().scores is None


def test_a_frame_rate_of_zero_is_refused():
    with pytest.raises(UsageError, match="frame rate"):
        VmafMeter(255, Fraction(0))
