"""The encoder of profile `main`: what settings, effects and a quality that is asked for make of frames."""

import numpy as np
import pytest
from codec_cases import encoded, fast, flat, logged_types, paper_fast, same, waves

from gsvc_ref.encoder import Settings
from gsvc_ref.encoder.effects import EFFECT_NAMES
from gsvc_ref.encoder.log import read_log
from gsvc_ref.metrics import psnr
from gsvc_ref.stream import Stream, decode

CLIP = waves(48, 32, 4)
ENOUGH_DB = 0.3


def noise(frames=1, shape=(32, 48, 3)):
    rng = np.random.default_rng(5)
    return [rng.integers(0, 256, shape, np.uint8) for _ in range(frames)]


def codes(data):
    return [frame.codes for frame in Stream(data)]


def types(report):
    return "".join(frame.type for frame in report.frames)


@pytest.mark.parametrize("preset", [Settings.quick, Settings.slow])
def test_presets_make_the_round_trip(preset):
    report, data = encoded(CLIP[:2], preset(threads=1, splats=20))
    assert (report.header.profile, types(report)) == (1, "IP")
    assert [frame.psnr for frame in report.frames] == [
        psnr(a, b, 255) for a, b in zip(CLIP, decode(data), strict=False)
    ]
    assert all(frame.iterations > 50 for frame in report.frames)
    assert set(report.seconds_by_stage) == {"read and detect", "write", "intra", "inter"}


@pytest.mark.parametrize("precision", ["fast", "deterministic"])
def test_threads_leave_the_bytes_as_they_are(precision):
    for rate in ({}, {"psnr": 27.0}, {"quality": 25}):
        made = [encoded(CLIP[:3], fast(threads=threads, precision=precision, **rate))[1] for threads in (1, 2)]
        assert made[0] == made[1]


def test_the_seed_matters():
    assert encoded(CLIP[:1], fast(seed=1))[1] != encoded(CLIP[:1], fast(seed=2))[1]


def mosaic() -> list:
    """Waves under tiles that pass by: hundreds of splats, none of which is worth a tenth of a dB."""
    levels = np.random.default_rng(7).integers(-40, 41, (12, 18, 3))
    tiles = np.kron(levels, np.ones((6, 6, 1), np.int64))[:64, :96]
    moved = [np.roll(tiles, t, axis=1) + frame for t, frame in enumerate(waves(96, 64, 4))]
    return [np.clip(frame, 0, 255).astype(np.uint8) for frame in moved]


@pytest.mark.parametrize(
    "goal", [32.0, *(pytest.param(more, marks=pytest.mark.exhaustive) for more in (26.0, 28.0, 30.0, 34.0))]
)
def test_a_psnr_is_held_and_hardly_exceeded(goal):
    clip = mosaic()
    report, data = encoded(clip, Settings.quick(psnr=goal, key_frames=3, threads=1, precision="deterministic"))
    assert "P" in types(report)
    for frame, source, decoded in zip(report.frames, clip, decode(data), strict=True):
        assert goal <= psnr(source, decoded, 255) <= goal + (0.1 if frame.type == "I" else ENOUGH_DB)
    assert report.notes == []


@pytest.mark.exhaustive
def test_a_psnr_is_held_by_few_splats():
    """With thirty, one is worth up to a dB, and a picture may be as much too good."""
    goal, clip, spared = 32.0, waves(96, 64, 4), []
    for seed in range(3):
        settings = Settings.quick(psnr=goal, key_frames=3, threads=1, precision="deterministic", seed=seed)
        report, data = encoded(clip, settings)
        spared += [psnr(*pair, 255) - goal for pair in zip(clip, decode(data), strict=True)]
        assert report.notes == []
    assert min(spared) >= 0
    assert np.mean(spared) <= 0.5


def test_a_higher_psnr_costs_more():
    sizes = [encoded(CLIP[:2], fast(psnr=goal))[0].file_bytes for goal in (22.0, 26.0, 30.0)]
    assert sizes == sorted(sizes)


