"""All groups measured on a small picture: what is found, and how it is shown."""

import json
import math
import re

import numba
import numpy as np
import pytest
from html_pages import parsed

from gsvc_base.cli.text import to_json
from gsvc_base.errors import UsageError
from gsvc_lab.accuracy import GROUPS, Source, accuracy_html, accuracy_object, markdown, measure_accuracy, page
from gsvc_lab.accuracy.encoding import Curve, encoding_curve, thinned
from gsvc_lab.accuracy.measure import pareto
from gsvc_lab.accuracy.pictures import amplified
from gsvc_lab.accuracy.runner import central
from gsvc_lab.accuracy.sources import clip_source, scene_source
from gsvc_lab.accuracy.tables import number, time_text
from gsvc_lab.cli.accuracy import describe
from gsvc_lab.pages.charts import Axis, Point, Series, plot
from gsvc_ref.encoder.settings import Settings

JIT = not numba.config.DISABLE_JIT
ROWS, COLUMNS = (24, 40) if JIT else (10, 16)
"""Interpreted kernels take seconds for what compiled ones do in a millisecond."""


def small_source():
    frame = scene_source("chelsea").frame[100 : 100 + ROWS, 200 : 200 + COLUMNS]
    return Source("a <cat> & more", 0, np.ascontiguousarray(frame))


@pytest.fixture(scope="module")
def report():
    return measure_accuracy(small_source(), seconds=2, repeats=1)


@pytest.mark.exhaustive
def test_every_group_and_setting_has_finite_numbers(report):
    found = json.loads(json.dumps(to_json(accuracy_object(report)), allow_nan=False))
    assert [(group["name"], [rung["name"] for rung in group["rungs"]]) for group in found["groups"]] == [
        (group.name, [setting.name for setting in group.settings]) for group in GROUPS
    ]
    for group in found["groups"]:
        for rung in group["rungs"]:
            for name in ("largest_error", "error_quantile_99999", "rms_error", "ratio"):
                assert math.isfinite(rung[name])
            assert rung["largest_error"] >= rung["error_quantile_99999"] >= 0
            assert rung["largest_error"] >= rung["rms_error"]
            assert (rung["psnr"] is None) == (rung["rms_error"] == 0)
            assert rung["seconds"]["low"] <= rung["seconds"]["median"] <= rung["seconds"]["high"]
            assert rung["seconds"]["runs"] == 1
            assert (rung["bytes"] is not None) == (group["kind"] == "coding")
            assert math.isfinite(rung["source_psnr"]["median"])
        assert [rung["ratio"] for rung in group["rungs"] if rung["base"]] == [1]
    assert found["splats"] == ROWS * COLUMNS // 40
    assert [curve["preset"] for curve in found["curves"]] == ["quick", "paper"]


def test_the_exact_pictures_are_the_only_ones_without_error(report):
    found = {(result.group.name, one.setting.name): one for result in report.groups for one in result.measurements}
    exact = [key for key, one in found.items() if one.errors.psnr == math.inf]
    assert exact == [("precision", "exact"), ("cutoff", "none")]
    wide = [found["cutoff", name].errors.rms for name in ("1/255", "1/1024", "1/4096")]
    assert wide == sorted(wide, reverse=True)
    assert len({one.errors for (group, _), one in found.items() if group == "threads"}) == 1


def test_marks_are_pareto_in_error_and_cost(report):
    for result in report.groups:
        costs = [one.bytes if result.group.cost == "bytes" else one.seconds.median for one in result.measurements]
        rms = [one.errors.rms for one in result.measurements]
        assert [one.best for one in result.measurements] == pareto(list(zip(rms, costs, strict=True)))


def test_the_table_names_everything(report):
    text = "\n".join(describe(report))
    for group in GROUPS:
        assert f"{group.title} ({group.name}): errors against {group.against}" in text
        assert all(setting.name in text for setting in group.settings)
    assert "identical" in text
    assert "preset paper: " in text
    assert "99.999 %" in text


