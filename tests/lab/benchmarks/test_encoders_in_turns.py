"""Encoders in turns: what a worker tells of an encode, and what is made of it."""

import subprocess
import sys

import pytest

from gsvc_lab.benchmarks import encoders
from gsvc_lab.benchmarks.encoders import CHECKOUT, Case, Worker, fall, mean_psnr, seconds

TINY = Case("scene:water", 3, 96, 64, 80)


@pytest.mark.exhaustive
@pytest.mark.parametrize("profile", encoders.PROFILES)
def test_a_worker_tells_each_frame_of_an_encode(profile):
    with Worker(CHECKOUT) as worker:
        first, again = (worker.encoded(TINY.request(profile, 1)) for _ in range(2))
    assert [frame["type"] in kinds for frame, kinds in zip(first["frames"], ("I", "PR", "PR"), strict=True)] == [
        True
    ] * 3
    assert sum(frame["bits"] for frame in first["frames"]) <= 8 * first["bytes"]
    assert [frame["bits"] for frame in first["frames"]] == [frame["bits"] for frame in again["frames"]]
    assert 0 < sum(frame["seconds"] for frame in first["frames"]) <= first["seconds"]
    assert 15 < mean_psnr(first) < 60


def test_a_worker_runs_the_sources_of_its_checkout(tmp_path):
    """Of a folder with other sources, here with none that can be imported, it says that there was no answer."""
    (tmp_path / "gsvc_ref").mkdir()
    (tmp_path / "gsvc_ref" / "__init__.py").write_text("raise SystemExit('another checkout')")
    with Worker(tmp_path) as worker, pytest.raises(RuntimeError, match="without an answer"):
        worker.encoded(TINY.request("main", 1))


def test_numbers_of_a_gop():
    frames = [{"type": "IP"[number > 0], "psnr": 30 + number, "seconds": number} for number in range(6)]
    answer = {"frames": frames}
    assert fall(answer) == 4.0
    assert mean_psnr(answer) == 32.5
    assert seconds([answer, answer], "P") == 3.0


@pytest.mark.exhaustive
def test_tables_tell_before_and_after(monkeypatch):
    monkeypatch.setattr(encoders, "LEVELS", (TINY,))
    monkeypatch.setattr(encoders, "PROFILES", ("main",))
    with Worker(CHECKOUT) as before, Worker(CHECKOUT) as after:
        table = encoders.level_table([before, after], 1)
    [row] = table.rows
    assert row[:2] == ["main", "water 96x64, N = 80"]
    for cell in row[2:]:
        one, other = cell.split(" → ")
        assert one == other  # both sides are the same sources


def test_help_says_what_is_measured():
    text = subprocess.run(
        [sys.executable, "-m", "gsvc_lab.benchmarks.encoders", "--help"], capture_output=True, text=True, check=True
    ).stdout
    assert "--against" in text
