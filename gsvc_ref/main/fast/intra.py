"""The splats of an I-frame, or the new ones of a P-frame, out of their lanes, pass by pass (spec.md section 15.9)."""

from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from gsvc_base.arrays import I8
from gsvc_ref._jit import kernel
from gsvc_ref.main.cells import HALVES, MAX_BINOMIAL, cell_counts, cumulative_of_half, half_density, place_of_halves
from gsvc_ref.main.codes import CodeArrays
from gsvc_ref.main.densities import (
    ALPHAS,
    MAGNITUDE_CLASSES,
    PLANES,
    Densities,
    magnitude_distributions,
    windows_of,
)
from gsvc_ref.main.fast.lanes import (
    CELLS,
    CHROMA,
    LUMA,
    PLACE,
    SHEAR_PART,
    SIZE,
    Lanes,
    read_low_bits,
    read_raw,
    read_signs,
    read_symbols,
    take_symbol,
)
from gsvc_ref.main.passes import NONE, TOTAL, Distributions
from gsvc_ref.main.reconstruct import find_intra_state, log_size, place_unit
from gsvc_ref.main.state import CLASSES, N_MOST, class_of


class Tables(NamedTuple):
    """What the symbols of an I-frame are distributed by."""

    columns: int  # of cells
    rows: int
    alphas: I8  # (2 a,), the shape of each halving
    distributions: Distributions  # of the classes of luma, chroma1 and chroma2, then windows of size, aspect and shear
    low_bits: I8  # (3, 11), raw ones of size, aspect and shear, by the class of a splat
    first: I8  # (3, 11), their first bins


@lru_cache(maxsize=64)
def tables_of(densities: Densities, width: int, height: int) -> Tables:
    """The tables of the densities of a frame."""
    alphas = np.array([ALPHAS[code] for code in densities.halving_codes], np.int64)
    windows = [windows_of(plane, densities.of(plane)) for plane in PLANES[3:]]
    parts = [*map(magnitude_distributions, densities.planes[:3]), *(window.distributions for window in windows)]
    low_bits, first = (np.stack([window[k] for window in windows]) for k in (1, 2))
    return Tables(*cell_counts(width, height), alphas, Distributions.joined(parts), low_bits, first)


NO_TABLES: Final = Tables(0, 0, NONE, Distributions(NONE, NONE), NONE.reshape(0, 0), NONE.reshape(0, 0))
"""The tables of no splats."""


class New(NamedTuple):
    """The splats that are read, and what is known of them between passes."""

    step: int  # D in 1/16
    codes: CodeArrays
    counts: I8  # (2, N), the splats of each part before and after a halving, in turn
    origins: I8  # (2, N, 2), its first column and row
    parts: I8  # (2,), how many parts there are
    answers: I8  # (N,), for a pass: symbols
    sizes: I8  # (N,), and how many raw bits go with them
    low: I8  # (N,)
    rows: I8  # (N,), their distributions
    j: I8  # (N,), the classes of luma, which are the contexts of chroma, then those of the splats


@kernel()
def new_splats(step: int, codes: CodeArrays) -> New:
    """The state of reading before the first pass; what is read is put into `codes`."""
    count = len(codes.cells)
    counts, origins, parts = np.zeros((2, count), np.int64), np.zeros((2, count, 2), np.int64), np.zeros(2, np.int64)
    if count:
        counts[0, 0], parts[0] = count, 1
    answers, sizes, low = np.empty(count, np.int64), np.empty(count, np.int64), np.empty(count, np.int64)
    rows, j = np.empty(count, np.int64), np.zeros(count, np.int64)
    return New(step, codes, counts, origins, parts, answers, sizes, low, rows, j)


class Halving(NamedTuple):
    """A halving: its axis, the cells of a first half along it, those of the frame, and the shape alpha."""

    axis: int
    size: int
    inside: int
    alpha: int


