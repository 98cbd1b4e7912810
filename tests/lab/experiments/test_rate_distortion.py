"""The experiment against other codecs: BD-rates by hand, the verdict's outcomes, one codec on three small frames."""

import json
import subprocess
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("matplotlib", reason="figures need the extra experiments")

from gsvc_base.errors import UsageError
from gsvc_lab.bench import codecs, coders, compare, ffmpeg, measure, tables
from gsvc_lab.bench.bd_rate import bd_rate, efficient, mean_ratio, rate_at
from gsvc_lab.bench.planes import from_file, from_frames, from_raw
from gsvc_lab.experiments import rate_distortion
from gsvc_lab.experiments.experiment import Run
from gsvc_lab.experiments.rate_distortion import claim, figures, goals, plan
from gsvc_lab.experiments.rate_distortion.speed import Seconds
from gsvc_lab.scenes import demo_clip
from gsvc_ref.encoder import Settings

AVC, HEVC, AV1, VVC = codecs.CODECS
FIRST = {codec.standard: codec.label() for codec in codecs.CODECS}

needs_ffmpeg = pytest.mark.skipif(not ffmpeg.available(), reason="needs imageio-ffmpeg")


@pytest.fixture
def clip(tmp_path):
    video = replace(measure.WARM_UP, width=64, height=64)
    return from_frames(demo_clip(64, 64, 3), "demo", "drawn", tmp_path / "clip.yuv", video)


# BD-rates


@pytest.mark.parametrize(
    ("test", "percent", "share"),
    [
        ([(2, 30), (20, 40)], 100, 1),  # twice the bits everywhere
        ([(0.5, 30), (5, 40)], -50, 1),
        ([(1, 30), (100, 40)], 10**0.5 * 100 - 100, 1),  # from once to ten times, in the mean of logarithms 10 ** 0.5
        ([(2, 35), (2 * 10**0.5, 40), (20, 45)], 100 * 2 / 10**0.5 - 100, 0.5),  # 40 dB and more have no counterpart
        ([(1, 30), (3, 29), (10, 40)], 0, 1),  # the beaten point does not count
    ],
)
def test_the_bd_rate_of_lines_is_what_a_hand_finds(test, percent, share):
    found = bd_rate([(1, 30), (10, 40)], test)
    assert found.percent == pytest.approx(percent, abs=1e-9)
    assert found.share == pytest.approx(share)
    assert found.ratio == pytest.approx(1 + percent / 100)


def test_nothing_is_extrapolated():
    found = bd_rate([(1, 30), (10, 40)], [(1, 41), (2, 45)])
    assert found.percent is None
    assert found.reason == "no overlap: 41 to 45 lies above 30 to 40"
    assert tables.cell(found) == "no overlap"
    assert "below" in bd_rate([(1, 30), (10, 40)], [(1, 20), (2, 30)]).reason
    assert "fewer than two" in bd_rate([(1, 30), (10, 40)], [(1, 35), (2, 34)]).reason


def test_points_without_a_number_are_left_out():
    assert efficient([(3, float("inf")), (2, 31), (1, 30), (2, float("nan"))]) == [(1, 30), (2, 31)]


def test_the_bd_rate_is_that_of_another_package():
    bjontegaard = pytest.importorskip("bjontegaard", reason="pip install 'gsvc_ref[experiments]'")
    anchor = [(0.05, 28), (0.1, 31), (0.22, 34.5), (0.5, 38)]
    test = [(0.07, 29), (0.15, 32), (0.25, 34), (0.6, 39)]
    (rates, qualities), (own_rates, own_qualities) = (zip(*curve, strict=True) for curve in (anchor, test))
    theirs = bjontegaard.bd_rate(
        rates, qualities, own_rates, own_qualities, "pchip", require_matching_points=False, min_overlap=0
    )
    assert bd_rate(anchor, test).percent == pytest.approx(theirs, rel=1e-9)


def test_means_of_ratios_are_geometric():
    assert mean_ratio([0.5, 2, None]) == pytest.approx(1)
    assert mean_ratio([None]) is None


def test_a_curve_is_read_between_its_points_in_the_logarithm_of_the_rate():
    curve = [(1, 30), (10, 40), (100, 50)]
    assert rate_at(curve, 35) == pytest.approx(10**0.5)
    assert rate_at(curve, 50) == pytest.approx(100)
    assert rate_at(curve, 29.9) is None
    assert rate_at(curve, 50.1) is None
    assert rate_at(curve[:1], 30) is None


# Goals of profile main


