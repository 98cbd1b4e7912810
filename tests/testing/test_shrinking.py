"""Planted faults shrink to the splats that they need, with round numbers; docs/property-tests.md has the examples."""

import random
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import Phase, find, settings

from gsvc_base.rendering.definition import footprints
from gsvc_base.splats import Splats
from gsvc_ref.testing import splat_sets, streams

PAGE = Path(__file__).parents[2] / "docs" / "property-tests.md"
WIDTH, HEIGHT = 64, 48
QUIETLY = settings(max_examples=3000, database=None, deadline=None, phases=[Phase.generate, Phase.shrink])


def two_are_close(splats):
    apart = np.linalg.norm(splats.positions[:, None].astype(float) - splats.positions, axis=2)
    return bool((apart + np.diag(np.full(len(splats), np.inf)) < 1).any())


def three_cover_a_pixel(splats):
    counts = np.zeros((HEIGHT, WIDTH), int)
    for _, _, pixels in footprints(splats, WIDTH, HEIGHT):
        counts[pixels.rows, pixels.columns] += pixels.covered
    return bool((counts >= 3).any())


def one_is_outside(splats):
    return bool(((splats.positions < 0) | (splats.positions >= (WIDTH, HEIGHT))).any())


FAULTS = {
    "l11 > 10": (1, lambda splats: bool((splats.cholesky[:, 0] > 10).any())),
    "abs(R) > 1.2": (1, lambda splats: bool((abs(splats.colors[:, 0]) > 1.2).any())),
    "two splats closer than a pixel": (2, two_are_close),
    "a negative colour": (1, lambda splats: bool((splats.colors < 0).any())),
    "a splat outside the frame": (1, one_is_outside),
    "l21 < 0": (1, lambda splats: bool((splats.cholesky[:, 1] < 0).any())),
    "a needle, l11 / l22 > 50": (1, lambda splats: bool((splats.cholesky[:, 0] > 50 * splats.cholesky[:, 2]).any())),
    "N a multiple of 32": (32, lambda splats: len(splats) > 0 and len(splats) % 32 == 0),
    "a pixel covered by 3": (3, three_cover_a_pixel),
    "all three colours above 1": (1, lambda splats: bool((splats.colors > 1).all(axis=1).any())),
}
"""What each fault is, the fewest splats that have it, and the test that finds it."""


def smallest(name, seed):
    """The splats that are left of a fault."""
    return find(splat_sets(WIDTH, HEIGHT), FAULTS[name][1], settings=QUIETLY, random=random.Random(seed))


def on_the_page(name):
    """The splats of a row of the page, and their number as it says."""
    (row,) = [line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith(f"| {name} |")]
    _, _, count, examples, _ = row.split("|")
    rows = []
    for text, times in re.findall(r"`([^`]+)`(?: \((\d+) times\))?", examples):
        rows += [[float(word) for word in text.split()]] * int(times or 1)
    return Splats.from_array(np.array(rows, np.float32)), int(count)


@pytest.mark.parametrize("name", ["l11 > 10", "a negative colour", "a pixel covered by 3"])
def test_faults_shrink_to_the_splats_that_they_need(name):
    splats = smallest(name, 0)
    assert len(splats) == FAULTS[name][0]
    assert np.array_equal(splats.to_array(), np.rint(splats.to_array()))


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", FAULTS)
def test_the_page_has_what_is_left_of_each_fault(name):
    """As few splats, with round values; which of several equally simple ones is left, Hypothesis does not promise."""
    fewest, is_wrong = FAULTS[name]
    example, count = on_the_page(name)
    assert len(example) == count == fewest
    assert is_wrong(example)
    splats = smallest(name, 1)
    assert len(splats) == fewest
    assert np.array_equal(8 * splats.to_array(), np.rint(8 * splats.to_array()))


@pytest.mark.exhaustive
def test_small_streams_shrink_to_one_splat():
    few = settings(QUIETLY, max_examples=1000)
    small = streams(max_frames=1, max_count=8)
    stream = find(small, lambda stream: (stream.splats[0].to_array() < 0).any(), settings=few, random=random.Random(0))
    assert [len(splats) for splats in stream.splats] == [1]


def test_large_sets_shrink_to_few():
    sets = splat_sets(WIDTH, HEIGHT, max_count=5000)
    assert len(find(sets, lambda splats: len(splats) > 1000, settings=QUIETLY, random=random.Random(0))) == 1001
    wide = find(sets, FAULTS["l11 > 10"][1], settings=QUIETLY, random=random.Random(1))
    assert len(wide) == 1
