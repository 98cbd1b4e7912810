import base64
import io
from fractions import Fraction

import numpy as np
import pytest
from PIL import Image

from gsvc_lab.pages import pictures
from gsvc_lab.pages.pictures import (
    animation_uri,
    difference_picture,
    png_uri,
    side_by_side,
    splat_centres_picture,
    to_eight_bits,
)

GREY = np.full((20, 30, 3), 128, np.uint8)


def opened(uri, kind):
    head, content = uri.split(",", 1)
    assert head == f"data:image/{kind};base64"
    return Image.open(io.BytesIO(base64.b64decode(content, validate=True)))


def test_png_is_exact():
    picture = np.random.default_rng(0).integers(0, 256, (7, 5, 3), dtype=np.uint8)
    np.testing.assert_array_equal(np.asarray(opened(png_uri(picture), "png")), picture)


def test_difference_is_signed_amplified_and_clipped():
    original = np.array([[[100, 100, 100], [0, 255, 7]]], np.uint8)
    decoded = np.array([[[101, 98, 100], [255, 0, 7]]], np.uint8)
    np.testing.assert_array_equal(difference_picture(original, decoded), [[[136, 112, 128], [255, 0, 128]]])
    deep = [f.astype(np.uint16) * 257 for f in (original, decoded)]
    np.testing.assert_array_equal(difference_picture(*deep, peak=65535), difference_picture(original, decoded))


@pytest.mark.parametrize(
    ("peak", "value", "shown"), [(255, 200, 200), (1023, 1023, 255), (1023, 512, 128), (1, 1, 255)]
)
def test_any_depth_is_shown_with_eight_bits(peak, value, shown):
    assert (to_eight_bits(np.full((2, 2, 3), value, np.uint16), peak) == shown).all()


def test_centres_stand_where_the_splats_are():
    positions = np.array([[10.0, 5.0], [25.5, 15.25]], np.float32)
    plain = splat_centres_picture(GREY, positions[:0])
    dotted = splat_centres_picture(GREY, positions)
    assert dotted.shape == (80, 120, 3)
    ink = np.abs(plain.astype(float) - dotted).sum(axis=2)
    y, x = np.mgrid[0.5:80, 0.5:120]
    for centre_x, centre_y in positions * 4:
        near = np.hypot(x - centre_x, y - centre_y) < 4
        assert ink[near].sum() > 0
        assert np.average(x[near], weights=ink[near]) == pytest.approx(centre_x, abs=0.05)
        assert np.average(y[near], weights=ink[near]) == pytest.approx(centre_y, abs=0.05)
        ink[near] = 0
    assert not ink.any()


def test_outline_is_the_ellipse_of_one_standard_deviation():
    position, factor = np.array([[15.0, 10.0]], np.float32), np.array([[6.0, 2.0, 3.0]], np.float32)
    dotted = splat_centres_picture(GREY, position)
    outlined = splat_centres_picture(GREY, position, factor)
    ys, xs = np.nonzero((dotted != outlined).any(axis=2))
    u1 = ((xs + 0.5) / 4 - 15) / 6
    u2 = ((ys + 0.5) / 4 - 10 - 2 * u1) / 3
    radius = np.hypot(u1, u2)
    assert len(radius) > 60
    assert radius.min() > 0.8
    assert radius.max() < 1.2


def test_only_a_few_outlines_from_small_to_large_are_drawn(monkeypatch):
    seen = []
    original = pictures._ink
    monkeypatch.setattr(pictures, "_ink", lambda c, points, *rest: seen.append(points) or original(c, points, *rest))
    count = 100
    positions = np.zeros((count, 2), np.float32)
    factors = np.stack([np.arange(1, count + 1), np.zeros(count), np.arange(1, count + 1)], axis=1).astype(np.float32)
    splat_centres_picture(GREY, positions, factors, ellipses=3, scale=1)
    np.testing.assert_allclose(sorted(set(np.hypot(*seen[0].T).round(3))), [1, 51, 100])


@pytest.mark.parametrize("where", [(-50.0, 3.0), (1e30, -1e30), (31.0, 20.5)])
def test_splats_outside_the_frame_are_left_out(where):
    outside = np.array([where], np.float32)
    huge = np.array([[1e20, -1e20, 1e20]], np.float32)
    np.testing.assert_array_equal(splat_centres_picture(GREY, outside, huge), splat_centres_picture(GREY, outside[:0]))


def test_side_by_side_keeps_both():
    joined = side_by_side(GREY, GREY + np.uint8(5))
    np.testing.assert_array_equal(joined[:, :30], GREY)
    np.testing.assert_array_equal(joined[:, -30:], GREY + np.uint8(5))


def test_animation_has_every_frame_and_keeps_the_time():
    clip = [np.full((16, 32, 3), 10 * number, np.uint8) for number in range(12)]
    moving = opened(animation_uri(clip, Fraction(24)), "webp")
    assert moving.n_frames == 12
    assert moving.size == (32, 16)
    times = []
    for number in range(12):
        moving.seek(number)
        moving.load()
        times.append(moving.info["duration"])
    assert sum(times) == 500
    assert set(times) == {41, 42}


def test_a_large_animation_is_cut_to_size(monkeypatch):
    monkeypatch.setattr(pictures, "MAX_PREVIEW_BYTES", 12_000)
    rng = np.random.default_rng(0)
    clip = [rng.integers(0, 256, (64, 64, 3), dtype=np.uint8) for _ in range(16)]
    uri = animation_uri(clip, Fraction(25))
    assert len(base64.b64decode(uri.split(",")[1])) <= 12_000
    assert 1 <= opened(uri, "webp").n_frames < 16


def test_one_frame_that_is_too_large_is_still_shown(monkeypatch):
    monkeypatch.setattr(pictures, "MAX_PREVIEW_BYTES", 10)
    assert opened(animation_uri([GREY, GREY], Fraction(25)), "webp").size == (30, 20)


def test_without_webp_there_is_no_animation(monkeypatch):
    monkeypatch.setattr(pictures.features, "check", lambda _name: False)
    assert animation_uri([GREY], Fraction(25)) is None
