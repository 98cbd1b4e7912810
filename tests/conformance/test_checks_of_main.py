"""A reader of profile `main` that lacks a check loses a claim of `main` alone, whichever check it is.

The reader is spec.md's code, and its checks are all places where that refuses a stream, calls what does, or has a
number to compare with; so a check that the document gains is demanded here of the vectors without a word.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache
from typing import Any, Final

import pytest
from forgetful import OPERATIONS, Check, Reader, calls_of_checks, refusals
from test_one_fault import HUGE

from gsvc_conformance.case import Case, cases
from gsvc_conformance.coverage import UNCOVERED
from gsvc_conformance.expectations import Expectation, Refusal
from gsvc_conformance.mutants import judge
from gsvc_conformance.profiles import ANY, profile_of

CLAIMED: Final = ("main", ANY)
"""The profiles of the vectors that a claim of `main` asks."""

Vector = tuple[Case, Any, Mapping[str, Expectation]]


@cache
def faulty() -> dict[str, list[Case]]:
    """The faulty cases by the rule that they break, those of the class `bitstream` first, then the simplest."""
    found: dict[str, list[Case]] = {}
    for operation in sorted(OPERATIONS, key=OPERATIONS.index):
        for case in cases().values():
            slug = case.id.rpartition("/")[2]
            if case.tier == "faulty" and case.operation.name == operation and slug not in HUGE:
                found.setdefault(case.rules[0], []).append(case)
    return found


@cache
def vector(name: str) -> Vector | None:
    """A case with inputs and expectations, of which the kind of a refusal counts; None where no claim of `main` asks it."""
    case = cases()[name]
    inputs = next(case.function(**case.arguments))
    if profile_of(case.operation, inputs) not in CLAIMED:
        return None
    by_kind = {
        key: replace(value, in_full=False) if isinstance(value, Refusal) else value
        for key, value in case.operation.oracle(**inputs).items()
    }
    return case, inputs, by_kind


def asked(rules: tuple[str, ...]) -> Iterator[Vector]:
    """The vectors of a claim of `main` that break one of some rules."""
    for rule in rules:
        yield from filter(None, (vector(case.id) for case in faulty().get(rule, ())))


def is_right(reader: Reader, asked: Vector) -> bool:
    """Whether a reader answers a vector as it must."""
    case, inputs, expected = asked
    outputs = reader.answer(case.operation.name, inputs)
    return outputs is not None and all(verdict.passed for verdict in judge(expected, outputs))


def loses(reader: Reader, rules: tuple[str, ...]) -> str:
    """A vector of a claim that a reader gives a wrong answer to; empty if there is none."""
    return next((case.id for case, *rest in asked(rules) if not is_right(reader, (case, *rest))), "")


REFUSALS: Final = [(check, rule) for check in refusals() for rule in check.rules if rule not in UNCOVERED]


@pytest.fixture(scope="module")
def reader() -> Reader:
    return Reader()


def test_the_whole_reader_is_right(reader: Reader) -> None:
    reader.forget(())
    for rule in faulty():
        for one in list(asked((rule,)))[:2]:
            assert is_right(reader, one), one[0].id


@pytest.mark.parametrize(("check", "rule"), REFUSALS, ids=map(str, range(len(REFUSALS))))
def test_a_refusal(reader: Reader, check: Check, rule: str) -> None:
    reader.forget([(check.line, rule)])
    assert loses(reader, (rule,))


@pytest.mark.parametrize("check", calls_of_checks(), ids=str)
def test_a_call_of_checks(reader: Reader, check: Check) -> None:
    reader.forget((), [check.line])
    assert loses(reader, check.rules)
