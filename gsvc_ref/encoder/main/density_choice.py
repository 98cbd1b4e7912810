"""The densities of an I-frame's planes and the shapes of its halving with the least code length.

Lengths are counted in integers, units of 2^-16 bit, so that a choice is the same on every machine. Each density begins
where its moments say, and a search among its neighbours follows, in steps that halve.
"""

from collections.abc import Callable
from typing import Final

import numpy as np

from gsvc_base.arrays import I8
from gsvc_base.portable import log2
from gsvc_ref._jit import kernel
from gsvc_ref.main import densities
from gsvc_ref.main.cells import cell_counts, cell_keys, half_distribution, halving_count
from gsvc_ref.main.codes import IntraCodes
from gsvc_ref.main.densities import (
    ALPHAS,
    MAGNITUDE_CLASSES,
    PLANES,
    SLOPED,
    STEPS_OF,
    Densities,
)
from gsvc_ref.main.passes import PRECISION, TOTAL, magnitude_classes
from gsvc_ref.main.reconstruct import colors_of
from gsvc_ref.main.state import classes
from gsvc_ref.main.tables import EXP2, LAPLACE, LOGISTIC, exp2

Density = tuple[int, int, int, int]
"""Centre, scale code, family and slope."""

MOST_CENTRE: Final = 511
MOST_SLOPE: Final = 127

NO_CODE: Final = 1 << 40
"""The length of what a density cannot code."""

_LENGTHS: Final = np.array([NO_CODE, *np.rint(65536 * (PRECISION - log2(np.arange(1, TOTAL + 1))))], np.int64)
"""Of each frequency, in 2^-16 bit."""
_FAMILIES: Final = np.stack((LOGISTIC, LAPLACE))  # (families, 257) i8
_SCALES: Final = exp2(256 * np.arange(32), 4)
_SMALL: Final = 15
_ALPHAS: Final = np.array(ALPHAS, np.int64)


def _lengths_of_counts() -> I8:
    """(alphas, n, number) i8: lengths of the number on the left of n <= SMALL splats between equal halves."""
    lengths = np.zeros((len(_ALPHAS), _SMALL + 1, _SMALL + 1), np.int64)
    for row, alpha in enumerate(ALPHAS):
        for n in range(1, _SMALL + 1):
            cumulative, _ = half_distribution(n, 1, 1, alpha)
            lengths[row, n, : n + 1] = _LENGTHS[np.diff(cumulative)]
    return lengths


_COUNTS: Final = _lengths_of_counts()


def choose_densities(codes: IntraCodes, step: int, width: int, height: int) -> Densities:
    """The densities of splats' codes with about the least code length.

    Parameters
    ----------
    codes
        The codes of at least one splat, in the order of cells.
    step
        D in 1/16.
    width, height
        Size of the frame in pixels.
    """
    q = magnitude_classes(np.abs(codes.colors))  # (N, 3)
    j = classes(colors_of(codes.colors, step), step)
    chosen: list[Density] = []
    for c in range(3):
        known = q[:, 0] * (c > 0)
        numbers = np.zeros((MAGNITUDE_CLASSES, MAGNITUDE_CLASSES), np.int64)  # of each class, by the one that is known
        np.add.at(numbers, (known, q[:, c]), 1)

        def of_classes(x: Density, numbers: I8 = numbers) -> int:
            return _class_length(numbers, *x)

        chosen.append(_search(of_classes, 16 * q[:, c], known, 1, 4, MOST_SLOPE if c else 0))
    for c, plane in enumerate(PLANES[3:]):
        values = np.ascontiguousarray(codes.shapes[:, c])
        steps = STEPS_OF[plane]

        def of_plane(x: Density, values: I8 = values, steps: I8 = steps) -> int:
            return _plane_length(values, j, steps, *x)

        chosen.append(_search(of_plane, values * steps[j], j, 64, 16, MOST_SLOPE if plane in SLOPED else 0))
    planes = tuple(densities.Density(family, scale, centre, slope) for centre, scale, family, slope in chosen)
    return Densities(planes, choose_halving_codes(codes.cells, width, height))


