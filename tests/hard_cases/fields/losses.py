"""Hard cases of the loss and of weights."""

from typing import Final

from tests.hard_cases.catalogue import Entry, HardCase
from tests.hard_cases.measuring import mutated
from tests.hard_cases.naive import losses as naive
from tests.hard_cases.oracle.losses import loss, weighted_gradients, weighted_parameters

MOMENTS: Final = ("sum of x² - 2xy + y²", naive.by_moments)

CASES: Final[tuple[Entry, ...]] = (
    HardCase(
        "stress/loss/hard_loss_near_zero",
        danger="The loss is the difference of sums that are 10^14 times as large, and comes out as 0 or negative.",
        condition="Differences of binary32 numbers this close are exact, so the loss has as many digits as any other.",
        truth=loss,
        naive=MOMENTS,
    ),
    HardCase(
        "stress/loss/hard_loss_of_white_with_a_dim_pixel",
        danger="In an all-white frame the one sample that differs is lost among the squares of all others.",
        condition="Condition 1: one difference, its square and a division.",
        truth=loss,
        naive=MOMENTS,
    ),
    HardCase(
        "stress/loss/hard_loss_of_black_with_a_hot_pixel",
        danger="In an all-black frame whose sums are a hair below 0 no sample has a gradient, and the hot one never "
        "appears.",
        condition="Condition 1; the residual goes straight through the clamp, and is exactly 0 where black is right.",
        truth=loss,
        naive=("derivative of the clamp", mutated("loss", "residual-stopped-by-clamp")),
    ),
    HardCase(
        "stress/loss/loss_of_huge_sums",
        danger="The square of a sum of 1e30 is infinite before it is clamped.",
        condition="Condition 1 after the clamp: a sum is clamped before anything is done with it.",
        truth=loss,
        naive=("clamp after the difference", naive.clamped_after_the_square),
    ),
    HardCase(
        "stress/weighted_gradients/hard_weights",
        danger="Products of 10000 with gradients cancel to a thousandth, and weights reach from 1e-40 to 1e30.",
        condition="dL/dw has the condition sum abs(G c) / abs(sum G c), here 10^7 to 10^8; its bound is 2^-22 of "
        "the sum of magnitudes.",
        truth=weighted_gradients,
        naive=("binary16", naive.in_binary16),
    ),
    HardCase(
        "stress/weighted_parameters/hard_products",
        danger="Subnormal products are flushed, or ties among them are rounded up.",
        condition="One product, correctly rounded: the bits are fixed.",
        truth=weighted_parameters,
        naive=("flush to zero", naive.flushed),
    ),
)
