"""How many splats each cell of an I-frame has, by halving the frame (spec.md section 15.8)."""

from functools import lru_cache
from typing import Final

import numpy as np

from gsvc_ref.arrays import I8
from gsvc_ref.main_profile.densities import cumulative
from gsvc_ref.main_profile.passes import ONE, Distributions, Run

CELL: Final = 4
"""Side of a cell in pixels."""

_MOST_TABLED: Final = 15


def cell_counts(width: int, height: int) -> tuple[int, int]:
    """Columns and rows of cells."""
    return -(-width // CELL), -(-height // CELL)


def halving_count(width: int, height: int) -> int:
    """How often the frame is halved: 2a."""
    return 2 * (max(cell_counts(width, height)) - 1).bit_length()


def cell_keys(cells: I8, width: int, height: int) -> I8:
    """Numbers (N,) that grow with the order of cells (N, 2): the bits of row and column in turn."""
    keys = np.zeros(len(cells), np.int64)
    for bit in range(halving_count(width, height) // 2):
        keys |= (cells[:, 0] >> bit & 1) << (2 * bit + 1) | (cells[:, 1] >> bit & 1) << (2 * bit)
    return keys


def cell_order(cells: I8, width: int, height: int) -> I8:
    """The order of splats by their cells (N, 2): indices (N,), equal cells as they are."""
    return np.argsort(cell_keys(cells, width, height), kind="stable")


@lru_cache(maxsize=1 << 14)
def half_distribution(n: int, first: int, second: int, alpha: int) -> tuple[I8, int]:
    """Of the number of n splats that are in the first half of a part (15-8), (15-9).

    Parameters
    ----------
    n
        The splats of the part, at least 1.
    first, second
        p and q, the cells of both halves inside of the frame along the side that is halved.
    alpha
        The shape: 1 spreads splats evenly over all numbers, large ones put half of them into each half.

    Returns
    -------
    The cumulative frequencies, and how many low bits of the number are raw.
    """
    if first == second and n <= _MOST_TABLED:
        w = [2**16]
        for i in range(n // 2):
            w.append(w[i] * (n - i) * (i + alpha) // ((i + 1) * (n - i - 1 + alpha)))
        weights = np.array([w[min(i, n - i)] for i in range(n + 1)], np.int64)
        inner = np.arange(1, n + 1) + (ONE - n - 1) * np.cumsum(weights)[:-1] // weights.sum()
        return np.concatenate([[0], inner, [ONE]]), 0
    r = max(0, n.bit_length() - 9)
    m, b = n >> r, 256 * first // (first + second)
    v = m * b * (256 - b) * (2 * alpha + m) * 1245 // ((2 * alpha + 1) << 16)
    e = max(v, 1).bit_length() - 1
    scale_code = 2 * e + (v >> (e - 1) & 1 if e > 0 else 0)
    edges = 64 * (2 * np.arange(1, m + 1) - 1)
    return cumulative(edges, m * b // 4, 0, scale_code, 0), r


def code_cells(run: Run, count: int, width: int, height: int, alphas: tuple[int, ...], cells: I8 | None = None) -> I8:
    """Column and row of the cell of each splat, (count, 2) in the order of `cell_order`.

    Parameters
    ----------
    run
        The run of the frame.
    count
        The number of splats, at least 1.
    width, height
        Size of the frame in pixels.
    alphas
        The shape of each halving.
    cells
        The cells in that order, where a frame is written.
    """
    inside = cell_counts(width, height)
    size = 1 << (len(alphas) // 2)
    origins, counts = np.zeros((1, 2), np.int64), np.array([count], np.int64)
    for halving, alpha in enumerate(alphas):
        axis = halving % 2
        size = size >> 1 if axis == 0 else size
        second = np.minimum(size, inside[axis] - origins[:, axis] - size)
        first = counts.copy()
        asked = np.flatnonzero(second > 0)
        given = None
        if cells is not None:  # how many of each part's splats, which stand in a row, are in its first half
            part = np.repeat(np.arange(len(counts)), counts)
            given = np.bincount(part[cells[:, axis] < origins[part, axis] + size], minlength=len(counts))[asked]
        keys = counts[asked] * (size + 1) + second[asked]
        unique, which = np.unique(keys, return_inverse=True)
        tables = [half_distribution(int(key) // (size + 1), size, int(key) % (size + 1), alpha) for key in unique]
        low = np.array([r for _, r in tables], np.int64)[which] if len(which) else which
        high = run.symbols(
            Distributions.of([table for table, _ in tables]), which, None if given is None else given >> low
        )
        rest = run.raw_bits(low, None if given is None else given & ((1 << low) - 1))
        first[asked] = np.minimum((high << low) + rest, counts[asked])
        others = origins.copy()
        others[:, axis] += size
        counts = np.stack([first, counts - first], axis=1).ravel()
        origins = np.stack([origins, others], axis=1).reshape(-1, 2)[counts > 0]
        counts = counts[counts > 0]
    return np.repeat(origins, counts, axis=0)