def test_goals_are_judged_by_the_worst_clip_and_the_mean():
    line = (1, 30), (10, 40)
    curves = [
        *(curve(coders.PAPER.name, clip, *line) for clip in ("carphone", "b")),
        *(curve(goals.X264_IP, clip, *line) for clip in ("carphone", "b")),
        curve(coders.MAIN.name, "carphone", (0.2, 30), (2, 40)),
        curve(coders.MAIN.name, "b", (0.8, 30), (8, 40)),
    ]
    found = goals.goals_of(compare.compared(curves, coders.MAIN.name), curves, Seconds("c", 600, (2, 1.5), (1, 1.4)))
    assert [goal.reached for goal in found] == [
        "must", "no", "aim", "aim", "aim", "must", "no", "not measured"
    ]  # fmt: skip
    assert [goal.row()[3] for goal in found] == [
        "-60.0 %", "-20.0 %", "-80.0 %", "-80.0 %", "-20.0 %", "0.75", "1.40", "–"
    ]  # fmt: skip
    assert found[4].row()[1:3] == ("–", "+100 %")
    said = goals.summary(compare.compared(curves, coders.MAIN.name))
    assert "against profile paper, quick: -80.0 % to -20.0 % by clip, mean -60.0 %." in said
    assert "I- and P-frames only: carphone -80.0 %; b -20.0 %; mean -60.0 %." in said


def test_a_goal_about_all_clips_needs_all_of_them():
    curves = [
        *(curve(coders.PAPER.name, clip, (1, 30), (10, 40)) for clip in ("a", "b")),
        curve(coders.MAIN.name, "a", (0.1, 30), (1, 40)),
        curve(coders.MAIN.name, "b", (0.1, 50), (1, 60)),
    ]
    mean, worst = goals.goals_of(compare.compared(curves, coders.MAIN.name), curves, None)[:2]
    assert mean.measured == pytest.approx(0.1)
    assert mean.reached == worst.reached == "not on all clips"
    assert mean.remark == "1 of 2 clips"


def test_files_are_set_against_the_code_length_together_and_alone():
    points = [
        measure.Point("", size, 1, 30, 30, 0.9, None, 1, 1, 1, 10, measure.CodeLength(bits, 0, 0))
        for size, bits in ((110, 800), (1010, 8000))
    ]
    goal = goals.goals_of([], [measure.Curve(coders.MAIN.name, "c", tuple(points))], None)[-1]
    assert goal.measured == pytest.approx(1120 / 1100)
    assert goal.remark.endswith("single files +1.0 % to +10.0 %")


def test_what_is_not_there_is_no_goal_reached():
    found = goals.goals_of([], [], None)
    assert {goal.reached for goal in found} == {"not measured"}
    assert "no common quality" in goals.summary([])


def test_the_code_length_is_that_of_symbols_and_densities_with_what_the_design_counts():
    def frame(kind, **bits):
        return SimpleNamespace(type=kind, bits=bits)

    frames = [frame("I", cells=100, densities=30, container=64, entropy_coder=32), frame("P", modes=7, color=3)]
    length = measure.code_length([*frames, frame("R", container=64)])
    assert (length.symbols, length.densities, length.counted) == (110, 30, 200)
    assert length.bits == 340


# The verdict


def by_metric(ratio):
    return dict.fromkeys(measure.METRICS, ratio)


@pytest.mark.parametrize(
    ("alone", "others", "vvc", "holds"),
    [
        (0.4, {"AVC": 0.9, "HEVC": 1.1, "AV1": 1.0}, 3.0, "yes"),
        (0.4, {"AVC": 4.0, "HEVC": 5.0, "AV1": 6.0}, 8.0, "partly"),
        (1.2, {"AVC": 0.9, "HEVC": 1.0, "AV1": 1.0}, 3.0, "partly"),
        (1.2, {"AVC": 1.0, "HEVC": 5.0, "AV1": 6.0}, 3.0, "partly"),
        (1.2, {"AVC": 4.0, "HEVC": 5.0, "AV1": 6.0}, 8.0, "no"),
        (0.4, {}, None, "partly"),
        (1.2, {}, None, "no"),
        (None, {}, None, "cannot be compared"),
    ],
)
def test_the_verdict_follows_from_the_ratios(alone, others, vvc, holds):
    found = {coders.ALONE.name: by_metric(alone)} | {FIRST[name]: by_metric(ratio) for name, ratio in others.items()}
    if vvc is not None:
        found[FIRST["VVC"]] = by_metric(vvc)
    verdict = claim.verdict(found, 2)
    assert verdict.holds == holds
    for name, ratio in others.items():
        assert f"{FIRST[name]}: PSNR {ratio:.2f}, MS-SSIM" in verdict.sentence
    if not others:
        assert "AVC: could not be compared" in verdict.sentence


