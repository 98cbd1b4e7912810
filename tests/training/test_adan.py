"""Adan: against the published update in binary64, by hand, against its plain definition, and the care of its state."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from gsvc_base.errors import UsageError
from gsvc_ref import adan_step
from gsvc_ref.training import Adan, AdanSettings, adan
from gsvc_ref.training.adan import adan_step_plain
from gsvc_ref.training.pruning import compact


@dataclass
class Published:
    """The update as published, one array of one age, in binary64 and in the publication's order."""

    beta1: float = 0.98
    beta2: float = 0.92
    beta3: float = 0.99
    epsilon: float = 1e-8
    k: int = 0
    state: dict[str, np.ndarray] = field(default_factory=dict)

    def step(self, theta: np.ndarray, g: np.ndarray, rate: float) -> np.ndarray:
        b1, b2, b3 = self.beta1, self.beta2, self.beta3
        self.k += 1
        s = self.state
        if self.k == 1:
            s |= {"m": 0 * g, "v": 0 * g, "n": 0 * g, "g": g}
        d = g - s["g"]
        s["m"] = b1 * s["m"] + (1 - b1) * g
        s["v"] = b2 * s["v"] + (1 - b2) * d
        s["n"] = b3 * s["n"] + (1 - b3) * (g + b2 * d) ** 2
        s["g"] = g
        denominator = np.sqrt(s["n"]) / np.sqrt(1 - b3**self.k) + self.epsilon
        theta = theta - rate / (1 - b1**self.k) * s["m"] / denominator
        return theta - rate * b2 / (1 - b2**self.k) * s["v"] / denominator


def recorded_gradients(steps: int, shape: tuple[int, int], seed: int = 0) -> np.ndarray:
    """Gradients as a training run has them: noisy, decaying, of very different sizes by column."""
    rng = np.random.default_rng(seed)
    drift = rng.normal(size=shape) * np.exp(-np.arange(steps) / 20)[:, None, None]
    noise = 0.3 * rng.normal(size=(steps, *shape))
    return ((drift + noise) * 10.0 ** np.linspace(-5, 2, shape[1])).astype(np.float32)


@pytest.mark.parametrize("settings", [AdanSettings(), AdanSettings(0.9, 0.92, 0.99), AdanSettings(0.0, 0.0, 0.0, 1e-3)])
def test_every_step_is_the_published_one(settings: AdanSettings) -> None:
    gradients = recorded_gradients(140, (37, 9))  # past the ends of the first tables of corrections
    parameters = np.zeros((37, 9), np.float32)
    state = Adan(37, 9, settings)
    published = Published(settings.beta1, settings.beta2, settings.beta3, settings.epsilon)
    moved = np.zeros((37, 9))
    for g in gradients:
        before = parameters.copy()
        state.step(parameters, g, np.full(9, 1e-3))
        expected = published.step(np.zeros((37, 9)), g.astype(np.float64), 1e-3)
        # binary32 averages of up to 140 terms; the step itself is at most a few rates long.
        assert np.abs((parameters.astype(np.float64) - before) - expected).max() <= 2e-3 * 1e-3
        moved += expected
    assert np.abs(parameters - moved).max() <= 1e-3 * np.abs(moved).max()


def test_the_first_step_by_hand() -> None:
    parameters = np.array([[1.0, 1.0, 1.0]], np.float32)
    Adan(1, 3).step(parameters, np.array([[4.0, -0.5, 0.0]], np.float32), [0.25, 0.5, 1.0])
    # k = 1: d = 0, so m / (1 - b1) = g and sqrt(n) / sqrt(1 - b3) = |g|: a step of the rate against the sign.
    assert parameters == pytest.approx(np.array([[0.75, 1.5, 1.0]]), abs=1e-6)
    assert parameters[0, 2] == 1.0


def test_the_second_step_by_hand() -> None:
    settings = AdanSettings(0.5, 0.5, 0.75, 1e-8)
    state, parameters = Adan(1, 1, settings), np.zeros((1, 1), np.float32)
    state.step(parameters, np.array([[2.0]], np.float32), [1.0])
    assert parameters[0, 0] == pytest.approx(-1.0)
    state.step(parameters, np.array([[6.0]], np.float32), [1.0])
    # d = 4; m = .5*1 + .5*6 = 3.5; v = .5*4 = 2; n = .75*1 + .25*(6 + .5*4)^2 = 16.75
    denominator = np.sqrt(16.75) / np.sqrt(1 - 0.75**2)
    expected = -1.0 - (3.5 / 0.75) / denominator - 0.5 * (2 / 0.75) / denominator
    assert parameters[0, 0] == pytest.approx(expected, rel=1e-6)
    assert (state.m[0, 0], state.v[0, 0], state.n[0, 0], state.previous[0, 0]) == (3.5, 2.0, 16.75, 6.0)


