"""Hard cases of the sum of splats."""

from typing import Final

from tests.hard_cases.catalogue import Entry, HardCase
from tests.hard_cases.naive import rendering as naive
from tests.hard_cases.oracle.rendering import render_sum

INVERSE: Final = ("inverse covariance", naive.by_inverse_covariance)

CASES: Final[tuple[Entry, ...]] = (
    HardCase(
        "core/render_sum/a_determinant_that_cancels",
        danger="The determinant a c - b b of the covariance cancels to zero in binary32, and the splat vanishes.",
        condition="u2 = (d_y - l21 u1) / l22 has the condition (abs(d_y) + abs(l21 u1)) / abs(d_y - l21 u1); off the "
        "line the weight is zero and certain, on it the bound grows with l21 / l22 = 5000.",
        truth=render_sum,
        naive=INVERSE,
    ),
)
