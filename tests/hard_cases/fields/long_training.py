"""Hard because they last: a hundred thousand steps of Adan from 0, where gsvc_ref's optimiser gets."""

from collections.abc import Callable
from typing import Final

from mpmath import mpf, workdps

from tests.hard_cases.catalogue import Entry, LongRun
from tests.hard_cases.long_training import RATE, SETTINGS, gradients, run
from tests.hard_cases.measuring import DIGITS, Measurement, Worst
from tests.hard_cases.naive import trajectory as naive
from tests.hard_cases.oracle import trajectory as oracle

CONDITION: Final = (
    "Each step rounds the parameter once, half a unit of its last place: a rate far below that moves nothing any more. "
    "The bound is the sum of the errors of all steps."
)


def steps(kind: str, danger: str, naive_name: str, formula: Callable[..., float]) -> LongRun:
    """The steps of one kind of gradients."""

    def measure() -> Measurement:
        given = gradients()[kind], RATE, SETTINGS
        place = oracle.parameter(*given)
        *_, last = oracle.errors(*given)

        def error(value: float) -> float:
            with workdps(DIGITS):
                return float(abs(mpf(value) - mpf(str(place)))) if value == value else float("inf")

        found = float(run().path[-1, list(gradients()).index(kind)])
        return Measurement({"gsvc_ref": Worst(error(found), last.error)}, Worst(error(formula(*given)), last.error))

    return LongRun(f"{kind}_gradients_for_100000_steps", "adan_step", danger, CONDITION, naive_name, measure)


CASES: Final[tuple[Entry, ...]] = (
    steps(
        "constant",
        "A parameter that moves by the rate again and again stops where half a unit in the last place is more.",
        "parameters in binary16",
        naive.parameters_in_half,
    ),
    steps(
        "zero", "Averages of nothing over the root of nothing are NaN from the first step on.", "no epsilon",
        naive.without_epsilon,
    ),
    steps(
        "alternating",
        "A wrong first difference lives on in the averages, and the parameter never comes back from it.",
        "no rule for the first difference",
        naive.difference_to_nothing,
    ),
    steps(
        "exploding",
        "Gradients grow from 2^-66 to 2^62: squares begin below the subnormal numbers and end below the largest.",
        "plain sums",
        naive.plain_sums,
    ),
)  # fmt: skip
