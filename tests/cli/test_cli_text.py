import json
import math
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gsvc_base.cli.text import decibel, duration, frame_runs, per_second, plural, table, to_json
from gsvc_ref.cli.files import describe_format
from gsvc_ref.video import ColorDescription, VideoFormat


def test_counts_and_rates():
    assert [plural(count, "frame") for count in (0, 1, 1200)] == ["0 frames", "1 frame", "1,200 frames"]
    assert per_second(Fraction(25)) == "25 frames/s"
    assert per_second(Fraction(30000, 1001)) == "29.97 frames/s"


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0, "0.0 s"),
        (9.94, "9.9 s"),
        (9.96, "10 s"),
        (59.4, "59 s"),
        (59.6, "1:00 min"),
        (3599.6, "1:00 h"),
        (7800, "2:10 h"),
    ],
)
def test_duration_carries_over(seconds, text):
    assert duration(seconds) == text


def test_an_infinite_psnr_says_identical():
    assert decibel(math.inf) == decibel(None) == "identical"
    assert decibel(34.567) == "34.57 dB"


def test_table_aligns_its_columns():
    assert table(["part", "bits"], [["positions", "5"], ["x", "1,000"]]) == [
        "part        bits",
        "positions      5",
        "x          1,000",
    ]


@given(st.lists(st.sampled_from("IPR"), min_size=1, max_size=20), st.integers(0, 50))
def test_frame_runs_name_every_frame_once(types, first):
    named = []
    for run in frame_runs(types, range(first, first + len(types))).split(", "):
        word, span, kind = run.split(" ")
        start, _, stop = span.removesuffix(":").partition("-")
        assert word == ("frames" if stop else "frame")
        named += [(number, kind) for number in range(int(start), int(stop or start) + 1)]
    assert named == list(enumerate(types, first))


def test_many_runs_are_cut_short():
    assert frame_runs("IP" * 50, range(100)).endswith("frame 19: P, and 80 more runs")


def test_format_in_one_line():
    color = ColorDescription(1, 1, 1, False, 0)
    video = VideoFormat(352, 288, Fraction(30000, 1001), 10, "420", color, frame_count=90)
    assert describe_format(video) == "352x288, 90 frames, 29.97 frames/s, 10 bits, 4:2:0, BT.709, limited range"
    pictures = VideoFormat(7, 5, Fraction(25), 8, "rgb", ColorDescription(2, 2, 0, True, 0))
    assert describe_format(pictures) == "7x5, 25 frames/s, 8 bits, R'G'B'"


@dataclass
class Report:
    rate: Fraction
    psnr: list[float]
    path: Path
    count: np.int64


def test_json_is_strict():
    report = Report(Fraction(24, 1001), [math.inf, math.nan, 1.5], Path("a"), np.int64(3))
    assert json.loads(json.dumps(to_json({"report": report, 1: (True, None)}), allow_nan=False)) == {
        "report": {
            "rate": {"numerator": 24, "denominator": 1001},
            "psnr": [None, None, 1.5],
            "path": "a",
            "count": 3,
        },
        "1": [True, None],
    }


def test_a_file_name_of_bytes_that_are_no_characters_is_json():
    assert to_json({"input": "a\udcffb", "path": Path("é")}) == {"input": "a\\udcffb", "path": "é"}
