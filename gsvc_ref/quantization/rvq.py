"""Residual vector quantisation of colours in M stages (paper section 3.8, Q_c).

Stage k quantises what the stages before left over::

    r^1 = x,   i^k = argmin_b |r^k - C^k[b]|^2 (lowest b on a tie),   r^(k+1) = r^k - C^k[i^k]     (10-20)
    xq  = C^1[i^1] + ... + C^M[i^M]

Codebooks are a sequence of M arrays C^k of shape (B_k, 3), f4; the numbers of codewords may differ. Gradients pass
straight through to x; what pulls x towards its codewords is `commitment`.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_ref._jit import kernel
from gsvc_ref.errors import UsageError
from gsvc_ref.portable import log2
from gsvc_ref.quantization.half import from_half, to_half

F4 = NDArray[np.float32]
Indices = NDArray[np.uint16]
Codebooks = Sequence[F4]

MAX_CODEWORDS: Final = 1 << 16


class Commitment(NamedTuple):
    """The commitment loss and its gradient with respect to x."""

    loss: float
    grad_x: F4
    """(N, 3) f4."""


def assign(
    x: ArrayLike,
    codebooks: Codebooks,
    *,
    penalties: Sequence[F4] | None = None,
    weights: ArrayLike | None = None,
) -> Indices:
    """Codeword of each vector in each stage: the nearest (R-10.6-1), or the cheapest where codewords have a price.

    The cost of codeword b for splat n is fl(fl(w_n * d) + penalty_b), with the squared distance
    d = fl(fl(e_0^2 + e_1^2) + e_2^2) of e = fl(r - C[b]), every operation rounded to binary32. A decoder is not
    affected by the choice.

    Parameters
    ----------
    x
        (N, 3) f4.
    codebooks
        M arrays (B_k, 3) f4.
    penalties
        M arrays (B_k,) f4, at least 0, in units of the weighted squared distance: lambda times `codeword_bits` trades
        distortion for rate. None charges nothing, as the paper.
    weights
        (N,) f4 w_n, at least 0: without penalties they change nothing. None is 1.

    Returns
    -------
    Indices
        (N, M) u2.

    Raises
    ------
    UsageError
        A number is not finite, a penalty or weight is negative, a shape does not fit, or a stage has no codeword.
    """
    vectors, books = _checked_vectors(x), _checked_codebooks(codebooks)
    prices = [np.zeros(len(book), np.float32) for book in books] if penalties is None else list(penalties)
    if len(prices) != len(books) or any(len(price) != len(book) for price, book in zip(prices, books, strict=False)):
        raise UsageError("penalties must be one array (B,) per stage, as long as its codebook")
    w = _checked_costs("weights", np.ones(len(vectors)) if weights is None else weights, len(vectors))
    residual = vectors.copy()  # (N, 3) f4
    indices = np.empty((len(vectors), len(books)), np.uint16)  # (N, M)
    with np.errstate(over="ignore"):  # an infinite distance is never the least
        for k, (book, price) in enumerate(zip(books, prices, strict=True)):
            _assign(residual, book, _checked_costs("penalties", price, len(book)), w, indices[:, k])
    return indices


def dequantize(indices: ArrayLike, codebooks: Codebooks) -> F4:
    """Sum of the codewords in stage order: C^1[i^1] first, then one binary32 addition per further stage.

    Parameters
    ----------
    indices
        (N, M) unsigned integers.
    codebooks
        M arrays (B_k, 3) f4.

    Returns
    -------
    F4
        (N, 3); what every decoder computes bit for bit.

    Raises
    ------
    UsageError
        An index is beyond its codebook, a shape or type does not fit, or a sum overflows binary32.
    """
    books = _checked_codebooks(codebooks)
    chosen = _checked_indices(indices, books)
    with np.errstate(over="ignore"):
        values = codeword_sum(chosen.astype(np.uint16), books)
    if not np.isfinite(values).all():
        raise UsageError("a sum of codewords overflows binary32; the codewords are too large")
    return values


def codeword_sum_plain(indices: Indices, codebooks: Codebooks) -> F4:
    """The definition of the colours, without any check: (N, 3) f4 of indices (N, M); spec.md (8-4)."""
    values: F4 = codebooks[0][indices[:, 0]]  # (N, 3) f4
    for k in range(1, len(codebooks)):
        values = values + codebooks[k][indices[:, k]]
    return values


def codeword_sum(indices: Indices, codebooks: Codebooks) -> F4:
    """Fast twin of `codeword_sum_plain`, for codebooks that hold every index; a decoder calls this."""
    values = np.full((len(indices), 3), -0.0, np.float32)  # -0 + x is x, to the sign of a zero
    for stage, book in enumerate(codebooks):
        _add_codewords(indices, stage, book, values)
    return values


@kernel()
def _add_codewords(indices: Indices, stage: int, book: F4, values: F4) -> None:
    """Add the codewords of one stage to `values` (N, 3)."""
    for n in range(len(indices)):
        word = np.int64(indices[n, stage])
        for c in range(3):
            values[n, c] += book[word, c]


def residuals(x: ArrayLike, indices: ArrayLike, codebooks: Codebooks) -> F4:
    """r^1 = x to r^(M+1) = the final error, (M + 1, N, 3) f4, each a binary32 difference from the one before."""
    books = _checked_codebooks(codebooks)
    chosen = _checked_indices(indices, books)
    vectors = _checked_vectors(x)
    if len(vectors) != len(chosen):
        raise UsageError(f"x holds {len(vectors)} vectors and indices {len(chosen)}; the counts must be equal")
    r = np.empty((len(books) + 1, len(vectors), 3), np.float32)  # (M + 1, N, 3)
    r[0] = vectors
    for k, book in enumerate(books):
        np.subtract(r[k], np.take(book, chosen[:, k], axis=0), out=r[k + 1])  # (10-20)
    return r


def commitment(x: ArrayLike, indices: ArrayLike, codebooks: Codebooks) -> Commitment:
    """Mean squared r^k - stopgrad(C^k[i^k]), summed over the stages (R-10.6-2).

    With r^(k+1) = r^k - C^k[i^k] the loss is sum_k mean |r^(k+1)|^2 over the 3 N components, and its gradient
    dL/dx = sum_k 2 r^(k+1) / (3 N), because every r^k moves with x while the codewords stand still.

    Parameters
    ----------
    x, indices, codebooks
        As for `residuals`.

    Returns
    -------
    Commitment
        loss, accumulated in binary64, and grad_x (N, 3) f4.

    Raises
    ------
    UsageError
        As for `residuals`.
    """
    errors = residuals(x, indices, codebooks)[1:]  # (M, N, 3) f4
    components = max(3 * errors.shape[1], 1)
    gradient = errors.sum(axis=0) * np.float32(2 / components)
    return Commitment(float(np.square(errors, dtype=np.float64).sum() / components), gradient)  # (10-21)


def codeword_bits(indices: ArrayLike, codebooks: Codebooks) -> list[F4]:
    """Ideal code length of each codeword by its frequency, -log2((n_b + 1) / (N + B)): M arrays (B_k,) f4, in bits."""
    books = _checked_codebooks(codebooks)
    chosen = _checked_indices(indices, books)
    counts = [np.bincount(chosen[:, k], minlength=len(book)) + 1 for k, book in enumerate(books)]
    return [np.asarray(log2(count.sum() / count), np.float32) for count in counts]


def round_codebooks(codebooks: Sequence[NDArray[np.floating]]) -> tuple[F4, ...]:
    """The nearest codebooks of binary16 entries, which is what a stream carries; UsageError beyond 65504 or NaN."""
    return tuple(from_half(to_half(book)) for book in codebooks)


def assign_plain(x: F4, codebooks: Codebooks, penalties: Sequence[F4], weights: F4) -> Indices:
    """The definition of `assign`, all (N, B_k) costs of a stage at once."""
    residual = x
    columns = []
    for book, penalty in zip(codebooks, penalties, strict=True):
        e = residual[:, None, :] - book  # (N, B, 3) f4
        d = (e[..., 0] * e[..., 0] + e[..., 1] * e[..., 1]) + e[..., 2] * e[..., 2]  # (N, B) f4
        column = (weights[:, None] * d + penalty).argmin(axis=1)  # argmin takes the lowest index
        columns.append(column)
        residual = residual - book[column]  # (10-20)
    return np.stack(columns, axis=1).astype(np.uint16)


@kernel()
def _assign(r: F4, book: F4, penalties: F4, weights: F4, chosen: Indices) -> None:
    """Twin of one stage of `assign_plain`; r becomes the residual of the next."""
    codewords = book.shape[0]
    planes = book.T.copy()  # contiguous over codewords, so that the first loop fills the vector lanes
    cost = np.empty(codewords, np.float32)
    for n in range(r.shape[0]):
        w, r0, r1, r2 = weights[n], r[n, 0], r[n, 1], r[n, 2]
        for b in range(codewords):
            e0, e1, e2 = r0 - planes[0, b], r1 - planes[1, b], r2 - planes[2, b]
            cost[b] = w * ((e0 * e0 + e1 * e1) + e2 * e2) + penalties[b]
        best, least = 0, cost[0]
        for b in range(1, codewords):
            if cost[b] < least:
                best, least = b, cost[b]
        chosen[n] = best
        for c in range(3):
            r[n, c] -= book[best, c]  # (10-20)


@kernel()
def nearest_codewords(x: F4, books: F4, ends: NDArray[np.int64], chosen: Indices, errors: F4) -> None:
    """Twin of all stages of `assign_plain` without penalties, and of `residuals` summed over the stages.

    Parameters
    ----------
    x
        (N, 3) f4.
    books, ends
        The codebooks one after the other, (sum of B, 3) f4, and where each ends, (M,) i8: see `joined`.
    chosen
        (N, M) u2, filled: the codewords.
    errors
        (N, 3) f4, filled: r^2 + ... + r^(M+1).
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
                cost[b] = (e0 * e0 + e1 * e1) + e2 * e2
            best, least = 0, cost[0]
            for b in range(1, red.size):
                if cost[b] < least:
                    best, least = b, cost[b]
            chosen[n, k] = best
            for c in range(3):
                r[c] -= books[first + best, c]  # (10-20)
                errors[n, c] += r[c]
            first = ends[k]


