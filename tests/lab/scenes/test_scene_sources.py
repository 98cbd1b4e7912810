"""Scenes where a video is read: `open_video`, `gsvc_ref.encode`."""

import io
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from scene_cases import scene

import gsvc_ref
from gsvc_base.errors import UsageError
from gsvc_lab.scenes import Scene, frames
from gsvc_ref.video import open_video

QUICK = gsvc_ref.Settings.quick(splats=8)
TOML = 'title = "t"\nsize = [12, 8]\nframes = 2\nframe_rate = 10\nbase = {color = [0.2, 0.4, 0.6]}\n'


def test_a_built_in_scene_is_read_by_its_name():
    with open_video("scene:static") as reader:
        found = Scene.named("static")
        video = reader.format
        assert (video.width, video.height, video.frame_count) == (found.width, found.height, found.frames)
        assert (video.bit_depth, video.chroma_format, video.frame_rate) == (8, "rgb", Fraction(24))
        assert (video.color.primaries, video.color.transfer, video.color.matrix) == (1, 1, 0)
        np.testing.assert_array_equal(next(reader), next(frames(found)))
        assert len(list(reader)) == found.frames - 1
        assert reader.notes == []


def test_a_file_is_read_by_its_suffix(tmp_path):
    path = tmp_path / "Mine.TOML"
    path.write_text(TOML)
    for name in (path, str(path)):
        with open_video(name) as reader:
            assert reader.format.frame_rate == 10
            assert [frame.shape for frame in reader] == [(8, 12, 3)] * 2


def test_a_scene_is_read_as_it_is():
    found = scene({"color": (1, 0, 0)}, size=(5, 4), frames=3)
    with open_video(found) as reader:
        assert (np.array(list(reader)) == [255, 0, 0]).all()


def test_a_reader_that_is_closed_ends():
    reader = open_video(scene({"color": (1, 0, 0)}))
    next(reader)
    reader.close()
    assert list(reader) == []


def test_wrong_names_say_what_there_is(tmp_path):
    with pytest.raises(UsageError, match=r"did you mean static\?"):
        open_video("scene:statics")
    with pytest.raises(UsageError, match="there is no scene ''"):
        open_video("scene:")
    with pytest.raises(FileNotFoundError):
        open_video(Path("scene:static"))  # a path is one
    with pytest.raises(FileNotFoundError):
        open_video("none.toml")
    path = tmp_path / "a.toml"
    path.write_text("title = 3")
    with pytest.raises(UsageError, match="size is missing"):
        open_video(path)


def test_a_still_scene_is_coded_as_repetitions():
    report = gsvc_ref.encode(scene({"photograph": "coffee"}, size=(24, 16), frames=4), io.BytesIO(), QUICK)
    assert [frame.type for frame in report.frames] == ["I", "R", "R", "R"]
    assert report.notes == []


def test_scenes_are_encoded_from_python_by_name_and_from_files(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text(TOML)
    streams = []
    for source in (path, Scene.from_toml(path), (frames(Scene.from_toml(path)), open_video(path).format)):
        target = io.BytesIO()
        gsvc_ref.encode(source, target, QUICK)
        streams.append(target.getvalue())
    assert streams[0] == streams[1] == streams[2]
    report = gsvc_ref.encode("scene:jumping-circle", io.BytesIO(), gsvc_ref.Settings.quick(
        splats=4, frames=(0, 1)))  # fmt: skip
    assert len(report.frames) == 1


def test_what_is_no_source_says_that_a_scene_is_one():
    with pytest.raises(UsageError, match=r"an? int is not a source; give a path, .*, a VideoReader, a Scene"):
        gsvc_ref.encode(3, io.BytesIO())


def test_a_scene_file_is_not_overwritten_by_its_own_stream(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text(TOML)
    with pytest.raises(UsageError, match="is the source itself"):
        gsvc_ref.encode(path, path, QUICK)
    assert path.read_text() == TOML