def test_the_markdown_has_a_table_for_each_group(report):
    text = markdown(report)
    assert text.count("|---|---|---:|") == len(GROUPS)
    tables = [line for line in text.splitlines() if line.startswith("|")]
    assert len(tables) == sum(2 + len(group.settings) for group in GROUPS)
    assert "| \\* |" in text


def test_the_page_is_well_formed_and_needs_nothing_else(report):
    page = accuracy_html(report, "gsvc accuracy 'a b.png' --plot")
    checker = parsed(page)
    assert "script" not in checker.tags
    for name, value in checker.attributes:
        assert name not in ("srcset", "href")
        if name == "src":
            assert value.startswith("data:image/png;base64,")
    without_pictures = re.sub(r"data:image/[^\"]*", "", page)
    assert not re.search(r"https?:|//|url\(|@import", without_pictures)
    assert checker.tags.count("img") == 4
    assert checker.tags.count("svg") == 2 * 4  # for wide and for narrow pages
    text = " ".join(checker.text)
    assert "a <cat> & more" in text
    assert "gsvc accuracy 'a b.png' --plot" in text
    for result in report.groups:
        assert result.group.title in text
        for one in result.measurements:
            assert one.setting.name in text
            assert number(one.errors.largest) in text
            assert time_text(one.seconds.median) in text


def test_some_groups_make_a_page(report):
    source = small_source()
    some = measure_accuracy(source, ("threads", "start"), seconds=0.1, repeats=1)
    assert [result.group.name for result in some.groups] == ["threads", "start"]
    checker = parsed(accuracy_html(some))
    assert "Coding: PSNR against bytes" not in checker.text
    curves = measure_accuracy(source, ("encoding",), seconds=0.1, repeats=1)
    assert curves.splats == 0
    assert parsed(accuracy_html(curves)).tags.count("svg") == 2  # for wide and for narrow pages
    assert "Encoding one I-frame" in "\n".join(describe(curves))


def test_large_pictures_are_cut_down_for_training():
    picture = np.arange(60 * 100 * 3, dtype=np.float32).reshape(60, 100, 3)
    assert central(picture, 6000) is picture
    middle = central(picture, 1500)
    assert middle.shape == (30, 50, 3)
    np.testing.assert_array_equal(middle, picture[15:45, 25:75])


def test_cut_down_pictures_are_said(monkeypatch):
    monkeypatch.setattr("gsvc_lab.accuracy.runner.MAX_TRAINING_PIXELS", 40)
    found = measure_accuracy(small_source(), ("start",), seconds=0.1, repeats=1)
    width, height = (8, 4) if JIT else (8, 5)
    assert found.notes == (f"the settings that code and train took the middle {width}x{height} pixels of the picture",)


@pytest.mark.parametrize("numbers", [{"seconds": 0}, {"seconds": math.inf}, {"seconds": math.nan}, {"repeats": 0}])
def test_numbers_out_of_range(numbers):
    with pytest.raises(UsageError, match="seconds is"):
        measure_accuracy(small_source(), ("cutoff",), **numbers)


def test_a_curve_that_is_complete_and_one_that_is_stopped():
    source = small_source()
    complete = encoding_curve(Settings.quick(profile="paper", splats=12, iterations=4), source, math.inf)
    assert complete.end.startswith("complete: the decoded frame has ")
    seconds = [second for second, _ in complete.points]
    assert seconds == sorted(seconds)
    stopped = encoding_curve(Settings.paper(splats=12), source, 0.05)
    assert stopped.end.startswith("stopped after 0 s, in iteration ")
    assert stopped.end.endswith(" of the fit")


def test_when_a_curve_reached_something():
    curve = Curve("quick", ((0.1, 20.0), (0.2, 30.0), (0.3, 29.0), (0.4, 31.0)), 4, "complete")
    assert [curve.seconds_to(psnr) for psnr in (5, 30, 30.5, 31.5)] == [0.1, 0.2, 0.4, None]


