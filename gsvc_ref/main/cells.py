"""How many splats each cell of an I-frame has, by halving the frame (spec.md section 15.8)."""

from typing import Final

import numpy as np

from gsvc_base.arrays import I8
from gsvc_ref._jit import kernel
from gsvc_ref.main.densities import density_at
from gsvc_ref.main.fast.lanes import MISSING_WORD, Lanes, read_raw, take_symbol
from gsvc_ref.main.passes import ONE, Distributions, Run
from gsvc_ref.main.tables import EXP2, FAMILIES

CELL: Final = 4
"""Side of a cell in pixels."""

_MOST_TABLED: Final = 15
_MOST_OF_DENSITY: Final = 511


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


@kernel(inline=True)
def _small_half(n: int, alpha: int, C: I8) -> None:
    """Cumulative frequencies of the number of n splats, at most 15, in the first of two halves alike (15-8)."""
    weight, total = 2**16, 0
    for i in range(n + 1):
        C[i + 1] = C[n - i + 1] = weight
        if i == n // 2:
            break
        weight = weight * (n - i) * (i + alpha) // ((i + 1) * (n - i - 1 + alpha))
    for i in range(n + 1):
        total += C[i + 1]
    part_of_total = 0
    for i in range(n + 1):
        weight = C[i + 1]
        C[i] = i + (ONE - n - 1) * part_of_total // total
        part_of_total += weight
    C[n + 1] = ONE


