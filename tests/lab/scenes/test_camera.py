import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gsvc_base.errors import UsageError
from gsvc_lab.scenes import Camera, view
from gsvc_lab.scenes.camera import Sizes


def waves(height, width, period_x, period_y, shift=(0.0, 0.0)):
    """A picture of one smooth wave per axis, at any offset: its own ground truth for sub-pixel moves."""
    x, y = np.arange(width) + 0.5 + shift[0], (np.arange(height) + 0.5 + shift[1])[:, None]
    grey = 0.5 + 0.2 * np.sin(2 * math.pi * x / period_x) + 0.2 * np.sin(2 * math.pi * y / period_y)
    return np.repeat(grey[..., None], 3, axis=2).astype(np.float32)


def test_whole_picture_at_its_own_size_is_the_picture():
    picture = np.random.default_rng(0).random((20, 30, 3), dtype=np.float32)
    seen = view(picture, Camera(0.5, 0.5, 1.0), 30, 20)
    assert seen.dtype == np.float32
    np.testing.assert_allclose(seen, picture, atol=1e-5)


@given(st.floats(-8, 8), st.floats(-8, 8))
def test_pan_by_any_fraction_of_a_pixel_is_exact(dx, dy):
    picture = waves(80, 120, 16, 20)
    seen = view(picture, Camera(0.5 + dx / 120, 0.5 + dy / 80, 0.5), 60, 40)
    expected = waves(40, 60, 16, 20, shift=(30 + dx, 20 + dy))
    np.testing.assert_allclose(seen, expected, atol=1e-3)


def test_zoom_shows_a_part_larger():
    picture = waves(80, 120, 40, 40)
    seen = view(picture, Camera(0.5, 0.5, 0.5), 120, 80)
    x, y = (np.arange(120) + 0.5) / 2 + 30, ((np.arange(80) + 0.5) / 2 + 20)[:, None]
    expected = 0.5 + 0.2 * np.sin(2 * math.pi * x / 40) + 0.2 * np.sin(2 * math.pi * y / 40)
    np.testing.assert_allclose(seen[..., 0], expected, atol=1e-3)


@given(st.floats(0, 1), st.floats(0, 1), st.floats(0.1, 2), st.floats(-7, 7))
def test_where_a_point_is_shown_and_what_a_pixel_shows_are_inverse(x, y, span, roll):
    sizes, camera = Sizes(120, 80, 48, 40), Camera(x, y, span, roll)
    across, down = np.meshgrid([-3.0, 0.5, 60.0], [0.0, 39.5])
    back = sizes.to_frame(camera, *sizes.to_picture(camera, across, down))
    np.testing.assert_allclose(back, (across, down), atol=1e-9)


def test_shrinking_removes_what_the_frame_cannot_show():
    columns = np.arange(128) % 2
    picture = np.broadcast_to(columns[None, :, None], (128, 128, 3)).astype(np.float32)
    seen = view(picture, Camera(0.5, 0.5, 1.0), 40, 40)
    inside = seen[:, 2:-2]  # at the edges the mirror image doubles a stripe, which is really there
    assert np.abs(inside - 0.5).max() < 0.005


def test_roll_of_a_quarter_turn_turns_the_picture():
    picture = np.random.default_rng(1).random((24, 24, 3), dtype=np.float32)
    seen = view(picture, Camera(0.5, 0.5, 1.0, roll=math.pi / 2), 24, 24)
    np.testing.assert_allclose(seen, np.rot90(picture, 1), atol=1e-4)


def test_values_stay_in_range_at_hard_edges():
    picture = np.zeros((40, 40, 3), np.float32)
    picture[:, 20:] = 1
    seen = view(picture, Camera(0.51, 0.5, 0.3), 40, 40)
    assert seen.min() == 0
    assert seen.max() == 1


@pytest.mark.parametrize(
    "bad", [{"x": math.nan}, {"span": 0.0}, {"span": -1.0}, {"span": math.inf}, {"roll": math.inf}]
)
def test_a_camera_that_is_nowhere_is_refused(bad):
    with pytest.raises(UsageError, match="camera"):
        Camera(**({"x": 0.5, "y": 0.5, "span": 1.0} | bad))


def test_a_frame_without_pixels_is_refused():
    with pytest.raises(UsageError, match="0x4"):
        view(np.zeros((4, 4, 3), np.float32), Camera(0.5, 0.5, 1), 0, 4)
