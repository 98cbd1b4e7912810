import pytest
from tiny_clips import silent, tiny_clip

from gsvc_lab.experiments import time as experiment
from gsvc_lab.experiments.time import Plan, measure, verdict

TINY = Plan((32, 24), 2, 30, (4, 8), (5, 10))


def test_a_tiny_version_has_all_numbers_and_figures(tmp_path):
    pytest.importorskip("matplotlib", reason="figures are drawn by matplotlib")
    numbers = measure([tiny_clip(frames=2)], TINY, 1, silent)
    rows = numbers["tiny"]["presets"]
    assert [row["iterations"] for row in rows["quick"]] == [4, 8]
    assert [row["made"] for row in rows["paper"]] == [6, 11]  # and a tenth, at least one, for fine-tuning
    assert all(row["seconds"] > 0 for part in rows.values() for row in part)
    for name in experiment.draw(numbers, tmp_path):
        assert (tmp_path / f"{name}.svg").stat().st_size < 60_000
    (table,) = experiment.tables(numbers)
    assert len(table.rows) == 6
    assert "197.58" in str(table.rows)


@pytest.mark.parametrize(
    ("quick", "holds"),
    [((30, 32, 33), "yes"), ((30, 33, 32), "partly"), ((30, 27, 20), "no"), ((30, 30, 30), "partly")],
)
def test_verdicts(quick, holds):
    def rows(psnr: tuple[float, ...]) -> list[dict[str, float]]:
        return [
            {
                "iterations": 100 * 2**k,
                "made": 100.0,
                "seconds": 0.5 * 2**k,
                "psnr": float(value),
                "bits_per_pixel": 1.0,
            }
            for k, value in enumerate(psnr)
        ]

    said = verdict({"a": {"presets": {"quick": rows(quick), "paper": rows((20, 22, 24))}}})
    assert said.holds == holds
    assert f"quick gains {quick[-1] - quick[0]:.2f} dB" in said.sentence
    assert "0.50 to 2.0" in said.sentence
    assert "198 to 221 s" in said.sentence