@kernel()
def read_intra_pass(lanes: Lanes, tables: Tables, at: int, new: New) -> bool:
    """The part of the pass `at` that is about new splats, if there is one, and the early raw bits after it."""
    halvings, out, symbols = len(tables.alphas), new.codes, new.answers
    if at <= halvings:
        return read_halving(lanes, tables, at - 1, new)
    if at == halvings + 1:
        if not read_plane(lanes, LUMA, tables, 0, new, symbols):
            return False
        for splat in range(len(symbols)):
            new.j[splat] = symbols[splat]
        read_low_bits(lanes, LUMA, symbols)
        for splat in range(len(symbols)):
            out.colors[splat, 0] = symbols[splat]
    elif at == halvings + 2:
        if not read_plane(lanes, CHROMA, tables, 1, new, symbols):
            return False
        if not read_plane(lanes, CHROMA, tables, 2, new, new.low):
            return False
        read_low_bits(lanes, CHROMA, symbols)
        read_low_bits(lanes, CHROMA, new.low)
        for splat in range(len(symbols)):
            out.colors[splat, 1], out.colors[splat, 2] = symbols[splat], new.low[splat]
        find_classes(new)
    elif at == halvings + 3:
        for plane in range(3):
            if not read_plane(lanes, SIZE + plane, tables, 3 + plane, new, symbols):
                return False
            for splat in range(len(symbols)):
                out.shapes[splat, plane] = symbols[splat]
        for plane in range(2):  # no place depends on shear, so that its low bits are late
            read_window_bits(lanes, SIZE + plane, tables, plane, new)
    return True


@kernel()
def read_plane(lanes: Lanes, part: int, tables: Tables, plane: int, new: New, symbols: I8) -> bool:
    """The symbols of a plane of all splats, by the classes `new.j` of luma or of splats."""
    first = plane * MAGNITUDE_CLASSES if plane < 3 else 3 * MAGNITUDE_CLASSES + (plane - 3) * CLASSES
    for splat in range(len(symbols)):
        new.rows[splat] = first + new.j[splat]
    return read_symbols(lanes, part, tables.distributions, new.rows, symbols)


@kernel()
def find_classes(new: New) -> None:
    """The class of each splat: it follows from the colour without its signs, and says which windows the shape has."""
    most, color = N_MOST // new.step, np.empty(3, np.int64)
    for splat in range(len(new.j)):
        for axis in range(3):
            color[axis] = min(new.codes.colors[splat, axis], most) * new.step
        new.j[splat] = class_of(color, new.step)


@kernel()
def read_window_bits(lanes: Lanes, part: int, tables: Tables, plane: int, new: New) -> None:
    """The low bits of size, aspect or shear (plane 0, 1 or 2), whose bins are in `new.codes`: the codes (15-7)."""
    sizes, j, shapes = new.sizes, new.j, new.codes.shapes
    for splat in range(len(j)):
        sizes[splat] = tables.low_bits[plane, j[splat]]
    read_raw(lanes, part, sizes, new.low)
    for splat in range(len(j)):
        upper = shapes[splat, plane] + tables.first[plane, j[splat]]
        shapes[splat, plane] = (upper << sizes[splat]) + new.low[splat]


@kernel()
def put_cells(new: New) -> None:
    """Column and row of the cell of each splat, out of the parts after the last of an even number of halvings."""
    splat = 0
    for part in range(new.parts[0]):
        for _ in range(new.counts[0, part]):
            new.codes.cells[splat, 0], new.codes.cells[splat, 1] = new.origins[0, part, 0], new.origins[0, part, 1]
            splat += 1


@kernel()
def intra_late_count(tables: Tables, new: New) -> int:
    """How many late bits new splats have: signs, low bits of shear, and places."""
    count, out = 0, new.codes
    for splat in range(len(new.j)):
        j = new.j[splat]
        for axis in range(3):
            count += out.colors[splat, axis] != 0
        count += tables.low_bits[2, j]
        for axis in range(2):
            count += 2 - place_unit(log_size(out.shapes[splat, 0], out.shapes[splat, 1], j, axis), j)
    return count


