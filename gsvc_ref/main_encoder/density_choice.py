"""The densities of an I-frame's planes and the shapes of its halving with the least code length.

Lengths are counted in integers, units of 2^-16 bit, so that a choice is the same on every machine. Each density begins
where its moments say, and a search among its neighbours follows, in steps that halve.
"""

from collections.abc import Callable
from typing import Final

import codec
import numpy as np

from gsvc_ref._jit import kernel
from gsvc_ref.arrays import I8
from gsvc_ref.portable import log2

Density = tuple[int, int, int, int]
"""Centre, sigma, family and slope."""

NO_CODE: Final = 1 << 40
"""The length of what a density cannot code."""

_LENGTHS: Final = np.array([NO_CODE, *np.rint(65536 * (codec.R - log2(np.arange(1, codec.ONE + 1))))], np.int64)
"""Of each frequency, in 2^-16 bit."""
_FAMILIES: Final = np.stack(codec.FAMILIES)  # (families, 257) i8
_SCALES: Final = np.array([codec.scale_of(sigma, 16) for sigma in range(32)], np.int64)
_EXP2: Final = codec.EXP2
_ONE: Final = codec.ONE
_CLASSES: Final = codec.CLASSES
_SMALL: Final = codec.SMALL
_ALPHAS: Final = np.array(codec.ALPHAS, np.int64)


def _lengths_of_counts() -> I8:
    """(alphas, n, number) i8: lengths of the number on the left of n <= SMALL splats between equal halves."""
    lengths = np.zeros((len(_ALPHAS), _SMALL + 1, _SMALL + 1), np.int64)
    for (alpha, n), cumulative in codec.BB.items():
        lengths[codec.ALPHAS.index(alpha), n, : n + 1] = _LENGTHS[np.diff(cumulative)]
    return lengths


_COUNTS: Final = _lengths_of_counts()


def choose_densities(k: I8, g: I8, quantizer: int) -> dict[str, Density]:
    """The densities of splats' codes with about the least code length, as `codec.density_parameters` takes them.

    Parameters
    ----------
    k
        (N, 3) i8, luma and chroma codes, N at least 1.
    g
        (N, 3) i8, codes of size, aspect and shear.
    quantizer
        D in 1/16.
    """
    classes = codec.class_of(k)[0]  # (N, 3) i8
    level = codec.level(k * quantizer, quantizer)  # (N,) i8
    chosen: dict[str, Density] = {}
    for c, name in enumerate(("luma", "chroma1", "chroma2")):
        known = classes[:, 0] * (c > 0)
        numbers = np.zeros((_CLASSES, _CLASSES), np.int64)  # of each class, by the one that is known
        np.add.at(numbers, (known, classes[:, c]), 1)

        def of_classes(x: Density, numbers: I8 = numbers) -> int:
            return _class_length(numbers, *x)

        chosen[name] = _search(of_classes, 16 * classes[:, c], known, 1, 4, (512, 127 if c else 0))
    planes = (("size", codec.H_SIZE, 127), ("aspect", codec.H_SIZE, 127), ("shear", codec.H_SHEAR, 0))
    for c, (name, step, slopes) in enumerate(planes):
        codes = np.ascontiguousarray(g[:, c])

        def of_plane(x: Density, codes: I8 = codes, step: I8 = step) -> int:
            return _plane_length(codes, level, step, *x)

        chosen[name] = _search(of_plane, codes * step[level], level, 64, 16, (256, slopes))
    return chosen


