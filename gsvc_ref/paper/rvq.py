"""Residual vector quantisation of colours in M stages (paper section 3.8, Q_c).

Stage k quantises what the stages before left over::

    r^1 = x,   i^k = argmin_b |r^k - C^k[b]|^2 (lowest b on a tie),   r^(k+1) = r^k - C^k[i^k]     (10-20)
    xq  = C^1[i^1] + ... + C^M[i^M]

The codebooks of all stages are one array (K, 3), stage after stage, beside the number of codewords of each stage, (M,).
Gradients pass straight through to x; what pulls x towards its codewords is `commitment`.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_base.arrays import F4, I8
from gsvc_base.checks import door
from gsvc_base.errors import UsageError
from gsvc_ref._jit import kernel

Indices = NDArray[np.uint16]

MAX_CODEWORDS: Final = 1 << 16
"""Maximum number of codewords of a stage."""


class Commitment(NamedTuple):
    """The commitment loss and its gradient with respect to x."""

    loss: float
    grad_x: F4
    """(N, 3) f4."""


# twin of spec.rvq_assign
@door
def rvq_assign(x: ArrayLike, codebook_sizes: ArrayLike, codebooks: ArrayLike) -> Indices:
    """The nearest codeword of each vector in each stage, the lowest index on a tie (R-10.6-1).

    The squared distance is fl(fl(e_0^2 + e_1^2) + e_2^2) of e = fl(r - C[b]), every operation rounded to binary32. A
    decoder is not affected by the choice.

    Parameters
    ----------
    x
        (N, 3) f4.
    codebook_sizes
        (M,) i8, the number of codewords of each stage.
    codebooks
        (K, 3) f4, the codewords stage after stage.

    Returns
    -------
    Indices
        (N, M) u2.

    Raises
    ------
    UsageError
        A number is not finite, a shape does not fit, or a stage has no codeword.
    """
    vectors, (sizes, books) = _checked_vectors(x), _checked_codebooks(codebook_sizes, codebooks)
    indices = np.empty((len(vectors), len(sizes)), np.uint16)  # (N, M)
    with np.errstate(over="ignore"):  # an infinite distance is never the least
        nearest_codewords(vectors, books, np.cumsum(sizes), indices, np.empty_like(vectors))
    return indices


def dequantize(indices: ArrayLike, codebook_sizes: ArrayLike, codebooks: ArrayLike) -> F4:
    """The sum of the codewords in stage order, (N, 3) f4: C^1[i^1] first, then one binary32 addition per further stage.

    The indices are (N, M) unsigned integers. Every decoder computes the same bits.
    """
    sizes, books = _checked_codebooks(codebook_sizes, codebooks)
    chosen = _checked_indices(indices, sizes)
    with np.errstate(over="ignore"):
        values = codeword_sum(chosen.astype(np.uint16), sizes, books)
    if not np.isfinite(values).all():
        raise UsageError("a sum of codewords overflows binary32; the codewords are too large")
    return values


def codeword_sum(color_indices: Indices, codebook_sizes: I8, codewords: F4) -> F4:
    """The sums of codewords (K, 3) f4 in the order of the stages, (N, 3) f4, without any check (8-4)."""
    values = np.full((len(color_indices), 3), -0.0, np.float32)  # -0 + x is x, to the sign of a zero
    firsts = np.cumsum(codebook_sizes) - codebook_sizes
    for stage, first in enumerate(firsts.tolist()):
        _add_codewords(color_indices, stage, codewords[first:], values)  # one binary32 addition for each stage
    return values


@kernel()
def _add_codewords(indices: Indices, stage: int, book: F4, values: F4) -> None:
    """Add the codewords of one stage to `values` (N, 3)."""
    for n in range(len(indices)):
        word = np.int64(indices[n, stage])
        for c in range(3):
            values[n, c] += book[word, c]


def residuals(x: ArrayLike, indices: ArrayLike, codebook_sizes: ArrayLike, codebooks: ArrayLike) -> F4:
    """The vectors r^1 = x to r^(M+1), the final error: (M + 1, N, 3) f4, each a binary32 difference (10-20)."""
    sizes, books = _checked_codebooks(codebook_sizes, codebooks)
    chosen = _checked_indices(indices, sizes)
    vectors = _checked_vectors(x)
    if len(vectors) != len(chosen):
        raise UsageError(f"x holds {len(vectors)} vectors and indices {len(chosen)}; the counts must be equal")
    r = np.empty((len(sizes) + 1, len(vectors), 3), np.float32)  # (M + 1, N, 3)
    r[0] = vectors
    for k, book in enumerate(np.split(books, np.cumsum(sizes)[:-1])):
        np.subtract(r[k], np.take(book, chosen[:, k], axis=0), out=r[k + 1])  # (10-20)
    return r


# twin of spec.commitment
@door
def commitment(x: ArrayLike, indices: ArrayLike, codebook_sizes: ArrayLike, codebooks: ArrayLike) -> Commitment:
    """Mean squared r^k - stopgrad(C^k[i^k]), summed over the stages (R-10.6-2).

    With r^(k+1) = r^k - C^k[i^k] the loss is sum_k mean |r^(k+1)|^2 over the 3 N components, and its gradient
    dL/dx = sum_k 2 r^(k+1) / (3 N), because every r^k moves with x while the codewords stand still.

    Parameters
    ----------
    x
        (N, 3) f4.
    indices
        (N, M) unsigned integers, the codeword of each vector in each stage.
    codebook_sizes, codebooks
        As for `rvq_assign`.

    Returns
    -------
    Commitment
        loss, accumulated in binary64, and grad_x (N, 3) f4.

    Raises
    ------
    UsageError
        As for `rvq_assign`; or an index is beyond its codebook, or the counts differ.
    """
    errors = residuals(x, indices, codebook_sizes, codebooks)[1:]  # (M, N, 3) f4
    components = max(3 * errors.shape[1], 1)
    gradient = errors.sum(axis=0) * np.float32(2 / components)
    return Commitment(float(np.square(errors, dtype=np.float64).sum() / components), gradient)  # (10-21)


@kernel()
def nearest_codewords(x: F4, books: F4, ends: NDArray[np.int64], chosen: Indices, errors: F4) -> None:
    """The nearest codewords of all stages for x (N, 3), and the sum of the residuals that they leave.

    `books` (K, 3) are the codebooks stage after stage, and `ends` (M,) is where each ends. Fills `chosen` (N, M) with
    the codewords, and `errors` (N, 3) with r^2 + ... + r^(M+1).
    """
    planes = books.T.copy()  # contiguous over codewords, so that the first loop fills the vector lanes
    cost = np.empty(books.shape[0], np.float32)
    r = np.empty(3, np.float32)
    for n in range(x.shape[0]):
        for c in range(3):
            r[c], errors[n, c] = x[n, c], np.float32(0)
        first = 0
        for k in range(ends.size):
            red, green, blue = planes[0, first : ends[k]], planes[1, first : ends[k]], planes[2, first : ends[k]]
            r0, r1, r2 = r[0], r[1], r[2]
            for b in range(red.size):
                e0, e1, e2 = r0 - red[b], r1 - green[b], r2 - blue[b]
                cost[b] = (e0 * e0 + e1 * e1) + e2 * e2  # a loop without a branch, so that it becomes vector code
            best, least = 0, cost[0]
            for b in range(1, red.size):
                if cost[b] < least:  # strict: the lowest index on a tie
                    best, least = b, cost[b]
            chosen[n, k] = best
            for c in range(3):
                r[c] -= books[first + best, c]  # (10-20)
                errors[n, c] += r[c]
            first = ends[k]


def flat(codebooks: Sequence[NDArray[np.floating]]) -> tuple[I8, F4]:
    """Codebooks with an array (B, 3) for each stage, as their sizes (M,) i8 and one array (K, 3) f4."""
    sizes = np.array([len(book) for book in codebooks], np.int64)
    return sizes, np.concatenate([np.asarray(book, np.float32) for book in codebooks])


def joined(codebooks: Sequence[NDArray[np.floating]]) -> tuple[F4, I8]:
    """Codebooks with an array (B, 3) for each stage, as one array (K, 3) f4 and where each ends, (M,) i8."""
    sizes, books = flat(codebooks)
    return books, np.cumsum(sizes)


def _checked_vectors(x: ArrayLike) -> F4:
    vectors = np.ascontiguousarray(x, np.float32)
    if vectors.ndim != 2 or vectors.shape[1] != 3:
        raise UsageError(f"x has shape {vectors.shape}; it must be (N, 3)")
    if not np.isfinite(vectors).all():
        raise UsageError("a vector to quantize is NaN or infinite; every component must be finite")
    return vectors


def _checked_codebooks(codebook_sizes: ArrayLike, codebooks: ArrayLike) -> tuple[I8, F4]:
    sizes, books = np.asarray(codebook_sizes, np.int64), np.ascontiguousarray(codebooks, np.float32)
    if sizes.ndim != 1 or len(sizes) == 0 or books.shape != (sizes.sum(), 3):
        raise UsageError(f"codebooks have shape {books.shape}, their sizes are {sizes}; give (sum of the sizes, 3)")
    if not ((sizes >= 1) & (sizes <= MAX_CODEWORDS)).all():
        raise UsageError(f"codebooks hold {sizes} codewords; each must hold 1..{MAX_CODEWORDS}")
    if not np.isfinite(books).all():
        raise UsageError("a codeword is NaN or infinite; every component must be finite")
    return sizes, books


def _checked_indices(indices: ArrayLike, sizes: I8) -> NDArray[np.unsignedinteger]:
    chosen = np.asarray(indices)
    if chosen.dtype.kind != "u" or chosen.ndim != 2 or chosen.shape[1] != len(sizes):
        raise UsageError(
            f"indices are {chosen.dtype} of shape {chosen.shape}; they must be unsigned of shape (N, {len(sizes)})"
        )
    for k, size in enumerate(sizes.tolist()):
        if (chosen[:, k] >= size).any():
            raise UsageError(f"an index of stage {k} is {chosen[:, k].max()}; the codebook ends at {size - 1}")
    return chosen
