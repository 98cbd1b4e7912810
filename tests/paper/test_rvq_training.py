"""Learning RVQ codebooks: k-means starts, moving averages, dead and fixed codewords, weights."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from gsvc_base.errors import UsageError
from gsvc_ref.paper import from_half, rvq, rvq_assign, to_half
from gsvc_ref.paper.codebook_update import REVIVED_COUNT, rvq_update
from gsvc_ref.paper.rvq import flat
from gsvc_ref.paper.rvq_training import RvqSettings, RvqState, initialize, update

vectors = hnp.arrays(
    np.float32,
    st.tuples(st.integers(0, 30), st.just(3)),
    elements=st.one_of(st.floats(-4, 4, width=32), st.sampled_from([0.0, 1.0])),
)


def colors(count: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return (rng.normal(size=(count, 3)) @ np.diag([1, 0.3, 0.1]) + rng.integers(0, 3, (count, 1))).astype(np.float32)


def error(x: np.ndarray, state: RvqState, weights: np.ndarray | None = None) -> float:
    left_over = rvq.residuals(x, rvq_assign(x, *flat(state.codebooks)), *flat(state.codebooks))[-1]
    return float(np.average(np.square(left_over, dtype=np.float64).sum(axis=1), weights=weights))


def trained(x: np.ndarray, state: RvqState, settings: RvqSettings, steps: int) -> RvqState:
    rng = np.random.default_rng(9)
    for _ in range(steps):
        state = update(state, x, rvq_assign(x, *flat(state.codebooks)), settings, rng)
    return state


@given(vectors, st.lists(st.integers(1, 12), min_size=1, max_size=3), st.booleans())
def test_any_vectors_give_finite_codebooks_of_binary16(x: np.ndarray, codewords: list[int], zero: bool) -> None:
    settings = RvqSettings(codewords=tuple(codewords), zero_codeword=zero)
    state = initialize(x, settings, np.random.default_rng(0))
    state = trained(x, state, settings, 3)
    assert [book.shape for book in state.codebooks] == [(count, 3) for count in codewords]
    for book in state.codebooks:
        assert book.tobytes() == from_half(to_half(book)).tobytes()
        if zero:
            assert book[0].tolist() == [0, 0, 0]


def test_few_distinct_vectors_are_met_exactly() -> None:
    distinct = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3], [5, 5, 5]], np.float32)
    x = distinct[np.random.default_rng(1).integers(0, 5, 60)]
    state = initialize(x, RvqSettings(codewords=(8,)), np.random.default_rng(2))
    assert error(x, state) == 0
    assert {tuple(word) for word in state.codebooks[0]} == {tuple(word) for word in distinct}


def test_fewer_vectors_than_codewords_are_met_exactly() -> None:
    x = np.array([[0.5, 0.25, 0], [1, 1, 1]], np.float32)
    assert error(x, initialize(x, RvqSettings(codewords=(16, 16)), np.random.default_rng(0))) == 0


def test_no_vectors_give_zero_codebooks_that_updates_leave_alone() -> None:
    none = np.empty((0, 3), np.float32)
    settings = RvqSettings()
    state = initialize(none, settings, np.random.default_rng(0))
    assert [book.tolist() for book in state.codebooks] == [[[0, 0, 0]] * 8] * 2
    assert update(state, none, np.empty((0, 2), np.uint16), settings, np.random.default_rng(0)) is state


def test_the_same_generator_gives_the_same_codebooks() -> None:
    x, settings = colors(200), RvqSettings()
    first, again = (initialize(x, settings, np.random.default_rng(4)) for _ in range(2))
    other = initialize(x, settings, np.random.default_rng(5))
    assert [b.tobytes() for b in first.codebooks] == [b.tobytes() for b in again.codebooks]
    assert [b.tobytes() for b in first.codebooks] != [b.tobytes() for b in other.codebooks]


def test_more_stages_more_codewords_and_more_iterations_lower_the_error() -> None:
    x = colors(800)

    def start(codewords: tuple[int, ...], iterations: int) -> float:
        settings = RvqSettings(codewords=codewords, kmeans_iterations=iterations)
        return error(x, initialize(x, settings, np.random.default_rng(0)))

    assert start((8,), 5) < start((8,), 0)
    assert start((8, 8), 5) < 0.6 * start((8,), 5)
    assert start((32,), 5) < 0.6 * start((8,), 5)


def test_one_update_by_hand() -> None:
    settings = RvqSettings(codewords=(2,), decay=0.75, smoothing=0.5, dead_count=0)
    state = RvqState(
        (np.array([[1, 0, 0], [-1, 0, 0]], np.float32),),
        (np.array([4.0, 2.0]),),
        (np.array([[4.0, 0, 0], [-2, 0, 0]]),),
    )
    x = np.array([[2, 1, 0], [1, 0, 0], [-3, 0, 0], [3, 3, 0]], np.float32)
    indices = rvq_assign(x, *flat(state.codebooks))
    assert indices.ravel().tolist() == [0, 0, 1, 0]
    new = update(state, x, indices, settings, np.random.default_rng(0))
    assert new.counts[0].tolist() == [0.75 * 4 + 0.25 * 3, 0.75 * 2 + 0.25 * 1]
    assert new.sums[0].tolist() == [[0.75 * 4 + 0.25 * 6, 0.25 * 4, 0], [-0.75 * 2 - 0.25 * 3, 0, 0]]
    total, smoothing = 3.75 + 1.75, 0.5
    smoothed = [(n + smoothing) / (total + 2 * smoothing) * total for n in (3.75, 1.75)]
    expected = [[4.5 / smoothed[0], 1 / smoothed[0], 0], [-2.25 / smoothed[1], 0, 0]]
    assert new.codebooks[0] == pytest.approx(np.array(expected), rel=2.0**-11)
    assert state.counts[0].tolist() == [4, 2]  # the old state is not touched


def test_updates_follow_vectors_that_move() -> None:
    x, settings = colors(300), RvqSettings(codewords=(8, 8))
    state = initialize(x, settings, np.random.default_rng(0))
    moved = (x * 0.5 + 2).astype(np.float32)
    assert error(moved, trained(moved, state, settings, 40)) < 0.3 * error(moved, state)


def test_a_dead_codeword_is_replaced_by_a_residual_with_an_error() -> None:
    x = np.array([[0, 0, 0]] * 50 + [[7, 7, 7]], np.float32)
    settings = RvqSettings(codewords=(2,), dead_count=0.5)
    dead = RvqState(
        (np.array([[0, 0, 0], [100, 100, 100]], np.float32),),
        (np.array([51.0, 0.5]),),
        (np.array([[0.0, 0, 0], [50, 50, 50]]),),
    )
    revived = update(dead, x, rvq_assign(x, *flat(dead.codebooks)), settings, np.random.default_rng(0))
    assert revived.codebooks[0][1].tolist() == [7, 7, 7]  # only the last vector has an error
    assert revived.counts[0][1] == REVIVED_COUNT
    assert revived.sums[0][1].tolist() == [7 * REVIVED_COUNT] * 3
    never = RvqSettings(codewords=(2,), dead_count=0)
    kept = update(dead, x, rvq_assign(x, *flat(dead.codebooks)), never, np.random.default_rng(0))
    assert kept.codebooks[0][1].tolist() == pytest.approx([100, 100, 100], rel=1e-3)


def test_without_errors_a_dead_codeword_stays_and_draws_nothing() -> None:
    x = np.ones((20, 3), np.float32)
    settings = RvqSettings(codewords=(4,), dead_count=2.0)
    rng = np.random.default_rng(0)
    state = initialize(x, settings, rng)
    before = rng.bit_generator.state
    after = update(state, x, rvq_assign(x, *flat(state.codebooks)), settings, rng)
    assert rng.bit_generator.state == before
    assert error(x, after) == 0


def test_the_zero_codeword_is_never_moved_nor_replaced() -> None:
    x = (colors(200) + 10).astype(np.float32)  # far from zero, so codeword 0 is never chosen in stage one
    settings = RvqSettings(codewords=(4, 4), zero_codeword=True, dead_count=5.0)
    state = initialize(x, settings, np.random.default_rng(0))
    assert 0 not in rvq_assign(x, *flat(state.codebooks))[:, 0]
    state = trained(x, state, settings, 10)
    for book in state.codebooks:
        assert book[0].tobytes() == np.zeros(3, np.float32).tobytes()
    assert rvq.dequantize(np.zeros((1, 2), np.uint8), *flat(state.codebooks)).tolist() == [[0, 0, 0]]


def test_weights_move_codewords_to_where_they_count() -> None:
    x = colors(600)
    weights = np.where(x[:, 0] > 1.5, 100.0, 1.0)
    settings = RvqSettings(codewords=(8,))
    alike = initialize(x, settings, np.random.default_rng(0))
    weighted = initialize(x, settings, np.random.default_rng(0), weights)
    assert error(x, weighted, weights) < 0.7 * error(x, alike, weights)
    state, rng = alike, np.random.default_rng(1)
    for _ in range(40):
        state = update(state, x, rvq_assign(x, *flat(state.codebooks)), settings, rng, weights)
    assert error(x, state, weights) < 0.9 * error(x, alike, weights)


def test_weights_are_relative() -> None:
    x, settings = colors(50), RvqSettings(codewords=(4,))
    one = initialize(x, settings, np.random.default_rng(0), np.full(50, 0.25))
    none = initialize(x, settings, np.random.default_rng(0))
    assert one.codebooks[0].tobytes() == none.codebooks[0].tobytes()
    assert one.counts[0].sum() == 50


@pytest.mark.parametrize("weights", [np.zeros(3), np.array([1, -1, 1.0]), np.array([1, np.nan, 1]), np.ones(2)])
def test_weights_that_make_no_sense_are_refused(weights: np.ndarray) -> None:
    with pytest.raises(UsageError, match="weights"):
        initialize(np.zeros((3, 3)), RvqSettings(), np.random.default_rng(0), weights)


def test_vectors_beyond_binary16_are_refused() -> None:
    with pytest.raises(UsageError, match="65504"):
        initialize(np.full((3, 3), 1e6), RvqSettings(), np.random.default_rng(0))
    with pytest.raises(UsageError, match="NaN"):
        initialize(np.full((3, 3), np.nan), RvqSettings(), np.random.default_rng(0))


@pytest.mark.parametrize(
    "settings",
    [
        {"codewords": ()},
        {"codewords": (8, 0)},
        {"codewords": (65537,)},
        {"decay": 1.0},
        {"decay": -0.1},
        {"decay": float("nan")},
        {"smoothing": -1.0},
        {"dead_count": -1.0},
        {"kmeans_iterations": -1},
    ],
)
def test_settings_out_of_range_are_refused(settings: dict[str, object]) -> None:
    with pytest.raises(UsageError):
        RvqSettings(**settings)


def test_given_uniform_numbers_do_what_drawn_ones_do() -> None:
    """The numbers that a generator would draw next, given one after the other, replace the same codewords."""
    x, settings = colors(80), RvqSettings(codewords=(8, 4), dead_count=9.0)
    state = initialize(x, settings, np.random.default_rng(1))
    indices = rvq_assign(x, *flat(state.codebooks))
    drawn = update(state, x, indices, settings, np.random.default_rng(2))
    codebooks, counts, sums = (np.concatenate(part) for part in (state.codebooks, state.counts, state.sums))
    uniforms = np.random.default_rng(2).random(12)
    given = rvq_update(
        x, indices, np.array([8, 4]), codebooks, counts, sums, uniforms, settings.decay, settings.smoothing,
        settings.dead_count,
    )  # fmt: skip
    for name in ("counts", "sums", "codebooks"):
        assert getattr(given, name).tobytes() == np.concatenate(getattr(drawn, name)).tobytes()
    assert (np.concatenate(drawn.counts) == REVIVED_COUNT).any()


def test_too_few_uniform_numbers_are_refused() -> None:
    x = np.array([[0, 0, 0], [7, 7, 7]], np.float32)
    book, indices = np.array([[0, 0, 0], [9, 9, 9]], np.float32), np.zeros((2, 1), np.uint16)
    with pytest.raises(UsageError, match="0 uniform numbers"):
        rvq_update(x, indices, [2], book, np.array([2.0, 0.0]), np.zeros((2, 3)), np.zeros(0), 0.8, 1e-5, 0.5)


def test_without_vectors_an_update_gives_back_what_it_got() -> None:
    book, counts, sums = np.full((2, 3), 1 / 3, np.float32), np.ones(2), np.ones((2, 3))
    x, indices = np.zeros((0, 3), np.float32), np.zeros((0, 1), np.uint16)
    after = rvq_update(x, indices, [2], book, counts, sums, np.zeros(0), 0.8, 1e-5, 0.5)
    assert after.codebooks.tobytes() == book.tobytes()
    assert after.counts.tolist() == [1, 1]
