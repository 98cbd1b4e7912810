"""Cases of residual vector quantisation: the choice of codewords, and the commitment loss."""

from typing import Any

import numpy as np

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases.training import F4, f4
from gsvc_conformance.operation import Values
from gsvc_conformance.operations.codebooks import books_of
from gsvc_conformance.operations.quantization import rvq_assign_oracle


def codebooks(rng: Draws, sizes: list[int]) -> Values:
    """Codebooks of binary16 numbers, each stage a third as wide as the one before."""
    books = [rng.normal(size=(size, 3)) / 3**k for k, size in enumerate(sizes)]
    rows = np.concatenate(books).astype(np.float16).astype(np.float32)
    return {"codebook_sizes": np.array(sizes, np.int64), "codebooks": rows}


def clear_vectors(rng: Draws, count: int, books: Values) -> F4:
    """Vectors (count, 3) f4 whose every choice has a margin of more than sixteen times its error."""
    vectors: list[F4] = []
    while len(vectors) < count:
        x = rng.normal(size=(1, 3)).astype(np.float32)
        try:
            decision: Any = rvq_assign_oracle(x, **books)["indices"]
        except ValueError:
            continue
        if decision.guard is None or decision.margin > 16 * decision.guard:
            vectors.append(x)
    return np.concatenate(vectors)


def assigned(rng: Draws, count: int, sizes: list[int]) -> Values:
    """Vectors, codebooks and the indices that belong to them."""
    books = codebooks(rng, sizes)
    x = clear_vectors(rng, count, books)
    decision: Any = rvq_assign_oracle(x, **books)["indices"]
    return {"x": x, "indices": decision.value, **books}


@case(
    "core", "rvq_assign", flags=["stages"], each={"one_stage": [8], "two_stages": [8, 8], "four_stages": [5, 3, 7, 6]}
)
def nearest_codewords(rng: Draws, value: list[int]) -> Inputs:
    """Random vectors and {key}: every stage takes what is left over."""
    books = codebooks(rng, value)
    x = clear_vectors(rng, 31, books)
    expected = yield {"x": x, **books}
    indices = expected["indices"].value
    assert all(len(np.unique(indices[:, k])) > 1 for k in range(len(value)))
    again = [np.argmin(((x[:, None] - book) ** 2).sum(2), 1) for book in books_of(*books.values())]
    assert len(value) == 1 or not np.array_equal(indices, np.stack(again, 1))  # of x itself, not of what is left


@case("core", "rvq_assign", flags=["ties"])
def equal_codewords() -> Inputs:
    """Codewords that occur twice, in small whole numbers: the lower index of each pair is taken."""
    book = f4([4, 0, 0], [1, 1, 1], [1, 1, 1], [-2, 0, 0], [4, 0, 0], [-2, 0, 0])
    x = f4([1, 1, 2], [5, 0, 0], [-2, 0, 1], [4, 0, 0])
    expected = yield {"x": x, "codebook_sizes": np.array([6], np.int64), "codebooks": book}
    assert expected["indices"].value.ravel().tolist() == [1, 0, 3, 0]


@case("core", "rvq_assign", flags=["ties"])
def codewords_at_one_distance() -> Inputs:
    """Vectors in the middle between different codewords, in numbers without rounding: the lowest index is taken."""
    book = f4([2, 0, 0], [-2, 0, 0], [0, 2, 0], [0, 0, -2])
    x = f4([0, 0, 0], [-1, 1, 0], [0, 1, -1], [-2, 0, -2])
    expected = yield {"x": x, "codebook_sizes": np.array([4], np.int64), "codebooks": book}
    assert expected["indices"].value.ravel().tolist() == [0, 1, 2, 1]


@case("core", "rvq_assign", flags=["ties", "stages"])
def ties_of_the_second_stage() -> Inputs:
    """Exactly nothing is left for the second stage of one vector, and the opposite of another's: ties there too."""
    first, second = f4([0, 0, 0], [4, 4, 4]), f4([1, 0, 0], [-1, 0, 0], [0, 0, 1])
    x = f4([4, 4, 4], [3.5, 4, 4], [0.5, 0, 0.5], [4, 4, 4.5])
    expected = yield {
        "x": x, "codebook_sizes": np.array([2, 3], np.int64), "codebooks": np.concatenate([first, second])
    }  # fmt: skip
    assert expected["indices"].value.tolist() == [[1, 0], [1, 1], [0, 0], [1, 2]]


