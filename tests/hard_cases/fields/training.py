"""Hard cases of Adan and of learning rates."""

from typing import Final

from tests.hard_cases.catalogue import Entry, HardCase
from tests.hard_cases.measuring import mutated
from tests.hard_cases.naive.training import adan as naive
from tests.hard_cases.naive.training import rates_in_binary32
from tests.hard_cases.oracle.training import adan_step, learning_rates

CORRECTION: Final = (
    "1 - b^k is formed in binary64 and rounded once, so that it has one rounding for any k; from a binary32 b it has "
    "the condition k b^k / (1 - b^k)."
)
EPSILON: Final = (
    "Where sqrt(n) is far below epsilon, n may lose all its digits, or be flushed to zero: the step is m / epsilon to "
    "sqrt(n) / epsilon of its size."
)

OF_MUTANTS: Final = {
    "no rule for the first difference": mutated("adan_step", "adan-first-difference"),
    "powers in binary32": mutated("adan_step", "adan-powers-in-binary32"),
    "complements in binary32": mutated("adan_step", "adan-complement-in-binary32"),
    "no epsilon": mutated("adan_step", "adan-epsilon-missing"),
    "epsilon in the root": mutated("adan_step", "adan-epsilon-inside-root"),
}
"""Naive formulas that are mutants of the kit."""


def one(vector: str, danger: str, condition: str, form: str) -> HardCase:
    """A step whose naive formula differs in one thing."""
    return HardCase(vector, danger, condition, adan_step, (form, OF_MUTANTS.get(form) or naive(form)))


CASES: Final[tuple[Entry, ...]] = (
    one(
        "core/adan_step/first_step",
        "The first difference of gradients is taken against a gradient of 0 that never was.",
        "None: d is 0 by definition, and m / (1 - b1) over the root is the sign of the gradient.",
        "no rule for the first difference",
    ),
    one(
        "core/adan_step/corrections_of_slow_averages",
        "1 - b^k cancels in the first steps, where b^k is near 1.",
        CORRECTION,
        "powers in binary32",
    ),
    one(
        "stress/adan_step/late_steps",
        "A decay rate near 1 loses its distance from 1 when it is rounded, and its powers multiply that by k.",
        CORRECTION,
        "powers of rounded decay rates",
    ),
    one(
        "stress/adan_step/gradient_like_the_one_before",
        "The average of differences, a trillionth of the gradients, is formed of the gradients themselves.",
        "g - p is exact for neighbours; the average of d has 3 roundings of its own size.",
        "gradients averaged one by one",
    ),
    one(
        "stress/adan_step/opposite_momentum",
        "b1 m + (1 - b1) g cancels, and 1 - b1 is off by what b1 has been rounded.",
        "The condition of the sum is (abs(b1 m) + abs((1 - b1) g)) / abs(m'), here 4e4 and more: the bound is that of "
        "the parts.",
        "complements in binary32",
    ),
    one(
        "stress/adan_step/second_moment_near_zero",
        "m / sqrt(n) of a splat that no longer has a gradient is anything / 0.",
        EPSILON,
        "no epsilon",
    ),
    one(
        "core/adan_step/tiny_gradients",
        "Epsilon in the root is worth 1e-4 where gradients are of the size 1e-8.",
        EPSILON,
        "epsilon in the root",
    ),
    one(
        "stress/adan_step/huge_gradients",
        "Differences of gradients of 1e17 decide over a step whose sum cancels.",
        "All of a step but its length scales with the gradients: 1e17 is as good as 1.",
        "complements in binary32",
    ),
    one(
        "stress/adan_step/gradients_at_the_limit",
        "Squares of gradients of 2^62 are next to the end of binary32.",
        "Finite for gradients up to 2^62; past it n becomes infinite, and gsvc_ref refuses to go on.",
        "plain sums",
    ),
    one(
        "core/adan_step/rates_of_their_own",
        "A learning rate of 0 is divided by.",
        "None: a product with 0.",
        "parameters in units of their rate",
    ),
    HardCase(
        "stress/learning_rates/iterations_beyond_binary32",
        danger="Iterations past 2^24 are no binary32 numbers, and a quotient rounds up to the next interval.",
        condition="The exponent is a whole number; factor^n has 2 n roundings where it is formed by products.",
        truth=learning_rates,
        naive=("i / interval in binary32", rates_in_binary32),
    ),
)
