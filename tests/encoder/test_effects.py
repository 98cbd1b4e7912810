"""Effects: which steps are taken, by name, by frame and by what the scene shows."""

from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest
from codec_cases import encoded, flat, paper_fast, paper_quick, waves
from hypothesis import given
from hypothesis import strategies as st

from gsvc_base.errors import UsageError
from gsvc_base.splats import Splats
from gsvc_ref.encoder import Effects, Settings, pretraining
from gsvc_ref.encoder.effects import EFFECT_NAMES
from gsvc_ref.encoder.frame_types import typed_frames
from gsvc_ref.encoder.log import Decision
from gsvc_ref.encoder.pretraining import Pretraining
from gsvc_ref.encoder.settings.detection import DetectionSettings
from gsvc_ref.stream import Stream

RNG = np.random.default_rng(5)
TEXTURE = RNG.integers(40, 210, (48, 64, 3), np.uint8)
FAR_AWAY = np.array([[500, 500, 1, 0, 1, 0.5, 0.5, 0.5]], np.float32)

some_effects = st.builds(
    Effects, frames=st.sampled_from(["auto", "all"]), regions=st.sampled_from(["auto", "all"]),
    gsa=st.sampled_from(["auto", "all", "off"]), dks=st.sampled_from(["auto", "all", "off"]),
    gsp=st.sampled_from(["auto", "all", "off"]), motion=st.sampled_from(["auto", "off"]),
)  # fmt: skip


@given(some_effects)
def test_effects_are_what_their_text_says(effects):
    assert Effects.parse(str(effects)) == effects


def test_the_presets_have_their_effects():
    assert paper_quick().effects == Effects() == Effects.parse("auto")
    assert Settings.paper().effects == Effects("all", "all", "all", "all", "all", "off") == Effects.parse("all")
    assert Settings.paper(effects="auto, gsa = off").effects == replace(Effects(), gsa="off")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "give auto or all first"),
        ("gsa=off", "give auto or all first"),
        ("auto,gsa", "NAME=MODE"),
        ("auto,psnr=off", "frames, regions, gsa, dks, gsp, motion"),
        ("auto,gsa=never", "auto or all or off"),
        ("all,frames=off", "auto or all"),
    ],
)
def test_other_texts_are_refused_with_what_to_give(text, told):
    with pytest.raises(UsageError, match=told):
        paper_quick(effects=text)


def test_other_values_are_refused():
    with pytest.raises(UsageError, match=r"Effects\.motion"):
        Effects(motion="all")


def made(report, number) -> dict[str, Decision]:
    return {one.effect: one for one in report.frames[number].decisions}


def moved(columns: int) -> np.ndarray:
    return np.roll(TEXTURE, columns, axis=1)


def test_every_frame_has_a_decision_on_every_effect():
    clip = [TEXTURE, TEXTURE, moved(3), 255 - TEXTURE]
    for effects in ("auto", "all", "all,motion=auto", "auto,gsa=off,gsp=off,motion=off,dks=off"):
        report, _ = encoded(clip, paper_quick(iterations=4, threads=1, splats=40, effects=effects))
        for frame in report.frames:
            assert [one.effect for one in frame.decisions] == list(EFFECT_NAMES)
            assert all(one.reason and one.seconds >= 0 for one in frame.decisions)
            assert {one.effect: one.iterations for one in frame.decisions}["frames"] == frame.iterations
            for one in frame.decisions:
                if report.settings.effects.mode(one.effect) == "off":
                    assert not one.done


def test_what_changes_too_little_to_be_seen_stays_as_it_is():
    """Far from a corner that changes, splats survive with the same parameters, to the bit."""
    clip = waves(64, 48, 1) * 2
    clip[1] = clip[1].copy()
    clip[1][4:12, 4:12] = (250, 30, 30)
    for effects, still in (("auto", True), ("auto,regions=all", False)):
        report, data = encoded(clip, paper_quick(splats=80, key_frames=(0,), threads=1, effects=effects))
        assert made(report, 1)["regions"].done != still
        first, second = Stream(data)
        before, after = first.splats.to_array(), second.splats.to_array()
        kept = {int(origin): n for n, origin in enumerate(second.codes.origins) if origin >= 0}
        far = [n for n in np.flatnonzero((before[:, 0] > 32) & (before[:, 1] > 24)).tolist() if n in kept]
        same = [np.array_equal(after[kept[n]], before[n]) for n in far]
        assert len(same) > 10
        assert np.mean(same) > 0.5 if still else np.mean(same) < 0.2


def test_slow_changes_add_up_until_they_count():
    """Each step is too small to matter; the encoder must not sit still till the end."""
    dark = np.full((32, 48, 3), 60, np.uint8)
    dark[8:24, 10:30] = 150
    clip = [np.uint8(dark + t) for t in range(14)]
    report, _ = encoded(clip, paper_fast(splats=24, iterations=40))
    assert min(frame.psnr for frame in report.frames) > report.frames[0].psnr - 1.5
    assert "P" in [frame.type for frame in report.frames[1:]]