def test_a_repeated_gradient_has_no_difference_term() -> None:
    g = np.array([[3.0, -2.0]], np.float32)
    state, parameters = Adan(1, 2), np.zeros((1, 2), np.float32)
    for _ in range(10):
        state.step(parameters, g, [0.5, 0.5])
    assert state.v.tolist() == [[0.0, 0.0]]
    assert parameters == pytest.approx(np.array([[-5.0, 5.0]]), rel=1e-5)


def test_zero_gradients_and_zero_rates_move_nothing() -> None:
    state, parameters = Adan(5, 9), recorded_gradients(1, (5, 9))[0]
    before = parameters.copy()
    for _ in range(3):
        state.step(parameters, np.zeros((5, 9), np.float32), np.ones(9))
    assert parameters.tobytes() == before.tobytes()
    for g in recorded_gradients(3, (5, 9)):
        state.step(parameters, g, np.zeros(9))
    assert parameters.tobytes() == before.tobytes()
    assert state.steps.tolist() == [6] * 5
    assert np.abs(state.m).max() > 0


sizes = st.tuples(st.integers(0, 40), st.integers(1, 9))


@given(sizes, st.integers(0, 2**32 - 1), st.booleans())
def test_the_compiled_step_is_the_plain_one_bit_for_bit(shape: tuple[int, int], seed: int, by_row: bool) -> None:
    rng = np.random.default_rng(seed)
    rows, columns = shape
    state, parameters = Adan(rows, columns), rng.normal(size=shape).astype(np.float32)
    units = rng.choice([0.5, 1.0, 3.0], columns).astype(np.float32)
    rates = rng.random(columns).astype(np.float32)
    factors = rng.random(rows).astype(np.float32)
    row_columns = rng.random(columns) < 0.5
    plain = [parameters.copy(), *(np.zeros(shape, np.float32) for _ in range(3)), np.zeros(shape, np.float32)]
    rate = (rates * units) * np.where(row_columns & by_row, factors[:, None], np.float32(1))
    for k, gradient in enumerate(recorded_gradients(4, shape, seed)):
        state.step(
            parameters, gradient, rates, units=units, row_factors=factors if by_row else None, row_columns=row_columns
        )
        g = gradient * units
        previous = g if k == 0 else plain[4]
        x, m, v, n = adan_step_plain(
            *plain[:1], g, *plain[1:4], previous, rate,
            adan._coefficients(state.settings), adan._corrections(state.settings, k + 1)[k + 1],
        )  # fmt: skip
        plain = [x, m, v, n, g]
        ours = [parameters, state.m, state.v, state.n, state.previous]
        assert [a.tobytes() for a in ours] == [b.tobytes() for b in plain]


def test_units_only_rename_the_learned_value() -> None:
    """Learning theta = x / unit by hand gives the same x: powers of two, so that nothing is rounded differently."""
    units = np.array([256.0, 0.125], np.float32)
    rates = np.array([0.25, 0.5], np.float32)
    pixels, learned = np.ones((3, 2), np.float32), np.ones((3, 2), np.float32) / units
    in_pixels, in_units = Adan(3, 2), Adan(3, 2)
    for gradient in recorded_gradients(8, (3, 2)):
        in_pixels.step(pixels, gradient, rates, units=units)
        in_units.step(learned, gradient * units, rates)
    assert pixels.tobytes() == (learned * units).tobytes()


def test_row_factors_reach_their_columns_only() -> None:
    g = np.ones((2, 3), np.float32)
    parameters = np.zeros((2, 3), np.float32)
    Adan(2, 3).step(parameters, g, [1, 1, 1], row_factors=np.float32([2, 4]), row_columns=[True, False, True])
    assert parameters == pytest.approx(np.array([[-2, -1, -2], [-4, -1, -4]]), rel=1e-6)


