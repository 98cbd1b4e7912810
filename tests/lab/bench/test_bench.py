"""``gsvc bench``: names, turns, the estimate, what Ctrl-C leaves, the page, and the whole on three tiny frames."""

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from html_pages import parsed

from gsvc_base.errors import UsageError
from gsvc_lab.bench import ffmpeg, planes, runner
from gsvc_lab.bench.measure import Point
from gsvc_lab.bench.page import bench_html
from gsvc_lab.bench.planes import PlanarClip
from gsvc_lab.cli import bench
from gsvc_ref.cli import main
from gsvc_ref.metrics import psnr
from gsvc_ref.video import ColorDescription, VideoFormat, open_video

needs_ffmpeg = pytest.mark.skipif(not ffmpeg.available(), reason="needs imageio-ffmpeg")

VIDEO = VideoFormat(64, 48, Fraction(25), 8, "420", ColorDescription(1, 1, 1, False, 0), frame_count=3)


@pytest.fixture
def clip(tmp_path):
    return PlanarClip("a <clip>", "drawn", tmp_path / "clip.yuv", VIDEO)


def entries(*names):
    return [runner.ENTRIES[name] for name in names]


def made_up(calls, fail=()):
    """In place of the coders: a point of a line that is twice as high in bits for GSVC."""

    def point(clip, entry, number, points, folder, threads, asked):
        calls.append((entry.name, number))
        if (entry.name, number) in fail:
            raise fail[entry.name, number]
        rate = (2 if entry.name == "gsvc" else 1) * 10.0**number
        quality = 30.0 + 10 * number
        return Point(f"Q {number}", 100, rate, quality, quality, 0.9 + number / 100, quality, 0.5, 0.5, 0.1), ["told"]

    return point


def test_coders_take_turns_from_coarse_to_fine(clip, tmp_path, monkeypatch):
    calls = []
    monkeypatch.setattr(runner, "_point", made_up(calls))
    seen = []
    found = runner.measure(clip, entries("gsvc", "x264"), 2, tmp_path, None, lambda *step: seen.append(step))
    assert calls == [("gsvc", 0), ("x264", 0), ("gsvc", 1), ("x264", 1)]
    assert (found.count, found.planned, found.interrupted) == (4, 4, False)
    assert seen[0][2] is None
    assert all(whole > spent for _, spent, whole in seen[1:])
    page = bench_html(found, entries("gsvc", "x264"), "gsvc bench 'a <clip>'")
    text = " ".join(parsed(page).text)
    assert "+100 %" in text
    assert "a <clip>: 3 frames of 64 × 48 pixels" in text
    assert "AVC (libx264), slow: told" in text


def test_ctrl_c_leaves_what_was_measured(clip, tmp_path, monkeypatch):
    monkeypatch.setattr(runner, "_point", made_up([], {("x264", 1): KeyboardInterrupt()}))
    found = runner.measure(clip, entries("gsvc", "x264"), 4, tmp_path, None, lambda *step: None)
    assert found.interrupted
    text = " ".join(parsed(bench_html(found, entries("gsvc", "x264"), "")).text)
    assert "3 of 8 points were measured" in text


def test_a_coder_that_fails_is_left_out_and_told(clip, tmp_path, monkeypatch):
    calls = []
    monkeypatch.setattr(runner, "_point", made_up(calls, {("x264", 0): ffmpeg.FfmpegError("no such <encoder>")}))
    found = runner.measure(clip, entries("gsvc", "x264"), 2, tmp_path, None, lambda *step: None)
    assert ("x264", 1) not in calls
    assert "not run: no such <encoder>" in " ".join(parsed(bench_html(found, entries("gsvc", "x264"), "")).text)
    assert "note: AVC (libx264), slow could not be run: no such <encoder>" in bench.describe(
        found, entries("gsvc", "x264")
    )


def test_a_page_of_no_coder_is_not_written(tmp_path, monkeypatch, capsys):
    fail = {("gsvc", 0): ffmpeg.FfmpegError("no such encoder"), ("gsvc-slow", 0): ffmpeg.FfmpegError("nor this one")}
    monkeypatch.setattr(runner, "_point", made_up([], fail))
    monkeypatch.setattr(bench, "_warm_up", lambda entries, folder: None)
    monkeypatch.chdir(tmp_path)
    words = ["scene:cut", "--frames", "0:1", "--size", "32x32", "--points", "2", "--codecs", "gsvc,gsvc-slow"]
    assert main(["bench", *words]) == 2
    said = "no coder could be run: GSVC main, quick: no such encoder; GSVC main, slow: nor this one"
    assert said in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.exhaustive
