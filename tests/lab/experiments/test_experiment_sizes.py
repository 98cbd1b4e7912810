"""Smaller pictures: means of squares, the must at half size, and a clip of its own."""

import numpy as np
import pytest

from gsvc_base.splats import Splats
from gsvc_lab.experiments import sizes
from gsvc_lab.experiments.sizes import Measured, means, smaller, verdict


def test_means_are_those_of_whole_squares():
    picture = np.arange(5 * 4 * 3).reshape(5, 4, 3)
    found = means(picture, 2)
    assert found.shape == (2, 2, 3)
    assert np.array_equal(found[1, 0], picture[2:4, :2].mean(axis=(0, 1)))


def test_a_line_of_one_pixel_is_missed_by_samples_and_seen_by_the_filter():
    line = Splats.from_array([[4.5, 4, 0.3, 0, 100, 1, 1, 1]])
    sampled, filtered, mean = (smaller(line, way, 8, 8, 4)[0, :, 0] for way in sizes.WAYS)
    assert sampled.max() == 0
    assert filtered.max() > 0.1
    assert mean.max() == pytest.approx(0.25, abs=0.01)


@pytest.mark.parametrize(("filtered", "holds"), [(38.5, "yes"), (38.3, "no")])
def test_the_must_is_about_half_size(filtered, holds):
    half = Measured("a", 9, 1, {"sampled": 30.0, "filtered": filtered, "means": 40.0}, {})
    quarter = Measured("a", 9, 2, {"sampled": 20.0, "filtered": 30.0, "means": 40.0}, {})
    assert verdict([half, quarter]).holds == holds


def test_a_clip_is_measured_at_both_sizes(quiet, monkeypatch):
    monkeypatch.setattr(sizes, "FRAMES", 1)
    clip = sizes.excerpt(sizes.scene_clip("pan", 32, 24, 1), 0, 1, 32, 24)
    found = sizes.measure(clip, 25, quiet)
    assert [one.halvings for one in found] == [1, 2]
    assert found[0].pictures["filtered"].shape == (12, 16, 3)
    assert all(one.psnr["filtered"] > one.psnr["sampled"] for one in found)
