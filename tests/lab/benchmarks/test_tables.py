"""What the benchmarks make of their numbers."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2]))
results = pytest.importorskip("gsvc_lab.benchmarks.results", reason="gsvc_lab.benchmarks is only in a checkout")
timing = pytest.importorskip("gsvc_lab.benchmarks.timing", reason="gsvc_lab.benchmarks is only in a checkout")


@pytest.mark.parametrize(
    ("measured", "more_is_better", "verdict"),
    [
        (1.3, False, "aim met"),
        (1.5, False, "must met"),
        (1.87, False, "missed by 10.0 %"),
        (3.4, False, "missed by a factor of 2.0"),
        (2.0, True, "aim met"),
        (0.5, True, "missed by a factor of 3.4"),
        (None, False, "why"),
    ],
)
def test_a_goal_tells_how_far_off_it_is(measured, more_is_better, verdict):
    aim = 1.3 if not more_is_better else 2.0
    assert results.Goal("work", "times", 1.7, aim, measured, more_is_better, "why").verdict() == verdict


def test_contenders_take_turns_and_ratios_are_taken_within_rounds(monkeypatch):
    monkeypatch.setattr(timing, "SETTLE", 0.0)
    called = []
    times = timing.interleaved({name: lambda name=name: called.append(name) for name in "ab"}, seconds=0, fewest=3)
    assert called == ["a", "b"] + ["a", "a", "b", "b"] * 3  # the first of two equal ones is not timed
    assert [len(part) for part in times.values()] == [3, 3]
    assert timing.ratio({"a": [2.0, 30.0, 8.0], "b": [1.0, 10.0, 2.0]}, "a", "b").median == 3


def test_a_table_is_aligned_markdown():
    table = results.Table("Text.", ["a", "long"], [["wide cell", "1"]])
    assert table.markdown().splitlines()[2:] == ["| a         | long |", "|-----------|------|", "| wide cell | 1    |"]


def test_the_report_replaces_what_stands_between_its_markers():
    report = pytest.importorskip("gsvc_lab.benchmarks.report", reason="gsvc_lab.benchmarks is only in a checkout")
    document = "before\n<!-- measured: goals -->\nold\n<!-- end -->\nafter\n"
    once = report.filled(document, {"goals": "new"})
    assert once == "before\n<!-- measured: goals -->\n\nnew\n\n<!-- end -->\nafter\n"
    assert report.filled(once, {"goals": "new"}) == once
