"""Settings: presets, overrides by name, and what is refused."""

from dataclasses import FrozenInstanceError, replace
from io import BytesIO

import numpy as np
import pytest
from codec_cases import encoded, fast, paper_quick, waves

from gsvc_base.errors import UsageError
from gsvc_ref.encoder import Effects, Settings, encode
from gsvc_ref.encoder.main.settings import InterSettings, IntraSettings
from gsvc_ref.training import Cosine, FitSettings, Rates


def test_the_papers_settings_are_the_papers():
    paper = Settings.paper()
    assert paper.preset == "paper"
    for kind in (paper.intra, paper.inter):
        assert kind.fit.iterations == 50_000
        assert kind.fit.rates == Rates(1e-3, 1e-3, 1e-3, 1e-3)
        assert kind.fit.convergence.patience == 100
        assert kind.fit.convergence.tolerance == 1e-7
        assert kind.fit.pruning.fraction == 0.1
        assert kind.quantizer.cholesky_bits == 6
        assert kind.quantizer.colors.codewords == (8, 8)
    assert paper.inter.new_fraction == 0.1
    assert str(paper.effects) == "all"
    assert (paper.detection.iterations, paper.detection.window, paper.detection.threshold) == (500, 10, 3.0)
    assert (paper.detection.splats, paper.detection.longest_side, paper.detection.rule) == (None, None, "paper")


def test_quick_is_the_default_of_an_encode():
    file = BytesIO()
    report = encode(np.array(waves(16, 12, 1)), file)
    assert report.settings == Settings.quick()
    assert report.header.profile == 1


def test_overrides_of_nothing_change_nothing():
    names = ("splats", "psnr", "iterations", "threads", "cholesky_bits", "color_stages", "color_codewords")
    for preset in (Settings.quick, Settings.slow):
        assert preset(**dict.fromkeys((*names, "quality"))) == preset()
    assert Settings.paper(**dict.fromkeys(names)) == Settings.paper()


@pytest.mark.parametrize(
    "override",
    [
        {"splats": 12},
        {"psnr": 33.5},
        {"key_frames": 7},
        {"key_frames": (3, 9)},
        {"low_latency": True},
        {"effects": Effects.parse("auto,gsa=off")},
        {"decisions": False},
        {"frames": (2, 5)},
        {"frames": (2, None)},
        {"seed": 2**63 - 1},
        {"threads": 3},
        {"lane_count": 64},
        {"index": False},
        {"checksums": True},
    ],
)
def test_an_override_changes_its_field_and_no_other(override):
    for preset in (Settings.quick, Settings.slow, Settings.paper, paper_quick):
        assert preset(**override) == replace(preset(), **override)


@pytest.mark.parametrize(
    "override",
    [{"iterations": 5}, {"cholesky_bits": 8}, {"color_stages": 2}, {"color_codewords": 4}, {"entropy_precision": 12}],
)
def test_settings_of_profile_paper_are_refused_in_main(override):
    (name,) = override
    for preset in (Settings.quick, Settings.slow):
        with pytest.raises(
            UsageError, match=f"^{name} is a setting of profile paper, and the stream is of profile main"
        ):
            preset(**override)
    assert Settings.quick(**override, profile="paper") == paper_quick(**override) != paper_quick()


@pytest.mark.parametrize(
    "override",
    [{"quality": 30}, {"layers": (30.0, 34.0)}, {"layer_splats": (20, 40)}],
)
def test_settings_of_profile_main_are_refused_in_paper(override):
    (name,) = override
    for preset in (Settings.paper, paper_quick):
        with pytest.raises(UsageError, match=f"^{name} is a setting of profile main"):
            preset(**override)
    assert Settings.quick(**override) == replace(Settings.quick(), **override)


def test_settings_of_frames_are_those_of_the_profile():
    assert Settings.quick(intra=IntraSettings.slow(), inter=InterSettings.slow()) != Settings.quick()
    with pytest.raises(UsageError, match=r"PaperSettings\.intra is .*; it must be a FrameSettings"):
        paper_quick(intra=IntraSettings.slow())
    with pytest.raises(UsageError, match=r"MainSettings\.inter is .*; it must be a InterSettings"):
        Settings.quick(inter=paper_quick().inter)


