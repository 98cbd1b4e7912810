import json
import sys

import numpy as np
import pytest

from gsvc_lab.scenes import EFFECTS, Scene, frames, scene_names
from gsvc_ref.cli import main
from gsvc_ref.video import encode_png, open_video

TOML = """
title = "A test"
size = [32, 24]
frames = 3
base = {photograph = "coffee"}
[[effects]]
kind = "pan"
to = [0.6, 0.5]
"""


@pytest.fixture
def mine(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(TOML)
    return tmp_path


def test_a_scene_is_drawn_and_said(mine, capsys):
    assert main(["scene", "mine.toml", "out.y4m"]) == 0
    said = capsys.readouterr()
    assert said.err == ""
    assert "out.y4m: 32x24, 3 frames, 24 frames/s" in said.out
    assert "A test" in said.out
    with open_video("out.y4m") as reader:
        drawn = list(reader)
    assert reader.format.chroma_format == "444"
    for a, b in zip(drawn, frames(Scene.from_toml("mine.toml")), strict=True):
        assert np.abs(a.astype(int) - b).max() <= 2


def test_pictures_are_exact(mine):
    assert main(["scene", "mine.toml", "out", "--quiet"]) == 0
    with open_video("out") as reader:
        np.testing.assert_array_equal(list(reader), list(frames(Scene.from_toml("mine.toml"))))


def test_size_length_seed_and_chroma_are_options(mine, capsys):
    options = ["--size", "20x10", "--frames", "2", "--seed", "9", "--chroma", "420", "--json"]
    assert main(["scene", "noise", "out.y4m", *options]) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["width"], said["height"], said["frames"], said["seed"]) == (20, 10, 2, 9)
    assert said["effects"] == ["noise"]
    assert said["truth"] is None
    with open_video("out.y4m") as reader:
        assert reader.format.chroma_format == "420"
        assert [frame.shape for frame in reader] == [(10, 20, 3)] * 2


def test_options_stand_anywhere(mine):
    assert main(["scene", "--frames", "1", "noise", "--size", "8x6", "out.y4m", "--quiet"]) == 0
    with open_video("out.y4m") as reader:
        assert [frame.shape for frame in reader] == [(6, 8, 3)]


def test_the_truth_is_written_beside(mine, capsys):
    assert main(["scene", "mine.toml", "out.y4m", "--truth", "truth.npz"]) == 0
    assert "truth.npz: camera, cut, motion, visible_before" in capsys.readouterr().out
    with np.load("truth.npz") as file:
        assert file["motion"].shape == (3, 2, 24, 32)


def test_all_scenes_are_listed(capsys):
    assert main(["scene", "--list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[1:]] == list(scene_names())
    assert main(["scene", "--list", "--json"]) == 0
    assert set(json.loads(capsys.readouterr().out)) == set(scene_names())


def test_a_printed_scene_is_one_to_start_from(mine, capsys):
    assert main(["scene", "--print", "pan"]) == 0
    (mine / "own.toml").write_text(capsys.readouterr().out)
    assert Scene.from_toml("own.toml").effects == Scene.named("pan").effects
    assert main(["scene", "scene:pan", "--print"]) == 0
    assert capsys.readouterr().out == (mine / "own.toml").read_text()


def test_all_effects_are_listed_with_their_parameters(capsys):
    assert main(["scene", "--effects"]) == 0
    lines = capsys.readouterr().out
    assert all(f'kind = "{kind}"' in lines for kind in EFFECTS)
    assert max(map(len, lines.splitlines())) <= 120
    assert main(["scene", "--effects", "--json"]) == 0
    assert set(json.loads(capsys.readouterr().out)["effects"]) == set(EFFECTS)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "give a scene and where to draw it"),
        (["pan"], "give a scene and where to draw it"),
        (["pam", "a.y4m"], "there is no scene 'pam' (did you mean pan?)"),
        (["none.toml", "a.y4m"], "there is no file none.toml"),
        (["pan", "no/a.y4m"], "the folder no does not exist"),
        (["pan", "a.xyz"], "cannot tell what to write as a.xyz"),
        (["pan", "a.y4m", "--frames", "0"], "frames is 0; it must be a whole number from 1"),
        (["pan", "a.y4m", "--seed", "-1"], "seed is -1"),
        (["pan", "a.y4m", "--size", "65535x65535"], "width is 65535; it must be a whole number from 1 to 16,384"),
        (["pan", "a.y4m", "--size", "0x0"], "'0x0' is not a size"),
        (["pan", "a.y4m", "--truth", "a.txt"], "ends in .npz"),
        (["pan", "a.y4m", "--truth", "no/a.npz"], "the folder no does not exist"),
        (["pan", "-", "--json"], "--json needs standard output"),
        (["pan", "-", "--truth", "-"], "ends in .npz"),
        (["--print"], "--print needs the name"),
        (["--print", "nix"], "there is no scene 'nix'"),
        (["--list", "--print"], "--list and --print do not go together"),
        (["--list", "pan"], "--list draws no clip, so it does not take 'pan'"),
        (["pan", "--print", "a.y4m"], "--print draws no clip, so it does not take 'a.y4m'"),
        (["mine.toml", "--print"], "--print needs the name of a built-in scene"),
        (["--gallery", "pan"], "--gallery pan: give a folder that exists, or a file whose name ends in .html"),
        (["pan", "a.y4m", "--truth", "a.npz", "--frames", "9999"], "9,999 frames of 352x288 would take 8.5 GiB"),
        (["mine.toml", "mine.toml"], "mine.toml is the input itself"),
    ],
)
def test_wrong_use_is_said_and_nothing_is_left(mine, capsys, monkeypatch, arguments, message):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: False)
    assert main(["scene", *arguments]) == 2
    assert message in capsys.readouterr().err
    assert [path.name for path in mine.iterdir()] == ["mine.toml"]
    assert (mine / "mine.toml").read_text() == TOML


