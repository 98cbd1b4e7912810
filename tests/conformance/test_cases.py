"""Every case: what it asserts holds, and gsvc_ref's own answer is judged as right, to the rule and bit of a refusal."""

from dataclasses import replace

import pytest

from gsvc_conformance.case import TIERS, cases
from gsvc_conformance.cases import FLAGS
from gsvc_conformance.expectations import Rate, Refusal

CASES = [case for case in cases().values() if case.tier in TIERS]


@pytest.mark.exhaustive
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.id)
def test_case(case):
    inputs, expected = case.run()
    assert list(inputs) == [port.name for port in case.operation.inputs]
    assert list(expected) == [port.name for port in case.operation.outputs]
    assert case.title.endswith(".")
    assert set(case.flags) <= FLAGS.keys()
    outputs = case.operation.reference(**inputs)
    assert list(outputs) == list(expected)
    for name, expectation in expected.items():
        strict = replace(expectation, in_full=True) if isinstance(expectation, Refusal) else expectation
        strict = strict.beside(outputs) if isinstance(strict, Rate) else strict
        verdict = strict.judge(outputs[name])
        assert verdict.passed, f"{name} {verdict.message}"
