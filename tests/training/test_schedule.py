"""Learning-rate factors by iteration."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gsvc_base.errors import UsageError
from gsvc_ref.training import PAPER_SCHEDULE, Constant, Cosine, StepDecay


def test_the_paper_halves_every_20000_iterations() -> None:
    factors = {0: 1.0, 19_999: 1.0, 20_000: 0.5, 39_999: 0.5, 40_000: 0.25, 49_999: 0.25}
    assert {iteration: PAPER_SCHEDULE(iteration) for iteration in factors} == factors


def test_a_constant_stays() -> None:
    assert [Constant()(iteration) for iteration in (0, 1, 10**9)] == [1.0, 1.0, 1.0]


def test_a_cosine_falls_from_one_to_its_final_factor() -> None:
    schedule = Cosine(100, 0.02)
    assert schedule(0) == 1.0
    assert schedule(50) == pytest.approx(0.51)
    assert schedule(100) == pytest.approx(0.02)
    assert schedule(1000) == schedule(100)


@given(st.integers(1, 500), st.floats(0, 1), st.integers(0, 600))
def test_a_cosine_never_rises_nor_leaves_its_range(steps: int, final: float, iteration: int) -> None:
    schedule = Cosine(steps, final)
    assert final - 1e-12 <= schedule(iteration + 1) <= schedule(iteration) + 1e-12 <= 1 + 1e-12


@pytest.mark.parametrize(("factor", "interval"), [(0.0, 10), (1.5, 10), (0.5, 0)])
def test_step_decays_out_of_range_are_refused(factor: float, interval: int) -> None:
    with pytest.raises(UsageError, match="interval"):
        StepDecay(factor, interval)


@pytest.mark.parametrize(("steps", "final"), [(0, 0.02), (5, 2.0), (5, -0.1)])
def test_cosines_out_of_range_are_refused(steps: int, final: float) -> None:
    with pytest.raises(UsageError, match="final"):
        Cosine(steps, final)
