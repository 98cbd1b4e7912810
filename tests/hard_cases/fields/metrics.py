"""Hard cases of metrics."""

from typing import Final

from tests.hard_cases.catalogue import Entry, HardCase
from tests.hard_cases.measuring import mutated
from tests.hard_cases.naive import frames as naive
from tests.hard_cases.oracle.metrics import metrics

EXACT: Final = "The squares are integers, and their sum is exact in 64 bits; condition 1."

CASES: Final[tuple[Entry, ...]] = (
    HardCase(
        "core/metrics/equal_frames",
        danger="The PSNR of equal frames is a division by zero: NaN, an error, or some large number.",
        condition="MSE is exactly 0 and PSNR +infinity by definition; reports and JSON say so in words or as null.",
        truth=metrics,
        naive=("MSE + 1e-10", naive.with_a_floor),
    ),
    HardCase(
        "core/metrics/one_sample_differs",
        danger="One step in one sample vanishes in the difference of large means.",
        condition=EXACT,
        truth=metrics,
        naive=("E[a²] - 2E[ab] + E[b²]", naive.by_moments),
    ),
    HardCase(
        "core/metrics/black_and_white",
        danger="255 squared wraps around in 8 bits, and the worst of all frames has a PSNR of 48 dB.",
        condition=EXACT + " At PSNR = 0 the two logarithms cancel: the bound is absolute, in dB.",
        truth=metrics,
        naive=("unsigned 8 bits", mutated("metrics", "mse-overflow")),
    ),
    HardCase(
        "stress/metrics/hard_hot_pixel",
        danger="The only sample that differs is 255 off, whose square is 1 modulo 256.",
        condition=EXACT,
        truth=metrics,
        naive=("unsigned 8 bits", mutated("metrics", "mse-overflow")),
    ),
    HardCase(
        "stress/metrics/extremes_of_16_bits",
        danger="The sum of squares of 65535 exceeds 32 bits with the second sample.",
        condition=EXACT,
        truth=metrics,
        naive=("unsigned 32 bits", naive.in_32_bits),
    ),
    HardCase(
        "stress/metrics/hard_flat_frames",
        danger="Flat frames have no variance: 0/0, or a variance that is a negative rounding error.",
        condition="C2 keeps the quotient away from 0/0, but a variance as a difference of moments is off by their last "
        "digits: condition (E[x²] + E[y²]) / C2 = 2200, and the limit is 1e-3. Exact variances give 1e-16.",
        truth=metrics,
        naive=("no C1, C2", naive.without_constants),
    ),
    HardCase(
        "core/metrics/inverted_structure",
        danger="A negative frame has a negative covariance, and a fractional power of the negative mean is NaN.",
        condition="The mean of a scale is clamped at 0 (11-7), and MS-SSIM is 0.",
        truth=metrics,
        naive=("power of a negative mean", naive.powers_of_negatives),
    ),
    HardCase(
        "stress/metrics/hard_structure_near_zero",
        danger="Means a hair below 0 are NaN after their power, and those a hair above lose their digits to it.",
        condition="MS-SSIM goes with mean^w, so that its derivative grows without end as the mean goes to 0: condition "
        "sum w / mean.",
        truth=metrics,
        naive=("power of a negative mean", naive.powers_of_negatives),
    ),
)
