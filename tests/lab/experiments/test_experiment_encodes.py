import math
from dataclasses import replace

import numpy as np
import pytest
from tiny_clips import tiny_clip

from gsvc_base.errors import UsageError
from gsvc_lab.experiments.ablation import WEIGHTS, variant
from gsvc_lab.experiments.encodes import decoded_ms_ssim, encoded, excerpt, fitted_frames, held, joined, shortened
from gsvc_ref.encoder import Settings


def test_shortened_settings_keep_the_fractions_of_the_schedule():
    settings = shortened(Settings.paper(), 500, 2e-2)
    for kind in (settings.intra, settings.inter):
        assert (kind.fit.iterations, kind.tune.iterations) == (500, 50)
        assert [kind.fit.schedule(i) for i in (0, 199, 200, 400)] == [1, 1, 0.5, 0.25]
        assert kind.fit.rates.columns()[0] == kind.tune.rates.columns()[8] == pytest.approx(2e-2)
    prunings = [kind.fit.pruning for kind in (settings.intra, settings.inter)]
    assert [(p.first, p.last, p.interval, p.fraction) for p in prunings] == [(5, 200, 5, 0.1), (25, 50, 5, 0.1)]


def test_an_excerpt_is_those_frames_and_no_more_than_there_are():
    clip = tiny_clip(frames=6)
    part = excerpt(clip, 2, 3, 32, 24)
    assert part.format.frame_count == 3
    np.testing.assert_array_equal(list(part.frames()), list(clip.frames(2, 5)))
    np.testing.assert_array_equal(list(part.frames(1)), list(clip.frames(3, 5)))
    assert excerpt(clip, 4, 9, 32, 24).format.frame_count == 2
    with pytest.raises(UsageError, match="tiny has no frame 6"):
        excerpt(clip, 6, 1, 32, 24)


@pytest.mark.parametrize("stated", [None, 99])
def test_the_frames_of_an_excerpt_are_counted(stated):
    clip = tiny_clip(frames=3)
    assert excerpt(replace(clip, format=replace(clip.format, frame_count=stated)), 0, 9, 32, 24).format.frame_count == 3


def test_a_held_clip_is_read_once():
    clip, reads = tiny_clip(), []

    def read(start):
        reads.append(start)
        return clip.read(start)

    small = held(replace(clip, read=read))
    for _ in range(2):
        np.testing.assert_array_equal(list(small.frames(1, 3)), list(clip.frames(1, 3)))
    assert reads == [0]
    large = replace(clip, read=read, format=replace(clip.format, frame_count=10**6))
    assert held(large) is large


def test_joined_clips_follow_one_another():
    clips = [tiny_clip("a", 5), tiny_clip("b", 2), tiny_clip("c", 5, cut=5)]
    clip, seams = joined(clips, 3, 32, 24)
    assert (seams, clip.format.frame_count) == ([3, 5], 8)
    expected = [*clips[0].frames(0, 3), *clips[1].frames(), *clips[2].frames(0, 3)]
    np.testing.assert_array_equal(list(clip.frames()), expected)
    np.testing.assert_array_equal(list(clip.frames(4)), expected[4:])


def test_an_encode_tells_what_its_stream_has():
    clip, told = tiny_clip(frames=3), []
    made = encoded(
        clip, Settings.quick(profile="paper", splats=20, iterations=4, threads=1, key_frames=2), told.append, "it"
    )
    assert (made.types, made.key_frames) == ("IPI", (0, 2))
    assert len(made.psnr) == len(made.bits) == 3
    assert sum(made.bits) < 8 * len(made.stream)
    assert told[-1].startswith("it: ")
    assert len(decoded_ms_ssim(clip.frames(), made.stream, 1)) == 3


def test_every_variant_ends_with_as_many_splats():
    base = shortened(Settings.paper(splats=40, threads=1), 20, 2e-2)
    clip = tiny_clip(frames=3)
    for name in ("P only", WEIGHTS, "+ GSP", "+ GSA", "+ DKS"):
        frames = list(fitted_frames(clip.frames(), variant(name, base, (0, 2)), (0,)))
        assert [len(frame.splats) for frame in frames] == [36] * 3, name
        assert all(math.isfinite(frame.quality.psnr) and 0 <= frame.quality.ms_ssim <= 1 for frame in frames)


def test_a_p_frame_begins_with_the_splats_before():
    settings = variant("P only", shortened(Settings.paper(splats=40, threads=1), 30, 2e-2), (0,))
    still = [next(tiny_clip().frames())] * 3
    predicted = [frame.quality.psnr for frame in fitted_frames(still, settings, (0,))]
    alone = [frame.quality.psnr for frame in fitted_frames(still, settings, (0, 1, 2))]
    assert predicted[0] == alone[0]
    assert predicted[2] > alone[2] + 1
