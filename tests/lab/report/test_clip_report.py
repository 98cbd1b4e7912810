"""The page about any file: one pass over file and source, damage, layers, x264 at equal PSNR, and the commands."""

import math
import shlex
from dataclasses import replace

import numpy as np
import pytest
from html_pages import parsed

from gsvc_base.errors import UsageError
from gsvc_base.splats import Splats
from gsvc_lab.bench import ffmpeg
from gsvc_lab.pages.data import FrameRecord, condensed
from gsvc_lab.pages.glossary import WORDS
from gsvc_lab.pages.report import report_html
from gsvc_lab.report import contents, material, x264
from gsvc_lab.report.contents import Wanted, report_data, summarise
from gsvc_lab.report.material import gather, picture_row, smaller
from gsvc_lab.scenes import Scene
from gsvc_ref import Settings, encode
from gsvc_ref.bitstream.coder import CATEGORIES, MAIN_CATEGORIES
from gsvc_ref.cli import main
from gsvc_ref.video import ColorDescription, VideoFormat, open_video, open_writer
from gsvc_tools.cli import encode_page

FRAMES = 5


@pytest.fixture(scope="module")
def coded(tmp_path_factory):
    """A tiny clip as a file, the file of its encode in two layers, and the report of that."""
    folder = tmp_path_factory.mktemp("report")
    source, file = folder / "clip.y4m", folder / "clip.gsvc"
    scene = Scene.named("cut").resized(32, 24, FRAMES)
    color = ColorDescription(primaries=1, transfer=1, matrix=1, full_range=False, chroma_location=0)
    video = VideoFormat(32, 24, scene.frame_rate, 8, "420", color, frame_count=FRAMES)
    with scene.open_video() as reader, open_writer(source, video) as writer:
        for frame in reader:
            writer.write(frame)
    return source, file, encode(source, file, Settings.quick(layer_splats=(8, 16), threads=1))


@pytest.fixture(scope="module")
def whole(coded):
    """The contents of the page with the source."""
    source, file, _ = coded
    return report_data(Wanted(file, str(source), vmaf=False, x264=False, threads=1))


def test_one_pass_finds_what_the_encoder_had(coded, whole):
    _, _, report = coded
    assert [frame.psnr for frame in whole.frames] == [frame.psnr for frame in report.frames]
    assert [frame.type for frame in whole.frames] == [frame.type for frame in report.frames]
    assert sum(frame.bits for frame in whole.frames) == sum(sum(f.bits.values()) for f in report.frames) + sum(
        sum(layer.bits.values()) for f in report.frames for layer in f.layers[1:]
    )
    worst = min(whole.frames, key=lambda frame: frame.psnr).number
    assert {0, worst, FRAMES - 1} <= {row.number for row in whole.pictures}
    with open_video(str(coded[0])) as reader:
        np.testing.assert_array_equal(whole.pictures[0].original, next(iter(reader)))


def test_each_layer_has_its_bits_and_its_psnr(coded, whole):
    _, _, report = coded
    for number, layer in enumerate(whole.layers):
        levels = [frame.layers[number].psnr for frame in report.frames]
        assert layer.psnr == pytest.approx(sum(levels) / FRAMES)
    assert [layer.name for layer in whole.layers] == ["base", "layer 1"]
    assert "Layers" in report_html(whole)


def test_the_file_alone_has_bits_and_pictures_but_no_psnr(coded):
    _, file, report = coded
    data = report_data(Wanted(file, threads=1))
    page = report_html(data)
    text = " ".join(parsed(page).text)
    assert "Quality of each frame" not in text
    assert "Where the bits went" in text
    assert "gsvc report clip.gsvc SOURCE" in text
    assert data.mean_psnr is None
    assert data.pictures[0].original is None
    assert [frame.iterations for frame in data.frames] == [frame.iterations for frame in report.frames]  # of the log
    told = report_data(Wanted(file, encoded=report, threads=1))
    assert told.mean_psnr == pytest.approx(report.mean_psnr)
    assert "Where the time went" in report_html(told)


def test_commands_to_copy_have_names_as_a_shell_wants_them(coded, tmp_path):
    file = tmp_path / "it's $mine.gsvc"
    file.write_bytes(coded[1].read_bytes())
    data = report_data(Wanted(file, threads=1))
    assert [shlex.split(line)[2] for line in data.hint] == [str(file)] * 3
    (line,) = [note.partition(": ")[2] for note in data.notes if "gsvc report" in note]
    assert shlex.split(line) == ["gsvc", "report", file.name, "SOURCE"]