@kernel(inline=True)
def _half_density(n: int, first: int, second: int, alpha: int) -> tuple[int, int, int]:
    """The raw low bits, the centre and the `scale_code` of the density of the number in the first half (15-9)."""
    r = 0
    while n >> (9 + r):
        r += 1
    m, b = n >> r, 256 * first // (first + second)
    v = max(m * b * (256 - b) * (2 * alpha + m) * 1245 // ((2 * alpha + 1) << 16), 1)
    e = 0
    while v >> (e + 1):
        e += 1
    return r, m * b // 4, 2 * e + (v >> (e - 1) & 1 if e > 0 else 0)


@kernel(inline=True)
def _density_of_half(i: int, m: int, centre: int, scale_code: int) -> int:
    """C[i] of the density of the number of m splats in the first half, 0 < i <= m (15-6)."""
    return i + ((ONE - m - 1) * density_at(64 * (2 * i - 1), centre, scale_code, 0, EXP2, FAMILIES[0]) >> 16)


@kernel()
def _half_frequencies(n: int, first: int, second: int, alpha: int) -> tuple[I8, int]:
    """Cumulative frequencies of the number of n splats in the first half, and how many of its low bits are raw."""
    if n <= _MOST_TABLED and first == second:
        C = np.empty(n + 2, np.int64)
        _small_half(n, alpha, C)
        return C, 0
    r, centre, scale_code = _half_density(n, first, second, alpha)
    m = n >> r
    C = np.empty(m + 2, np.int64)
    C[0], C[m + 1] = 0, ONE
    for i in range(1, m + 1):
        C[i] = _density_of_half(i, m, centre, scale_code)
    return C, r


@kernel()
def _halves(counts: I8, origins: I8, axis: int, size: int, inside: int, alpha: int) -> tuple[I8, I8, I8, I8]:
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
        The shape, as in `half_distribution`.

    Returns
    -------
    The indices of the parts that are asked; cumulative frequencies, one distribution behind the other, and where each
    begins, as `Distributions` have them; and how many low bits of each number are raw.
    """
    asked = np.empty(len(counts), np.int64)
    first = np.zeros(len(counts) + 1, np.int64)
    low = np.zeros(len(counts), np.int64)
    most = many = 0
    for part in range(len(counts)):
        most += min(counts[part], _MOST_OF_DENSITY) + 2
    cumulative = np.empty(most, np.int64)
    for part in range(len(counts)):
        second = min(size, inside - origins[part, axis] - size)
        if second > 0:
            C, low[many] = _half_frequencies(counts[part], size, second, alpha)
            asked[many] = part
            first[many + 1] = first[many] + len(C)
            for i in range(len(C)):
                cumulative[first[many] + i] = C[i]
            many += 1
    return asked[:many], cumulative[: first[many]], first[: many + 1], low[:many]


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
    cumulative, low = _half_frequencies(n, first, second, alpha)
    return cumulative, int(low)


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
                places[many, axis] = origins[part, axis] + (size if half else 0)
                places[many, 1 - axis] = origins[part, 1 - axis]
                many += 1
    return halves[:many], places[:many]


def code_cells(run: Run, count: int, width: int, height: int, alphas: tuple[int, ...], cells: I8 | None = None) -> I8:
    """Column and row of the cell of each splat, (count, 2) in the order of `cell_order`; `read_cells` reads them.

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
        The cells in that order; None where the run makes them.
    """
    inside = cell_counts(width, height)
    size = 1 << (len(alphas) // 2)
    origins, counts = np.zeros((1, 2), np.int64), np.array([count], np.int64)
    for halving, alpha in enumerate(alphas):
        axis = halving % 2
        size = size >> 1 if axis == 0 else size
        asked, cumulative, begins, low = _halves(counts, origins, axis, size, inside[axis], alpha)
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


@kernel()
def read_cells(lanes: Lanes, inside: tuple[int, int], alphas: I8, cells: I8) -> bool:
    """Column and row of the cell of each splat, in the order of `cell_order` (spec.md section 15.8).

    Parameters
    ----------
    lanes
        The lanes of the frame.
    inside
        Columns and rows of cells.
    alphas
        (2 a,), the shape of each halving.
    cells
        (count, 2), where the cells are put.

    Returns
    -------
    Whether the words sufficed.
    """
    many = 1
    counts, origins = np.empty(len(cells), np.int64), np.zeros((len(cells), 2), np.int64)
    halves, places = np.empty(len(cells), np.int64), np.empty((len(cells), 2), np.int64)
    answers, sizes, low = np.empty(len(cells), np.int64), np.empty(len(cells), np.int64), np.empty(len(cells), np.int64)
    counts[0] = len(cells)
    size = 1 << (len(alphas) // 2)
    for halving in range(len(alphas)):
        axis = halving % 2
        size = size >> 1 if axis == 0 else size
        if not _read_halves(lanes, counts[:many], origins, axis, size, inside[axis], alphas[halving], answers, sizes):
            return False
        if not read_raw(lanes, sizes[:many], low):
            return False
        after = 0
        for part in range(many):
            first = min((answers[part] << sizes[part]) + low[part], counts[part])
            for half in range(2):
                n = counts[part] - first if half else first
                if n > 0:
                    halves[after] = n
                    places[after, axis] = origins[part, axis] + (size if half else 0)
                    places[after, 1 - axis] = origins[part, 1 - axis]
                    after += 1
        counts, halves, origins, places, many = halves, counts, places, origins, after
    splat = 0
    for part in range(many):
        for _ in range(counts[part]):
            cells[splat, 0], cells[splat, 1] = origins[part, 0], origins[part, 1]
            splat += 1
    return True


@kernel()
def _read_halves(
    lanes: Lanes, counts: I8, origins: I8, axis: int, size: int, inside: int, alpha: int, answers: I8, sizes: I8
) -> bool:
    """A pass of the upper bits of how many splats are in the first half of each part, and how many lower ones it has.

    A part that is not asked has all splats in its first half.
    """
    states, words, mask = lanes.states, lanes.words, len(lanes.states) - 1
    taken, place, length = lanes.taken[0], 0, 0
    small, known = np.empty((_MOST_TABLED + 1, _MOST_TABLED + 2), np.int64), np.zeros(_MOST_TABLED + 1, np.bool_)
    for part in range(len(counts)):
        n, second = counts[part], min(size, inside - origins[part, axis] - size)
        answers[part], sizes[part] = n, 0
        if second <= 0:
            continue
        x = states[place & mask]
        slot = x & (ONE - 1)
        if n <= _MOST_TABLED and size == second:
            if not known[n]:
                _small_half(n, alpha, small[n])
                known[n] = True
            k = 0
            while small[n, k + 1] <= slot:
                k += 1
            start, end = small[n, k], small[n, k + 1]
        else:
            sizes[part], centre, scale_code = _half_density(n, size, second, alpha)
            m = n >> sizes[part]
            k, above, start, end = 0, m + 1, 0, ONE
            while above - k > 1:  # C[k] is start <= slot, C[above] is end > slot
                middle = (k + above) >> 1
                c = _density_of_half(middle, m, centre, scale_code)
                if c <= slot:
                    k, start = middle, c
                else:
                    above, end = middle, c
        answers[part] = k
        x, taken = take_symbol(x, start, end - start, words, taken)
        if taken == MISSING_WORD:
            return False
        states[place & mask] = x
        place += 1
        length += lanes.lengths[end - start - 1]
    lanes.taken[0] = taken
    lanes.spent[0] += length
    return True
