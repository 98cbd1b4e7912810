"""Hard cases of key-frame selection, convergence, pruning and new splats."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from gsvc_conformance.expectations import Exact
from tests.hard_cases.catalogue import Entry, HardCase
from tests.hard_cases.measuring import Measurement, Truth, Variant, exactly, implementations, measure, mutated
from tests.hard_cases.naive import selection as naive
from tests.hard_cases.oracle import selection as oracle

SAMPLE: Final = "dividing by n - 1"
"""The form that is a mutant of the kit."""


@dataclass(frozen=True)
class KeyFrames(HardCase):
    """Key frames, compared as a 0 or 1 for every frame: lists of them differ in length."""

    def measure(self) -> Measurement:
        """As for any case, frame by frame."""
        inputs, expected = self.case().run()
        frames = len(inputs["losses_i"])

        def flags(outputs: Mapping[str, Any]) -> dict[str, Any]:
            return {"key_frames": np.bincount(np.asarray(outputs["key_frames"]), minlength=frames)}

        def flagged(variant: Variant) -> Variant:
            return lambda **given: flags(variant(**given))

        numbers = [int(number) for number in self.truth(**inputs)["key_frames"].value]
        return measure(
            inputs,
            {"key_frames": Exact(flags({"key_frames": expected["key_frames"].value})["key_frames"])},
            {"key_frames": Truth(exactly(flags({"key_frames": numbers})["key_frames"]))},
            {name: flagged(variant) for name, variant in implementations(self.operation).items()},
            flagged(self.naive[1]),
        )


def key_frames(vector: str, danger: str, form: str) -> KeyFrames:
    """A choice of key frames; the naive formula is in binary64."""
    condition = "None: rational numbers, so that a tie is a tie; a tie is no key frame."
    formula = mutated("select_key_frames", "dks-sample-deviation") if form == SAMPLE else naive.key_frames(form)
    return KeyFrames(vector, danger, condition, oracle.select_key_frames, (f"{form} in binary64", formula))


CASES: Final[tuple[Entry, ...]] = (
    key_frames(
        "stress/select_key_frames/equal_differences_11",
        "All losses equal: differences from a rounded mean over a rounded deviation of them are anything.",
        "a score",
    ),
    key_frames(
        "stress/select_key_frames/equal_differences_40",
        "All losses equal: every frame exceeds a rounded mean, since the variance of rounded squares is negative.",
        "sums of squares",
    ),
    key_frames(
        "core/select_key_frames/two_frames_exactly_twice",
        "T = 2: one difference has the deviation 0, and its score is 0 / 0, which does not compare.",
        "a score",
    ),
    key_frames(
        "core/select_key_frames/short_sequence",
        "T = 11: ten differences are never more than 3 deviations high, and a cut is missed.",
        "mean and deviation",
    ),
    key_frames(
        "core/select_key_frames/deviation_of_the_population",
        "Two cuts in one window: dividing by n - 1 hides the lower one.",
        SAMPLE,
    ),
    key_frames(
        "uncommon/select_key_frames/tie_in_decimal_fractions_sums",
        "Two equal cuts among 20 values are exactly 3 deviations high, which rounded sums are not.",
        "sums of squares",
    ),
    key_frames(
        "uncommon/select_key_frames/tie_in_decimal_fractions_deviations",
        "Two equal cuts among 20 values are exactly 3 deviations high, which a rounded deviation is not.",
        "mean and deviation",
    ),
    key_frames(
        "stress/select_key_frames/cuts_at_both_ends",
        "Cuts at the ends have windows of half the length; zeros in place of what is missing are outliers themselves.",
        "windows filled with zeros",
    ),
    key_frames(
        "stress/select_key_frames/cut_on_a_floor_of_billions",
        "n Q - S^2 is rounding errors where differences are large and alike.",
        "sums of squares",
    ),
    key_frames(
        "stress/select_key_frames/losses_at_the_ends_of_binary64_huge",
        "Squares of losses of 1e300 are infinite, and no cut exceeds infinity.",
        "sums of squares",
    ),
    key_frames(
        "stress/select_key_frames/losses_at_the_ends_of_binary64_tiny",
        "Squares of subnormal losses are 0, and no cut exceeds nothing.",
        "sums of squares",
    ),
    HardCase(
        "stress/converged/changes_that_binary32_loses",
        "Changes of 1e-7 at a loss of 2.5 are less than half a unit in the last place of binary32.",
        "In binary64 a difference of losses below 4 is good to 9e-16; the tolerance is 1e-7.",
        oracle.converged,
        ("losses in binary32", naive.converged_in_binary32),
    ),
    HardCase(
        "stress/prune/extreme_weights",
        "Squares of weights vanish or overflow, and the order of removal is lost.",
        "None: magnitudes are compared as they are.",
        oracle.prune,
        ("squares", naive.prune_by_squares),
    ),
    HardCase(
        "stress/augment/new_splats_of_the_largest_frame",
        "65,535 is no binary16 number, and in mixed precision a position is infinite.",
        "One rounding of binary32: 0.004 pixels at the far edge of the largest frame.",
        oracle.augment,
        ("products in binary16", naive.augment_in_half),
    ),
)