def test_points_of_an_executor_are_those_that_are_measured_here(clip, tmp_path):
    """All of them are asked for at once; the codec's are measured here."""
    clip.path.write_bytes(np.random.default_rng(0).integers(0, 256, 3 * clip.frame_bytes, np.uint8).tobytes())
    here = runner.measure(clip, entries("gsvc"), 2, tmp_path, 1, lambda *step: None)
    with ThreadPoolExecutor(1) as executor:
        there = runner.measure(clip, entries("gsvc"), 2, tmp_path, 1, lambda *step: None, executor)
    names = ("setting", "bytes", "psnr", "ms_ssim")
    ours, theirs = ([[getattr(point, name) for name in names] for point in found.points["GSVC main, quick"]]
                    for found in (here, there))  # fmt: skip
    assert ours == theirs
    assert there.count == 2
    assert any("workers of a cluster with 1 thread each" in note for note in there.notes["GSVC main, quick"])


@pytest.mark.parametrize(("threads", "each"), [(None, 1), (3, 3)])
def test_a_point_of_a_worker_has_one_thread_if_no_number_is_given(clip, monkeypatch, threads, each):
    """Workers of one machine would else take all of its cores, each of them."""
    monkeypatch.setattr(runner, "submit_point", lambda executor, clip, coder, settings: settings.threads)
    (gsvc,) = entries("gsvc")
    assert runner._asked(None, clip, [(gsvc, 0), (gsvc, 1)], 2, threads) == {
        (gsvc.label, 0): each,
        (gsvc.label, 1): each,
    }


def test_the_estimate_counts_what_is_left():
    estimate = runner._Estimate()
    estimate.add("slow", 30.0)
    estimate.add("slow", 10.0)
    estimate.add("fast", 1.0)
    spent, whole = estimate.whole(["slow", "fast", "new"])
    assert whole - spent == pytest.approx(20 + 1 + 10.5)


def test_points_come_out_of_the_middle():
    assert runner.middle((1, 2, 3, 4, 5, 6), 4) == (2, 3, 4, 5)
    assert runner.middle((1, 2, 3, 4, 5, 6), 6) == (1, 2, 3, 4, 5, 6)
    assert all(
        len(getattr(e.coder, "values", runner.WIDER)) == runner.MAX_CURVE_POINTS for e in runner.ENTRIES.values()
    )


def test_coders_have_names(monkeypatch):
    with pytest.raises(UsageError, match="no coder 'h264'; there are gsvc, gsvc-slow"):
        runner.chosen(["h264"])

    def missing():
        raise ffmpeg.FfmpegError("pip install 'gsvc_ref[bench]'")

    monkeypatch.setattr(ffmpeg, "program", missing)
    assert [entry.name for entry in runner.chosen(["gsvc", "gsvc"])] == ["gsvc"]
    with pytest.raises(UsageError, match="bench"):
        runner.chosen(["gsvc", "x264"])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["-"], "save it to a file"),
        (["scene:pan", "--points", "1"], "a curve has 2 to 6 points"),
        (["missing.mp4"], "there is no file"),
        (["scene:pan", "-o", "page"], "it ends in .html"),
        (["scene:pan", "--codecs", "mpeg2"], "there is no coder 'mpeg2'"),
        (["scene:pan", "--codecs", ","], "names no coder"),
        (["scene:pan", "--whole", "--size", "9x9"], "not allowed with"),
    ],
)
def test_what_cannot_be_is_refused_before_work(tmp_path, monkeypatch, capsys, words, said):
    monkeypatch.chdir(tmp_path)
    assert main(["bench", *words]) == 2
    assert said in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@needs_ffmpeg
@pytest.mark.parametrize("degrees", [0, 90, 180])
def test_pictures_of_phones_are_upright(tmp_path, degrees):
    """Their planes are as coded, and their display matrix says how they are held."""
    pytest.importorskip("av")
    from tools.video.odd_clips import write_clip

    source = tmp_path / "a.mp4"
    write_clip(source, rotation=degrees, times=[0, 40])
    clip = planes.from_file(source, tmp_path / "clip.yuv", 9)
    assert (clip.note == "the file's own planes") == (degrees == 0)
    with open_video(source) as reader:
        assert reader.is_turned == (degrees != 0)
        for shown, frame in zip(clip.frames(), reader, strict=True):
            assert psnr(shown, frame, 255) > 25
            assert psnr(np.ascontiguousarray(shown[::-1, ::-1]), frame, 255) < 15


@needs_ffmpeg
def test_the_command_measures_and_writes(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    first = runner.ENTRIES["gsvc"]
    cheap = replace(first, coder=replace(first.coder, overrides={"profile": "main", "low_latency": True}))
    monkeypatch.setitem(runner.ENTRIES, "gsvc", cheap)
    words = ["scene:cut", "--frames", "0:2", "--size", "32x32", "--points", "2", "--codecs", "gsvc,x264", "--json"]
    assert main(["bench", *words, "--threads", "1"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [curve["coder"] for curve in found["curves"]] == ["GSVC main, quick", "AVC (libx264), slow"]
    assert all(len(curve["points"]) == 2 for curve in found["curves"])
    assert found["bd_rates"][0]["anchor"] == "AVC (libx264), slow"
    text = " ".join(parsed((tmp_path / "cut-bench.html").read_text()).text)
    assert "32x32 out of the middle" in text
    assert "gsvc bench scene:cut --frames 0:2 --codecs gsvc,x264 --size 32x32 --points 2 --threads 1" in text