@given(st.lists(st.sampled_from(["step", "append", "take"]), max_size=12), st.integers(0, 2**32 - 1))
def test_every_row_lives_as_if_it_were_alone(actions: list[str], seed: int) -> None:
    rng = np.random.default_rng(seed)
    state, parameters = Adan(4, 2), np.zeros((4, 2), np.float32)
    alone = [(Adan(1, 2), np.zeros((1, 2), np.float32)) for _ in range(4)]
    for action in actions:
        if action == "append":
            state, parameters = state.append(3), np.concatenate([parameters, np.zeros((3, 2), np.float32)])
            alone += [(Adan(1, 2), np.zeros((1, 2), np.float32)) for _ in range(3)]
        elif action == "take":
            kept = np.flatnonzero(rng.random(len(alone)) < 0.7)
            parameters, *left = compact(kept, parameters, *state.state)
            state = state.with_state(*left)
            alone = [alone[i] for i in kept]
        else:
            gradients = rng.normal(size=parameters.shape).astype(np.float32)
            state.step(parameters, gradients, [0.1, 0.2])
            for row, (own, value) in enumerate(alone):
                own.step(value, gradients[row : row + 1], [0.1, 0.2])
    assert len(state.steps) == len(alone)
    for row, (own, value) in enumerate(alone):
        assert state.steps[row] == own.steps[0]
        assert parameters[row].tobytes() == value.tobytes()
        assert state.n[row].tobytes() == own.n.tobytes()


def test_survivors_keep_their_state_and_settings() -> None:
    state, parameters = Adan(3, 2), np.zeros((3, 2), np.float32)
    state.step(parameters, np.arange(6, dtype=np.float32).reshape(3, 2), [1, 1])
    left = compact(np.array([0, 2]), parameters, *state.state)
    assert left.previous.tolist() == [[0, 1], [4, 5]]
    assert left.values.tolist() == parameters[[0, 2]].tolist()
    other = state.with_state(*left[1:])
    assert (other.settings, other.steps.tolist()) == (state.settings, [1, 1])


@given(hnp.arrays(np.float32, (3, 2), elements=st.floats(-(2.0**50), 2.0**50, width=32)))
def test_a_step_is_never_longer_than_its_bound(gradient: np.ndarray) -> None:
    state, parameters = Adan(3, 2), np.zeros((3, 2), np.float32)
    state.step(parameters, gradient, [1, 1])
    assert (np.abs(parameters) <= 1 + 1e-6).all()
    assert (np.sign(parameters) * np.sign(gradient) <= 0).all()


@pytest.mark.parametrize(
    ("parameters", "gradients", "message"),
    [
        (np.zeros((2, 3)), np.zeros((2, 3), np.float32), "float32"),
        (np.zeros((3, 2), np.float32).T, np.zeros((2, 3), np.float32), "C order"),
        (np.zeros((1, 3), np.float32), np.zeros((1, 3), np.float32), r"state is for \(2, 3\)"),
        (np.zeros((2, 3), np.float32), np.zeros((3, 3), np.float32), r"state is for \(2, 3\)"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(parameters: np.ndarray, gradients: np.ndarray, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        Adan(2, 3).step(parameters, gradients, np.ones(3))


def test_factors_that_do_not_fit_are_refused() -> None:
    with pytest.raises(UsageError, match="row_factors"):
        Adan(2, 1).step(np.zeros((2, 1), np.float32), np.zeros((2, 1)), [1.0], row_factors=np.ones(3))


@pytest.mark.parametrize("wrong", [(1.0, 0.9, 0.9), (0.9, -0.1, 0.9), (0.9, 0.9, float("nan")), (0.9, 0.9, 0.9, 0.0)])
def test_settings_out_of_range_are_refused(wrong: tuple[float, ...]) -> None:
    with pytest.raises(UsageError, match=r"out of range|AdanSettings\.beta3 is nan"):
        AdanSettings(*wrong)


@pytest.mark.parametrize(("rows", "columns"), [(-1, 3), (2, 0)])
def test_sizes_out_of_range_are_refused(rows: int, columns: int) -> None:
    with pytest.raises(UsageError, match="at least 0 rows"):
        Adan(rows, columns)


@pytest.mark.parametrize(
    "wrong",
    [{"parameters": np.zeros(3)}, {"m": 0}, {"v": None}, {"n": np.zeros((2, 8))}, {"previous": 0}, {"steps": [0]}],
)
def test_the_operation_refuses_a_state_of_another_shape(wrong):
    """The kernel would write beyond the ends of arrays that are too small."""
    rows = np.zeros((3, 8))
    state = {"parameters": rows, "gradients": rows, "m": rows, "v": rows, "n": rows, "previous": rows, "steps": [0] * 3}
    with pytest.raises(UsageError, match=f"{next(iter(wrong))} has shape"):
        adan_step(**{**state, **wrong}, rates=1, units=1, beta1=0.98, beta2=0.92, beta3=0.99, epsilon=1e-8)
