"""Constant quality: the searches alone, on functions whose answer is known, and what they make of clips."""

from dataclasses import replace
from itertools import islice
from typing import NamedTuple

import numpy as np
import pytest
from codec_cases import encoded, logged_types, paper_quick, waves

from gsvc_lab.scenes import Scene, frames
from gsvc_ref.encoder import Settings
from gsvc_ref.encoder.held_quality import (
    ENOUGH,
    I_TRIES,
    MAX_TRIES,
    is_missed,
    search_removals,
    search_splat_count,
    search_threshold,
)
from gsvc_ref.metrics import psnr
from gsvc_ref.stream import decode


class Made(NamedTuple):
    """A frame of which only the PSNR is known, and of what number it was made."""

    psnr: float
    of: float


def counting(curve):
    """`curve` as a function that makes frames, and the numbers that it was asked for."""
    asked = []

    def make(number):
        asked.append(number)
        return Made(curve(number), number)

    return make, asked


@pytest.mark.parametrize("slope", [2.5, 4.5, 9.0])
@pytest.mark.parametrize("first", [40, 300, 4000])
def test_a_line_over_the_logarithm_is_found(slope, first):
    make, asked = counting(lambda n: 30 + slope * np.log2(n / 300))
    number, frame = search_splat_count(make, first, 5000, 30.0)
    assert frame.of == number
    assert 30 <= frame.psnr <= 30 + ENOUGH
    assert len(asked) <= I_TRIES


def test_where_steps_are_larger_than_enough_the_fewest_that_reach_it_are_found():
    make, asked = counting(lambda n: 30 + 2 * (n // 50 - 6) + 0.5)
    number, frame = search_splat_count(make, 330, 5000, 30.0)
    assert frame.psnr == 30.5
    assert number == min(n for n in asked if n >= 300)
    assert len(asked) == len(set(asked)) <= I_TRIES


def test_a_goal_out_of_reach_takes_all_splats_that_are_allowed():
    make, asked = counting(lambda n: 20 + np.log2(n))
    number, frame = search_splat_count(make, 10, 640, 35.0)
    assert (number, frame.of) == (640, 640)
    assert len(asked) == len(set(asked)) <= MAX_TRIES


def test_the_search_goes_on_while_nothing_reaches_the_goal():
    make, asked = counting(lambda n: 30 - 0.2 * (n < 100) - 1.0 * (n < 98) - 1.0 * (n < 90))
    _, frame = search_splat_count(make, 80, 500, 30.0)
    assert frame.psnr >= 30
    assert len(asked) <= MAX_TRIES


@pytest.mark.parametrize("spare", [0, 1, 7, 62])
def test_as_many_splats_are_spared_as_the_goal_allows(spare):
    make, asked = counting(lambda fewer: 30.0 if fewer <= spare else 29.9)
    whole = Made(31.0, 0)
    assert search_removals(make, whole, 63, 30.0) == (Made(30.0, spare) if spare else whole)
    assert len(asked) <= 6


@pytest.mark.parametrize("most", [1.3, 3.0, 20.0])
def test_changes_become_fewer_until_the_goal_is_near(most):
    make, _ = counting(lambda scale: 30 + 0.4 * np.log2(most / scale))
    begin = make(1.0)
    frame = search_threshold(make, begin, 30.0)
    assert 30 <= frame.psnr <= begin.psnr
    assert frame.psnr <= 30 + 2 * ENOUGH
    assert search_threshold(make, begin, 99.0) == begin  # it misses the goal as it is


def test_an_i_frame_takes_the_place_of_a_p_frame_only_where_i_frames_are_better():
    assert is_missed(29.99, 30, 30.05)
    assert not is_missed(30.0, 30, 30.05)
    assert not is_missed(27.5, 30, 28)
    assert is_missed(26.5, 30, 28)


@pytest.fixture(scope="module")
def clip():
    """A scene that moves, 64x48, and the same frame again, all but equal."""
    some = list(islice(frames(Scene.named("pan").resized(width=64, height=48)), 4))
    again = some[-1].copy()
    again[0, 0] ^= 1
    return [*some, again]


@pytest.fixture(scope="module")
def paper(clip):
    return encoded(clip, Settings.quick(profile="paper", psnr=32.0, key_frames=100, threads=1))


@pytest.mark.parametrize("profile", ["main", "paper"])
def test_quality_is_held_in_every_frame_and_hardly_exceeded(clip, paper, profile):
    """By P-frames: in profile `main` those of this clip once became I-frames, for a tenth of a dB."""
    settings = Settings.quick(profile="main", psnr=30.0, key_frames=100, threads=1)
    (report, data), goal = (paper, 32.0) if profile == "paper" else (encoded(clip, settings), 30.0)
    for source, picture in zip(clip, decode(data), strict=True):
        assert goal <= psnr(source, picture, 255) <= goal + 3 * ENOUGH
    assert "I" not in [frame.type for frame in report.frames[1:]]


def test_a_frame_that_has_the_quality_already_is_repeated(paper):
    report, _ = paper
    assert report.frames[-1].type == "R"
    (why,) = [one.reason for one in report.frames[-1].decisions if one.effect == "frames"]
    assert why == report.frames[-1].reason == "the frame before has the quality"


def test_a_cut_becomes_an_i_frame_where_a_p_frame_misses_the_quality():
    cut = [np.zeros((24, 32, 3), np.uint8), waves(frames=1)[0]]
    settings = Settings.quick(profile="paper", psnr=40.0, key_frames=100, threads=1)
    report, data = encoded(cut, settings)
    assert [frame.type for frame in report.frames] == ["I", "I"]
    assert report.frames[1].reason == "a P-frame does not reach the quality"
    assert logged_types(data)[1] == "an I-frame: a P-frame does not reach the quality"


def test_what_keeps_frames_from_their_quality_is_told():
    noise = [np.random.default_rng(0).integers(0, 256, (16, 24, 3), np.uint8)]
    report, _ = encoded(noise, replace(paper_quick(iterations=10, threads=1), psnr=50.0, splats=14))
    assert report.notes[-1].endswith("the 14 splats that a frame may have are all in use, so allow more splats")
