"""The splats of an I-frame, or the new ones of a P-frame, out of their lanes in one kernel (spec.md section 15.9)."""

from typing import NamedTuple

import numpy as np

from gsvc_base.arrays import I8
from gsvc_ref._jit import kernel
from gsvc_ref.main.cells import MAX_BINOMIAL, cell_counts, cumulative_of_half, half_density, small_half
from gsvc_ref.main.codes import CodeArrays, IntraCodes
from gsvc_ref.main.densities import ALPHAS, PLANES, Densities, Windows, magnitude_distributions, windows_of
from gsvc_ref.main.fast.lanes import (
    CELLS,
    CHROMA,
    LUMA,
    MISSING_WORD,
    PLACE,
    SIZE,
    Lanes,
    MissingWordError,
    magnitude_class,
    read_low_bits,
    read_raw,
    read_signs,
    read_symbols,
    take_symbol,
)
from gsvc_ref.main.passes import TOTAL, Distributions
from gsvc_ref.main.reconstruct import find_intra_state, log_size, place_unit
from gsvc_ref.main.state import N_MOST, class_of
from gsvc_ref.main.tables import step_of


class Tables(NamedTuple):
    """What the symbols of an I-frame are distributed by."""

    inside: tuple[int, int]  # columns and rows of cells
    alphas: I8  # (2 a,), the shape of each halving
    magnitudes: tuple[Distributions, Distributions, Distributions]  # of the classes of luma, chroma1 and chroma2
    windows: tuple[Windows, Windows, Windows]  # of size, aspect and shear

    @classmethod
    def of(cls, densities: Densities, width: int, height: int) -> "Tables":
        """Those of the densities of a frame."""
        alphas = np.array([ALPHAS[code] for code in densities.halving_codes], np.int64)
        luma, chroma1, chroma2 = (magnitude_distributions(plane) for plane in densities.planes[:3])
        size, aspect, shear = (windows_of(plane, densities.of(plane)) for plane in PLANES[3:])
        return cls(cell_counts(width, height), alphas, (luma, chroma1, chroma2), (size, aspect, shear))


class Halving(NamedTuple):
    """A halving: its axis, the cells of a first half along it, those of the frame, and the shape alpha."""

    axis: int
    size: int
    inside: int
    alpha: int


class ReadIntra(NamedTuple):
    """The codes of the splats of an I-frame, or of new ones, and their state (N, 8)."""

    codes: IntraCodes
    state: I8


def read_intra(lanes: Lanes, size: tuple[int, int], densities: Densities, count: int, quantizer: int) -> ReadIntra:
    """The passes of the splats of an I-frame, or of new ones (15.9); a MissingWordError if words end before them."""
    codes, state = CodeArrays.empty(count), np.empty((count, 8), np.int64)
    if not _read_intra(lanes, Tables.of(densities, *size), step_of(quantizer), codes, state):
        raise MissingWordError
    return ReadIntra(IntraCodes(*codes), state)


@kernel()
def _read_intra(lanes: Lanes, tables: Tables, step: int, out: CodeArrays, state: I8) -> bool:
    """All passes, put into `out`, and the state (N, 8) that they stand for; whether the words sufficed."""
    count = len(state)
    if not read_cells(lanes, tables.inside, tables.alphas, out.cells):
        return False
    lanes.spent_after[CELLS] = lanes.spent[0]
    context, codes = np.zeros(count, np.int64), np.empty(count, np.int64)
    for plane in range(3):
        if not read_colors(lanes, tables.magnitudes[plane], context, codes):
            return False
        for splat in range(count):
            out.colors[splat, plane] = codes[splat]
            if plane == 0:  # the classes of luma are the contexts of both chroma planes
                context[splat] = magnitude_class(abs(codes[splat]))
        lanes.spent_after[CHROMA if plane else LUMA] = lanes.spent[0]
    # The class follows from the colour alone, and says which window the codes of shape have.
    most, j, color = N_MOST // step, np.empty(count, np.int64), np.empty(3, np.int64)
    for splat in range(count):
        for axis in range(3):
            color[axis] = min(max(out.colors[splat, axis], -most), most) * step
        j[splat] = class_of(color, step)
    for plane in range(3):
        if not read_windowed(lanes, tables.windows[plane], j, codes):
            return False
        for splat in range(count):
            out.shapes[splat, plane] = codes[splat]
        lanes.spent_after[SIZE + plane] = lanes.spent[0]
    bits = context
    for axis in range(2):
        for splat in range(count):
            size = log_size(out.shapes[splat, 0], out.shapes[splat, 1], j[splat], axis)
            bits[splat] = 2 - place_unit(size, j[splat])  # 2^2 pixels are a cell
        if not read_raw(lanes, bits, codes):
            return False
        for splat in range(count):
            out.places[splat, axis] = codes[splat]
    lanes.spent_after[PLACE] = lanes.spent[0]
    find_intra_state(out, step, state)
    return True