def test_a_psnr_out_of_reach_is_told_and_ends():
    report, _ = encoded(noise(2), fast(psnr=60.0, splats=30))
    assert types(report) == "IP"  # no I-frame in place of a P-frame, since I-frames do not reach it either
    (note,) = report.notes
    assert note.startswith("2 of 2 frames have less than 60 dB (frame ")
    assert note.endswith("allow more splats than 30")


def test_a_p_frame_that_cannot_hold_the_psnr_becomes_an_i_frame():
    cut = [CLIP[0], waves(48, 32, 1, cut=0)[0]]
    report, data = encoded(cut, fast(psnr=30.0))
    assert types(report) == "II"
    assert report.frames[1].reason == "a P-frame does not reach the quality"
    assert logged_types(data)[1] == "an I-frame: a P-frame does not reach the quality"
    assert min(frame.psnr for frame in report.frames) >= 30


def test_quality_gives_the_step():
    for quality in (20, 37):
        report, data = encoded(CLIP[:2], fast(quality=quality, splats=40))
        assert [frame.quantizer for frame in codes(data)] == [79 - quality, 79 - quality]
        assert report.frames[0].splats <= 48
    assert [codes(encoded(CLIP[:1], fast(quality=q, splats=9))[1])[0].quantizer for q in (0, 79)] == [79, 0]


def test_more_splats_go_with_a_higher_quality():
    counts = [encoded(CLIP[:1], fast(quality=quality))[0].frames[0].splats for quality in (10, 22, 34)]
    assert counts == sorted(set(counts))
    assert counts[-1] <= 1.2 * 48 * 32 / 6


def test_equal_frames_are_repeated_unless_all_are_asked_for():
    clip = [CLIP[0]] * 3
    assert types(encoded(clip, fast())[0]) == "IRR"
    assert types(encoded(clip, fast(effects="auto,frames=all"))[0]) == "IPP"
    assert types(encoded(clip, fast(key_frames=(2,)))[0]) == "IRI"


def test_a_frame_in_which_no_change_is_worth_its_bits_is_repeated():
    clip = [CLIP[0], CLIP[0] ^ 1]
    report, data = encoded(clip, fast(splats=20, effects="auto,gsa=off"))
    assert types(report) == "IR"
    first, second = decode(data)
    assert np.array_equal(first, second)
    reason = "no splat changes, so the frame before is repeated"
    assert report.frames[1].reason == report.frames[1].decisions[0].reason == reason


def test_motion_and_new_splats_can_be_switched_off():
    clip = [CLIP[0], waves(48, 32, 1, cut=0)[0]]
    _, data = encoded(clip, fast(quality=40, splats=40))
    assert codes(data)[1].intra_count > 0
    report, data = encoded(clip, fast(quality=40, splats=40, effects="auto,gsa=off,motion=off"))
    assert (codes(data)[1].motion_cell, codes(data)[1].intra_count) == (0, 0)
    assert {one.reason for one in report.frames[1].decisions if one.effect in ("gsa", "motion")} == {"switched off"}


@pytest.mark.parametrize("effects", ["auto", "auto,dks=all"])
@pytest.mark.parametrize("low_latency", [False, True])
def test_cuts_are_found(effects, low_latency):
    clip = waves(48, 32, 14, cut=9, speed=0.2)
    report, data = encoded(clip, fast(key_frames="auto", low_latency=low_latency, effects=effects))
    assert report.frames[9].type == "I"
    assert report.frames[9].reason == "scene change"
    assert logged_types(data)[9] == "an I-frame: scene change"
    assert types(report).count("I") == 2


def test_a_frame_without_splats_is_followed_by_an_i_frame():
    report, data = encoded([*flat(0, 48, 32), CLIP[0], *flat(0, 48, 32)], fast(splats=20))
    assert types(report)[:2] == "II"
    assert report.frames[0].splats == 0
    assert report.frames[1].reason == "the frame before has no splats"
    assert logged_types(data)[1] == "an I-frame: the frame before has no splats"
    assert same([next(iter(decode(data)))], flat(0, 48, 32))