def test_no_settings_change_their_profile():
    for settings, other in ((Settings.quick(), "paper"), (Settings.paper(), "main")):
        assert settings.with_(profile=settings.profile) == settings
        with pytest.raises(UsageError, match=rf"of profile {settings.profile}: make others, such as Settings.quick"):
            settings.with_(profile=other)


def test_presets_and_profiles_that_go_together():
    for preset, profile in ((Settings.quick, "main"), (Settings.slow, "main"), (Settings.paper, "paper")):
        assert preset().profile == profile == preset(profile=profile).profile
    assert paper_quick().detection == Settings.quick().detection
    with pytest.raises(UsageError, match="profile is 'other'; it must be 'main' or 'paper'"):
        Settings.quick(profile="other")
    assert paper_quick(effects="all").effects == Settings.paper().effects
    with pytest.raises(UsageError, match="preset slow writes profile main only; of profile paper are quick and paper"):
        Settings.slow(profile="paper")
    with pytest.raises(UsageError, match="preset paper writes profile paper only; of profile main are quick and slow"):
        Settings.paper(profile="main")
    with pytest.raises(UsageError, match="give one of them"):
        Settings.quick(quality=30, psnr=30)


@pytest.mark.parametrize("switch", ["regions=all", "gsa=all", "gsp=all", "gsp=off"])
def test_effects_that_main_does_not_have(switch):
    with pytest.raises(UsageError, match=rf"{switch} is of profile paper;.*It has frames=auto\|all; regions=auto;"):
        Settings.quick(effects=f"auto,{switch}")
    assert Settings.quick(effects=f"auto,{switch}", profile="paper").effects == Effects.parse(f"auto,{switch}")


def test_settings_are_frozen():
    with pytest.raises(FrozenInstanceError):
        Settings.quick().splats = 3


@pytest.mark.parametrize("name", ["splat", "iteration", "bits", "preset", "Psnr"])
def test_unknown_names_are_refused_with_the_known_ones(name):
    with pytest.raises(UsageError, match=f"unknown settings {name}.*splats.*quality"):
        Settings.quick(**{name: 3})
    with pytest.raises(UsageError, match=f"unknown settings {name}.*splats.*iterations.*color_codewords"):
        Settings.paper(**{name: 3})


@pytest.mark.parametrize(
    "wrong",
    [
        {"splats": 0},
        {"splats": -1},
        {"splats": (1 << 22) + 1},
        {"splats": 2.5},
        {"splats": True},
        {"psnr": 0},
        {"psnr": 101},
        {"quality": -1},
        {"quality": 80},
        {"quality": 1.5},
        {"psnr": float("nan")},
        {"psnr": float("inf")},
        {"threads": 0},
        {"threads": 1.5},
        {"seed": -1},
        {"seed": 0.5},
        {"lane_count": 0},
        {"lane_count": 4097},
        {"lane_count": "by-bits"},
        {"lane_count": "by-size:100%"},
        {"entropy_precision": 11},
        {"entropy_precision": 17},
        {"iterations": 0},
        {"iterations": -5},
        {"iterations": 2.5},
        {"cholesky_bits": 0},
        {"cholesky_bits": 13},
        {"color_stages": 0},
        {"color_stages": 9},
        {"color_codewords": 0},
        {"color_codewords": 1025},
        {"key_frames": 0},
        {"key_frames": -3},
        {"key_frames": (0, -1)},
        {"key_frames": "all"},
        {"key_frames": [1, 2]},
        {"frames": (-1, 3)},
        {"frames": (3, 3)},
        {"frames": (3, 2)},
    ],
)
def test_values_out_of_range_are_refused_by_name(wrong):
    name = next(iter(wrong))
    for preset in (Settings.quick, Settings.paper):
        with pytest.raises(UsageError, match=name):
            preset(**wrong)


def test_iterations_are_those_of_an_i_frame_and_scale_all_others():
    base, changed = paper_quick(), paper_quick(iterations=20)  # a quarter
    assert changed.intra.fit.iterations == 20
    for kind in ("intra", "inter"):
        for part in ("fit", "tune"):
            before, after = getattr(getattr(base, kind), part), getattr(getattr(changed, kind), part)
            assert after.iterations == max(1, round(before.iterations / 4))
            assert after == before.with_(iterations=after.iterations)