def test_good_ms_ssim_alone_is_not_comparable():
    near = by_metric(1.0) | {"vmaf": 2.0}
    found = {coders.ALONE.name: by_metric(0.5)} | {FIRST[name]: near for name in claim.CLAIMED}
    verdict = claim.verdict(found, 1)
    assert verdict.holds == "partly"
    assert "with none of AVC, HEVC, AV1" in verdict.sentence


# Tables


def curve(coder, clip, *pairs):
    points = [measure.Point("", 1, rate, psnr, psnr, 1 - 10 ** (-psnr / 10), psnr, 1, 1, 1) for rate, psnr in pairs]
    return measure.Curve(coder, clip, tuple(points))


def test_the_tables_have_each_clip_and_means_over_those_that_can_be_compared():
    near, far = [(1, 30), (10, 40)], [(1, 50), (10, 60)]
    curves = [
        *(curve(coders.PAPER.name, clip, (2, 30), (20, 40)) for clip in ("a", "b", "c")),
        curve(coders.ALONE.name, "a", *near),
        curve(coders.ALONE.name, "b", (2 * 2, 30), (20 * 2, 40)),
        curve(coders.ALONE.name, "c", *far),
    ]
    against = compare.compared(curves, coders.PAPER.name)
    table = tables.bd_table("", against, compare.ratios(against))
    assert [row[0] for row in table.rows] == ["a", "b", "c", "mean of the clips"]
    assert [row[2] for row in table.rows] == ["+100 %", "-50.0 %", "no overlap", "+0.0 % *"]
    assert all(len(set(row[2:6])) == 1 for row in table.rows)  # made so that all four metrics agree
    assert [row[6] for row in table.rows] == ["30.0–40.0", "30.0–40.0", "–", "2 of 3 clips"]
    (other,) = compare.compared(curves[:1] + curves[3:4], coders.PAPER.name, coders.PAPER.name)
    assert (other.test, other.anchor) == (coders.ALONE.name, coders.PAPER.name)
    assert other.rates["vmaf"].percent == pytest.approx(-50)


def test_a_little_overlap_is_marked():
    assert tables.cell(bd_rate([(1, 30), (10, 40)], [(1, 38), (10, 48)])).endswith(" *")


def test_what_was_reported_on_some_clips_names_them():
    def told(coder, clip, *notes):
        return measure.Curve(coder, clip, (), notes)

    curves = [told("A", "x", "version 1", "small"), told("A", "y", "version 1"), told("B", "x", "small")]
    assert tables.reported(curves) == ["A: version 1", "A: small (x)", "B: small"]


# Clips


NAMES = ["plain.y4m", "-i.y4m", "two words, 50%d $x$.y4m", "quote'\".y4m", "data:x.y4m", "concat|x.y4m", "ä[in].y4m"]