def test_a_wrong_file_is_named_with_the_key(mine, capsys):
    (mine / "mine.toml").write_text(TOML.replace("0.6", "6"))
    assert main(["scene", "mine.toml", "a.y4m"]) == 2
    said = capsys.readouterr().err
    assert said == (
        "gsvc scene: mine.toml: effects[1].to is [6, 0.5]; it must be two numbers from 0 to 1, such as [0, 1]\n"
    )


def test_an_interrupt_leaves_nothing(mine, capsys, monkeypatch):
    from gsvc_lab.scenes import Clip

    def stop(*_arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(Clip, "frame", stop)
    assert main(["scene", "mine.toml", "out.y4m"]) == 130
    assert "interrupted; out.y4m was not written" in capsys.readouterr().err
    assert [path.name for path in mine.iterdir()] == ["mine.toml"]


def test_an_interrupt_of_the_truth_leaves_the_clip(mine, capsys, monkeypatch):
    def stop(*_arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr("gsvc_lab.scenes.ground_truth.write_truth", stop)
    assert main(["scene", "mine.toml", "out.y4m", "--truth", "truth.npz"]) == 130
    assert "interrupted; truth.npz was not written" in capsys.readouterr().err
    assert sorted(path.name for path in mine.iterdir()) == ["mine.toml", "out.y4m"]


def test_a_picture_of_the_scene_is_not_overwritten(mine, capsys):
    picture = encode_png(np.zeros((3, 4, 3), np.uint8))
    (mine / "a.png").write_bytes(picture)
    (mine / "mine.toml").write_text(TOML.replace('photograph = "coffee"', 'image = "a.png"'))
    assert main(["scene", "mine.toml", "a.png", "--frames", "1"]) == 2
    assert "a.png is the input itself" in capsys.readouterr().err
    assert (mine / "a.png").read_bytes() == picture


def test_scenes_go_where_videos_go(mine, capsys):
    assert main(["encode", "mine.toml", "out.gsvc", "--splats", "8", "--quiet"]) == 0
    assert main(["compare", "mine.toml", "out.gsvc", "--no-vmaf", "--quiet"]) == 0
    assert "mean of 3 frames" in capsys.readouterr().out
    assert main(["compare", "scene:static", "scene:static", "--frames", "0:1", "--no-vmaf", "--quiet"]) == 0
    assert "identical" in capsys.readouterr().out
    assert main(["encode", "scene:statik", "out.gsvc"]) == 2
    assert "did you mean static" in capsys.readouterr().err
    assert main(["decode", "scene:static", "out.y4m"]) == 2  # no stream
    assert main(["encode", "mine.toml", "mine.toml"]) == 2
    assert (mine / "mine.toml").read_text() == TOML


def test_the_gallery_is_written_where_asked(mine, capsys, monkeypatch):
    (mine / "folder").mkdir()
    written = []

    def write(path, on_progress):
        on_progress("static", 1, 1)
        written.append(str(path))

    monkeypatch.setattr("gsvc_lab.scenes.gallery.write_gallery", write)
    assert main(["scene", "--gallery"]) == 0
    assert main(["scene", "--gallery", "folder"]) == 0
    assert main(["scene", "--gallery", "mine.html"]) == 0
    assert written == ["gallery.html", "folder/gallery.html", "mine.html"]
    assert "gallery.html: pictures and descriptions" in capsys.readouterr().out
