"""The experiment on the jumping circle."""

import numpy as np
import pytest

from gsvc_base.splats import Splats
from gsvc_lab.experiments import augmentation, jumping
from gsvc_lab.experiments.jumping import CASES, WAYS, Jump, Outcome, Size

TINY = Size(32, 18, 18, 20, (5, 10), (0,))


@pytest.fixture(scope="module")
def jump():
    return Jump(64, 36, 1, black=True)


def test_the_circle_jumps(jump):
    before, after = jump.inside
    assert before[:, :32].sum() > 200
    assert not before[:, 32:].any()
    assert not after[:, :32].any()
    np.testing.assert_array_equal(jump.background, 0)
    assert jump.color == pytest.approx([0.13, 0.30, 0.62], abs=0.01)
    assert jump.center == pytest.approx([0.22 * 64, 18], abs=0.5)
    assert jump.radius == pytest.approx(9, abs=0.2)


def test_coverage_and_ghost(jump):
    assert jump.covered(jump.after.frame) == (1, 0)
    assert jump.covered(jump.before.frame) == (0, 1)
    assert jump.covered(np.zeros_like(jump.after.frame)) == (0, 0)


def test_only_splats_near_the_circle_are_kept(jump):
    places = np.array([[14, 18], [30, 18], [60, 18]], np.float32)
    splats = Splats(places, np.ones((3, 3), np.float32), np.ones((3, 3), np.float32))
    np.testing.assert_array_equal(jump.at_circle(splats).positions, places[:2])


def test_a_tiny_version_compares_all_ways(quiet):
    pytest.importorskip("matplotlib", reason="figures are drawn by matplotlib")
    found = jumping.measure(TINY, quiet)
    assert len(found) == len(CASES) * len(WAYS) * len(TINY.inter)
    (with_gsa,) = augmentation.chosen(found, "light", "with")
    (without,) = augmentation.chosen(found, "light", "without")
    assert (len(with_gsa.splats), len(without.splats), without.iterations) == (18, 18, 10)
    assert len(augmentation.table(found).rows) == len(found)
    assert augmentation.verdict(found).holds in ("yes", "partly", "no")
    for name in augmentation.draw(TINY, found, quiet):
        assert (quiet.folder / f"{name}.svg").is_file()


def outcomes(**coverage):
    """One outcome for each case and way, from coverages without and with GSA by case."""
    nothing = Splats(*(np.zeros((1, columns), np.float32) for columns in (2, 3, 3)))
    frame = np.zeros((1, 1, 3), np.uint8)
    return [
        Outcome(case, way, 10, 0, 20.0, part, 0.0, nothing, frame)
        for case, parts in coverage.items()
        for way, part in zip(WAYS, parts, strict=True)
    ]


@pytest.mark.parametrize(
    ("light", "black", "gone", "holds", "sentence"),
    [
        ((0, 1), (0, 1), (0, 1), "yes", "Without GSA the frame stays empty, and with it the circle is captured"),
        ((1, 1), (0, 1), (0, 1), "partly", "stays empty on black background, and GSA captures the circle"),
        ((1, 1), (0, 0.5), (0, 1), "partly", "does not always capture it"),
        ((1, 1), (1, 1), (0, 1), "partly", "GSA then captures the circle"),
        ((1, 1), (1, 1), (0, 0.3), "partly", "GSA then captures a part of the circle"),
        ((1, 1), (1, 1), (0.5, 1), "no", "No frame stays empty without GSA"),
    ],
)
def test_the_verdict(light, black, gone, holds, sentence):
    verdict = augmentation.verdict(outcomes(light=light, black=black, gone=gone))
    assert verdict.holds == holds
    assert sentence in verdict.sentence
