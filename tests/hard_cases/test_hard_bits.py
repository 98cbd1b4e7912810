"""Deterministic rendering of the inputs of all hard sums: the bits of spec.md's code."""

import numpy as np
import pytest

from gsvc_conformance.case import cases
from gsvc_conformance.spec import namespace
from gsvc_ref.rendering import render_sum_deterministic
from tests.hard_cases.catalogue import HardCase, catalogue

SUMS = [
    entry.vector for entry in catalogue().values() if isinstance(entry, HardCase) and entry.operation == "render_sum"
]


@pytest.mark.parametrize("vector", SUMS)
def test_deterministic_sums_have_the_bits_of_the_text(vector):
    inputs, _ = cases()[vector].run()
    with np.errstate(all="ignore"):
        expected = namespace()["render_sum_deterministic"](**inputs)["sum"]
    assert render_sum_deterministic(**inputs).tobytes() == expected.tobytes()
