import itertools
import socket

import numpy as np
import pytest

from gsvc_base.errors import UsageError
from gsvc_lab.scenes import PHOTOGRAPHS, Ball, demo_clip, demo_cut, paint_ball, photograph


def as_bytes(**arguments):
    return b"".join(frame.tobytes() for frame in demo_clip(**arguments))


@pytest.mark.exhaustive
def test_same_seed_same_bytes_and_another_seed_another_camera():
    small = {"width": 48, "height": 28, "frames": 4}
    assert as_bytes(**small, seed=3) == as_bytes(**small, seed=3)
    assert as_bytes(**small, seed=3) != as_bytes(**small, seed=4)


@pytest.mark.exhaustive
def test_the_clip_has_the_size_and_length_asked_for():
    clip = list(demo_clip(50, 31, 5))
    assert [(f.shape, f.dtype) for f in clip] == [((31, 50, 3), np.uint8)] * 5
    assert next(demo_clip()).shape == (112, 192, 3)
    assert len(list(demo_clip(1, 1, 1))) == 1


def test_it_is_drawn_without_the_network(monkeypatch):
    def refuse(*_arguments, **_settings):
        raise AssertionError("the network was asked for")

    monkeypatch.setattr(socket.socket, "connect", refuse)  # the class is needed to load modules
    assert len(list(demo_clip(16, 16, 2))) == 2


def test_the_one_cut_is_where_it_says():
    clip = [frame.astype(int) for frame in demo_clip(96, 56, 20)]
    changes = [np.abs(after - before).mean() for before, after in itertools.pairwise(clip)]
    cut = demo_cut(20)
    others = changes[: cut - 1] + changes[cut:]
    assert changes[cut - 1] > 3 * max(others)


def test_something_moves_between_any_two_frames():
    clip = list(demo_clip(96, 56, 12))
    assert all((before != after).any() for before, after in itertools.pairwise(clip))


@pytest.mark.parametrize(("frames", "cut"), [(1, 0), (2, 1), (40, 22)])
def test_where_the_cut_is(frames, cut):
    assert demo_cut(frames) == cut


@pytest.mark.parametrize("bad", [{"width": 0}, {"height": -1}, {"frames": 0}])
def test_an_empty_clip_is_refused_when_it_is_asked_for(bad):
    with pytest.raises(UsageError, match="must be positive"):
        demo_clip(**bad)


@pytest.mark.parametrize("name", PHOTOGRAPHS)
def test_photographs_are_pictures_in_range(name):
    picture = photograph(name)
    assert picture.dtype == np.float32
    assert picture.ndim == 3
    assert picture.shape[2] == 3
    assert 0 <= picture.min() < picture.max() <= 1


def test_an_unknown_photograph_is_refused():
    with pytest.raises(UsageError, match="chelsea"):
        photograph("motorcycle")


def test_the_ball_covers_its_area_and_nothing_else():
    grey = np.full((40, 60, 3), 0.5, np.float32)
    seen = paint_ball(grey, Ball(20.3, 17.8, 9.0, (0, 1, 0)))
    y, x = np.mgrid[0.5:40, 0.5:60]
    distance = np.hypot(x - 20.3, y - 17.8)
    np.testing.assert_array_equal(seen[distance > 9.5], np.float32(0.5))
    assert (seen[distance < 8.5] != np.float32(0.5)).any(axis=1).all()
    # White minus black ground is what shows of the ground: the rest is the area of the ball.
    white = paint_ball(np.ones((40, 60, 3), np.float32), Ball(20.3, 17.8, 9.0, (0, 0, 0)))
    black = paint_ball(np.zeros((40, 60, 3), np.float32), Ball(20.3, 17.8, 9.0, (0, 0, 0)))
    assert (1 - (white - black)[..., 0]).sum() == pytest.approx(np.pi * 81, rel=0.01)


def test_a_ball_outside_the_frame_changes_nothing():
    grey = np.full((10, 10, 3), 0.5, np.float32)
    np.testing.assert_array_equal(paint_ball(grey, Ball(-30, 5, 9.0, (1, 0, 0))), grey)
