"""The densities of an I-frame's planes and the shapes of its halving with the least code length.

Lengths are those of a decoder's own tables, in integers, so that a choice is the same on every machine. Each density
begins where its moments say, and a search among its neighbors follows, in steps that halve.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import Final

import numpy as np

from gsvc_base.arrays import I8
from gsvc_ref._jit import kernel
from gsvc_ref.main.cells import Halves, cell_counts, halved, halves_of, halving_count, splats_in_first_halves
from gsvc_ref.main.codes import IntraCodes
from gsvc_ref.main.densities import (
    ALPHAS,
    MAGNITUDE_CLASSES,
    PLANES,
    SLOPED,
    STEPS_OF,
    Densities,
    Density,
    Plane,
    Windows,
    magnitude_distributions,
    windows_of,
)
from gsvc_ref.main.passes import LENGTH_UNIT, LENGTHS, magnitude_classes
from gsvc_ref.main.reconstruct import colors_of
from gsvc_ref.main.state import classes
from gsvc_ref.main.tables import exp2

MAX_CENTRE: Final = 511  # of what `centre` stands for, in magnitude
MAX_SLOPE: Final = 127  # of what `slope` stands for, in magnitude
MAX_SCALE_CODE: Final = 31

SEARCH_STEPS: Final = (8, 4, 2, 1)  # of centre, scale code and slope
MAX_SCALE_STEP: Final = 4  # a scale changes by an octave at most
NO_CODE: Final = 1 << 40  # the length of what a density cannot code: more than that of any plane
_SCALES: Final = exp2(256 * np.arange(MAX_SCALE_CODE + 1), 4)  # 2^(scale_code / 4) in 1/16

Length = Callable[[Density], int]
"""The code length of a plane by a density, in parts of a bit (`LENGTH_UNIT`)."""


def choose_densities(codes: IntraCodes, step: int, width: int, height: int) -> Densities:
    """The densities with about the least code length for the codes of at least one splat, in the order of cells."""
    q = magnitude_classes(np.abs(codes.colors))  # (N, 3)
    j = classes(colors_of(codes.colors, step), step)
    chosen: list[Density] = []
    for c in range(3):
        known = q[:, 0] * (c > 0)
        counts = np.zeros((MAGNITUDE_CLASSES, MAGNITUDE_CLASSES), np.int64)  # of each class, by the one that is known
        np.add.at(counts, (known, q[:, c]), 1)
        start = _moments(16 * q[:, c], known, 1, 2, MAX_SLOPE if c else 0)
        chosen.append(_search(partial(_magnitudes_length, counts), start, known, MAX_SLOPE if c else 0))
    for c, plane in enumerate(PLANES[3:]):
        values, most_slope = np.ascontiguousarray(codes.shapes[:, c]), MAX_SLOPE if plane in SLOPED else 0
        start = _moments(values * STEPS_OF[plane][j], j, 64, 4, most_slope)
        chosen.append(_search(partial(_windowed_length, plane, values, j), start, j, most_slope))
    return Densities(tuple(chosen), choose_halving_codes(codes.cells, width, height))


def _moments(values: I8, known: I8, unit: int, unit_bits: int, most_slope: int) -> Density:
    """The density that the moments of values (N,) suggest.

    A centre is in `unit` of the values, and a slope in a quarter of that for each `known` (N,); 2^unit_bits of the
    values are one scale at scale_code 0.
    """
    count, sum_known, sum_values = len(values), int(known.sum()), int(values.sum())
    spread = count * int((known * known).sum()) - sum_known * sum_known
    slope = 0
    if most_slope and spread:  # that of the regression line
        slope = 4 * (count * int((known * values).sum()) - sum_known * sum_values) // (unit * spread)
        slope = min(max(slope, -most_slope), most_slope)
    rest = values - known * unit * slope // 4
    median = int(np.sort(rest)[count // 2])
    deviation = int(np.abs(rest - median).sum()) // count
    scale_code = int(np.searchsorted((_SCALES << unit_bits) // 16, deviation))
    return Density(0, min(scale_code, MAX_SCALE_CODE), min(max(median // unit, -MAX_CENTRE), MAX_CENTRE), slope)


def _search(length: Length, start: Density, known: I8, most_slope: int) -> Density:
    """The best density that steps of SEARCH_STEPS find from a first one, as long as they gain."""
    best, least = start, length(start)

    def gain(moves: list[tuple[int, int, int, int]]) -> bool:
        """Take the moves of centre, scale code, slope and family that shorten the length; whether there is one."""
        nonlocal best, least
        before = least
        for centre, scale, slope, family in moves:
            trial = Density(best.family ^ family, best.scale_code + scale, best.centre + centre, best.slope + slope)
            legal = abs(trial.centre) <= MAX_CENTRE and 0 <= trial.scale_code <= MAX_SCALE_CODE
            if legal and abs(trial.slope) <= most_slope and (bits := length(trial)) < least:
                best, least = trial, bits
        return least < before

    while least >= NO_CODE and best.scale_code < MAX_SCALE_CODE:  # the window must hold all values
        best = replace(best, scale_code=best.scale_code + 1)
        least = length(best)
    pivot = int(known.sum()) // len(known)  # a slope turns about the mean of what is known
    for step in SEARCH_STEPS:
        scale = min(step, MAX_SCALE_STEP)
        moves = [(step, 0, 0, 0), (-step, 0, 0, 0), (0, scale, 0, 0), (0, -scale, 0, 0)]
        moves += [(-(s * pivot) // 4, 0, s, 0) for s in (step, -step)] if most_slope else []
        gains = True
        while gains:
            gains = gain(moves)
            if step == 1 or not gains:
                gains |= gain([(0, change, 0, 1) for change in (-1, 0, 1)])
    return best


def _magnitudes_length(counts: I8, density: Density) -> int:
    """The length of classes of magnitudes, `counts` (classes, classes) of each by the class that is known."""
    C = magnitude_distributions(density).cumulative.reshape(MAGNITUDE_CLASSES, -1)
    return int((counts * LENGTHS[np.diff(C, axis=1) - 1]).sum())


def _windowed_length(plane: Plane, codes: I8, j: I8, density: Density) -> int:
    """The length of the codes (N,) of a plane with windows, of splats of the classes j (N,)."""
    return _length_in_windows(windows_of(plane, density), codes, j, LENGTHS)


@kernel()
def _length_in_windows(windows: Windows, codes: I8, j: I8, lengths: I8) -> int:
    cumulative, begins = windows.distributions
    total = 0
    for i in range(len(codes)):
        r, begin = windows.low_bits[j[i]], begins[j[i]]
        v = (codes[i] >> r) - windows.first[j[i]]
        if v < 0 or v >= begins[j[i] + 1] - begin - 1:
            total += NO_CODE
        else:
            total += lengths[cumulative[begin + v + 1] - cumulative[begin + v] - 1] + r * LENGTH_UNIT
    return total


def choose_halving_codes(cells: I8, width: int, height: int) -> tuple[int, ...]:
    """The `halving_code` of each halving with the least code length for cells (N, 2); 0 where no part has a choice."""
    inside, halvings = cell_counts(width, height), halving_count(width, height)
    origins, counts = np.zeros((1, 2), np.int64), np.array([len(cells)], np.int64)
    chosen = []
    for axis, size in chain.from_iterable(((0, 1 << k), (1, 1 << k)) for k in reversed(range(halvings // 2))):
        first = splats_in_first_halves(cells, counts, origins, axis, size)
        lengths = [_halves_length(halves_of(counts, origins, axis, size, inside[axis], a), first) for a in ALPHAS]
        chosen.append(int(np.argmin(lengths)))
        counts, origins = halved(counts, origins, axis, size, np.arange(len(counts)), first)
    return tuple(chosen)


def _halves_length(halves: Halves, first: I8) -> int:
    """The length of how many splats (n,) each part has in its first half."""
    cumulative, begins = halves.tables
    at = begins[:-1] + (first[halves.asked] >> halves.low_bits)
    return int(LENGTHS[cumulative[at + 1] - cumulative[at] - 1].sum() + LENGTH_UNIT * halves.low_bits.sum())