def _search(
    length: Callable[[Density], int], values: I8, known: I8, unit: int, scale: int, limits: tuple[int, int]
) -> Density:
    """The best density: from moments, then by steps of 8, 4, 2, 1 while they gain.

    A centre is in `unit`, a slope in a quarter of that for each `known`, and sigma 0 is the deviation `scale`.
    """
    count, sum_known, sum_values = len(values), int(known.sum()), int(values.sum())
    spread = count * int((known * known).sum()) - sum_known * sum_known
    slope = 0
    if limits[1] and spread:
        slope = 4 * (count * int((known * values).sum()) - sum_known * sum_values) // (unit * spread)
        slope = min(max(slope, -limits[1]), limits[1])
    rest = values - known * unit * slope // 4
    middle = int(np.sort(rest)[count // 2])
    deviation = int(np.abs(rest - middle).sum()) // count
    sigma = int(np.searchsorted(_SCALES * scale // 16, deviation))
    centre = min(max(middle // unit, 1 - limits[0]), limits[0] - 1)
    best: Density = (centre, min(sigma, 31), 0, slope)
    least = length(best)
    while least >= NO_CODE and best[1] < 31:  # the window must hold all values
        best = (best[0], best[1] + 1, best[2], best[3])
        least = length(best)
    pivot = sum_known // count  # a slope turns about the mean of what is known
    for step in (8, 4, 2, 1):
        while True:
            before = least
            turns = [(s, -(s * pivot) // 4) for s in (step, -step)] if limits[1] else []
            moves = [
                (step, 0, 0),
                (-step, 0, 0),
                (0, min(step, 4), 0),
                (0, -min(step, 4), 0),
                *((c, 0, s) for s, c in turns),
            ]
            for centre, sigma, slope in moves:
                trial = (best[0] + centre, best[1] + sigma, best[2], best[3] + slope)
                legal = abs(trial[0]) < limits[0] and 0 <= trial[1] < 32 and abs(trial[3]) <= limits[1]
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
    """`codec.density` at edge i, whose place (doubled) is `edge`."""
    if i == 0:
        return 0
    if i == bins:
        return _ONE
    mantissa = _EXP2[(-256 * sigma) & 1023]
    x = ((((edge - 2 * centre) * mantissa * 2048) // unit) >> (15 + (sigma + 3) // 4)) + 32768
    x = min(max(x, 0), 65535)
    at, part = x >> 8, x & 255
    t = _FAMILIES[family, at] + (((_FAMILIES[family, at + 1] - _FAMILIES[family, at]) * part) >> 8)
    return int(i + (((_ONE - bins) * t) >> 16))


@kernel()
def _class_length(numbers: I8, centre: int, sigma: int, family: int, slope: int) -> int:
    """Length of classes under `codec.class_density`, `numbers` of each by the class that is known."""
    total = 0
    for known in range(_CLASSES):
        middle = centre + slope * known // 4
        for c in range(_CLASSES):
            if numbers[known, c]:
                low = _cumulative(c, _CLASSES, 32 * c - 16, middle, sigma, 4, family)
                high = _cumulative(c + 1, _CLASSES, 32 * c + 16, middle, sigma, 4, family)
                total += numbers[known, c] * _LENGTHS[high - low]
    return total


@kernel()
def _plane_length(codes: I8, level: I8, step: I8, centre: int, sigma: int, family: int, slope: int) -> int:
    """Length of the codes of a plane under `codec.plane_tables`, by the classes j in `level`."""
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


def choose_alphas(codes: I8, columns: int, rows: int) -> list[int]:
    """The index in `codec.ALPHAS` of each level of the halving that asks anything, from the first level on.

    Parameters
    ----------
    codes
        (N,) i8, the Morton codes of the splats' cells, ascending.
    columns, rows
        The number of cells.
    """
    bits = max(columns - 1, rows - 1, 0).bit_length()
    chosen = []
    for level in range(2 * bits):
        lengths = np.zeros(len(_ALPHAS), np.int64)
        if _halving_lengths(codes, columns, rows, bits, level, lengths):
            chosen.append(int(np.argmin(lengths)))
    return chosen


@kernel()
def _halving_lengths(codes: I8, columns: int, rows: int, bits: int, level: int, lengths: I8) -> bool:
    """Adds the length of a level for each alpha; whether the level asks anything."""
    shift = 2 * bits - 1 - level
    half = 1 << (bits - level // 2 - 1)
    across = level % 2 == 0
    total = columns if across else rows
    asked = False
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
        asked = True
        if right == half and n <= _SMALL:
            for a in range(len(lengths)):
                lengths[a] += _COUNTS[a, n, left]
            continue
        r = 0
        while n >> (r + 9):
            r += 1
        m, q = n >> r, 256 * half // (half + right)
        for a in range(len(lengths)):
            w = ((m * q * (256 - q)) >> 16) * (2 * _ALPHAS[a] + m) * 1245 // (2 * _ALPHAS[a] + 1)
            w = max(w, 1)
            e = 0
            while w >> (e + 1):
                e += 1
            sigma = 2 * e + ((w >> (e - 1)) & 1 if e else 0)
            v, middle = left >> r, 64 * (m * q) // 256
            low = _cumulative(v, m + 1, 64 * (2 * v - 1), middle, sigma, 1, 0)
            high = _cumulative(v + 1, m + 1, 64 * (2 * v + 1), middle, sigma, 1, 0)
            lengths[a] += _LENGTHS[high - low] + (r << 16)
    return asked
