"""Weights in training: what is rendered, gradients through it, and the kernels against their definitions."""

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from gsvc_ref import spec
from gsvc_ref.training.weighting import weighted_gradients, weighted_parameters

FINITE = st.floats(-(2.0**40), 2.0**40, width=32)


def rows(columns: int) -> st.SearchStrategy[np.ndarray]:
    return st.integers(0, 20).flatmap(lambda n: hnp.arrays(np.float32, (n, columns), elements=FINITE))


def test_colours_are_multiplied_by_their_weight() -> None:
    values = np.array([[1, 2, 3, 4, 5, 1, 2, 3, 2], [6, 7, 8, 9, 10, 0.5, -1, 0, -0.5]], np.float32)
    assert weighted_parameters(values).tolist() == [[1, 2, 3, 4, 5, 2, 4, 6], [6, 7, 8, 9, 10, -0.25, 0.5, 0]]


def test_the_gradient_is_that_of_differences() -> None:
    rng = np.random.default_rng(0)
    values, pull = rng.normal(size=(5, 9)).astype(np.float32), rng.normal(size=(5, 8)).astype(np.float32)
    gradient = weighted_gradients(values, pull)
    for n, k in np.ndindex(values.shape):
        ends = []
        for side in (-1, 1):
            moved = values.astype(np.float64)
            moved[n, k] += side * 0.1
            ends.append((spec.weighted_parameters(moved)["parameters"] * pull).sum())  # so differences are exact
        assert abs(gradient[n, k] - (ends[1] - ends[0]) / 2e-1) < 1e-5