def joined(codebooks: Codebooks) -> tuple[F4, NDArray[np.int64]]:
    """Codebooks one after the other, (sum of B, 3) f4, and where each ends, (M,) i8."""
    books = np.concatenate([np.asarray(book, np.float32) for book in codebooks])
    return books, np.cumsum([len(book) for book in codebooks])


def _checked_vectors(x: ArrayLike) -> F4:
    vectors = np.ascontiguousarray(x, np.float32)
    if vectors.ndim != 2 or vectors.shape[1] != 3:
        raise UsageError(f"x has shape {vectors.shape}; it must be (N, 3)")
    if not np.isfinite(vectors).all():
        raise UsageError("a vector to quantize is NaN or infinite; every component must be finite")
    return vectors


def _checked_codebooks(codebooks: Codebooks) -> list[F4]:
    books = [np.ascontiguousarray(book, np.float32) for book in codebooks]
    if not books or any(book.ndim != 2 or book.shape[1] != 3 for book in books):
        raise UsageError(f"codebooks have shapes {[b.shape for b in books]}; give one (B, 3) array per stage")
    if any(not 1 <= len(book) <= MAX_CODEWORDS for book in books):
        raise UsageError(f"codebooks hold {[len(b) for b in books]} codewords; each must hold 1..{MAX_CODEWORDS}")
    if not all(np.isfinite(book).all() for book in books):
        raise UsageError("a codeword is NaN or infinite; every component must be finite")
    return books


def _checked_indices(indices: ArrayLike, books: list[F4]) -> NDArray[np.unsignedinteger]:
    chosen = np.asarray(indices)
    if chosen.dtype.kind != "u" or chosen.ndim != 2 or chosen.shape[1] != len(books):
        raise UsageError(
            f"indices are {chosen.dtype} of shape {chosen.shape}; they must be unsigned of shape (N, {len(books)})"
        )
    for k, book in enumerate(books):
        if (chosen[:, k] >= len(book)).any():
            raise UsageError(f"an index of stage {k} is {chosen[:, k].max()}; the codebook ends at {len(book) - 1}")
    return chosen


def _checked_costs(name: str, costs: ArrayLike, length: int) -> F4:
    array = np.ascontiguousarray(costs, np.float32)
    if array.shape != (length,):
        raise UsageError(f"{name} have shape {array.shape}; they must be ({length},)")
    if not (np.isfinite(array).all() and (array >= 0).all()):
        raise UsageError(f"one of the {name} is negative or not finite; all must be at least 0")
    return array
