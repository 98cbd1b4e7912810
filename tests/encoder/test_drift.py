"""Constant rate in profile `main`: the choice of D alone, on PSNRs that are given, and what it makes of clips."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from codec_cases import encoded

from gsvc_lab.scenes import demo_clip
from gsvc_ref.encoder import Settings
from gsvc_ref.encoder.drift import FINEST, JUMP, RECOVERED, Drift
from gsvc_ref.encoder.main.frame import MainFrameEncoder
from gsvc_ref.encoder.main.layers import LayeredFrameEncoder
from gsvc_ref.stream import Stream

FALL = 1.5
INTRA = 40
"""The quantiser of the I-frame."""


def chosen(*psnrs, intra=INTRA):
    """The quantizers that follow P-frames of these PSNRs."""
    drift, quantizer, found = Drift(FALL, intra), intra, []
    for psnr in psnrs:
        drift = drift.after(psnr)
        quantizer = drift.following(quantizer)
        found.append(quantizer)
    return found


def test_a_step_finer_for_each_frame_that_is_behind():
    assert chosen(35.0, 34.0, 33.5, 33.4, 33.3, 33.4) == [40, 40, 40, 39, 38, 37]


def test_d_comes_back_once_the_psnr_does_and_no_further():
    behind = FALL - RECOVERED
    assert chosen(35.0, 33.0, 33.0, 35 - behind - 0.01, 35 - behind + 0.01, 34.0, 36.0) == [40, 39, 38, 38, 39, 40, 40]


@pytest.mark.parametrize(("intra", "finest"), [(INTRA, INTRA - FINEST), (3, 0)])
def test_d_has_a_finest(intra, finest):
    assert chosen(35.0, *[33.0] * 20, intra=intra)[-1] == finest


def test_what_falls_at_once_shows_something_else():
    """P-frames are then compared with what is shown now; and what falls as far step by step sinks."""
    assert chosen(35.0, 35 - JUMP - 0.1, 31.0, 30.5) == [40] * 4
    assert chosen(35.0, 33.6, 32.1)[-1] == 39


def test_layers_do_not_correct_their_own_drift():
    """Their D is that of all of them together, in every group of pictures."""
    encoder = LayeredFrameEncoder(Settings.quick(layer_splats=(20, 30)), 48, 32, 8)
    for each in (encoder, encoder.for_group(), encoder.for_group().for_group()):
        assert [part.corrects_drift for part in each.parts] == [False, False]
    assert MainFrameEncoder(Settings.quick(splats=20), 48, 32, 8).for_group().corrects_drift


def fallen(report):
    """By how many dB the mean PSNR of the last third is below that of the first."""
    values = [frame.psnr for frame in report.frames]
    third = len(values) // 3
    return np.mean(values[:third]) - np.mean(values[-third:])


def quantizers(data):
    return [frame.codes.quantizer for frame in Stream(data) if frame.codes.type != "R"]


def before_the_cut(count):
    return list(islice(demo_clip(96, 56), count))


def test_p_frames_do_not_sink():
    clip = before_the_cut(18)
    settings = Settings.quick(threads=1, splats=150, key_frames=len(clip))
    sinking = replace(settings, inter=replace(settings.inter, fall=200.0))
    free, sunk = encoded(clip, sinking)
    held, data = encoded(clip, settings)
    assert fallen(free) > 2
    assert fallen(held) < fallen(free) - 0.8
    assert set(quantizers(sunk)) == {quantizers(sunk)[0]}
    steps = np.diff(quantizers(data))
    assert steps.min() == -1
    assert steps.max() <= 1
    assert 0 < quantizers(data)[0] - min(quantizers(data)) <= FINEST


@pytest.mark.parametrize("asked", [{"quality": 25}, {"quality": 25, "splats": 100}])
def test_a_step_that_is_asked_for_stays(asked):
    settings = Settings.quick(threads=1, key_frames=10, **asked)
    assert set(quantizers(encoded(before_the_cut(10), settings)[1])) == {54}


def test_a_cut_inside_a_group_does_not_make_d_finer():
    plain = [np.full((32, 48, 3), grey, np.uint8) for grey in (90, 92)]
    rng = np.random.default_rng(5)
    noise = [rng.integers(0, 256, (32, 48, 3), np.uint8) for _ in range(4)]
    settings = Settings.quick(threads=1, splats=60, key_frames=6, effects="auto,frames=all")
    report, data = encoded([*plain, *noise], settings)
    values = [frame.psnr for frame in report.frames]
    assert min(values[:2]) > max(values[2:]) + JUMP
    assert len(set(quantizers(data))) == 1