def _search(length: Callable[[Density], int], values: I8, known: I8, unit: int, scale: int, most_slope: int) -> Density:
    """The best density: from moments, then by steps of 8, 4, 2, 1 while they gain.

    A centre is in `unit`, a slope in a quarter of that for each `known`, and sigma 0 is the deviation `scale`.
    """
    count, sum_known, sum_values = len(values), int(known.sum()), int(values.sum())
    spread = count * int((known * known).sum()) - sum_known * sum_known
    slope = 0
    if most_slope and spread:
        slope = 4 * (count * int((known * values).sum()) - sum_known * sum_values) // (unit * spread)
        slope = min(max(slope, -most_slope), most_slope)
    rest = values - known * unit * slope // 4
    middle = int(np.sort(rest)[count // 2])
    deviation = int(np.abs(rest - middle).sum()) // count
    sigma = int(np.searchsorted(_SCALES * scale // 16, deviation))
    centre = min(max(middle // unit, -MOST_CENTRE), MOST_CENTRE)
    best: Density = (centre, min(sigma, 31), 0, slope)
    least = length(best)
    while least >= NO_CODE and best[1] < 31:  # the window must hold all values
        best = (best[0], best[1] + 1, best[2], best[3])
        least = length(best)
    pivot = sum_known // count  # a slope turns about the mean of what is known
    for step in (8, 4, 2, 1):
        while True:
            before = least
            turns = [(s, -(s * pivot) // 4) for s in (step, -step)] if most_slope else []
            moves = [
                (step, 0, 0),
                (-step, 0, 0),
                (0, min(step, 4), 0),
                (0, -min(step, 4), 0),
                *((c, 0, s) for s, c in turns),
            ]
            for centre, sigma, slope in moves:
                trial = (best[0] + centre, best[1] + sigma, best[2], best[3] + slope)
                legal = abs(trial[0]) <= MOST_CENTRE and 0 <= trial[1] < 32 and abs(trial[3]) <= most_slope
                if legal and (bits := length(trial)) < least:
                    best, least = trial, bits
            if step == 1 or least == before:
                for sigma in range(-1, 2):
                    trial = (best[0], min(max(best[1] + sigma, 0), 31), 1 - best[2], best[3])
                    if (bits := length(trial)) < least:
                        best, least = trial, bits
            if least == before:
                break
    return best


@kernel(inline=True)
def _cumulative(i: int, bins: int, edge: int, centre: int, sigma: int, unit: int, family: int) -> int:
    """`densities.cumulative` at edge i, whose place (doubled) is `edge`."""
    if i == 0:
        return 0
    if i == bins:
        return TOTAL
    mantissa = EXP2[(-256 * sigma) & 1023]
    x = ((((edge - 2 * centre) * mantissa * 2048) // unit) >> (15 + (sigma + 3) // 4)) + 32768
    x = min(max(x, 0), 65535)
    at, part = x >> 8, x & 255
    t = _FAMILIES[family, at] + (((_FAMILIES[family, at + 1] - _FAMILIES[family, at]) * part) >> 8)
    return int(i + (((TOTAL - bins) * t) >> 16))


@kernel()
def _class_length(numbers: I8, centre: int, sigma: int, family: int, slope: int) -> int:
    """Length of classes of magnitudes, `numbers` of each by the class that is known."""
    total = 0
    for known in range(MAGNITUDE_CLASSES):
        middle = centre + slope * known // 4
        for c in range(MAGNITUDE_CLASSES):
            if numbers[known, c]:
                low = _cumulative(c, MAGNITUDE_CLASSES, 32 * c - 16, middle, sigma, 4, family)
                high = _cumulative(c + 1, MAGNITUDE_CLASSES, 32 * c + 16, middle, sigma, 4, family)
                total += numbers[known, c] * _LENGTHS[high - low]
    return total


@kernel()
def _plane_length(codes: I8, level: I8, step: I8, centre: int, sigma: int, family: int, slope: int) -> int:
    """Length of the codes of a plane with windows, by the classes j in `level`."""
    s = _SCALES[sigma]
    drop, first, bins, middle = np.empty((4, 11), np.int64)
    for j in range(11):
        middle[j] = 64 * centre + 64 * slope * j // 4
        r = 0
        while 16 * s > (step[j] << r) * 512:
            r += 1
        width = step[j] << r
        drop[j], first[j] = r, (middle[j] - 8 * s) // width
        bins[j] = -((-middle[j] - 8 * s) // width) - first[j] + 1
    total = 0
    for i in range(len(codes)):
        j = level[i]
        v = (codes[i] >> drop[j]) - first[j]
        if v < 0 or v >= bins[j]:
            total += NO_CODE
            continue
        edge = (2 * ((first[j] + v) << drop[j]) - 1) * step[j]
        low = _cumulative(v, bins[j], edge, middle[j], sigma, 16, family)
        edge += 2 * (step[j] << drop[j])
        high = _cumulative(v + 1, bins[j], edge, middle[j], sigma, 16, family)
        total += _LENGTHS[high - low] + (drop[j] << 16)
    return total


def choose_halving_codes(cells: I8, width: int, height: int) -> tuple[int, ...]:
    """The `halving_code` of each halving with the least code length; 0 where nothing is asked.

    Parameters
    ----------
    cells
        (N, 2), the cells of splats in their order.
    width, height
        Size of the frame in pixels.
    """
    columns, rows = cell_counts(width, height)
    halvings = halving_count(width, height)
    keys = cell_keys(cells, width, height)
    chosen = []
    for halving in range(halvings):
        lengths = np.zeros(len(_ALPHAS), np.int64)
        _halving_lengths(keys, columns, rows, halvings // 2, halving, lengths)
        chosen.append(int(np.argmin(lengths)))
    return tuple(chosen)


@kernel()
def _halving_lengths(codes: I8, columns: int, rows: int, bits: int, level: int, lengths: I8) -> None:
    """Add the length of a halving for each alpha."""
    shift = 2 * bits - 1 - level
    half = 1 << (bits - level // 2 - 1)
    across = level % 2 == 0
    total = columns if across else rows
    i = 0
    while i < len(codes):
        parent = codes[i] >> (shift + 1)
        n = left = 0
        while i < len(codes) and codes[i] >> (shift + 1) == parent:
            n += 1
            if (codes[i] >> shift) & 1 == 0:
                left += 1
            i += 1
        at, place = 0, parent << (shift + 1)
        for b in range(bits):
            at |= ((place >> (2 * b + (1 if across else 0))) & 1) << b
        right = min(max(total - at - half, 0), half)
        if right == 0:
            continue
        if right == half and n <= _SMALL:
            for a in range(len(lengths)):
                lengths[a] += _COUNTS[a, n, left]
            continue
        r = 0
        while n >> (r + 9):
            r += 1
        m, q = n >> r, 256 * half // (half + right)
        for a in range(len(lengths)):
            w = m * q * (256 - q) * (2 * _ALPHAS[a] + m) * 1245 // ((2 * _ALPHAS[a] + 1) << 16)
            w = max(w, 1)
            e = 0
            while w >> (e + 1):
                e += 1
            sigma = 2 * e + ((w >> (e - 1)) & 1 if e else 0)
            v, middle = left >> r, m * q // 4
            low = _cumulative(v, m + 1, 64 * (2 * v - 1), middle, sigma, 1, 0)
            high = _cumulative(v + 1, m + 1, 64 * (2 * v + 1), middle, sigma, 1, 0)
            lengths[a] += _LENGTHS[high - low] + (r << 16)
