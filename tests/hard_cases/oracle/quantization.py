"""LSQ+, residual vector quantisation and binary16 in 60 digits: section 8 and 10.5, 10.6."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from mpmath import frexp, ldexp, mpf
from numpy.typing import NDArray

from tests.hard_cases.measuring import Objects, Truth, exactly, precise
from tests.hard_cases.oracle.rounding import fl, nearest

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]
I8 = NDArray[np.int64]
U2 = NDArray[np.uint16]


def half_bits(value: Any, *, negative: bool) -> int:
    """(8-6)."""
    magnitude = abs(value)
    n = -14
    if magnitude > 0:
        n = max(int(frexp(magnitude)[1]) - 1, -14)
    return negative * 2**15 + (n + 14) * 2**10 + int(nearest(ldexp(magnitude, 10 - n)))


def half_value(bits: int) -> Any:
    """(8-5)."""
    sign, E, F = -1 if bits >> 15 else 1, bits >> 10 & 31, bits & 1023
    if E == 31:
        return sign * mpf("inf")
    return sign * (ldexp(1024 + F, E - 25) if E > 0 else ldexp(F, -24))


@precise
def to_half(values: F4) -> Mapping[str, Truth]:
    """(8-6)."""
    bits = [half_bits(value, negative=bool(np.signbit(v))) for value, v in zip(exactly(values), values, strict=True)]
    return {"bits": Truth(exactly(np.array(bits)))}


@precise
def from_half(bits: U2) -> Mapping[str, Truth]:
    """(8-5): exact."""
    values: Objects = np.empty(bits.shape, object)
    values[:] = [half_value(int(pattern)) for pattern in bits]
    return {"values": Truth(values, 0.0)}


@precise
def lsq_quantize(x: F4, scale: F4, offset: F4, bits: int) -> Mapping[str, Truth]:
    """(10-15) and (10-16), t as a real number."""
    codes = [
        nearest(min(max(t, mpf(0)), mpf(2**bits - 1))) for t in ((exactly(x) - exactly(offset)) / exactly(scale)).flat
    ]
    return {"codes": Truth(np.array(codes, object).reshape(x.shape))}


@precise
def lsq_dequantize(codes: U2, scale: F4, offset: F4) -> Mapping[str, Truth]:
    """(10-17), whose two roundings are part of it."""
    rounded = np.vectorize(fl, otypes=[object])
    return {"values": Truth(rounded(rounded(exactly(codes) * exactly(scale)) + exactly(offset)), 0.0)}


@precise
def lsq_gradients(x: F4, scale: F4, offset: F4, bits: int, grad_output: F4) -> Mapping[str, Truth]:
    """(10-18) and (10-19)."""
    p = 2**bits - 1
    grad_x, grad = exactly(np.zeros(x.shape)), exactly(grad_output)
    sums = exactly(np.zeros((2, x.shape[1])))
    t = (exactly(x) - exactly(offset)) / exactly(scale)
    for n, c in np.ndindex(*x.shape):
        if 0 <= t[n, c] <= p:
            grad_x[n, c] = grad[n, c]
            sums[0, c] += grad[n, c] * (nearest(t[n, c]) - t[n, c])
        else:
            sums[0, c] += grad[n, c] * (p if t[n, c] > p else 0)
            sums[1, c] += grad[n, c]
    return {"grad_x": Truth(grad_x), "grad_scale": Truth(sums[0]), "grad_offset": Truth(sums[1])}


def stages_of(codebook_sizes: I8, rows: Objects) -> list[Objects]:
    """Rows that lie one stage after the other, as a list."""
    return np.split(rows, np.cumsum(codebook_sizes)[:-1])


def squared(vector: Objects) -> Any:
    """|vector|^2."""
    return sum(component * component for component in vector)


@precise
def rvq_assign(x: F4, codebook_sizes: I8, codebooks: F4) -> Mapping[str, Truth]:
    """(10-20) in real numbers, of equal distances the first."""
    books = stages_of(codebook_sizes, exactly(codebooks))
    indices = np.zeros((len(x), len(books)), np.int64)
    for n, vector in enumerate(exactly(x)):
        for k, book in enumerate(books):
            distances = [squared(vector - codeword) for codeword in book]
            indices[n, k] = distances.index(min(distances))
            vector = vector - book[indices[n, k]]
    return {"indices": Truth(exactly(indices))}


def residuals(x: F4, indices: U2, books: list[Objects]) -> list[Objects]:
    """r^1 to r^(M+1), each (N, 3)."""
    found = [exactly(x)]
    for k, book in enumerate(books):
        found.append(found[-1] - book[indices[:, k]])
    return found


@precise
def commitment(x: F4, indices: U2, codebook_sizes: I8, codebooks: F4) -> Mapping[str, Truth]:
    """(10-21)."""
    left = residuals(x, indices, stages_of(codebook_sizes, exactly(codebooks)))[1:]
    loss = sum(squared(vector) for r in left for vector in r) / (3 * len(x))
    return {"loss": Truth(np.array(loss, object)), "grad_x": Truth(sum(2 * r / (3 * len(x)) for r in left))}


@precise
def rvq_update(
    x: F4, indices: U2, codebook_sizes: I8, codebooks: F4, counts: F8, sums: F8, uniforms: F8, decay: float,
    smoothing: float, dead_count: float,
) -> Mapping[str, Truth]:  # fmt: skip
    """(10-22) to (10-24)."""
    a, epsilon = mpf(decay), mpf(smoothing)
    books, of_counts, of_sums = (stages_of(codebook_sizes, exactly(rows)) for rows in (codebooks, counts, sums))
    r = residuals(x, indices, [book.copy() for book in books])
    taken = 0
    for k, book in enumerate(books):
        n_b, S_b = of_counts[k], of_sums[k]
        for b in range(len(book)):
            users = r[k][indices[:, k] == b]
            n_b[b] = a * n_b[b] + (1 - a) * len(users)
            S_b[b] = a * S_b[b] + (1 - a) * sum(users, exactly(np.zeros(3)))
        n = sum(n_b)
        for b in range(len(book)):
            smoothed = (n_b[b] + epsilon) / (n + len(book) * epsilon) * n
            if smoothed > 0:
                book[b] = S_b[b] / smoothed
        E = np.cumsum([squared(vector) for vector in r[k + 1]])
        for b in np.flatnonzero(n_b < mpf(dead_count)):
            if E[-1] > 0:
                j = next((j for j in range(len(x)) if E[j] > mpf(uniforms[taken]) * E[-1]), len(x) - 1)
                book[b], n_b[b], S_b[b] = r[k][j], mpf(1), r[k][j]
                taken += 1
    rounded = [half_value(half_bits(c, negative=c < 0)) for book in books for c in book.flat]
    return {
        "counts": Truth(np.concatenate(of_counts)),
        "sums": Truth(np.concatenate(of_sums)),
        "codebooks": Truth(np.array(rounded, object).reshape(-1, 3)),
    }