def test_thinned_curves_keep_their_ends():
    points = [(0.01 * (n + 1), float(n)) for n in range(5000)]
    kept = thinned(points, 50)
    assert 30 < len(kept) <= 50
    assert (kept[0], kept[-1]) == (points[0], points[-1])
    assert set(kept) <= set(points)
    assert thinned(points[:50], 50) == tuple(points[:50])


def test_errors_are_amplified_around_grey():
    error = np.zeros((40, 50, 3))
    error[0, 0] = 0.02, -0.01, 0
    error[1:3, :5] = 0.003
    picture, gain = amplified(error)
    assert gain == 20_000
    assert picture[0, 0].tolist() == [255, 0, 128]
    assert picture[1, 1].tolist() == [128 + 60] * 3
    picture, gain = amplified(np.zeros((2, 2, 3)))
    assert (picture == 128).all()
    assert gain == 1


def circles(chart):
    """The places of the marks as wide pages show them."""
    wide = chart.partition('<div class="narrow">')[0]
    return [(float(x), float(y)) for x, y in re.findall(r'<circle class="[^"]*" cx="([\d.]+)" cy="([\d.]+)"', wide)]


def test_points_stand_where_their_values_are():
    points = (Point(1, 0), Point(10, 5), Point(100, 10))
    chart = plot([Series("a", points, 0)], Axis("x", str, log=True), Axis("y", str), "label")
    (x0, y0), (x1, y1), (x2, y2) = circles(chart)
    assert x1 == pytest.approx((x0 + x2) / 2, abs=0.11)
    assert y1 == pytest.approx((y0 + y2) / 2, abs=0.11)
    assert x0 < x1 < x2
    assert y0 > y1 > y2


def test_zero_stands_below_everything_on_a_logarithmic_axis():
    points = (Point(1, 0), Point(2, 1e-9), Point(3, 1))
    chart = plot([Series("a", points, 0)], Axis("x", str), Axis("y", lambda value: f"{value:g}", log=True), "label")
    heights = [y for _, y in circles(chart)]
    assert heights == sorted(heights, reverse=True)
    assert ">0</text>" in chart


def test_labels_do_not_cover_each_other():
    points = tuple(Point(n % 4, n // 4 / 10, label=f"point number {n}") for n in range(12))
    chart = plot([Series("a", points, 0, line=False)], Axis("x", str), Axis("y", str), "label")
    wide = chart.partition('<div class="narrow">')[0]
    found = re.findall(r'<text class="name" x="([\d.]+)" y="([\d.]+)">([^<]+)</text>', wide)
    boxes = [(float(x), float(y), float(x) + 6 * len(text)) for x, y, text in found]
    assert len(boxes) >= 8
    for n, (left, y, right) in enumerate(boxes):
        for other_left, other_y, other_right in boxes[n + 1 :]:
            assert abs(y - other_y) >= 13 or right <= other_left or other_right <= left


def test_scenes_and_clips(tmp_path):
    assert scene_source("demo", 3).frame.shape == (112, 192, 3)
    assert not np.array_equal(scene_source("demo", 3).frame, scene_source("demo", 0).frame)
    assert scene_source("coffee").picture.max() <= 1
    with pytest.raises(UsageError, match="no scene 'dog'; there are demo, astronaut, chelsea, coffee"):
        scene_source("dog")
    with pytest.raises(UsageError, match="chelsea has no frame 1"):
        scene_source("chelsea", 1)
    with pytest.raises(UsageError, match="the frame is -1"):
        scene_source("demo", -1)
    with pytest.raises(FileNotFoundError):
        clip_source(str(tmp_path / "missing.png"))


@pytest.mark.parametrize(
    ("value", "digit", "exponent"), [(5e-5, "5·", "−5"), (1e-5, "", "−5"), (2e-4, "2·", "−4"), (2e4, "2·", "4")]
)
def test_marks_of_an_axis_keep_their_digit(value, digit, exponent):
    assert page._power(value).startswith(f"{digit}10<tspan")
    assert f">{exponent}</tspan>" in page._power(value)


def test_marks_of_an_axis_are_plain_where_they_can():
    assert [page._power(value) for value in (0, 0.001, 0.5, 20)] == ["0", "0.001", "0.5", "20"]
