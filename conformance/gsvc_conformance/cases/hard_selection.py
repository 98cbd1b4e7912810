"""Numerically hard cases of key-frame selection: sums and squares that binary64 does not hold."""

import numpy as np

from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases.key_frames import PAPER, losses


@case("stress", "select_key_frames", flags=["ties"], each={"11": 11, "40": 40}, said={"11": "11 frames"})
def equal_differences(value: int) -> Inputs:
    """All losses are equal, 0.1 from scratch and 1.2 predicted, {key}: there is no outlier.

    Neither the mean nor the deviation of equal decimal fractions comes out exactly in binary64.
    """
    inputs = {"losses_i": np.full(value, 0.1), "losses_p": np.full(value - 1, 1.2), **PAPER}
    expected = yield inputs
    assert expected["key_frames"].value.tolist() == [0]


@case("stress", "select_key_frames", flags=["window"])
def cuts_at_both_ends() -> Inputs:
    """Cuts on a high floor, at the first and the last frame with a difference: their windows are half as long.

    Zeros in place of the missing frames would be far below the floor, and the deviation large.
    """
    expected = yield {**losses(40, {1: 60, 39: 70}, floor=50), **PAPER}
    assert expected["key_frames"].value.tolist() == [0, 1, 39]


@case("stress", "select_key_frames", flags=["cancellation"])
def cut_on_a_floor_of_billions() -> Inputs:
    """Differences of 2^33 that vary by a few, one by 64 more: the sum of squares less the square of sums cancels.

    In binary64 n Q - S^2 is rounding errors alone, negative ones among them.
    """
    steps = np.resize([0.0, 3, 1, 4, 1, 5, 2], 39)
    steps[20] += 64
    expected = yield {"losses_i": np.full(40, 8.0), "losses_p": 8 + 2.0**33 + steps, **PAPER}
    assert expected["key_frames"].value.tolist() == [0, 21]


@case("stress", "select_key_frames", flags=["overflow", "subnormal"], each={"huge": 1e300, "tiny": 2.0**-1074})
def losses_at_the_ends_of_binary64(value: float) -> Inputs:
    """Losses so {key} that their squares do not fit into binary64, with one cut."""
    sequence = losses(40, {20: 30})
    expected = yield {"losses_i": value * sequence["losses_i"], "losses_p": value * sequence["losses_p"], **PAPER}
    assert expected["key_frames"].value.tolist() == [0, 20]
