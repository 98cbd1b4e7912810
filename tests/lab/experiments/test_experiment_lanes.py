"""The experiment about lanes: bits and rounds of a frame, the musts, and a clip of its own."""

from dataclasses import replace

import numpy as np
import pytest
from tiny_clips import tiny_clip

from gsvc_lab.experiments import lanes
from gsvc_lab.experiments.lanes import DEFAULT, SMALL, WAYS, Measured, measure, verdict


@pytest.mark.parametrize(("bits", "rounds", "holds"), [(1005, 500, "yes"), (1007, 500, "no"), (1005, 501, "no")])
def test_the_musts_are_about_bits_and_rounds(bits, rounds, holds):
    frame = np.tile([1, 1000, 900], (len(WAYS), 1))
    frame[DEFAULT] = 4, bits, rounds
    assert verdict([Measured("a", SMALL, "I", frame[None])]).holds == holds


def test_means_are_by_type():
    found = Measured("a", SMALL, "IPP", np.array([[[1, bits, 9]] for bits in (100, 10, 30)]))
    assert [found.means(types)[0, 1] for types in ("I", "P", "IP", "R")] == pytest.approx([100, 20, 140 / 3, 0])


def test_a_clip_is_coded_anew_in_lanes(quiet, monkeypatch):
    monkeypatch.setattr(lanes, "SMALL", replace(SMALL, splats=60))
    found = measure(tiny_clip(frames=2), quiet)
    assert found.types == "IP"
    for frame in found.frames:
        counts, bits, rounds = frame.T
        assert counts[:3].tolist() == [1, 32, 64]
        assert bits[0] < bits[1] < bits[2]
        assert rounds[0] > rounds[1] >= rounds[2]
        assert bits[DEFAULT] <= 1.02 * bits[0]
    assert found.frames[0, 0, 2] > 3 * 60  # one symbol of luma and two of chroma for each splat, and others
