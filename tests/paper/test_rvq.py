"""Residual VQ: assignment, dequantisation and commitment loss."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from gsvc_base.errors import UsageError
from gsvc_ref import spec
from gsvc_ref.paper import rvq, rvq_assign
from gsvc_ref.paper.rvq import flat

components = st.floats(-4, 4, width=32)
vectors = hnp.arrays(np.float32, st.tuples(st.integers(0, 10), st.just(3)), elements=components)
codebook = hnp.arrays(np.float32, st.tuples(st.integers(1, 20), st.just(3)), elements=components)
codebook_lists = st.lists(codebook, min_size=1, max_size=3)
# Few distinct numbers, so that ties and exact zeros are common.
grid = hnp.arrays(np.float32, st.tuples(st.integers(1, 8), st.just(3)), elements=st.sampled_from([-1.0, 0.0, 1.0]))


@given(st.one_of(vectors, grid), st.one_of(codebook_lists, st.lists(grid, min_size=1, max_size=3)))
def test_assignment_equals_its_definition(x: np.ndarray, books: list[np.ndarray]) -> None:
    assert np.array_equal(rvq_assign(x, *flat(books)), spec.rvq_assign(x, *flat(books))["indices"])


@given(vectors, codebook)
def test_the_codeword_is_a_nearest_one(x: np.ndarray, book: np.ndarray) -> None:
    distance = np.square(x[:, None].astype(np.float64) - book).sum(axis=2)
    chosen = distance[np.arange(len(x)), rvq_assign(x, *flat([book]))[:, 0]]
    assert (chosen <= distance.min(axis=1, initial=np.inf) * (1 + 2.0**-20) + 1e-30).all()


def test_a_tie_goes_to_the_lowest_index() -> None:
    book = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [1, 0, 0]], np.float32)
    assert rvq_assign(np.zeros((1, 3)), *flat([book])).tolist() == [[0]]
    assert rvq_assign([[0, 0.5, 0]], *flat([book[[1, 0, 3]]])).tolist() == [[0]]
    assert rvq_assign([[1, 0, 0]], *flat([book[::-1]])).tolist() == [[0]]


halves = st.one_of(codebook, grid).map(lambda book: -book.astype(np.float16).astype(np.float32))


@given(st.lists(halves, min_size=1, max_size=3), st.data())
def test_the_sum_of_codewords_equals_its_definition(books: list[np.ndarray], data: st.DataObject) -> None:
    count = data.draw(st.integers(0, 10))
    columns = [data.draw(hnp.arrays(np.uint16, count, elements=st.integers(0, len(book) - 1))) for book in books]
    indices = np.stack(columns, axis=1)
    sizes, codewords = flat(books)
    expected = spec.codeword_sum(indices, sizes, codewords.astype(np.float16).view(np.uint16))
    assert rvq.codeword_sum(indices, sizes, codewords).tobytes() == expected.tobytes()


def test_stages_quantise_what_is_left_over() -> None:
    books = [np.array([[0, 0, 0], [8, 8, 8]], np.float32), np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0]], np.float32)]
    x = np.array([[9, 8, 8], [0, 2, 0], [8, 10.5, 8]], np.float32)
    indices = rvq_assign(x, *flat(books))
    assert indices.tolist() == [[1, 1], [0, 2], [1, 2]]
    assert rvq.dequantize(indices, *flat(books)).tolist() == [[9, 8, 8], [0, 2, 0], [8, 10, 8]]
    assert rvq.residuals(x, indices, *flat(books))[-1].tolist() == [[0, 0, 0], [0, 0, 0], [0, 0.5, 0]]


def test_dequantisation_adds_in_stage_order_in_binary32() -> None:
    books = [np.full((1, 3), value, np.float32) for value in (1.0, 2.0**-24, 2.0**-24)]
    one = np.zeros((1, 3), np.uint8)
    assert rvq.dequantize(one, *flat(books)).tolist() == [[1, 1, 1]]
    assert rvq.dequantize(one, *flat(books[::-1])).tolist() == [[1 + 2.0**-23] * 3]


def test_a_single_negative_zero_stays_what_it_is() -> None:
    book = np.full((1, 3), -0.0, np.float32)
    assert rvq.dequantize(np.zeros((1, 1), np.uint8), [1], book).tobytes() == book.tobytes()


@given(vectors, codebook_lists)
def test_the_last_residual_is_the_quantisation_error(x: np.ndarray, books: list[np.ndarray]) -> None:
    indices = rvq_assign(x, *flat(books))
    error = x.astype(np.float64) - rvq.dequantize(indices, *flat(books))
    assert np.abs(rvq.residuals(x, indices, *flat(books))[-1] - error).max(initial=0) <= 2.0**-19


def test_far_vectors_do_not_confuse_the_choice() -> None:
    book = np.array([[-3e38, 0, 0], [3e38, 0, 0]], np.float32)
    assert rvq_assign([[3e38, 0, 0], [-3e38, 0, 0]], *flat([book])).tolist() == [[1], [0]]
    assert rvq_assign([[0, 3e38, 0]], *flat([book])).tolist() == [[0]]  # every distance overflows: the lowest index


def test_commitment_by_hand() -> None:
    books = [np.array([[1, 0, 0]], np.float32), np.array([[0, 1, 0]], np.float32)]
    x = np.array([[2, 3, 0], [1, 1, 0]], np.float32)
    loss = rvq.commitment(x, np.zeros((2, 2), np.uint8), *flat(books))
    # Residuals (1,3,0), (0,1,0) after stage one; (1,2,0), (0,0,0) after stage two; 6 components.
    assert loss.loss == (10 + 1 + 5) / 6
    assert loss.grad_x == pytest.approx(np.array([[2, 5, 0], [0, 1, 0]]) * 2 / 6, rel=1e-6)


@given(vectors, codebook_lists)
def test_commitment_gradient_equals_autograd(x: np.ndarray, books: list[np.ndarray]) -> None:
    torch = pytest.importorskip("torch", reason="PyTorch is the peer that differentiates the commitment loss")
    indices = rvq_assign(x, *flat(books))
    leaf = torch.tensor(x, dtype=torch.float64, requires_grad=True)
    left_over, total = leaf, leaf.sum() * 0
    for k, book in enumerate(books):
        left_over = left_over - torch.tensor(book[indices[:, k]], dtype=torch.float64)
        total = total + (left_over**2).sum() / max(x.size, 1)
    total.backward()
    ours = rvq.commitment(x, indices, *flat(books))
    assert ours.loss == pytest.approx(total.item(), rel=1e-5, abs=1e-9)
    assert np.abs(ours.grad_x - leaf.grad.numpy()).max(initial=0) <= 2.0**-18


BOOK = np.zeros((2, 3), np.float32)


@pytest.mark.parametrize(
    ("x", "sizes", "codebooks", "message"),
    [
        (np.zeros((1, 2)), [2], BOOK, r"\(N, 3\)"),
        (np.full((1, 3), np.nan), [2], BOOK, "NaN or infinite"),
        (np.zeros((1, 3)), [], np.zeros((0, 3)), "sum of the sizes"),
        (np.zeros((1, 3)), [2], np.zeros((2, 2)), "sum of the sizes"),
        (np.zeros((1, 3)), [1, 2], BOOK, "sum of the sizes"),
        (np.zeros((1, 3)), [2, 0], BOOK, "must hold 1"),
        (np.zeros((1, 3)), [1], np.full((1, 3), np.inf), "codeword is NaN"),
    ],
)
def test_arguments_that_do_not_fit_are_refused(x, sizes, codebooks, message) -> None:
    with pytest.raises(UsageError, match=message):
        rvq_assign(x, sizes, codebooks)


@pytest.mark.parametrize(
    ("indices", "message"),
    [
        (np.zeros((1, 1), np.int64), "unsigned"),
        (np.zeros((1, 2), np.uint8), r"\(N, 1\)"),
        (np.full((1, 1), 2, np.uint8), "ends at 1"),
    ],
)
def test_indices_that_do_not_fit_are_refused(indices: np.ndarray, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        rvq.dequantize(indices, [2], BOOK)


def test_counts_that_differ_and_sums_that_overflow_are_refused() -> None:
    with pytest.raises(UsageError, match="counts must be equal"):
        rvq.residuals(np.zeros((2, 3)), np.zeros((1, 1), np.uint8), [2], BOOK)
    with pytest.raises(UsageError, match="overflows"):
        rvq.dequantize(np.zeros((1, 2), np.uint8), [1, 1], np.full((2, 3), 3e38, np.float32))
