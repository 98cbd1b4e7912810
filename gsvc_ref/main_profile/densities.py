"""Densities: how the planes of splats are distributed (spec.md section 15.7)."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, Literal, NamedTuple, get_args

import numpy as np

from gsvc_ref._jit import kernel
from gsvc_ref.arrays import I8
from gsvc_ref.main_profile.lanes import Lanes, read_low_bits, read_raw, read_signs, read_symbols
from gsvc_ref.main_profile.passes import ONE, Distributions, Run
from gsvc_ref.main_profile.state import CLASSES, SHEAR_STEPS, SIZE_STEPS
from gsvc_ref.main_profile.tables import EXP2, FAMILIES, exp2

Plane = Literal["luma", "chroma1", "chroma2", "size", "aspect", "shear"]
PLANES: Final[tuple[Plane, ...]] = get_args(Plane)
SLOPED: Final = ("chroma1", "chroma2", "size", "aspect")
"""The planes whose centre depends on what was decoded before."""

STEPS_OF: Final[Mapping[str, I8]] = {"size": SIZE_STEPS, "aspect": SIZE_STEPS, "shear": SHEAR_STEPS}
"""The step of a code by class, of the planes with windows."""

ALPHAS: Final = (1, 2, 3, 4, 6, 10, 20, 100)
"""The shapes of the distribution of halves, by `halving_code`."""

MAGNITUDE_CLASSES: Final = 40
LARGEST_MAGNITUDE: Final = (4 << 18) - 1

_MOST_BINS: Final = 512


@dataclass(frozen=True)
class Density:
    """The density of a plane.

    Attributes
    ----------
    family
        `density_family`: 0 logistic, 1 Laplace.
    scale_code
        0..31: the scale is 2^(scale_code / 4) units.
    centre
        -512..511.
    slope
        -128..127; 0 for luma and shear.
    """

    family: int = 0
    scale_code: int = 0
    centre: int = 0
    slope: int = 0


@dataclass(frozen=True)
class Densities:
    """What densities() says: the density of each plane, and the `halving_code` of each halving."""

    planes: tuple[Density, ...]
    halving_codes: tuple[int, ...]

    def of(self, plane: Plane) -> Density:
        """The density of a plane."""
        return self.planes[PLANES.index(plane)]


def cumulative(edges: I8, centre: int, family: int, scale_code: int, unit_bits: int) -> I8:
    """Cumulative frequencies of bins (15-6).

    Parameters
    ----------
    edges
        (K - 1,), the inner edges of K bins, doubled.
    centre
        The centre, not doubled.
    family, scale_code
        As in `Density`.
    unit_bits
        w: 2^w units of the edges are one scale at scale_code 0.

    Returns
    -------
    (K + 1,) from 0 to 2^14.
    """
    result = np.empty(len(edges) + 2, np.int64)
    _cumulative(edges, centre, scale_code, unit_bits, FAMILIES[family], result)
    return result


@kernel()
def _cumulative(edges: I8, centre: int, scale_code: int, unit_bits: int, family: I8, result: I8) -> None:
    bins = len(edges) + 1
    result[0], result[bins] = 0, ONE
    for i in range(1, bins):
        v = density_at(edges[i - 1], centre, scale_code, unit_bits, EXP2, family)
        result[i] = i + ((ONE - bins) * v >> 16)


@kernel(inline=True)
def density_at(edge: int, centre: int, scale_code: int, unit_bits: int, exp2_table: I8, family: I8) -> int:
    """V of (15-6) at a doubled edge: the distribution function in 2^-16."""
    shift = 15 - (-scale_code // 4) - 11 + unit_bits
    u = 2**15 + ((edge - 2 * centre) * exp2_table[-256 * scale_code & 1023] >> shift)
    u = min(max(u, 0), 2**16 - 1)
    place = u >> 8
    return int(family[place] + ((family[place + 1] - family[place]) * (u & 255) >> 8))


@lru_cache(maxsize=64)
def magnitude_distributions(density: Density) -> Distributions:
    """The distributions of classes of magnitudes, by the class that the centre slopes with."""
    return _magnitude_tables(density.centre, density.slope, density.scale_code, FAMILIES[density.family])


@kernel()
def _magnitude_tables(centre: int, slope: int, scale_code: int, family: I8) -> Distributions:
    edges = 16 * (2 * np.arange(1, MAGNITUDE_CLASSES) - 1)
    tables = np.empty((MAGNITUDE_CLASSES, MAGNITUDE_CLASSES + 1), np.int64)
    for q in range(MAGNITUDE_CLASSES):
        _cumulative(edges, centre + slope * q // 4, scale_code, 2, family, tables[q])
    return Distributions(tables.ravel(), np.arange(MAGNITUDE_CLASSES + 1) * (MAGNITUDE_CLASSES + 1))


def code_magnitudes(run: Run, density: Density, context: I8, codes: I8 | None) -> I8:
    """Signed codes of a colour channel: passes of classes, of low bits and of signs (spec.md section 15.7)."""
    magnitudes = run.magnitudes(magnitude_distributions(density), context, None if codes is None else np.abs(codes))
    return run.signs(magnitudes, codes)


@kernel()
def read_codes(lanes: Lanes, part: int, tables: Distributions, context: I8, codes: I8) -> bool:
    """Signed codes of a colour channel, as `code_magnitudes` has them; whether the words sufficed."""
    return (
        read_symbols(lanes, part, tables, context, codes)
        and read_low_bits(lanes, part, codes)
        and read_signs(lanes, part, codes)
    )


class Windows(NamedTuple):
    """The windows of a plane (15-7) by class: distributions, raw low bits and first bins, (11,) each."""

    distributions: Distributions
    low_bits: I8
    first: I8


@lru_cache(maxsize=64)
def windows_of(plane: Plane, density: Density) -> Windows:
    """The windows of size, aspect or shear."""
    scale, steps = int(exp2(256 * density.scale_code, 4)), STEPS_OF[plane]
    return _window_tables(
        scale, 64 * density.centre, 16 * density.slope, density.scale_code, steps, FAMILIES[density.family]
    )


@kernel()
def _window_tables(scale: int, centre: int, slope: int, scale_code: int, steps: I8, family: I8) -> Windows:
    """The windows of classes 0 to 10, whose centres are `centre` + j `slope`."""
    first, low, firsts = np.zeros(CLASSES + 1, np.int64), np.zeros(CLASSES, np.int64), np.empty(CLASSES, np.int64)
    bins = np.empty(CLASSES, np.int64)
    for j in range(CLASSES):
        while 16 * scale > _MOST_BINS * (steps[j] << low[j]):
            low[j] += 1
        width, middle = steps[j] << low[j], centre + slope * j
        firsts[j] = (middle - 8 * scale) // width
        bins[j] = -((-middle - 8 * scale) // width) - firsts[j] + 1
        first[j + 1] = first[j] + bins[j] + 1
    tables = np.empty(first[CLASSES], np.int64)
    for j in range(CLASSES):
        inner = np.arange(firsts[j] + 1, firsts[j] + bins[j])
        edges = (2 * (inner << low[j]) - 1) * steps[j]
        _cumulative(edges, centre + slope * j, scale_code, 4, family, tables[first[j] : first[j + 1]])
    return Windows(Distributions(tables, first), low, firsts)


def code_windowed(run: Run, windows: Windows, j: I8, codes: I8 | None) -> I8:
    """The codes of a plane with windows, (N,), of splats of the classes j."""
    sizes, first = windows.low_bits[j], windows.first[j]
    bins = run.symbols(windows.distributions, j, None if codes is None else (codes >> sizes) - first)
    low = run.raw_bits(sizes, None if codes is None else codes & ((1 << sizes) - 1))
    return ((bins + first) << sizes) + low


@kernel()
def read_windowed(lanes: Lanes, part: int, windows: Windows, j: I8, codes: I8) -> bool:
    """The codes of a plane with windows, as `code_windowed` has them; whether the words sufficed."""
    low = np.empty(len(j), np.int64)
    if not read_symbols(lanes, part, windows.distributions, j, codes):
        return False
    if not read_raw(lanes, part, windows.low_bits[j], low):
        return False
    for i in range(len(j)):
        codes[i] = ((codes[i] + windows.first[j[i]]) << windows.low_bits[j[i]]) + low[i]
    return True
