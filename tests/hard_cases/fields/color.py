"""Hard cases of the last rounding and of colour conversion."""

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tests.hard_cases.catalogue import Entry, HardCase
from tests.hard_cases.measuring import Truth, exactly, mutated
from tests.hard_cases.naive import frames as naive
from tests.hard_cases.oracle.color import frame_to_planes, planes_to_frame
from tests.hard_cases.oracle.rendering import scaled, to_frame

AFFINE: Final = (
    "A result is an integer; where the exact value is within gamma_8 of the sum of magnitudes of a tie, both "
    "neighbours are legal."
)


def within_half_a_step(sum: NDArray[np.float32], bit_depth: int) -> Mapping[str, Truth]:
    """R-9.1-1 before its rounding: the product may be off by 2^-24 of itself, and its rounding by a half."""
    return {"frame": Truth(scaled(exactly(sum), bit_depth), 0.5 + 2.0 ** (bit_depth - 24))}


CASES: Final[tuple[Entry, ...]] = (
    HardCase(
        "stress/to_frame/hard_ties_8_bits",
        danger="Samples on a half, beside it, at the ends and far beyond them are rounded by one step too many.",
        condition="Only 1/2 is an exact tie; where the product with the peak is rounded onto a half, both "
        "neighbours are legal in bounded rendering.",
        truth=to_frame,
        naive=("floor(256 v)", mutated("to_frame", "frame-times-256")),
    ),
    HardCase(
        "stress/to_frame/hard_ties_16_bits",
        danger="At 16 bits binary32 has 8 bits left for the fraction of a sample, and rounds products onto halves.",
        condition="As at 8 bits; near the peak the product's last place is 1/256 of a step.",
        truth=to_frame,
        naive=("binary16", naive.in_binary16),
    ),
    *(
        HardCase(
            f"stress/to_frame_deterministic/hard_ties_{depth}_bits",
            danger="Deterministic rendering has one answer for each tie, also where the product is rounded onto one.",
            condition="The bits are fixed by (9-7), half a step and one rounding of the product from the exact value.",
            truth=within_half_a_step,
            naive=("floor(v peak + 1/2)", mutated("to_frame_deterministic", "strict-frame-half-up")),
        )
        for depth in (8, 16)
    ),
    HardCase(
        "stress/planes_to_frame/hard_corners",
        danger="Planes at the ends of their range stand for R'G'B' far outside of 0..255: results wrap around.",
        condition=AFFINE,
        truth=planes_to_frame,
        naive=("no clamp", mutated("planes_to_frame", "sample-not-clamped")),
    ),
    HardCase(
        "stress/planes_to_frame/hard_corners_of_16_bits",
        danger="Coefficients of 8 fractional bits, good enough for 8 bits, are 100 steps off at 16.",
        condition=AFFINE,
        truth=planes_to_frame,
        naive=("coefficients / 256", naive.planes_in_fixed_point),
    ),
    *(
        HardCase(
            f"stress/frame_to_planes/hard_cube_{name}",
            danger="Black, white and the corners of the cube of colours are a step off in fixed-point arithmetic.",
            condition=AFFINE,
            truth=frame_to_planes,
            naive=("coefficients / 256", naive.frame_in_fixed_point),
        )
        for name in ("limited", "full")
    ),
    HardCase(
        "stress/frame_to_planes/hard_pixels_on_black_and_white",
        danger="Hot and dark samples make means that end on exact halves, which are rounded the other way.",
        condition="The coefficients are quarters and sums of sixteenths, so all numbers are exact and each tie has one "
        "answer.",
        truth=frame_to_planes,
        naive=("ties away from zero", mutated("frame_to_planes", "sample-half-up")),
    ),
)
