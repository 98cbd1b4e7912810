"""The experiment about layers: what it reads off a report and a curve, its goals and verdict, and one tiny clip."""

import json
from dataclasses import replace
from types import SimpleNamespace

import pytest

pytest.importorskip("scipy", reason="curves need the extra experiments")

from gsvc_lab.bench import measure
from gsvc_lab.bench.planes import from_frames
from gsvc_lab.experiments import layers
from gsvc_lab.experiments.layers import Layered, Quality
from gsvc_lab.experiments.rate_distortion.plan import Job
from gsvc_lab.experiments.results import record
from gsvc_lab.scenes import demo_clip

SINGLE = [(1000.0, 30.0), (10000.0, 40.0)]


def frame(*layers):
    return SimpleNamespace(layers=[SimpleNamespace(psnr=psnr, bits=bits) for psnr, bits in layers])


def made(clip, count, *ratios):
    return Layered(clip, (10,) * count, tuple(Quality(30.0, round(1000 * ratio), 1000.0) for ratio in ratios), (0,))


def test_qualities_are_read_off_a_report():
    report = SimpleNamespace(
        file_bytes=500, frames=[frame((30, {"all": 100}), (35, {"all": 900})), frame((30, {"all": 50}), (35, {}))]
    )
    found = layers.layered("c", (10, 20), report, SINGLE)
    assert [quality.bits for quality in found.qualities] == [3100, 4000]
    assert found.qualities[0].ratio == pytest.approx(3.1)
    assert found.qualities[1].ratio == pytest.approx(4000 / 1000 / 10**0.5)
    assert found.carried == (1,)
    assert layers.layered("c", (10, 20), report, [(1.0, 31.0), (2.0, 32.0)]).qualities[0].ratio is None


def test_goals_are_the_mean_and_the_worst():
    found = [made("a", 2, 1.2, 1.1), made("b", 2, 1.2, 1.0), made("a", 3, 1.5, 1.3), made("b", 3, 1.5, 1.4)]
    assert [goal.reached for goal in layers.goals(found, 2)] == ["must", "must", "must", "no must"]
    mean, worst, *_ = layers.goals(found, 3)
    assert (mean.reached, worst.reached, worst.remark) == ("no", "no", "b")
    assert worst.measured == pytest.approx(1.4)
    unknown = replace(found[0], qualities=(found[0].qualities[0], Quality(50.0, 1, None)))
    assert layers.goals([unknown, found[1]], 2)[0].reached == "not on all clips"
    assert layers.clips_table([unknown]).rows[0][4] == "–"
    assert layers.verdict(found).holds == "no"
    assert layers.verdict([*found[1:2], made("a", 3, 1.5, 1.3)]).holds == "partly"
    assert layers.verdict([unknown]).holds == "cannot be compared"


def test_the_experiment_codes_a_clip_in_one_two_and_three_layers(quiet, monkeypatch):
    def load(target):
        video = replace(measure.WARM_UP, width=48, height=32)
        return from_frames(demo_clip(48, 32, 2), "demo", "drawn", target, video)

    monkeypatch.setattr(layers, "jobs", lambda run: [Job(load)])
    monkeypatch.setattr(layers, "warm_up", lambda coders, folder: None)
    result = layers.run(quiet)
    goals, clips = result.tables
    assert len(goals.rows) == 8
    assert [row[1] for row in clips.rows] == ["30, 61", "15, 30, 61"]
    assert len(result.numbers["single"]["demo, 48x32, 2 frames"]) == 5
    json.dumps(record(layers.EXPERIMENT, result, quiet, 1.0))
