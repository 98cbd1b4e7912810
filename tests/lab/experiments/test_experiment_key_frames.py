import copy
import statistics

import pytest
from tiny_clips import silent, tiny_clip

from gsvc_base.errors import UsageError
from gsvc_lab.experiments import key_frames
from gsvc_lab.experiments.experiment import Run
from gsvc_lab.experiments.key_frames import Plan, drops, measure, thresholds, verdict
from gsvc_ref.encoder.key_frames import select_key_frames

TINY = Plan((32, 24), 6, 30, 6, 6, 2e-2, 4)


@pytest.fixture(scope="module")
def numbers(few_iterations):
    return measure([tiny_clip("a", 6, cut=6), tiny_clip("b", 6)], TINY, 1, silent)


def test_a_tiny_version_has_all_numbers_and_figures(numbers, tmp_path):
    pytest.importorskip("matplotlib", reason="figures are drawn by matplotlib")
    assert (numbers["seams"], numbers["frames"]) == ([6], 12)
    assert numbers["detections"]["as in quick"]["found"]["robust"] == [0, 6]
    assert numbers["encodes"]["quick"]["dynamic"]["types"] == "IPPPPPIPPPPP"
    assert numbers["encodes"]["paper"]["periodic"]["types"] == "IPPPIPPPIPPP"
    for name in key_frames.draw(numbers, tmp_path):
        assert (tmp_path / f"{name}.svg").stat().st_size < 60_000
    assert [len(table.rows) for table in key_frames.tables(numbers)] == [3, 4]


def test_a_drop_is_what_a_periodic_key_frame_loses():
    encodes = {
        "dynamic": {"types": "IPPIP", "psnr": [30, 31, 32, 30, 31]},
        "periodic": {"types": "IPIIP", "psnr": [30, 31, 29.5, 30, 31]},
    }
    assert drops(encodes) == [2.5]


@pytest.mark.parametrize(
    ("literal", "fast", "fall", "holds"),
    [([6], [6], 1.0, "yes"), ([], [6], 1.0, "partly"), ([], [], 1.0, "partly"), ([6], [6], -1.0, "partly"),
     ([], [4], -1.0, "no")],
)  # fmt: skip
def test_verdicts(numbers, literal, fast, fall, holds):
    made = copy.deepcopy(numbers)
    parts = list(made["detections"].values())
    for part, keys in zip(parts, (literal, fast, fast), strict=True):
        part["found"] = {"paper": [0, *keys], "robust": [0, *keys]}
    encodes = made["encodes"]["paper"]
    encodes["periodic"]["psnr"] = [psnr - fall for psnr in encodes["dynamic"]["psnr"]]
    said = verdict(made)
    assert said.holds == holds
    assert f"{fall:.2f} dB" in said.sentence
    lost = -statistics.fmean(drops(made["encodes"]["quick"]))
    assert f"with quick they {'rise' if lost > 0 else 'fall'} by {abs(lost):.2f} dB" in said.sentence


def test_the_lines_drawn_are_what_the_rules_ask():
    losses_i = [1.0, 1.0, 1.1, 0.9, 1.0, 1.0, 1.2, 1.0, 1.0, 1.1, 1.0, 1.0, 0.9, 1.0, 1.0, 1.0]
    losses_p = [0.9, 0.8, 0.9, 0.9, 3.5, 0.9, 1.0, 0.9, 0.8, 0.9, 0.9, 2.4, 0.9, 0.9, 0.9]
    found = {rule: select_key_frames(losses_i, losses_p, robust=rule == "robust") for rule in ("paper", "robust")}
    lines = thresholds(losses_i, losses_p, found["robust"], 2.0)
    for keys, line in zip(found.values(), lines, strict=True):
        above = [t for t, least in enumerate(line, 1) if losses_p[t - 1] - losses_i[t] > least]
        assert above == keys[1:]
    assert found["paper"] != found["robust"]


def test_one_clip_cannot_be_joined(tmp_path, monkeypatch):
    monkeypatch.setattr(key_frames, "given_clips", lambda run: [tiny_clip()])
    with pytest.raises(UsageError, match="at least twice"):
        key_frames.run(Run(full=False, folder=tmp_path, say=silent))
