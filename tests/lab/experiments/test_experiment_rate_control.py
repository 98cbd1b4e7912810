import copy

import pytest
from tiny_clips import silent, tiny_clip

from gsvc_lab.experiments import rate_control
from gsvc_lab.experiments.rate_control import Plan, measure, of_type, unevenness, verdict

TINY = Plan((32, 24), 4, 30, (20.0, 24.0), 6, 2e-2)


@pytest.fixture(scope="module")
def numbers(few_iterations):
    return measure([tiny_clip("steady"), tiny_clip("broken", cut=2)], TINY, 1, silent)


def test_a_tiny_version_has_all_numbers_and_figures(numbers, tmp_path):
    pytest.importorskip("matplotlib", reason="figures are drawn by matplotlib")
    assert set(numbers["rate"]["steady"]) == {"paper", "quick"}
    assert set(numbers["quality"]["broken"]) == {"20", "24"}
    assert {made["types"].count("I") for made in numbers["rate"]["broken"].values()} == {2}
    assert set(numbers["rate"]["steady"]["paper"]["splats"]) == {27}
    for name in rate_control.draw(numbers, tmp_path):
        assert (tmp_path / f"{name}.svg").stat().st_size < 60_000
    assert [len(table.rows) for table in rate_control.tables(numbers)] == [4, 4]


def test_unevenness_is_relative_to_the_mean():
    made = {"types": "IPPR", "bits": [900, 100, 120, 8]}
    assert unevenness(of_type(made, "P")) == pytest.approx(20 / 110)
    assert unevenness([]) == 0


@pytest.mark.parametrize(
    ("least", "usual", "last", "splats", "holds"),
    [(98, 0.2, 1.6, 30, "yes"), (50, 0.2, 1.6, 30, "partly"), (98, 0.2, -0.8, 30, "partly"),
     (98, 0.2, 16, 30, "partly"), (98, -0.2, -0.8, 30, "partly"), (98, 0.2, 1.6, 29, "partly"),
     (50, -0.2, -0.8, 29, "no")],
)  # fmt: skip
def test_verdicts(numbers, least, usual, last, splats, holds):
    made = copy.deepcopy(numbers)
    for presets in made["rate"].values():
        for part in presets.values():
            part |= {"types": "IPPP", "bits": [400, 100, 100, least], "splats": [30, 30, 30, splats]}
    for goals in made["quality"].values():
        for goal, part in goals.items():
            part["psnr"] = [float(goal) + usual] * 3 + [float(goal) + last]
    said = verdict(made)
    assert said.holds == holds
    assert f"has {(200 + least) / 1200:.0%} of the bits of an I-frame" in said.sentence
    held = 12 * (usual > 0) + 4 * (last > 0)
    assert f"{held} of 16 frames have the PSNR" in said.sentence
    assert ("the others, of broken and steady, miss it by up to 0.80 dB" in said.sentence) == (last < 0)
