"""Frames of a few pixels: each has a splat, and noise comes back as it was."""

import numpy as np
import pytest

import gsvc_ref
from gsvc_ref import Settings
from gsvc_ref.encoder.main.pixels import PIXEL_SPLATS
from gsvc_ref.encoder.settings import PIXELS_PER_SPLAT

SEEDS = range(6)


def noise(width, height, seed, depth=8):
    kind = np.uint8 if depth == 8 else np.uint16
    return np.random.default_rng(seed).integers(0, 1 << depth, (3, height, width, 3), dtype=kind)


def largest_error(frames, folder, **settings):
    report = gsvc_ref.encode(frames, folder / "noise.gsvc", Settings.quick(**settings))
    decoded = np.stack([*gsvc_ref.decode(folder / "noise.gsvc")]).astype(np.int64)
    return int(np.abs(decoded - frames).max()), report


@pytest.mark.parametrize(
    ("width", "height", "most"), [(1, 1, 0), (1, 2, 0), (2, 1, 0), (2, 2, 0), (1, 16, 1), (16, 1, 1), (13, 3, 1)]
)
def test_noise_comes_back_as_it_was(width, height, most, tmp_path):
    assert width * height < PIXELS_PER_SPLAT
    for seed in SEEDS if width * height < 16 else SEEDS[:2]:
        error, _ = largest_error(noise(width, height, seed), tmp_path)
        assert error <= most, f"seed {seed}"


def test_noise_that_must_keep_a_psnr_keeps_it(tmp_path):
    frames = noise(2, 2, 1)[:2]
    _, report = largest_error(frames, tmp_path, psnr=50.0)
    assert all(frame.psnr >= 50 for frame in report.frames)


@pytest.mark.parametrize("profile", ["main", "paper"])
def test_one_pixel_is_exact_in_both_profiles(profile, tmp_path):
    for seed in SEEDS:
        error, report = largest_error(noise(1, 1, seed), tmp_path, profile=profile, key_frames=())
        assert error == 0, f"seed {seed}"
        assert [frame.reason for frame in report.frames[1:]] == [PIXEL_SPLATS, PIXEL_SPLATS]


def test_one_pixel_of_sixteen_bits_is_exact(tmp_path):
    error, _ = largest_error(noise(1, 1, 3, depth=16), tmp_path)
    assert error == 0


def test_a_black_picture_needs_no_splat(tmp_path):
    error, report = largest_error(np.zeros((2, 2, 2, 3), np.uint8), tmp_path)
    assert (error, report.frames[0].splats) == (0, 0)
