"""Every hard case: the project's implementations are within the bounds, and a naive formula is not."""

from functools import cache

import pytest

from gsvc_conformance.cases import FLAGS
from gsvc_conformance.expectations import Bounded
from tests.hard_cases.catalogue import HardCase, catalogue
from tests.hard_cases.measuring import FAR, Measurement

LONG = ("100000_steps", "ten_thousand_frames", "2048_splats")
every_case = pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.exhaustive) if any(part in name for part in LONG) else name
        for name in catalogue()
    ],
)
every_vector = pytest.mark.parametrize(
    "name", [name for name, entry in catalogue().items() if isinstance(entry, HardCase)]
)


@cache
def measured(name: str) -> Measurement:
    return catalogue()[name].measure()


@every_case
def test_implementations_are_within_the_bounds(name):
    assert measured(name).ours
    for implementation, worst in measured(name).ours.items():
        assert worst.ratio <= 1, f"{implementation}: {worst}"


@every_case
def test_the_naive_formula_is_not(name):
    assert measured(name).naive.ratio > 1


@every_vector
def test_the_oracle_of_the_kit_uses_next_to_nothing_of_the_bounds(name):
    kit = measured(name).kit
    if kit is not None:
        assert kit.ratio <= FAR
    else:  # there are only bits, which are fixed
        _, expected = catalogue()[name].case().run()
        assert not any(isinstance(expectation, Bounded) for expectation in expected.values())


@every_case
def test_it_says_what_could_go_wrong_and_how_accurate_it_can_be(name):
    entry = catalogue()[name]
    for sentence in (entry.danger, entry.condition):
        assert sentence.endswith(".")
    assert not entry.naive_name.endswith(".")
    if isinstance(entry, HardCase):
        assert set(entry.case().flags) <= FLAGS.keys()
