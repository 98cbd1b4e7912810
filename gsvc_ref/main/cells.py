"""How many splats each cell of an I-frame has, by halving the frame (spec.md section 15.8)."""

from itertools import accumulate
from typing import Final, NamedTuple

import numpy as np

from gsvc_base.arrays import I8
from gsvc_base.errors import UsageError
from gsvc_ref._jit import kernel
from gsvc_ref.main.densities import ALPHAS, cumulative_at
from gsvc_ref.main.passes import TOTAL, Distributions, Run
from gsvc_ref.main.tables import EXP2, LOGISTIC

CELL: Final = 4
"""Side of a cell in pixels."""

MAX_BINOMIAL: Final = 15
"""Most splats of a part whose halves are alike that have the beta-binomial distribution (15-8)."""

COUNT_BITS: Final = 9
"""The bits of the number in a first half that have a density; those below them are raw (15-9)."""


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


def _equal_halves(n: int, alpha: int) -> list[int]:
    """C[1] to C[n] of the number of n splats in the first of equal halves (15-8)."""
    weights = [2**16]
    for i in range(n // 2):
        weights.append(weights[i] * (n - i) * (i + alpha) // ((i + 1) * (n - i - 1 + alpha)))
    *sums, total = accumulate(weights[min(i, n - i)] for i in range(n + 1))
    return [i + (TOTAL - n - 1) * part // total for i, part in enumerate(sums, 1)]


HALVES: Final[I8] = np.concatenate([_equal_halves(n, alpha) for alpha in ALPHAS for n in range(1, MAX_BINOMIAL + 1)])
"""C[1] to C[n] of (15-8) for all n up to MAX_BINOMIAL and all shapes, (960,)."""


@kernel(inline=True)
def place_of_halves(n: int, alpha: int) -> int:
    """Where HALVES begins for n splats and a shape alpha."""
    place = n * (n - 1) // 2
    for shape in ALPHAS:
        if shape == alpha:
            break
        place += MAX_BINOMIAL * (MAX_BINOMIAL + 1) // 2
    return place


@kernel(inline=True)
def half_density(n: int, first: int, second: int, alpha: int) -> tuple[int, int, int]:
    """The raw low bits, the centre and the `scale_code` of the density of the number in the first half (15-9)."""
    r = 0
    while n >> (COUNT_BITS + r):
        r += 1
    m, b = n >> r, 256 * first // (first + second)  # b: the expected share in 1/256
    t = (2 * alpha + m) * 1245 // (2 * alpha + 1)
    v = max((((m * b * (256 - b)) >> 9) * t) >> 7, 1)  # the variance of both, in 1/64^2
    e = 0
    while v >> (e + 1):
        e += 1
    return r, m * b // 4, 2 * e + (v >> (e - 1) & 1 if e > 0 else 0)  # log2 of the deviation in quarters


@kernel(inline=True)
def cumulative_of_half(i: int, m: int, centre: int, scale_code: int) -> int:
    """C[i] of the density of the number of m splats in the first half, 0 < i <= m (15-6)."""
    return cumulative_at(i, m + 1, 64 * (2 * i - 1), centre, scale_code, 0, EXP2, LOGISTIC)


@kernel()
def _half_frequencies(n: int, first: int, second: int, alpha: int) -> tuple[I8, int]:
    """Cumulative frequencies of the number of n splats in the first half, and how many of its low bits are raw."""
    if n <= MAX_BINOMIAL and first == second:
        C, place = np.empty(n + 2, np.int64), place_of_halves(n, alpha)
        C[0], C[n + 1] = 0, TOTAL
        for i in range(n):
            C[i + 1] = HALVES[place + i]
        return C, 0
    r, centre, scale_code = half_density(n, first, second, alpha)
    m = n >> r
    C = np.empty(m + 2, np.int64)
    C[0], C[m + 1] = 0, TOTAL
    for i in range(1, m + 1):
        C[i] = cumulative_of_half(i, m, centre, scale_code)
    return C, r


class Halves(NamedTuple):
    """The numbers of splats in the first halves of the parts that have a choice."""

    asked: I8  # (n,), the indices of these parts
    tables: Distributions  # of each number without its raw bits
    low_bits: I8  # (n,), how many low bits of each number are raw


@kernel()
def halves_of(counts: I8, origins: I8, axis: int, size: int, inside: int, alpha: int) -> Halves:
    """The distributions of the numbers of splats in the first halves of parts (15-8), (15-9).

    `counts` (N,) and `origins` (N, 2) are the splats of each part, and its first column and row. Parts are halved along
    `axis`, where a first half has `size` cells and the frame `inside`.
    """
    asked = np.empty(len(counts), np.int64)
    first = np.zeros(len(counts) + 1, np.int64)
    low = np.zeros(len(counts), np.int64)
    most = many = 0
    for part in range(len(counts)):
        most += min(counts[part], (1 << COUNT_BITS) - 1) + 2
    cumulative = np.empty(most, np.int64)
    for part in range(len(counts)):
        second = min(size, inside - origins[part, axis] - size)
        if second > 0:  # a part whose second half is outside has all splats in its first one
            C, low[many] = _half_frequencies(counts[part], size, second, alpha)
            asked[many] = part
            first[many + 1] = first[many] + len(C)
            for i in range(len(C)):
                cumulative[first[many] + i] = C[i]
            many += 1
    return Halves(asked[:many], Distributions(cumulative[: first[many]], first[: many + 1]), low[:many])


def half_distribution(n: int, first: int, second: int, alpha: int) -> tuple[I8, int]:
    """Cumulative frequencies of the number of n >= 1 splats in the first half of a part, and its raw low bits.

    `first` and `second` are the p and q of (15-8), (15-9). A shape `alpha` of 1 spreads splats evenly over all numbers,
    and large ones put half of them into each half.
    """
    cumulative, low = _half_frequencies(n, first, second, alpha)
    return cumulative, int(low)


@kernel()
def halved(counts: I8, origins: I8, axis: int, size: int, asked: I8, answers: I8) -> tuple[I8, I8]:
    """Counts and origins of the halves that have splats, each first half before the second one."""
    after, places = np.empty(2 * len(counts), np.int64), np.empty((2 * len(counts), 2), np.int64)
    k = many = 0
    for part in range(len(counts)):
        first = counts[part]
        if k < len(asked) and asked[k] == part:
            first = min(answers[k], first)
            k += 1
        for half in range(2):
            n = counts[part] - first if half else first
            if n > 0:
                after[many] = n
                places[many, axis] = origins[part, axis] + (size if half else 0)
                places[many, 1 - axis] = origins[part, 1 - axis]
                many += 1
    return after[:many], places[:many]


def splats_in_first_halves(cells: I8, counts: I8, origins: I8, axis: int, size: int) -> I8:
    """How many of each part's splats (n,), which stand in a row in cells (N, 2), are in its first half, (n,)."""
    part = np.repeat(np.arange(len(counts)), counts)
    return np.bincount(part[cells[:, axis] < origins[part, axis] + size], minlength=len(counts)).astype(np.int64)


def code_cells(run: Run, count: int, width: int, height: int, alphas: tuple[int, ...], cells: I8 | None = None) -> I8:
    """Column and row of the cell of each of `count` >= 1 splats, (count, 2) in the order of `cell_order`.

    `alphas` are the shapes of the halvings, of which each is a pass; `cells` are None where the run makes them.
    """
    inside = cell_counts(width, height)
    size = 1 << (len(alphas) // 2)
    origins, counts = np.zeros((1, 2), np.int64), np.array([count], np.int64)
    for halving, alpha in enumerate(alphas):
        axis = halving % 2
        size = size >> 1 if axis == 0 else size
        asked, tables, low = halves_of(counts, origins, axis, size, inside[axis], alpha)
        answers = asked
        if len(asked):
            given = None if cells is None else splats_in_first_halves(cells, counts, origins, axis, size)[asked]
            at = halving + 1
            answers = run.symbols(at, tables, np.arange(len(asked)), None if given is None else given >> low)
            if low.any():
                answers = (answers << low) + run.raw_bits(at, low, None if given is None else given & ((1 << low) - 1))
        counts, origins = halved(counts, origins, axis, size, asked, answers)
    return np.repeat(origins, counts, axis=0)


def cells_of_halves(first_halves: I8, count: int, width: int, height: int) -> I8:
    """Column and row of the cell of each of `count` splats, by how many are in the first half of each part.

    Raises
    ------
    UsageError
        There are more or fewer numbers than parts with splats.
    """
    inside, size = cell_counts(width, height), 1 << (halving_count(width, height) // 2)
    origins, counts = np.zeros((1, 2), np.int64), np.array([count], np.int64)
    at = 0
    for halving in range(halving_count(width, height)):
        axis = halving % 2
        size = size >> 1 if axis == 0 else size
        asked = np.flatnonzero(origins[:, axis] + size < inside[axis])
        numbers = first_halves[at : at + len(counts)]
        at += len(counts)
        if at > len(first_halves):
            break
        counts, origins = halved(counts, origins, axis, size, asked, numbers[asked])
    if at != len(first_halves):
        raise UsageError(f"first_halves has {len(first_halves)} numbers; it must have one for each part with splats")
    return np.repeat(origins, counts, axis=0)
