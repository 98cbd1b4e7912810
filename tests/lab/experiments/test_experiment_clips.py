"""Clips: frames by number, cropping, and UVG's raw files."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from tiny_clips import tiny_clip

from gsvc_base.errors import UsageError
from gsvc_lab.clips import UVG_COLOR, as_frame, as_picture, file_clip, resized, scene_clip, uvg_clip, uvg_paths
from gsvc_lab.experiments.material import given_clips, preferred, stills
from gsvc_ref.video import VideoFormat, open_writer, to_planes

SIZE = (32, 16)


@pytest.fixture
def demo():
    return tiny_clip("demo", 4, None, *SIZE)


def raw_file(path, frames, cut=0):
    """Write frames as raw 4:2:0 planes; the last `cut` bytes are left out."""
    video = uvg_format(path)
    data = b"".join(plane.tobytes() for frame in frames for plane in to_planes(frame, video))
    path.write_bytes(data[: len(data) - cut])
    return path


def uvg_format(path):
    return VideoFormat(*SIZE, Fraction(120), 8, "420", UVG_COLOR)


def test_a_clip_is_read_from_any_frame_and_again(demo):
    frames = list(demo.frames())
    assert len(frames) == 4
    np.testing.assert_array_equal(list(demo.frames(1, 3)), frames[1:3])
    source, video = demo.source(1)
    assert video.frame_count == 3
    np.testing.assert_array_equal(list(source), frames[1:])
    with pytest.raises(UsageError, match="demo has no frame 9"):
        demo.picture(9)


def test_scaling_keeps_the_mean_colour(demo):
    scaled = demo.scaled(16, 8)
    frame = next(scaled.frames())
    assert frame.shape == (8, 16, 3)
    np.testing.assert_allclose(frame.mean(axis=(0, 1)), next(demo.frames()).mean(axis=(0, 1)), atol=6)


def test_a_scene_is_a_clip():
    clip = scene_clip("jumping-circle", 32, 18, 14)
    assert (clip.name, clip.format.frame_count) == ("jumping-circle", 14)
    frames = list(clip.frames(11, 13))
    assert not np.array_equal(*frames)


def test_files_of_the_user_replace_the_built_in_ones(quiet, tmp_path, demo):
    path = tmp_path / "mine.y4m"
    with open_writer(
        path, replace(demo.format, chroma_format="444", color=replace(demo.format.color, matrix=1))
    ) as out:
        for frame in demo.frames():
            out.write(frame)
    run = replace(quiet, clips=(path,))
    (clip,) = given_clips(run)
    assert (clip.name, clip.format.frame_count) == ("mine", 4)
    assert [clip.name for clip in given_clips(replace(run, clips=(path,) * 3))] == ["mine", "mine (2)", "mine (3)"]
    assert given_clips(quiet) == []
    (still,) = stills(run, ("coffee",), 16, 8)
    assert still.size == (16, 8)
    assert "resampled to 16x8" in still.about
    (whole,) = stills(replace(run, full=True), ("coffee",), 16, 8)
    np.testing.assert_array_equal(whole.frame, next(file_clip(path).frames()))


def test_raw_files_are_read_frame_by_frame(tmp_path, demo):
    said = []
    path = raw_file(tmp_path / "Beauty_32x16_120fps_420_8bit_YUV.yuv", demo.frames())
    clip = uvg_clip(path, said.append)
    assert (clip.format.frame_count, clip.format.frame_rate, said) == (4, 120, [])
    frames = list(clip.frames())
    np.testing.assert_array_equal(list(clip.frames(2)), frames[2:])
    assert list(clip.frames(9)) == []
    for frame, original in zip(frames, demo.frames(), strict=True):
        assert np.abs(frame.mean(axis=(0, 1)) - original.mean(axis=(0, 1))).max() < 2


def test_a_raw_file_that_is_cut_off_gives_its_whole_frames_and_says_so(tmp_path, demo):
    said = []
    path = raw_file(tmp_path / "Jockey_32x16_120fps_420_8bit_YUV.yuv", demo.frames(), cut=100)
    assert uvg_clip(path, said.append).format.frame_count == 3
    assert "ends with 668 of the 768 bytes of a frame" in said[0]
    path.write_bytes(b"x")
    with pytest.raises(UsageError, match="has 1 bytes; one frame of its size has 768"):
        uvg_clip(path, said.append)


def test_the_sequences_of_the_paper_come_first(tmp_path, demo):
    for name in ("Bosphorus", "Jockey", "HoneyBee"):
        raw_file(tmp_path / f"{name}_32x16_120fps_420_8bit_YUV.yuv", demo.frames(0, 1))
    (tmp_path / "notes.yuv").write_bytes(b"")
    assert [path.name.partition("_")[0] for path in uvg_paths(tmp_path)] == ["HoneyBee", "Jockey", "Bosphorus"]
    with pytest.raises(UsageError, match="not named as UVG's files"):
        uvg_clip(tmp_path / "notes.yuv", print)


def test_a_folder_without_sequences_is_told(tmp_path):
    with pytest.raises(UsageError, match="holds no file such as Beauty_1920x1080"):
        uvg_paths(tmp_path)


def test_stills_are_photographs_without_files(quiet):
    pictures = stills(quiet, ("coffee", "chelsea"), 24, 16)
    assert [still.name for still in pictures] == ["coffee", "chelsea"]
    assert preferred(pictures, "chelsea").name == "chelsea"
    assert preferred(pictures, "Jockey").name == "coffee"


def test_pictures_and_frames_are_each_others_inverse():
    frame = np.arange(256, dtype=np.uint8).reshape(8, 32, 1).repeat(3, axis=2)
    np.testing.assert_array_equal(as_frame(as_picture(frame)), frame)
    assert as_picture(np.full((1, 1, 3), 1023, np.uint16), 1023).max() == 1
    picture = as_picture(frame)
    assert resized(picture, 32, 8) is picture
