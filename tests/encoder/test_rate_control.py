"""Constant rate and constant quality: which splats go, how many stay, and what a frame must reach."""

import math

import numpy as np
import pytest
from codec_cases import encoded, paper_fast, paper_quick, waves

from gsvc_base.splats import Splats
from gsvc_ref.encoder import Settings
from gsvc_ref.encoder import paper as paper_module
from gsvc_ref.encoder.held_quality import visibility
from gsvc_ref.metrics import psnr
from gsvc_ref.rendering import render_sum
from gsvc_ref.stream import decode


def test_visibility_is_what_the_removal_of_a_splat_adds():
    """Eight splats far from each other: the sum of squares of each alone, by the exact renderer."""
    x, y = np.meshgrid(np.arange(25, 200, 50), np.arange(25, 100, 50))
    rng = np.random.default_rng(0)
    parameters = np.column_stack(
        [
            x.ravel(),
            y.ravel(),
            rng.uniform(2, 5, 8),
            rng.uniform(-2, 2, 8),
            rng.uniform(2, 5, 8),
            rng.normal(0, 0.5, (8, 3)),
        ]
    ).astype(np.float32)
    whole = render_sum(Splats.from_array(parameters), 200, 100, precision="exact")
    added = []
    for n in range(8):
        rest = Splats.from_array(np.delete(parameters, n, axis=0))
        added.append(np.square(whole - render_sum(rest, 200, 100, precision="exact")).sum())
    np.testing.assert_allclose(math.pi * visibility(parameters), added, rtol=2e-3)


def test_a_splat_with_a_negative_factor_is_not_visible():
    parameters = np.array(
        [[5, 5, -1, 0, 2, 1, 1, 1], [5, 5, 1, 0, -2, 1, 1, 1], [5, 5, -1, 0, -2, 1, 1, 1]], np.float32
    )
    assert not visibility(parameters).any()


def test_a_picture_that_jumps_comes_back_to_the_quality_of_its_i_frame():
    """The source is the same from frame 1 on; a pass over one frame is too short to draw it anew."""
    before, after = waves(frames=1)[0], np.ascontiguousarray(waves(frames=1)[0][::-1, ::-1])
    report, _ = encoded([before, *[after] * 8], Settings.quick(splats=80, key_frames=100, threads=1))
    first, jump, *later = report.frames
    assert jump.psnr < first.psnr - 1  # otherwise there is nothing to catch up with
    why = "equal to the frame before, which is not yet as good as its I-frame"
    assert (later[0].type, later[0].reason) == ("P", why)
    assert next(one for one in later[0].decisions if one.effect == "frames").reason == why
    assert (later[-1].type, later[-1].reason) == ("R", "equal to the frame before")
    assert later[-1].psnr > jump.psnr + 1


@pytest.mark.parametrize(("goal", "at_cut"), [(24.0, "P"), (28.0, "I"), (33.0, "I")])
def test_constant_quality_holds_in_every_frame(goal, at_cut):
    """Through a cut as well: by a P-frame with more splats, or, where that misses the goal, by an I-frame."""
    clip = waves(frames=3, cut=2)
    settings = paper_quick(iterations=40, psnr=goal, key_frames=(), threads=1, precision="deterministic")
    report, data = encoded(clip, settings)
    assert [frame.type for frame in report.frames] == ["I", "P", at_cut]
    reason = "predicted" if at_cut == "P" else "a P-frame does not reach the quality"
    assert report.frames[2].reason == reason
    assert min(psnr(*pair, 255) for pair in zip(clip, decode(data), strict=True)) >= goal
    assert report.frames[2].new_splats > report.frames[1].new_splats
    assert max(frame.splats for frame in report.frames) < settings.most_splats(32, 24)


def test_of_all_attempts_at_a_quality_the_best_is_kept(monkeypatch):
    """Where the quantisers are the limit more splats do not help, and the last attempt can be the worst."""
    attempts = []
    finish = paper_module._PaperFrame._reconstructed

    def recording(work, codes, state):
        attempts.append(finish(work, codes, state))
        return attempts[-1]

    monkeypatch.setattr(paper_module._PaperFrame, "_reconstructed", recording)
    settings = paper_fast(iterations=40, psnr=24.0, cholesky_bits=2, color_stages=1, color_codewords=4)
    report, data = encoded(waves(frames=1), settings)
    qualities = [attempt.psnr for attempt in attempts]
    assert qualities[-1] < max(qualities) < 24
    frame = report.frames[0]
    assert frame.psnr == max(qualities)
    assert frame.psnr == psnr(waves(frames=1)[0], next(decode(data)), 255)
    assert frame.iterations == attempts[-1].iterations  # all the work, not that of the best alone


def test_an_easy_frame_takes_fewer_splats_than_a_hard_one():
    y, x = np.mgrid[:24, :32]
    slope = np.repeat(((3 * x + 4 * y)[:, :, None]).astype(np.uint8), 3, axis=2)
    settings = paper_quick(iterations=40, psnr=26.0, key_frames=1, threads=1)
    report, _ = encoded([slope, *waves(frames=1)], settings)
    easy, hard = report.frames
    assert min(easy.psnr, hard.psnr) >= 26
    assert easy.splats < hard.splats


def test_more_quality_takes_more_splats_and_more_bytes():
    sizes = []
    for goal in (27.0, 32.0, 37.0):
        report, data = encoded(waves(frames=1), paper_quick(iterations=40, psnr=goal, cholesky_bits=8, threads=1))
        sizes.append((report.frames[0].splats, len(data)))
    assert sizes == sorted(sizes)
    assert len({splats for splats, _ in sizes}) == 3


def test_the_most_splats_are_a_bound_for_constant_quality():
    noise = [np.random.default_rng(t).integers(0, 256, (16, 24, 3), np.uint8) for t in range(2)]
    report, _ = encoded(noise, paper_fast(psnr=50.0, splats=14))
    assert [frame.splats for frame in report.frames] == [14, 14]


def test_constant_rate_gives_every_frame_the_same_number_of_splats():
    report, _ = encoded(waves(frames=4, cut=2), paper_fast(splats=33, key_frames=3, effects="auto,gsa=all"))
    assert [frame.splats for frame in report.frames] == [33] * 4
    assert all(frame.new_splats == frame.pruned_splats == 1 for frame in report.frames if frame.type == "P")


@pytest.mark.parametrize(("splats", "left"), [(40, 36), (10, 9), (15, 13), (3, 3), (1, 1)])
def test_the_papers_frames_have_nine_tenths_of_their_splats(splats, left):
    """GSP removes 10 % of an I-frame's; GSA adds as many to a P-frame, and GSP removes them again."""
    report, _ = encoded(waves(frames=4), Settings.paper(iterations=40, splats=splats, key_frames=3, threads=1))
    assert [frame.splats for frame in report.frames] == [left] * 4
    assert [frame.type for frame in report.frames] == ["I", "P", "P", "I"]