def test_noise_alone_calls_for_no_splats():
    clip = [
        np.clip(waves(64, 48, 1)[0] + np.rint(RNG.normal(0, 6, (48, 64, 3))), 0, 255).astype(np.uint8) for _ in range(2)
    ]
    settings = paper_fast(splats=40, iterations=60)
    report, _ = encoded(clip, settings)
    assert not made(report, 1)["gsa"].done
    assert report.frames[1].new_splats == 0
    everything, _ = encoded(clip, replace(settings, effects=Effects.parse("all")))
    assert made(everything, 1)["gsa"].done


def test_splats_are_added_where_something_appears():
    clip = [waves(64, 48, 1)[0], waves(64, 48, 1)[0]]
    clip[1][10:26, 30:46] = (250, 20, 30)
    report, data = encoded(clip, paper_fast(splats=200, iterations=40))
    assert made(report, 1)["gsa"].reason.endswith("dB less than the frame before has")
    frame = list(Stream(data))[1]
    new = frame.splats.positions[frame.codes.origins < 0]
    assert len(new)
    assert ((new[:, 0] > 24) & (new[:, 0] < 52) & (new[:, 1] > 4) & (new[:, 1] < 32)).all()


def test_gsa_off_adds_none_and_gsp_off_removes_none():
    clip = waves(40, 30, 3, speed=4)
    without, _ = encoded(clip, paper_fast(splats=60, effects="all,gsa=off"))
    assert [frame.new_splats for frame in without.frames[1:]] == [0, 0]
    assert [frame.splats for frame in without.frames] == [60, 60, 60]
    kept, _ = encoded(clip, paper_fast(splats=60, effects="all,gsp=off"))
    assert [frame.pruned_splats for frame in kept.frames] == [0, 0, 0]
    assert [frame.splats for frame in kept.frames] == [60, 60, 60]
    assert made(kept, 1)["gsa"].reason == "no room for more splats without pruning"


def test_all_prunes_as_many_as_it_adds():
    report, _ = encoded(waves(40, 30, 3, speed=4), paper_fast(splats=100, effects="all", iterations=40))
    assert [frame.splats for frame in report.frames] == [100, 100, 100]
    assert [frame.new_splats + frame.pruned_splats > 0 for frame in report.frames[1:]] == [True, True]


@pytest.mark.parametrize("effects", ["auto", "all", "all,gsp=off"])
@pytest.mark.parametrize("low_latency", [False, True])
def test_a_quality_is_held_by_all_of_them(effects, low_latency):
    settings = paper_quick(psnr=24.0, iterations=40, threads=1, effects=effects, low_latency=low_latency)
    report, _ = encoded(waves(40, 30, 3), settings)
    assert min(frame.psnr for frame in report.frames) >= 24


def pretrained(clip, settings) -> tuple[str, int]:
    """The types, and how many pictures were pre-trained."""
    with patch.object(Pretraining, "losses", autospec=True, side_effect=Pretraining.losses) as losses:
        types = "".join(item.type for item in typed_frames(clip, settings, 255))
    return types, losses.call_count


@pytest.mark.parametrize("low_latency", [False, True])
def test_only_suspects_are_pretrained(low_latency):
    clip = [*waves(40, 30, 6), *waves(40, 30, 12, cut=0)[6:]]
    quick = paper_quick(threads=1, low_latency=low_latency)
    types, count = pretrained(clip, quick)
    every, all_count = pretrained(clip, replace(quick, effects=Effects.parse("all")))
    assert types == every == "IPPPPPIPPPPP"
    assert all_count == len(clip)
    assert count == 2 or low_latency  # the cut and the frame before; from the past alone the first frames are suspects


def test_pretraining_that_converges_early_counts_what_it_took():
    """No splat covers a pixel: nothing changes, which convergence notices after its 100 iterations."""
    settings = Settings.paper(threads=1, splats=2, iterations=9, detection=DetectionSettings(iterations=400))
    with patch.object(pretraining, "random_splats", lambda *_: Splats.from_array(FAR_AWAY)):
        items = list(typed_frames(flat(0, width=8, height=8, frames=2), settings, 255))
    first, second = (item.decisions[-1].iterations for item in items)
    assert 100 <= first < 110
    assert second == 2 * first


def test_still_pictures_are_not_pretrained_and_fades_hardly():
    assert pretrained(flat(90, frames=5), paper_quick(threads=1)) == ("IRRRR", 0)
    fade = [np.uint8(waves(40, 30, 1)[0] * (1 - t / 24)) for t in range(12)]
    types, count = pretrained(fade, paper_quick(threads=1))
    assert types == "I" + 11 * "P"
    assert count <= 2


def test_without_dks_there_is_one_key_frame():
    clip = waves(40, 30, 6, cut=3)
    assert pretrained(clip, paper_quick(threads=1, effects="auto,dks=off")) == ("IPPPPP", 0)


def test_decisions_do_not_depend_on_the_threads():
    clip = [*waves(48, 40, 3), *waves(48, 40, 5, cut=0)[3:]]
    (one, first), (three, second) = (
        encoded(clip, paper_quick(iterations=6, splats=40, threads=threads)) for threads in (1, 3)
    )
    assert first == second
    assert all(
        replace(a, seconds=0.0) == replace(b, seconds=0.0)
        for x, y in zip(one.frames, three.frames, strict=True)
        for a, b in zip(x.decisions, y.decisions, strict=True)
    )