@kernel()
def read_cells(lanes: Lanes, inside: tuple[int, int], alphas: I8, cells: I8) -> bool:
    """Column and row of the cell of each splat, into cells (count, 2) (spec.md section 15.8).

    `inside` is columns and rows of cells, and `alphas` (2 a,) the shape of each halving.
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
        this = Halving(axis, size, inside[axis], alphas[halving])
        if not _read_halves(lanes, counts[:many], origins, this, answers, sizes):
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
def _read_halves(lanes: Lanes, counts: I8, origins: I8, halving: Halving, answers: I8, sizes: I8) -> bool:
    """A pass of the upper bits of how many splats are in the first half of each part, and how many lower ones it has.

    A part that has no choice has all splats in its first half. Frequencies are found at the edges that the slot is
    compared with, a few of up to 512; `halves_of`, which a writer uses, finds them all.
    """
    axis, size, inside, alpha = halving
    states, words, mask = lanes.states, lanes.words, len(lanes.states) - 1
    taken, place, length = lanes.taken[0], 0, 0
    small, known = np.empty((MAX_BINOMIAL + 1, MAX_BINOMIAL + 2), np.int64), np.zeros(MAX_BINOMIAL + 1, np.bool_)
    for part in range(len(counts)):
        n, second = counts[part], min(size, inside - origins[part, axis] - size)
        answers[part], sizes[part] = n, 0
        if second <= 0:
            continue
        x = states[place & mask]
        slot = x & (TOTAL - 1)
        if n <= MAX_BINOMIAL and size == second:
            if not known[n]:
                small_half(n, alpha, small[n])
                known[n] = True
            k = 0
            while small[n, k + 1] <= slot:
                k += 1
            start, end = small[n, k], small[n, k + 1]
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
        x, taken = take_symbol(x, start, end - start, words, taken)
        if taken == MISSING_WORD:
            return False
        states[place & mask] = x
        place += 1
        length += lanes.lengths[end - start - 1]
    lanes.taken[0] = taken
    lanes.spent[0] += length
    return True


@kernel()
def read_colors(lanes: Lanes, tables: Distributions, context: I8, codes: I8) -> bool:
    """Signed codes of a colour channel: passes of classes, of low bits and of signs (spec.md section 15.7)."""
    if not read_symbols(lanes, tables, context, codes):
        return False
    return read_low_bits(lanes, codes) and read_signs(lanes, codes)


@kernel()
def read_windowed(lanes: Lanes, windows: Windows, j: I8, codes: I8) -> bool:
    """The codes of a plane with windows, of splats of the classes j: passes of bins and of low bits (15-7)."""
    sizes, low = np.empty(len(j), np.int64), np.empty(len(j), np.int64)
    for i in range(len(j)):
        sizes[i] = windows.low_bits[j[i]]
    if not (read_symbols(lanes, windows.distributions, j, codes) and read_raw(lanes, sizes, low)):
        return False
    for i in range(len(j)):
        codes[i] = ((codes[i] + windows.first[j[i]]) << sizes[i]) + low[i]
    return True
