"""The oracle of codebook updates: moving averages, dead codewords, and rounding to binary16."""

from collections.abc import Mapping
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from gsvc_base.exact.expansions import certain, exact, joined
from gsvc_base.exact.running_error import COMPONENTS, Computed, given, rounded_once, stack, with_bound
from gsvc_conformance.expectations import Bounded, Expectation

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]
I8 = NDArray[np.int64]
U2 = NDArray[np.uint16]
F = TypeVar("F", bound=np.floating)


def books_of(codebook_sizes: I8, rows: NDArray[F]) -> list[NDArray[F]]:
    """Rows that lie one stage after the other, as one array per stage."""
    return np.split(rows, np.cumsum(codebook_sizes)[:-1])


def residual(x: F4, chosen: list[F8], components: int = COMPONENTS) -> Computed:
    """The vectors minus codewords (N, 3), by running error analysis in any order of the stages."""
    return stack(given(x, components), *(-given(codewords, components) for codewords in chosen)).total(0)


def rvq_update_oracle(
    x: F4,
    indices: U2,
    codebook_sizes: I8,
    codebooks: F4,
    counts: F8,
    sums: F8,
    uniforms: F8,
    decay: float,
    smoothing: float,
    dead_count: float,
) -> Mapping[str, Expectation]:
    """Running error analysis of (10-22) to (10-24), stage by stage: see `updated_codebooks`."""
    if len(x) == 0:
        return {
            "counts": Bounded(*with_bound(rounded_once(counts)), "<f8"),
            "sums": Bounded(*with_bound(rounded_once(sums)), "<f8"),
            "codebooks": Bounded(*with_bound(given(codebooks))),
        }
    splits = [books_of(codebook_sizes, rows) for rows in (codebooks.astype(np.float64), counts, sums)]
    chosen: list[F8] = []
    parts: list[dict[str, Computed]] = []
    taken = 0
    for k, (book, of_counts, of_sums) in enumerate(zip(*splits, strict=True)):
        r = residual(x, chosen)
        chosen.append(book[indices[:, k]])
        error = residual(x, chosen)
        part, used = updated_codebooks(
            r, error, indices[:, k], book, of_counts, of_sums, uniforms[taken:], decay, smoothing, dead_count
        )
        taken += used
        parts.append(part)
    dtypes = {"counts": "<f8", "sums": "<f8", "codebooks": "<f4"}
    return {
        name: Bounded(
            certain(joined(*(part[name].number for part in parts))),
            np.concatenate([part[name].error for part in parts]),
            dtype,
        )
        for name, dtype in dtypes.items()
    }


def updated_codebooks(
    r: Computed,
    error: Computed,
    indices: U2,
    book: F8,
    counts: F8,
    sums: F8,
    uniforms: F8,
    decay: float,
    smoothing: float,
    dead_count: float,
) -> tuple[dict[str, Computed], int]:
    """The new counts (B,), sums (B, 3) and codewords (B, 3) of one stage, and how many uniform numbers it took.

    The averages follow from running error analysis, with users summed in any order. A codeword lies between the
    binary16 numbers that the ends of its interval round to.

    Parameters
    ----------
    r, error
        (N, 3), what reaches the stage and what it leaves over.
    indices
        (N,), its codewords.
    book, counts, sums
        Its state before.
    uniforms
        Those left, at least one per dead codeword.
    decay, smoothing, dead_count
        a, epsilon and the least count of a codeword that lives.

    Raises
    ------
    ValueError
        Whether a codeword is dead, or which vector replaces it, lies within the error: the inputs are no vector.
    """
    a, rest = rounded_once(decay), rounded_once(exact(1.0, COMPONENTS) - exact(decay))
    batch = r.totals(indices.astype(np.int64), len(book))
    new_counts = a * rounded_once(counts) + rest * given(np.bincount(indices, minlength=len(book)))
    new_sums = a * rounded_once(sums) + rest * batch
    total = new_counts.total()
    spread = total + given(float(len(book))) * rounded_once(smoothing)
    smoothed = (new_counts + rounded_once(smoothing)) / spread * total
    used = smoothed.value > 0
    quotient = new_sums / smoothed.where(used, given(1.0))[:, None]
    moved = quotient.where(used[:, None], given(book))

    close = new_counts.error + rounded_once(dead_count).error
    if ((close > 0) & (abs(new_counts.value - dead_count) <= close)).any():
        raise ValueError("whether a codeword is dead lies within the error of its count")
    dead = new_counts.value < dead_count
    squares = (error * error).total(1)
    drawn = _drawn(squares, uniforms[: np.count_nonzero(dead)]) if squares.value.any() else []
    vectors, revived = np.zeros(len(book), np.int64), np.zeros(len(book), np.bool_)
    of_drawn = np.flatnonzero(dead)[: len(drawn)]
    vectors[of_drawn], revived[of_drawn] = drawn, True
    there = ~revived
    return {
        "counts": new_counts.where(there, given(1.0)),
        "sums": new_sums.where(there[:, None], r[vectors]),
        "codebooks": _in_half(moved.where(there[:, None], r[vectors])),
    }, len(drawn)


def _drawn(squares: Computed, uniforms: F8) -> list[int]:
    """The vectors that uniform numbers choose among squared errors (N,), by (10-24)."""
    reach, total = np.cumsum(squares.value), squares.total()
    passed = rounded_once(uniforms)[:, None] * total  # y E
    errors = passed.error + total.error  # no partial sum is further off than all of it
    if ((errors > 0) & (abs(passed.value - reach) <= errors)).any():
        raise ValueError("a uniform number lies too close to the border between two vectors")
    return [int(np.count_nonzero(reach <= border)) for border in passed.value]


def _in_half(number: Computed) -> Computed:
    """Rounded to binary16, once."""
    value, lowest, highest = (
        end.astype(np.float16).astype(np.float64)
        for end in (number.number.odd(), number.value - number.error, number.value + number.error)
    )
    return Computed(exact(value), np.maximum(highest - value, value - lowest))
