"""Every case, by its vector: gsvc_ref's own answer is judged as right, to the rule and bit of a refusal.

That the cases make these vectors is tested in test_vectors.py.
"""

from dataclasses import replace

import pytest

from gsvc_conformance.case import TIERS, cases
from gsvc_conformance.cases import FLAGS
from gsvc_conformance.expectations import Rate, Refusal
from gsvc_conformance.vector import VECTORS, read

CASES = [case for case in cases().values() if case.tier in TIERS]


def test_what_a_case_says_of_itself():
    for case in CASES:
        assert case.title.endswith("."), case.id
        assert set(case.flags) <= FLAGS.keys(), case.id


@pytest.mark.exhaustive
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.id)
def test_case(case):
    vector = read(VECTORS / case.id)
    inputs, expected = vector.inputs, vector.expected
    assert list(inputs) == [port.name for port in case.operation.inputs]
    assert list(expected) == [port.name for port in case.operation.outputs]
    outputs = case.operation.reference(**inputs)
    assert list(outputs) == list(expected)
    for name, expectation in expected.items():
        strict = replace(expectation, in_full=True) if isinstance(expectation, Refusal) else expectation
        strict = strict.beside(outputs) if isinstance(strict, Rate) else strict
        verdict = strict.judge(outputs[name])
        assert verdict.passed, f"{name} {verdict.message}"
