"""Videos at another size and frame rate."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.encoder.source_and_target import FrameSource
from gsvc_ref.video.format import array_format
from gsvc_tools.video.resampling import (
    FrameRateReader,
    Resampled,
    ScaledReader,
    resampled,
    resampled_like,
    scaled_size,
)

RATE = Fraction(24)


def source(frames, bit_depth=8):
    height, width = frames[0].shape[:2]
    video = array_format(width, height, RATE, bit_depth)
    return FrameSource(frames, replace(video, frame_count=len(frames)))


def numbered(count):
    return [np.full((4, 6, 3), number, np.uint8) for number in range(count)]


class Timed(FrameSource):
    """Frames at the times given."""

    def __init__(self, frames, times):
        super().__init__(frames, array_format(6, 4, RATE, 8))
        self._times, self.frame_time = iter(times), None

    def __next__(self):
        frame = super().__next__()
        self.frame_time = next(self._times)
        return frame


def shown(reader):
    return [int(frame[0, 0, 0]) for frame in reader]


@pytest.mark.parametrize(
    ("rate", "expected"),
    [
        ("12", [0, 2, 4, 6]),
        ("24", [0, 1, 2, 3, 4, 5, 6]),
        (48, [0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6]),
        (Fraction(9), [0, 2, 5]),
        ("24000/1001", [0, 1, 2, 3, 4, 5, 6]),
        (10, [0, 2, 4]),
    ],
)
def test_each_time_has_the_frame_that_is_shown_then(rate, expected):
    reader = FrameRateReader(source(numbered(7)), rate)
    assert reader.format.frame_rate == Fraction(rate)
    frames = shown(reader)
    assert frames == expected
    assert reader.format.frame_count == len(expected)


def test_times_of_the_source_count_where_it_tells_them():
    times = [Fraction(5), Fraction(5) + Fraction(1, 24), Fraction(6), Fraction(6) + Fraction(1, 100)]
    reader = FrameRateReader(Timed(numbered(4), times), 4)
    assert shown(reader) == [0, 1, 1, 1, 2]
    assert reader.frame_time is None


def test_damaged_times_do_not_repeat_a_frame_for_years():
    reader = FrameRateReader(Timed(numbered(2), [Fraction(0), Fraction(10**9)]), 25)
    with pytest.raises(GsvcError, match="more than 3600 seconds"):
        list(reader)


def test_frames_whose_times_go_back_are_not_shown():
    reader = FrameRateReader(Timed(numbered(3), [Fraction(0), Fraction(1), Fraction(1, 2)]), 2)
    assert shown(reader) == [0, 0]


def test_the_last_frame_is_shown_to_its_end():
    source = Timed(numbered(2), [Fraction(0), Fraction(1)])
    source.end_time = Fraction(3)
    assert shown(FrameRateReader(source, 2)) == [0, 0, 1, 1, 1, 1]


@pytest.mark.parametrize("bit_depth", [8, 10, 16])
def test_an_even_picture_stays_even_and_a_slope_stays_a_slope(bit_depth):
    peak = 2**bit_depth - 1
    dtype = np.uint8 if bit_depth == 8 else np.uint16
    even = np.full((12, 20, 3), peak, dtype)
    slope = np.repeat(np.linspace(0, peak, 64).round().astype(dtype)[None, :, None], 3, axis=2).repeat(16, axis=0)
    for picture in (even, slope):
        half = resampled(picture, picture.shape[1] // 2, picture.shape[0] // 2, peak)
        assert half.dtype == dtype
        assert half.shape == (picture.shape[0] // 2, picture.shape[1] // 2, 3)
        area = picture.reshape(half.shape[0], 2, half.shape[1], 2, 3).mean(axis=(1, 3))
        assert np.abs(half - area)[:, 2:-2].max() <= max(1, peak / 250)
        assert half.max() <= peak


def test_small_details_do_not_alias():
    stripes = np.zeros((32, 32, 3), np.uint8)
    stripes[:, ::2] = 255
    small = resampled(stripes, 8, 8, 255)[:, 1:-1]
    assert abs(small.mean() - 127.5) < 3
    assert small.std() < 3


@pytest.mark.parametrize(
    ("scale", "size"), [(0.5, (48, 27)), (1.0, (96, 54)), (2, (192, 108)), ((30, 20), (30, 20)), (0.004, (1, 1))]
)
def test_sizes(scale, size):
    assert scaled_size(96, 54, scale) == size


@pytest.mark.parametrize("scale", [0.0, -1.0, 17.0, float("nan"), (0, 5), (70000, 5), (60000, 60000)])
def test_sizes_that_cannot_be_are_refused(scale):
    with pytest.raises(UsageError):
        scaled_size(96, 54, scale)


@pytest.mark.parametrize("rate", [0, "x", Fraction(1, 100), 24 * 17])
def test_rates_that_cannot_be_are_refused(rate):
    with pytest.raises(UsageError):
        FrameRateReader(source(numbered(2)), rate)


def test_pixels_get_another_shape_where_the_picture_does():
    wide = ScaledReader(source(numbered(1)), (6, 8))
    assert wide.format.sample_aspect_ratio == 2
    assert ScaledReader(source(numbered(1)), 3.0).format.sample_aspect_ratio == 1
    assert ScaledReader(source(numbered(1)), (12, 8)).format.sample_aspect_ratio == 1


def test_both_at_once_again_and_again_and_said():
    both = Resampled(lambda: source(numbered(6)), 2.0, 12)
    for _ in range(2):
        with both.open_video() as reader:
            assert (reader.format.width, reader.format.height, reader.format.frame_rate) == (12, 8, 12)
            assert shown(reader) == [0, 2, 4]
            assert ["from 24 to 12" in reader.notes[0], "from 6x4 to 12x8" in reader.notes[1]] == [True, True]
    with Resampled(lambda: source(numbered(6))).open_video() as reader:
        assert reader.notes == []
        assert len(list(reader)) == 6


@pytest.mark.parametrize(
    ("scale", "rate"), [(2.0, None), (0.5, None), (None, Fraction(12)), (1.3, Fraction(9)), (None, None)]
)
def test_a_source_is_resampled_as_a_stream_of_it_was(scale, rate):
    def opened():
        return source(numbered(7))

    with Resampled(opened, scale, rate).open_video() as reader:
        video, frames = reader.format, list(reader)
    with resampled_like(opened, video).open_video() as reader:
        assert (reader.format.width, reader.format.height) == (video.width, video.height)
        np.testing.assert_array_equal(list(reader), frames)


def test_a_source_of_another_shape_or_another_length_is_left_as_it_is():
    def opened():
        return source(numbered(7))

    for changes in ({"width": 4, "height": 6}, {"frame_rate": Fraction(12), "frame_count": 5}):
        with resampled_like(opened, replace(opened().format, **changes)).open_video() as reader:
            assert reader.format == opened().format