def test_the_preview_and_the_pictures_are_bounded(coded, monkeypatch):
    source, file, _ = coded
    monkeypatch.setattr(material, "MAX_PREVIEW_FRAMES", 2)
    monkeypatch.setattr(contents, "MAX_PREVIEW_FRAMES", 2)
    monkeypatch.setattr(material, "MAX_PIXELS", 200)
    with open_video(source) as reader:
        found = gather(file, {0: "first"}, iter(reader), with_vmaf=False, threads=1)
    assert len(found.preview_decoded) == len(found.preview_original) == 2
    assert found.preview_decoded[0].shape == (12, 16, 3)
    assert len(found.pictures) <= 2
    assert found.pictures[0].detail.decoded.shape == (24, 32, 3)
    assert (
        contents._preview_note(32, 24, FRAMES) == "It shows the first 2 of 5 frames at 1/2 of their width and height."
    )


def test_a_source_that_ends_early_is_told(coded, tmp_path):
    source, file, _ = coded
    data = report_data(Wanted(file, str(source), start=2, vmaf=False, x264=False, threads=1))
    assert len(data.levels) == FRAMES - 2
    assert any("has a frame for 3 of the file's 5" in note for note in data.notes)
    assert f"{FRAMES - 2} of {FRAMES} frames" in report_html(data)


