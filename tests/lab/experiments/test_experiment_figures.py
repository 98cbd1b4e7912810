"""Figures: the same numbers give the same file, pictures inside are small."""

import re

import numpy as np
import pytest

pytest.importorskip("matplotlib", reason="figures are drawn by matplotlib: pip install 'gsvc_ref[experiments]'")

from gsvc_lab.experiments.figures import (
    LARGEST_PICTURE,
    line,
    log_axis,
    new_figure,
    save_figure,
    show_centers,
    show_picture,
)


def drawn(folder, name):
    figure, axes = new_figure(6, 4, 1, 3)
    noise = np.random.default_rng(1).integers(0, 256, (60, 80, 3), np.uint8)
    show_picture(axes[0, 0], noise, "a picture")
    show_centers(axes[0, 1], np.random.default_rng(0).random((500, 2), np.float32) * 60, 80, 60, "centres")
    line(axes[0, 2], [10, 100, 1000], [1, 2, 3], 0, "a line")
    log_axis(axes[0, 2], [10, 100, 1000])
    return (folder / f"{save_figure(figure, folder, name)}.svg").read_text()


def test_the_same_numbers_give_the_same_file(tmp_path):
    first = drawn(tmp_path, "one")
    assert first == drawn(tmp_path, "two")
    assert "dc:date" not in first
    assert "1,000" in first


def test_pictures_inside_are_small(tmp_path):
    text = drawn(tmp_path, "one")
    kinds = re.findall(r"data:image/(\w+);base64", text)
    assert sorted(kinds) == ["jpeg", "png"]
    assert len(text) < 30_000


def test_large_pictures_are_resampled(tmp_path):
    _, axes = new_figure(3, 2)
    show_picture(axes[0, 0], np.zeros((300, 900, 3), np.float32), "large")
    assert axes[0, 0].images[0].get_array().shape == (LARGEST_PICTURE // 3, LARGEST_PICTURE, 3)


def test_centres_outside_of_the_frame_are_not_shown():
    _, axes = new_figure(3, 2)
    show_centers(axes[0, 0], np.array([[1, 1], [-1, 3], [4, 9]], np.float32), 8, 8, "centres")
    np.testing.assert_array_equal(axes[0, 0].collections[0].get_offsets(), [[1, 1]])