def test_a_p_frame_with_more_splats_than_the_level_may_have_becomes_an_i_frame():
    clip = noise(8)
    report, data = encoded(clip, fast(splats=6, quality=60, effects="auto,frames=all"))
    assert max(frame.splats for frame in report.frames) <= 12
    became = [number for number in range(1, len(clip)) if report.frames[number].type == "I"]
    why = "no room for more splats in the level of the stream"
    assert {report.frames[number].reason for number in became} <= {why}
    assert {logged_types(data)[number] for number in became} <= {f"an I-frame: {why}"}


def test_every_frame_has_a_decision_about_every_effect_and_the_stream_tells_them():
    clip = [*CLIP[:3], CLIP[2]]
    report, data = encoded(clip, fast(key_frames="auto"))
    assert types(report) == "IPPR"
    told = [[(one.effect, one.done, one.reason) for one in frame.decisions] for frame in report.frames]
    assert all([effect for effect, _, _ in frame] == list(EFFECT_NAMES) for frame in told)
    assert report.frames[1].decisions[0].iterations == report.frames[1].iterations
    kept = read_log(Stream(data).info().ancillary, len(clip))
    assert [[(one.effect, one.done, one.reason) for one in frame] for frame in kept] == told


def test_progress_within_a_frame():
    seen = []
    encoded(CLIP[:2], Settings.quick(threads=1, splats=20), progress=seen.append)
    for frame in (0, 1):
        steps = [told for told in seen if told.stage == "encode" and told.frame == frame]
        assert len(steps) > 50
        assert all(1 <= told.iteration <= told.iterations for told in steps)
        assert all(told.psnr is not None and np.isfinite(told.psnr) for told in steps)


def test_lanes():
    reports = [encoded(CLIP[:2], fast(lane_count=count)) for count in (1, 5, 8)]
    assert [[frame.lane_exponent for frame in codes(data)] for _, data in reports] == [[0, 0], [2, 2], [3, 3]]
    pictures = [list(decode(data)) for _, data in reports]
    assert same(pictures[0], pictures[1])
    assert same(pictures[0], pictures[2])


@pytest.mark.parametrize(("share", "most"), [("by-size", 0.006), ("by-size:5%", 0.05)])
def test_lanes_by_size_cost_a_share_of_the_bits(share, most):
    (one, _), (_, data) = (encoded(CLIP, fast(lane_count=count, key_frames=(0, 3))) for count in (1, share))
    spent, room = 0, 0.0
    for frame, plain in zip(codes(data), one.frames, strict=True):
        if frame.type == "I":
            spent, room = 0, 0.0
        spent += 9 * ((1 << frame.lane_exponent) - 1)
        room += most * sum(plain.bits.values())
        assert spent <= room
        assert frame.quantizer_present == (frame.type == "I" or frame.quantizer != codes(data)[0].quantizer)


def test_lanes_by_size_stop_where_symbols_or_bits_do():
    settings = fast()
    many = [settings.lane_exponent(bits, 10**6, 0, 6) for bits in (0, 1499, 1500, 4499, 4500, 10**9)]
    assert many == [0, 0, 1, 1, 2, 6]
    assert settings.lane_exponent(0, 10**6, 27, 6) == 2  # of what is left over
    assert [settings.lane_exponent(10**9, symbols, 0, 6) for symbols in (500, 501, 1000, 1001)] == [0, 1, 1, 2]
    assert [settings.lane_bits_left(4000, 100, exponent) for exponent in (0, 1, 3)] == [124, 115, 61]
    assert settings.max_lane_exponent(352, 288) == 6
    assert settings.max_lane_exponent(1920, 1080) == 10
    assert fast(lane_count=8).lane_bits_left(4000, 0, 3) == 0


def test_both_profiles_take_what_is_common():
    common = {"seed": 4, "checksums": True, "index": False, "decisions": False, "key_frames": 2, "frames": (1, 4)}
    for make in (fast, paper_fast):
        report, data = encoded(CLIP, make(**common))
        assert types(report) == "IPI"
        assert report.header.parameter_checksum_flag
        assert len(list(decode(data))) == 3