@case("core", "rvq_assign", flags=["metric"])
def squares_and_not_magnitudes() -> Inputs:
    """Codewords that the sum or the largest of the magnitudes would rank in the other order."""
    book = f4([3, 0, 0], [1.75, 1.75, 0], [1.5, 1.5, 1.5])
    expected = yield {
        "x": f4([0, 0, 0], [-0.25, -0.25, 0.25]), "codebook_sizes": np.array([3], np.int64), "codebooks": book
    }  # fmt: skip
    assert expected["indices"].value.ravel().tolist() == [1, 2]


@case("core", "rvq_assign", flags=["cancellation"])
def codewords_side_by_side(rng: Draws) -> Inputs:
    """Vectors between neighbouring binary16 numbers, far from 0: their distances are a millionth of their squares.

    |C|^2 - 2 r . C is the same in real numbers, and in binary32 its errors decide.
    """
    book = f4(*(600 + 0.5 * np.stack(np.meshgrid([0, 1], [1, 2], [3, 5]), axis=-1).reshape(-1, 3)))
    books = {"codebook_sizes": np.array([8], np.int64), "codebooks": book}
    middle = np.array([600.25, 600.75, 602], np.float32)
    x = (middle + rng.choice([-1, 1], (32, 3)) * rng.uniform(0.002, 0.1, (32, 3))).astype(np.float32)
    expected = yield {"x": x, **books}
    indices = expected["indices"]
    assert indices.margin > 100 * indices.guard
    expanded = (book**2).sum(axis=1) - 2 * (x @ book.T)
    assert np.mean(expanded.argmin(axis=1) != indices.value[:, 0]) > 0.25


@case("uncommon", "rvq_assign", flags=["many"])
def three_hundred_codewords(rng: Draws) -> Inputs:
    """300 codewords, more than a byte can number."""
    books = codebooks(rng, [300, 1])
    expected = yield {"x": clear_vectors(rng, 60, books), **books}
    assert expected["indices"].value.max() > 255
    assert not expected["indices"].value[:, 1].any()


@case("uncommon", "rvq_assign", flags=["empty"])
def no_vectors(rng: Draws) -> Inputs:
    """A block without splats."""
    expected = yield {"x": np.zeros((0, 3), np.float32), **codebooks(rng, [4, 2])}
    assert expected["indices"].value.shape == (0, 2)


@case("stress", "rvq_assign", flags=["overflow"])
def large_vectors() -> Inputs:
    """Vectors at the ends of binary16, whose squares binary16 does not hold."""
    book = f4([65504, 65504, 65504], [-65504, -65504, -65504], [0, 0, 0])
    x = f4([60000, 65504, 40000], [-65504, -1, -65504], [300, -300, 200])
    expected = yield {"x": x, "codebook_sizes": np.array([3], np.int64), "codebooks": book}
    assert expected["indices"].value.ravel().tolist() == [0, 1, 2]


@case("core", "commitment", flags=["factor", "stages"], each={"one_stage": [8], "three_stages": [6, 5, 4]})
def commitment_of_random_vectors(rng: Draws, value: list[int]) -> Inputs:
    """Random vectors and {key}: the loss adds up what every stage leaves over, and is a mean over 3 N components."""
    inputs = assigned(rng, 19, value)
    expected = yield inputs
    left, total = inputs["x"].astype(np.float64), 0.0
    for k, book in enumerate(books_of(inputs["codebook_sizes"], inputs["codebooks"])):
        left = left - book[inputs["indices"][:, k]]
        total += float(np.sum(left**2))
    assert np.isclose(expected["loss"].value, total / 57)


@case("core", "commitment", flags=["factor", "stages"])
def commitment_by_hand() -> Inputs:
    """One vector and two stages in small numbers: what is left is (1, 0, 2) and then (0, -1, 2).

    The loss is (5 + 5) / 3 and the gradient 2 (1, -1, 4) / 3: both stages count, and the mean is over 3 components.
    """
    expected = yield {
        "x": f4([3, 0, 2]), "indices": np.array([[1, 0]], np.uint16), "codebook_sizes": np.array([2, 1], np.int64),
        "codebooks": f4([9, 9, 9], [2, 0, 0], [1, 1, 0]),
    }  # fmt: skip
    assert np.isclose(expected["loss"].value, 10 / 3)
    assert np.allclose(expected["grad_x"].value, [[2 / 3, -2 / 3, 8 / 3]])


@case("uncommon", "commitment", flags=["empty"])
def commitment_of_nothing(rng: Draws) -> Inputs:
    """Without splats the loss is 0, not a quotient of zeros."""
    expected = yield {
        "x": np.zeros((0, 3), np.float32), "indices": np.zeros((0, 2), np.uint16), **codebooks(rng, [4, 2])
    }  # fmt: skip
    assert expected["loss"].value == 0