def test_no_fit_is_left_without_iterations():
    one = paper_quick(iterations=1)
    assert [part.iterations for kind in (one.intra, one.inter) for part in (kind.fit, kind.tune)] == [1, 1, 1, 1]
    assert one.with_(iterations=300).intra.fit.iterations == 300


def test_only_a_cosine_stretches_with_the_iterations():
    assert FitSettings().with_(iterations=7) == FitSettings(iterations=7)
    assert FitSettings(schedule=Cosine(100, 0.1)).with_(iterations=7).schedule == Cosine(7, 0.1)


def test_settings_are_changed_as_presets_are_overridden():
    changes = {"iterations": 50, "cholesky_bits": 5, "color_stages": 2, "splats": 9, "effects": "auto,gsa=off"}
    for preset in (paper_quick, Settings.paper):
        assert preset().with_(**changes) == preset(**changes)
        assert preset().with_() == preset()
    with pytest.raises(UsageError, match="unknown settings splat;"):
        paper_quick().with_(splat=3)


def test_the_quantiser_of_one_frame_type_can_be_changed():
    intra = paper_quick().intra
    changed = intra.with_(cholesky_bits=9, color_codewords=4, new_fraction=0.2)
    assert changed.quantizer == intra.quantizer.with_(cholesky_bits=9, color_codewords=4)
    assert changed == replace(intra, new_fraction=0.2, quantizer=changed.quantizer)


def test_quantisers_can_be_chosen_for_all_frames():
    chosen = paper_quick(cholesky_bits=5, color_stages=3, color_codewords=64)
    for kind in (chosen.intra, chosen.inter):
        assert kind.quantizer.cholesky_bits == 5
        assert kind.quantizer.colors.codewords == (64, 64, 64)
    assert chosen.inter.quantizer.colors.zero_codeword
    assert Settings.paper(color_stages=1).intra.quantizer.colors.codewords == (8,)
    assert Settings.paper(color_codewords=16).inter.quantizer.colors.codewords == (16, 16)


def test_one_stream_has_one_b():
    quick = paper_quick()
    other = replace(quick.inter, quantizer=replace(quick.inter.quantizer, cholesky_bits=5))
    with pytest.raises(UsageError, match="cholesky_bits"):
        paper_quick(inter=other)


@pytest.mark.parametrize(
    ("width", "height", "count"), [(1, 1, 1), (40, 1, 1), (40, 2, 2), (160, 96, 384), (1920, 1080, 51840)]
)
def test_by_default_a_splat_stands_for_forty_pixels(width, height, count):
    assert Settings.quick().splat_count(width, height) == count
    assert Settings.quick().most_splats(width, height) == count
    assert Settings.paper().splat_count(width, height) == count


def test_fewer_pixels_have_a_splat_each():
    for settings in (Settings.quick(), Settings.quick(psnr=30.0), Settings.quick(quality=30)):
        assert settings.splat_count(13, 3) == settings.most_splats(13, 3) == 39
    assert Settings.quick(splats=2).most_splats(13, 3) == 2
    assert Settings.paper().splat_count(13, 3) == 1


def test_constant_quality_may_take_a_splat_for_six_pixels_or_those_asked_for():
    assert Settings.quick(psnr=30.0).splat_count(40, 30) == 30
    assert Settings.quick(psnr=30.0).most_splats(40, 30) == 200
    assert Settings.quick(quality=30).most_splats(40, 30) == 200
    assert Settings.quick(quality=30, splats=25).most_splats(40, 30) == 25
    assert Settings.quick(splats=25).counted_splats(40, 30) == 50
    assert paper_quick(splats=25).counted_splats(40, 30) == 31
    assert Settings.quick(psnr=30.0, splats=25).most_splats(40, 30) == 25


def test_no_more_splats_than_pixels():
    assert Settings.quick(splats=12).splat_count(4, 3) == 12
    with pytest.raises(UsageError, match="13 splats are more than the 12 pixels"):
        Settings.quick(splats=13).splat_count(4, 3)
    with pytest.raises(UsageError, match="13 splats are more than the 12 pixels"):
        encoded(waves(4, 3, 1), fast(splats=13))
