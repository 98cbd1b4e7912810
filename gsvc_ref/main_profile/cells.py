"""How many splats each cell of an I-frame has, by halving the frame (spec.md section 15.8)."""

from typing import Final

import numpy as np

from gsvc_ref._jit import kernel
from gsvc_ref.arrays import I8
from gsvc_ref.main_profile.densities import density_at
from gsvc_ref.main_profile.passes import ONE, Distributions, Run
from gsvc_ref.main_profile.tables import EXP2, FAMILIES

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


@kernel()
def _halves(
    counts: I8, origins: I8, axis: int, size: int, inside: int, alpha: int, exp2: I8, logistic: I8
) -> tuple[I8, I8, I8, I8]:
    """Of the number of splats in the first half of each part that is asked: (15-8), (15-9).

    Parameters
    ----------
    counts, origins
        The splats of each part (N,), and its first column and row (N, 2).
    axis, size
        The axis along which parts are halved, and the cells of a first half along it.
    inside
        The cells of the frame along it.
    alpha
        The shape: 1 spreads splats evenly over all numbers, large ones put half of them into each half.
    exp2, logistic
        The tables of section 15.3.

    Returns
    -------
    The indices of the parts that are asked; cumulative frequencies, one distribution behind the other, and where each
    begins, as `Distributions` have them; and how many low bits of each number are raw.
    """
    asked = np.empty(len(counts), np.int64)
    first = np.zeros(len(counts) + 1, np.int64)
    low = np.zeros(len(counts), np.int64)
    many = 0
    for part in range(len(counts)):
        second = min(size, inside - origins[part, axis] - size)
        if second > 0:
            n, r = counts[part], 0
            if n > _MOST_TABLED or second < size:
                while n >> (9 + r):
                    r += 1
            asked[many], low[many] = part, r
            first[many + 1] = first[many] + (n >> r) + 2
            many += 1
    cumulative = np.empty(first[many], np.int64)
    weights = np.empty(_MOST_TABLED + 1, np.int64)
    for k in range(many):
        n = counts[asked[k]]
        second = min(size, inside - origins[asked[k], axis] - size)
        C = cumulative[first[k] : first[k + 1]]
        if second == size and n <= _MOST_TABLED:
            weights[0] = 2**16
            for i in range(n // 2):
                weights[i + 1] = weights[i] * (n - i) * (i + alpha) // ((i + 1) * (n - i - 1 + alpha))
            total = 0
            for i in range(n + 1):
                total += weights[min(i, n - i)]
            part_of_total = 0
            for i in range(n + 1):
                C[i] = i + (ONE - n - 1) * part_of_total // total
                part_of_total += weights[min(i, n - i)]
            C[n + 1] = ONE
            continue
        m, b = n >> low[k], 256 * size // (size + second)
        v = max(m * b * (256 - b) * (2 * alpha + m) * 1245 // ((2 * alpha + 1) << 16), 1)
        e = 0
        while v >> (e + 1):
            e += 1
        scale_code = 2 * e + (v >> (e - 1) & 1 if e > 0 else 0)
        C[0], C[m + 1] = 0, ONE
        for i in range(1, m + 1):
            reached = density_at(64 * (2 * i - 1), m * b // 4, scale_code, 0, exp2, logistic)
            C[i] = i + ((ONE - m - 1) * reached >> 16)
    return asked[:many], cumulative, first[: many + 1], low[:many]


def half_distribution(n: int, first: int, second: int, alpha: int) -> tuple[I8, int]:
    """Of the number of n splats that are in the first half of a part (15-8), (15-9).

    Parameters
    ----------
    n
        The splats of the part, at least 1.
    first, second
        p and q, the cells of both halves inside of the frame along the side that is halved.
    alpha
        The shape, as in `_halves`.

    Returns
    -------
    The cumulative frequencies, and how many low bits of the number are raw.
    """
    origin = np.zeros((1, 2), np.int64)
    counts = np.array([n], np.int64)
    _, cumulative, _, low = _halves(counts, origin, 0, first, first + second, alpha, EXP2, FAMILIES[0])
    return cumulative, int(low[0])


@kernel()
def _halved(counts: I8, origins: I8, axis: int, size: int, asked: I8, answers: I8) -> tuple[I8, I8]:
    """Counts and origins of the halves that have splats, each first half before the second one."""
    halves, places = np.empty(2 * len(counts), np.int64), np.empty((2 * len(counts), 2), np.int64)
    k = many = 0
    for part in range(len(counts)):
        first = counts[part]
        if k < len(asked) and asked[k] == part:
            first = min(answers[k], first)
            k += 1
        for half in range(2):
            n = counts[part] - first if half else first
            if n > 0:
                halves[many] = n
                places[many] = origins[part]
                places[many, axis] += size if half else 0
                many += 1
    return halves[:many], places[:many]


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
        asked, cumulative, begins, low = _halves(counts, origins, axis, size, inside[axis], alpha, EXP2, FAMILIES[0])
        if len(asked):
            given = None
            if cells is not None:  # how many of each part's splats, which stand in a row, are in its first half
                part = np.repeat(np.arange(len(counts)), counts)
                given = np.bincount(part[cells[:, axis] < origins[part, axis] + size], minlength=len(counts))[asked]
            which = np.arange(len(asked))
            high = run.symbols(Distributions(cumulative, begins), which, None if given is None else given >> low)
            if low.any():
                high = (high << low) + run.raw_bits(low, None if given is None else given & ((1 << low) - 1))
        else:
            high = asked
        counts, origins = _halved(counts, origins, axis, size, asked, high)
    return np.repeat(origins, counts, axis=0)
