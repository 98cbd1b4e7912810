import pytest
from tiny_clips import silent, tiny_clip

from gsvc_lab.experiments import ablation
from gsvc_lab.experiments.ablation import VARIANTS, WEIGHTS, Plan, gains, measure, verdict

TINY = Plan((32, 24), 4, (20, 40), 40, 2, 6, 2e-2)


@pytest.fixture(scope="module")
def numbers():
    return measure([tiny_clip("steady"), tiny_clip("broken", cut=2)], TINY, 1, silent)


def test_a_tiny_version_has_all_numbers_and_figures(numbers, tmp_path):
    pytest.importorskip("matplotlib", reason="figures are drawn by matplotlib")
    assert [part["keys"] for part in numbers["clips"].values()] == [(0,), (0, 2)]
    for part in numbers["clips"].values():
        for splats, made in part["counts"].items():
            assert set(made) == {WEIGHTS, *VARIANTS}
            runs = [run for runs in made.values() for run in runs]
            assert {tuple(run["splats"]) for run in runs} == {(round(0.9 * int(splats)),)}
            decoded = [["decoded" in run for run in runs] for runs in made.values()]
            assert decoded == [[splats == "40", False]] * 5
            assert all(run["decoded"]["splats"] == run["splats"] for run in runs if "decoded" in run)
    steady, broken = (numbers["clips"][name]["counts"]["40"] for name in ("steady", "broken"))
    assert steady["+ DKS"] == steady["+ GSA"]
    assert broken["+ DKS"] != broken["+ GSA"]
    for name in ablation.draw(numbers, tmp_path):
        assert (tmp_path / f"{name}.svg").stat().st_size < 60_000
    assert [len(table.rows) for table in ablation.tables(numbers)] == [20, 10]
    assert verdict(numbers).sentence


def invented(*gained: float) -> dict:
    """Numbers in which GSP, GSA and DKS add so many dB, a hundredth more with the second seed."""
    made = {WEIGHTS: [{"psnr": 30.5, "ms_ssim": 0.9}] * 2}
    runs = [{"psnr": 30.0, "ms_ssim": 0.9}] * 2
    for name, gain in zip(VARIANTS, (0, *gained), strict=True):
        runs = [{"psnr": run["psnr"] + gain + 0.01 * k, "ms_ssim": 0.9} for k, run in enumerate(runs)]
        made[name] = runs
    return {"clips": {"a": {"keys": (0,), "counts": {"100": made}}, "b": {"keys": (0, 4), "counts": {"100": made}}}}


def test_gains_are_means_over_all_runs():
    found = gains(invented(2, 1, 0.5), "psnr")
    assert found["+ GSP"].mean == pytest.approx(2.005)
    assert found["+ DKS"].error == pytest.approx(0.00289, abs=1e-4)


@pytest.mark.parametrize(
    ("gained", "holds"),
    [((2, 1, 0.5), "yes"), ((1, 2, 0.5), "partly"), ((2, 1, -0.5), "partly"), ((-1, -2, -3), "no"), ((-1, 1, 2), "no")],
)
def test_verdicts(gained, holds):
    said = verdict(invented(*gained))
    assert said.holds == holds
    assert "with a cut (b)" in said.sentence
    assert "weights w alone" in said.sentence
