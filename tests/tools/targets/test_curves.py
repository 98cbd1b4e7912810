"""Bits over splats: the curve of a group, and bits spent on groups at equal slope."""

import numpy as np
import pytest

from gsvc_tools.targets.curves import (
    LIMITS,
    SPREAD,
    USUAL,
    FrameCost,
    GroupCurve,
    Slopes,
    equal_slope,
    same_for_all,
)


def curve(intra=8000.0, inter=1000.0, frames=4, error=0.001, octave=8.0, slopes=USUAL, first=0) -> GroupCurve:
    costs = [FrameCost(first, "I", intra, error)]
    costs += [FrameCost(first + n, "P", inter, error) for n in range(1, frames)]
    return GroupCurve(tuple(costs), octave, slopes)


def taken(curves, octaves) -> float:
    return sum(sum(one.frame_bits(at)) for one, at in zip(curves, octaves, strict=True))


def lost(curves, octaves) -> float:
    return sum(float(one.error(np.array([at]))[0]) for one, at in zip(curves, octaves, strict=True))


def test_a_curve_goes_through_what_was_measured_and_follows_its_slopes():
    one = curve(slopes=Slopes(1.0, 2.0, 1.5))
    assert one.frame_bits(8.0) == [8000, 1000, 1000, 1000]
    assert one.frame_bits(9.0) == pytest.approx([16000, 4000, 4000, 4000])
    assert one.bits(np.array([8.0, 9.0])) == pytest.approx([11000, 28000])
    assert one.error(np.array([8.0, 9.0])) == pytest.approx([0.004, 0.004 * 2**-1.5])


def test_repeated_frames_cost_the_same_with_any_number_of_splats():
    one = GroupCurve((FrameCost(0, "I", 8000, 0.1), FrameCost(1, "R", 56, 0.1)), 8.0)
    assert one.frame_bits(12.0)[1] == 56
    assert one.bits(np.array([12.0]))[0] == pytest.approx(sum(one.frame_bits(12.0)))


def test_slopes_are_found_again_from_two_measurements():
    true = Slopes(1.2, 1.7, 0.9)
    one = curve(slopes=true)
    again = [
        FrameCost(frame.number, frame.type, bits, frame.error * 2**-0.9)
        for frame, bits in zip(one.frames, one.frame_bits(9.0), strict=True)
    ][:3]
    found = curve().with_slopes(again, 9.0).slopes
    assert (found.intra, found.inter, found.error) == pytest.approx((1.2, 1.7, 0.9))


def test_chance_gives_no_slope_beyond_the_limits():
    wild = [FrameCost(0, "I", 80000, 1e-9), FrameCost(1, "P", 500, 1e-9), FrameCost(2, "P", 500, 1e-9)]
    found = curve().with_slopes(wild, 9.0).slopes
    assert (found.intra, found.inter, found.error) == (LIMITS["intra"][1], LIMITS["inter"][0], LIMITS["error"][1])
    assert curve().with_slopes(wild, 8.1).slopes == USUAL  # too near each other
    assert curve(inter=100.0).with_slopes(wild, 9.0).slopes.inter == USUAL.inter  # too few bits
    assert curve().with_slopes([], 9.0).slopes == USUAL


CLIPS = {
    "one group": [curve()],
    "equal groups": [curve(first=0), curve(first=4)],
    "dear and cheap": [curve(16000, 4000, error=0.004), curve(2000, 100, error=0.0005, first=4)],
    "many": [curve(3000 + 997 * n, 50 * n + 10, 3 + n % 3, 0.0002 * (1 + n % 5), first=10 * n) for n in range(9)],
}


@pytest.mark.parametrize("name", CLIPS)
@pytest.mark.parametrize("factor", [0.4, 1.0, 2.5])
def test_the_bits_are_spent_and_no_exchange_of_bits_is_better(name, factor):
    curves = CLIPS[name]
    bits = factor * taken(curves, [8.0] * len(curves))
    octaves = equal_slope(curves, bits, 0.0, 14.0)
    assert taken(curves, octaves) == pytest.approx(bits, rel=1e-6)
    even = same_for_all(curves, bits, 0.0, 14.0)
    assert taken(curves, [even] * len(curves)) == pytest.approx(bits, rel=1e-6)
    assert lost(curves, octaves) <= lost(curves, [even] * len(curves)) * 1.001
    if any(abs(at - even) >= SPREAD - 0.1 for at in octaves):
        return  # held back
    slopes = []
    for one, at in zip(curves, octaves, strict=True):
        near = np.array([at - 0.01, at + 0.01])
        slopes.append(np.diff(one.error(near))[0] / np.diff(one.bits(near))[0])
    assert max(slopes) / min(slopes) == pytest.approx(1, abs=0.25)  # they are on a grid of octaves / 16


def test_a_goal_out_of_reach_gives_the_nearest():
    curves = CLIPS["dear and cheap"]
    assert equal_slope(curves, 0.0, 2.0, 12.0) == [2.0, 2.0]
    assert equal_slope(curves, 1e12, 2.0, 12.0) == [12.0, 12.0]
    assert equal_slope(curves, 1e5, 3.0, 3.0) == [3.0, 3.0]


def test_the_group_that_loses_more_by_it_gets_more():
    busy, calm = CLIPS["dear and cheap"]
    assert busy.error(np.array([8.0]))[0] > calm.error(np.array([8.0]))[0]
    simple = [curve(error=0.004), curve(error=0.0005, first=4)]
    bits = taken(simple, [8.0, 8.0])
    first, second = equal_slope(simple, bits, 0.0, 14.0)
    assert first > 8 > second