@kernel()
def read_intra_late(lanes: Lanes, tables: Tables, new: New, state: I8) -> None:
    """The late bits of new splats, and the state (N, 8) that all codes stand for."""
    out, numbers = new.codes, new.answers
    for plane in range(3):
        for splat in range(len(numbers)):
            numbers[splat] = out.colors[splat, plane]
        read_signs(lanes, CHROMA if plane else LUMA, numbers)
        for splat in range(len(numbers)):
            out.colors[splat, plane] = numbers[splat]
    put_cells(new)
    read_window_bits(lanes, SHEAR_PART, tables, 2, new)
    for axis in range(2):
        for splat in range(len(numbers)):
            size = log_size(out.shapes[splat, 0], out.shapes[splat, 1], new.j[splat], axis)
            new.sizes[splat] = 2 - place_unit(size, new.j[splat])  # 2^2 pixels are a cell
        read_raw(lanes, PLACE, new.sizes, numbers)
        for splat in range(len(numbers)):
            out.places[splat, axis] = numbers[splat]
    find_intra_state(out, new.step, state)


@kernel()
def read_halving(lanes: Lanes, tables: Tables, halving: int, new: New) -> bool:
    """A halving of the frame (spec.md section 15.8)."""
    before = axis = halving & 1  # left and right in turn with above and below
    many, answers, sizes, low = new.parts[before], new.answers, new.sizes, new.low
    counts, origins = new.counts[before], new.origins[before]
    halves, places = new.counts[1 - before], new.origins[1 - before]
    size = 1 << ((len(tables.alphas) - halving - 1) // 2)
    this = Halving(axis, size, tables.rows if axis else tables.columns, tables.alphas[halving])
    if not read_halves(lanes, counts[:many], origins, this, answers, sizes):
        return False
    read_raw(lanes, CELLS, sizes[:many], low)
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
    new.parts[1 - before] = after
    return True


@kernel()
def read_halves(lanes: Lanes, counts: I8, origins: I8, halving: Halving, answers: I8, sizes: I8) -> bool:
    """The upper bits of how many splats are in the first half of each part, and how many lower ones it has.

    A part that has no choice has all splats in its first half. Frequencies are found at the edges that the slot is
    compared with, a few of up to 512; `halves_of`, which a writer uses, finds them all.
    """
    axis, size, inside, alpha = halving
    states, mask = lanes.states, len(lanes.states) - 1
    place, length = lanes.place[0], 0
    for part in range(len(counts)):
        n, second = counts[part], min(size, inside - origins[part, axis] - size)
        answers[part], sizes[part] = n, 0
        if second <= 0:
            continue
        lane = place & mask
        x = states[lane]
        slot = x & (TOTAL - 1)
        if n <= MAX_BINOMIAL and size == second:
            first, k = place_of_halves(n, alpha), 0
            while k < n and HALVES[first + k] <= slot:
                k += 1
            start, end = HALVES[first + k - 1] if k else 0, HALVES[first + k] if k < n else TOTAL
        else:
            sizes[part], centre, scale_code = half_density(n, size, second, alpha)
            m = n >> sizes[part]
            k, above, start, end = 0, m + 1, 0, TOTAL
            while above - k > 1:  # C[k] is start <= slot, C[above] is end > slot
                middle = (k + above) >> 1
                c = cumulative_of_half(middle, m, centre, scale_code)
                if c <= slot:
                    k, start = middle, c
                else:
                    above, end = middle, c
        answers[part] = k
        if not take_symbol(lanes, lane, x, start, end - start):
            return False
        place += 1
        length += lanes.lengths[end - start - 1]
    lanes.place[0] = place
    lanes.spent[CELLS] += length
    return True