def test_what_is_left_of_a_damaged_file_stands_beside_its_own_frames(coded, tmp_path):
    source, file, report = coded
    summary = summarise(file)
    frame = summary.frames[2]
    data = bytearray(file.read_bytes())
    data[frame.offset + frame.size // 2] ^= 0xFF
    broken = tmp_path / "broken.gsvc"
    broken.write_bytes(data)
    found = report_data(Wanted(broken, str(source), vmaf=False, x264=False, threads=1))
    assert found.damage
    assert 2 not in [frame.number for frame in found.frames]
    assert "This file is damaged." in report_html(found)
    expected = {frame.number: frame.psnr for frame in report.frames}
    assert all(frame.psnr == expected[frame.number] for frame in found.frames)


def test_a_file_without_a_frame_has_a_page_too(coded, tmp_path, capsys):
    broken = tmp_path / "cut.gsvc"
    broken.write_bytes(coded[1].read_bytes()[:100])
    page = tmp_path / "cut.html"
    assert main(["report", str(broken), "-o", str(page)]) == 1
    assert "is damaged" in capsys.readouterr().err
    parsed(page.read_text())
    assert "This file is damaged." in page.read_text()


def test_a_smaller_frame_is_of_means():
    frame = np.arange(7 * 5 * 3, dtype=np.uint16).reshape(7, 5, 3)
    np.testing.assert_array_equal(smaller(frame, 2)[1, 1], np.rint(frame[2:4, 2:4].mean(axis=(0, 1))))
    assert smaller(frame, 2).shape == (3, 2, 3)
    assert smaller(frame, 1).dtype == np.uint16


def test_the_detail_is_where_the_error_is():
    original = np.zeros((400, 600, 3), np.uint8)
    picture = original.copy()
    picture[330, 500] = 9
    splats = Splats.from_array(np.array([[60, 40, 3, 0, 3, 1, 1, 1]], np.float32))
    row = picture_row(0, original, picture, splats, "")
    assert row.detail.left <= 500 < row.detail.left + 240
    assert row.detail.decoded.max() == 9
    assert row.decoded.shape == (200, 300, 3)
    np.testing.assert_allclose(row.positions, [[30, 20]])
    assert picture_row(0, None, picture, splats, "").detail.left == 180


# x264


@pytest.mark.parametrize(("goal", "crf"), [(36.0, 22.35), (20.0, 41.18), (33.15, 25.71)])
def test_x264_is_read_off_between_two_settings(goal, crf):
    tries = []

    def measure(value):
        tries.append(value)
        return round(1e7 * math.exp(-0.12 * value)), 55 - 0.85 * value

    peer = x264._at("x", goal, measure)
    assert peer.bits == pytest.approx(1e7 * math.exp(-0.12 * crf), rel=0.001)
    assert len(tries) <= 5


def test_x264_beyond_its_range_is_told():
    assert x264._at("x", 99.0, lambda crf: (100, 50 - crf / 2)).bits is None
    assert "coarsest" in x264._at("x", 9.0, lambda crf: (100, 50 - crf / 2)).settings


def test_x264_gets_a_bounded_number_of_frames():
    assert x264.sample_frames(32, 24, 100) == 100
    assert x264.sample_frames(352, 288, 9000) == 250
    assert x264.sample_frames(3840, 2160, 9000) == 16


@pytest.mark.skipif(not ffmpeg.available(), reason="needs imageio-ffmpeg")
def test_the_page_sets_x264_beside_the_file(coded):
    source, file, _ = coded
    data = report_data(Wanted(file, str(source), vmaf=False, threads=1))
    rows = {row[0]: row for row in data.peers.rows}
    assert list(rows) == ["GSVC, this file", "AVC (libx264), slow, I and P only", "AVC (libx264), slow"]
    assert "between CRF" in rows["AVC (libx264), slow"][-1]
    assert "the file's own planes" in data.peers_note
    assert not any("x264" in note for note in data.notes)


def test_without_the_extra_the_page_says_what_it_would_add(coded, monkeypatch):
    source, file, _ = coded
    monkeypatch.setattr(ffmpeg, "available", lambda: False)
    data = report_data(Wanted(file, str(source), vmaf=False, threads=1))
    assert any("pip install 'gsvc_ref[bench]'" in note for note in data.notes)


# Words, long clips


def test_every_part_of_a_file_is_explained():
    explained = {name for word in WORDS for name in word.split(", ")}
    assert {*CATEGORIES, *MAIN_CATEGORIES} - {"survivors", "quantizers"} <= explained
    assert all(meaning.endswith(".") for meaning in WORDS.values())


def test_many_frames_share_marks():
    frames = [FrameRecord(n, "I" if n == 5 else "P", 30.0 + n % 2, {"a": 100 * (n % 2)}, 10) for n in range(1001)]
    few = condensed(frames, 400)
    assert len(few) == 334
    assert (few[1].number, few[1].last, few[1].type) == (3, 5, "I")
    assert few[1].bits == round(200 / 3)
    assert few[-1].last == 1000
    assert condensed(frames[:400], 400) == frames[:400]
    assert few[0].psnr == pytest.approx(30 + 1 / 3)


# The commands


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["report", "-"], "save standard input to a file"),
        (["report", "missing.gsvc"], "there is no file"),
        (["report", "FILE", "-o", "page.txt"], "it ends in .html"),
        (["report", "FILE", "--start", "1"], "--start is about SOURCE"),
        (["report", "FILE", "SOURCE", "--start", "9", "-o", "p.html"], "has 5 frames and no frame 9"),
        (["report", "FILE", "scene:pan", "-o", "p.html"], "give the video that was encoded"),
        (["encode", "SOURCE", "-", "--report", "p.html"], "give OUT.gsvc a name"),
        (["encode", "SOURCE", "out.gsvc", "--report", "p.txt"], "it ends in .html"),
    ],
)
def test_what_cannot_be_is_refused_before_work(coded, tmp_path, monkeypatch, capsys, words, said):
    monkeypatch.chdir(tmp_path)
    names = {"FILE": str(coded[1]), "SOURCE": str(coded[0])}
    assert main([names.get(word, word) for word in words]) == 2
    assert said in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_encode_writes_the_page(coded, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = ["encode", str(coded[0]), "out.gsvc", "--frames", "1:3", "--splats", "8", "--report", "page.html"]
    assert main([*words, "--threads", "1"]) == 0
    assert "page.html: open it in a browser" in capsys.readouterr().out
    text = " ".join(parsed((tmp_path / "page.html").read_text()).text)
    assert "out.gsvc, 2 frames" in text
    assert "Where the time went" in text


def test_without_the_package_of_pages_encode_says_so(coded, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(encode_page, "page_writer", lambda: None)
    page = str(tmp_path / "page.html")
    assert main(["encode", str(coded[0]), str(tmp_path / "out.gsvc"), "--report", page]) == 2
    assert "--report needs gsvc_lab" in capsys.readouterr().err


def test_ctrl_c_in_the_page_keeps_the_file(coded, tmp_path, monkeypatch, capsys):
    def interrupted(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(encode_page, "page_writer", lambda: interrupted)
    out = tmp_path / "out.gsvc"
    words = ["encode", str(coded[0]), str(out), "--frames", "0:1", "--splats", "8", "--threads", "1"]
    assert main([*words, "--report", str(tmp_path / "page.html")]) == 130
    assert "out.gsvc is complete" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["out.gsvc"]


def test_a_source_of_another_size_is_refused(coded):
    summary = summarise(coded[1])
    with pytest.raises(UsageError, match="give the video that was encoded"):
        report_data(Wanted(coded[1], "scene:pan"), replace(summary))
