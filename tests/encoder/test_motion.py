"""The motion that P-frames begin with: near the truth on smooth pictures, and never a trap."""

import numpy as np
import pytest
from codec_cases import encoded, paper_fast, waves
from hypothesis import given, settings
from hypothesis import strategies as st

from gsvc_ref.encoder.motion import estimated_motion


def smooth(width, height, dx=0.0, dy=0.0, wavelength=1.0) -> np.ndarray:
    """A smooth texture moved by (dx, dy) pixels, (height, width, 3) f4."""
    y, x = np.mgrid[:height, :width]
    x, y = (x - dx) / wavelength, (y - dy) / wavelength
    planes = [0.5 + 0.2 * np.sin(x / 5 + c) + 0.2 * np.cos(y / 6 - c) * np.sin((x + y) / 9) for c in range(3)]
    return np.stack(planes, axis=2).astype(np.float32)


def grid(width, height, margin) -> np.ndarray:
    """Places away from the edges, (N, 2) f4."""
    x, y = np.meshgrid(np.arange(margin, width - margin, 8), np.arange(margin, height - margin, 8))
    return np.stack([x, y], axis=2).reshape(-1, 2).astype(np.float32)


@pytest.mark.parametrize("motion", [(0.3, 0), (0, 0.4), (0.7, -0.5), (1.5, 1), (2.5, -1.8), (-3, 2)])
def test_a_known_motion_is_found(motion):
    """Within a twentieth of a pixel (0.03 at worst), 12 pixels from the edges."""
    found = estimated_motion(smooth(64, 48), smooth(64, 48, *motion), grid(64, 48, 12))
    assert found.dtype == np.float32
    assert np.abs(found - np.array(motion)).max() < 0.05


@pytest.mark.parametrize("motion", [(5.0, 2.5), (-4.0, 6.0)])
def test_large_frames_are_searched_at_a_smaller_size(motion):
    """300 pixels are reduced by 3: within a quarter of a pixel of the whole frame."""
    pictures = smooth(300, 180, wavelength=4.0), smooth(300, 180, *motion, wavelength=4.0)
    found = estimated_motion(*pictures, grid(300, 180, 40))
    assert np.abs(found - np.array(motion)).max() < 0.25


def test_equal_pictures_do_not_move():
    picture = smooth(64, 48)
    assert not estimated_motion(picture, picture.copy(), grid(64, 48, 4)).any()


@pytest.mark.parametrize(("before", "after"), [(0.0, 0.0), (0.2, 0.2), (0.2, 0.7), (1.0, 0.0)])
def test_flat_pictures_do_not_move(before, after):
    pictures = [np.full((24, 32, 3), value, np.float32) for value in (before, after)]
    found = estimated_motion(*pictures, grid(32, 24, 4))
    assert np.abs(found).max() == 0


@pytest.mark.parametrize(("width", "height"), [(1, 1), (200, 1), (15, 40), (40, 15), (2000, 12)])
def test_narrow_frames_are_not_searched(width, height):
    rng = np.random.default_rng(0)
    pictures = rng.random((2, height, width, 3), np.float32)
    places = np.array([[0, 0], [width, height]], np.float32)
    assert not estimated_motion(*pictures, places).any()


@settings(max_examples=40)
@given(st.integers(16, 40), st.integers(16, 40), st.integers(0, 5), st.integers(0, 5), st.integers(0, 99))
def test_motion_is_always_finite(width, height, first, second, seed):
    rng = np.random.default_rng(seed)
    shape = (height, width, 3)

    def picture(kind: int) -> np.ndarray:
        made = np.zeros(shape, np.float32)
        if kind == 1:
            made = rng.random(shape, np.float32)
        elif kind == 2:
            made[rng.integers(height), rng.integers(width)] = 1
        elif kind == 3:
            made += np.float32(0.5)
            made[rng.integers(height), rng.integers(width)] += np.float32(1e-6)
        elif kind == 4:
            made += np.linspace(0, 1, width, dtype=np.float32)[:, None]
        elif kind == 5:
            made += (np.indices((height, width)).sum(axis=0) % 2)[:, :, None].astype(np.float32)
        return made

    places = (rng.uniform(-1, 2, (20, 2)) * [width, height]).astype(np.float32)  # also outside of the frame
    found = estimated_motion(picture(first), picture(second), places)
    assert found.shape == (20, 2)
    assert np.isfinite(found).all()


def test_no_splats_have_no_motion():
    assert estimated_motion(smooth(64, 48), smooth(64, 48, 1), np.empty((0, 2), np.float32)).shape == (0, 2)


def test_a_p_frame_gains_from_following_the_motion():
    clip = waves(64, 48, 2, speed=4)
    base = paper_fast(iterations=20, splats=120)
    still = paper_fast(iterations=20, splats=120, effects="auto,motion=off")
    followed, stayed = (encoded(clip, chosen)[0].frames[1].psnr for chosen in (base, still))
    assert followed > stayed + 1