@needs_ffmpeg
@pytest.mark.parametrize("name", NAMES)
def test_codecs_get_the_planes_of_the_file(tmp_path, name):
    samples = np.random.default_rng(1).integers(0, 256, (2, 36 * 24 * 3 // 2), np.uint8)
    path = tmp_path / name
    path.write_bytes(b"YUV4MPEG2 W36 H24 F25:1 C420mpeg2\n" + b"".join(b"FRAME\n" + f.tobytes() for f in samples))
    clip = from_file(path, tmp_path / "out.yuv", 5)
    assert clip.path.read_bytes() == samples.tobytes()
    assert clip.frame_count == 2
    part = from_file(path, tmp_path / "part.yuv", 1, (16, 8), start=1)
    for whole, cut, (rows, columns), top, left in zip(
        list(clip.planes())[1], next(part.planes()), part.format.plane_shapes, (8, 4, 4), (10, 5, 5), strict=True
    ):
        np.testing.assert_array_equal(cut, whole[top : top + rows, left : left + columns])
    assert "16x8 out of the middle, from frame 1 on" in part.note
    assert part.frame_count == 1


@needs_ffmpeg
def test_a_raw_file_may_end_within_a_frame(tmp_path):
    video = replace(measure.WARM_UP, width=16, height=16)
    samples = np.random.default_rng(1).integers(0, 256, 3 * 384 + 5, np.uint8)
    path = tmp_path / "raw.yuv"
    path.write_bytes(samples.tobytes())
    clip = from_raw(path, tmp_path / "out.yuv", 9, video)
    assert clip.path.read_bytes() == samples[: 3 * 384].tobytes()


def test_titles_tell_clips_apart_and_make_harmless_names(clip):
    first = rate_distortion.named(clip, [])
    assert first.title == "demo, 64x64, 3 frames"
    assert rate_distortion.named(clip, [first]).title == "demo, 64x64, 3 frames (2)"
    assert plan.slug("../../$x: a b.y4m", 3) == "3-x-a-b"
    assert plan.slug("ä", 1) == "1"


# Codecs


def run_of(folder):
    return Run(full=False, folder=folder, say=lambda _: None)


@needs_ffmpeg
@pytest.mark.parametrize(("codec", "values"), [(AVC, (40, 10)), (HEVC, (40,)), (AV1, (60,)), (VVC, (43,))])
def test_a_codec_reports_that_its_options_took_effect(clip, tmp_path, codec, values):
    if codec.library not in ffmpeg.encoders():
        pytest.skip(f"this ffmpeg has no {codec.library}")
    found = list(measure.codec_curves(clip, codec, tmp_path, 1, values))
    assert [curve.coder for curve in found] == [codec.label(number) for number in range(len(codec.variants))]
    for curve in found:
        assert not any("does not show" in note for note in curve.notes)
        assert [point.setting for point in curve.points] == [f"{codec.quality[1]} {value}" for value in values]
        last = curve.points[-1]
        assert last.bits_per_pixel == 8 * last.bytes / (64 * 64 * 3)
        assert 20 < curve.points[0].psnr < 60
    if len(values) > 1:
        coarse, fine = found[0].points
        assert fine.bytes > coarse.bytes
        assert all(fine.quality(metric) > coarse.quality(metric) for metric in ("psnr", "psnr_y", "ms_ssim"))


@needs_ffmpeg
def test_a_variant_that_the_first_is_already_is_told_and_not_run(clip, tmp_path):
    alike = replace(AVC, variants=(AVC.variants[0], replace(AVC.variants[0], name="the same")))
    (curve,) = measure.codec_curves(clip, alike, tmp_path, None, (40,))
    assert "by its own report this is its the same, too" in curve.notes


@needs_ffmpeg
def test_without_loss_every_number_says_so(clip, tmp_path):
    exact = replace(AVC, quality=("-qp", "QP"), variants=(replace(AVC.variants[0], options=("-preset", "ultrafast")),))
    (curve,) = measure.codec_curves(clip, exact, tmp_path, None, (0,))
    assert curve.points[0].psnr_y == float("inf")
    assert curve.points[0].ms_ssim == 1
    assert any("does not show whether slow took effect" in note for note in curve.notes)


@needs_ffmpeg
def test_a_missing_codec_is_a_row_that_says_so(clip, tmp_path):
    (curve,) = measure.codec_curves(clip, replace(AVC, library="libnothing"), tmp_path, None)
    assert curve.points == ()
    assert "this ffmpeg has no libnothing" in curve.missing
    assert "not run: this ffmpeg has no libnothing" in tables.points_table([curve]).rows[0][-1]


@needs_ffmpeg
def test_a_codec_that_fails_is_a_row_with_its_own_words(clip, tmp_path):
    odd = replace(AVC, variants=(codecs.Variant("defaults", ("-tune", "nonsense"), ""),))
    (curve,) = measure.codec_curves(clip, odd, tmp_path, None, (40,))
    assert "nonsense" in curve.missing


def test_a_ctrl_c_that_the_encoder_takes_ends_the_experiment(clip, tmp_path, monkeypatch):
    """`gsvc_ref.encode` returns what was done so far, which would be a point of another clip."""
    frames = list(clip.frames())

    def interrupted(self):
        yield frames[0]
        raise KeyboardInterrupt

    monkeypatch.setattr(type(clip), "frames", interrupted)
    with pytest.raises(KeyboardInterrupt):
        measure.gsvc_point(clip, coders.PAPER.settings(splats=20, iterations=2), tmp_path)


@needs_ffmpeg
def test_no_process_stays_behind_when_decoding_is_ended_early(clip, tmp_path, monkeypatch):
    coded = codecs.encode(clip, AVC, AVC.variants[0], 40, tmp_path, None)
    started = []

    def popen(*arguments, **options):
        started.append(subprocess.Popen(*arguments, **options))
        return started[-1]

    monkeypatch.setattr(ffmpeg, "subprocess", SimpleNamespace(**{**vars(subprocess), "Popen": popen}))
    decoding = codecs.decode(coded, AVC, clip)
    next(decoding)
    decoding.close()
    assert started
    assert all(process.returncode is not None for process in started)


def test_without_ffmpeg_the_rest_is_measured(clip, tmp_path, monkeypatch):
    def missing():
        raise ffmpeg.FfmpegError("no ffmpeg here")

    monkeypatch.setattr(ffmpeg, "program", missing)
    (curve,) = measure.codec_curves(clip, AVC, tmp_path, None)
    assert curve.missing == "no ffmpeg here"
    assert ffmpeg.description() == ("no ffmpeg here", 0.0)
    path = tmp_path / "in.y4m"
    path.write_bytes(b"YUV4MPEG2 W8 H8 F25:1 C420jpeg\nFRAME\n" + bytes(96))
    assert from_file(path, tmp_path / "out.yuv", 1).note == "R′G′B′ turned into 4:2:0"


# The whole


@needs_ffmpeg
def test_the_experiment_compares_and_draws(tmp_path, monkeypatch):
    def load(target):
        video = replace(measure.WARM_UP, width=64, height=64)
        return from_frames(demo_clip(64, 64, 3), "a $ of <b>", "drawn", target, video)

    monkeypatch.setattr(rate_distortion, "jobs", lambda run: [plan.Job(load, (20, 60))])
    monkeypatch.setattr(rate_distortion, "warm_up", lambda coders, folder: None)
    monkeypatch.setattr(rate_distortion, "CODERS", (coders.PAPER, coders.MAIN, coders.ALONE))
    quick = Settings.quick
    monkeypatch.setattr(
        Settings,
        "quick",
        lambda **options: quick(**({} if options["profile"] == "main" else {"iterations": 10}), **options),
    )
    short = replace(AVC, values=(45, 20), variants=AVC.variants[:1])
    found = rate_distortion.run(run_of(tmp_path), [short, replace(HEVC, library="libnothing")])
    assert found.verdict.holds in ("yes", "partly", "no")
    assert "HEVC: could not be compared" in found.verdict.sentence
    assert {row[0] for row in found.tables[1].rows} == {"a $ of <b>, 64x64, 3 frames"}
    for table in found.tables:
        assert all(len(row) == len(table.columns) for row in table.rows)
    for name in found.figures:
        text = (tmp_path / f"{name}.svg").read_text()
        assert text.startswith("<?xml")
        assert "a $ of &lt;b&gt;, 64x64, 3 frames" in text
    curves = {curve["coder"]: curve for curve in found.numbers["curves"]}
    ours = [coder.name for coder in (coders.PAPER, coders.MAIN, coders.ALONE)]
    assert list(curves) == [*ours, FIRST["AVC"], replace(HEVC, library="libnothing").label()]
    alone, gsvc = curves[coders.ALONE.name], curves[coders.PAPER.name]
    assert alone["points"][0]["bytes"] > gsvc["points"][0]["bytes"]
    for point in curves[coders.MAIN.name]["points"]:
        assert sum(point["code_length"].values()) < 8 * point["bytes"]
    goal = {one.about: one for one in found.numbers["goals"]}
    assert goal["real files over the ideal code length"].measured > 1
    assert goal["seconds of decoding over those of paper"].measured > 0
    json.dumps(found.numbers["curves"])


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [(0.03, 0.6, [0.05, 0.1, 0.2, 0.5]), (1e-3, 2e3, [10.0**e for e in range(-3, 4)]), (0.31, 0.33, [0.3])],
)
def test_marks_on_a_logarithmic_axis_are_round(low, high, expected):
    assert figures.marks(low, high) == expected


def test_uvg_wants_its_own_names(tmp_path):
    with pytest.raises(UsageError, match="Beauty_1920x1080"):
        plan.jobs(replace(run_of(tmp_path), uvg=tmp_path))


def test_the_small_version_has_six_clips_of_their_own_titles(tmp_path):
    clips = []
    for job in plan.jobs(run_of(tmp_path)):
        clips.append(rate_distortion.named(job.load(tmp_path / f"{len(clips)}.yuv"), clips))
    assert [clip.title for clip in clips] == [
        "carphone_pristine.mp4, 176x144, 16 frames",
        "bikes.mp4, 256x176, 16 frames",
        "bikes.mp4 from frame 100, 256x176, 16 frames",
        "scene pan, 176x144, 16 frames",
        "scene talking-head, 160x128, 16 frames",
        "scene grain, 176x144, 16 frames",
    ]
    assert clips[1].path.read_bytes() != clips[2].path.read_bytes()


def test_numbers_of_splats_follow_from_the_area(clip):
    assert coders.PAPER.counts(clip) == (20, 40, 81, 163)
    assert coders.MAIN.counts(clip) == (10, 20, 40, 81, 163, 341)
    assert coders.MAIN.settings(splats=3).profile == "main"
    assert coders.LONG.settings(splats=3).profile == "paper"
