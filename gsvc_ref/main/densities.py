"""Densities: how the planes of splats are distributed (spec.md section 15.7)."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, Literal, NamedTuple, get_args

import numpy as np

from gsvc_base.arrays import I8
from gsvc_ref._jit import kernel
from gsvc_ref.main.fast.lanes import Lanes, read_low_bits, read_raw, read_signs, read_symbols
from gsvc_ref.main.passes import ONE, Distributions, Run
from gsvc_ref.main.state import CLASSES, SHEAR_STEPS, SIZE_STEPS
from gsvc_ref.main.tables import EXP2, FAMILIES, exp2

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

_MAGNITUDE_EDGES: Final[I8] = 16 * (2 * np.arange(1, MAGNITUDE_CLASSES) - 1)
"""The inner edges of the classes of magnitudes, doubled."""

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
    one = np.array([len(edges) + 1]), edges, np.array([centre])
    return _distributions(*one, scale_code, unit_bits, FAMILIES[family]).cumulative


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
    bins = np.full(MAGNITUDE_CLASSES, MAGNITUDE_CLASSES)
    edges = np.concatenate([_MAGNITUDE_EDGES] * MAGNITUDE_CLASSES)
    centres = density.centre + density.slope * np.arange(MAGNITUDE_CLASSES) // 4
    return _distributions(bins, edges, centres, density.scale_code, 2, FAMILIES[density.family])


@kernel()
def _distributions(bins: I8, edges: I8, centres: I8, scale_code: int, unit_bits: int, family: I8) -> Distributions:
    """The distributions of densities of so many bins each, by their inner edges, one behind the other, and centres."""
    first = np.zeros(len(bins) + 1, np.int64)
    for row in range(len(bins)):
        first[row + 1] = first[row] + bins[row] + 1
    cumulative, edge = np.empty(first[len(bins)], np.int64), 0
    for row in range(len(bins)):
        cumulative[first[row]], cumulative[first[row + 1] - 1] = 0, ONE
        for i in range(1, bins[row]):
            v = density_at(edges[edge], centres[row], scale_code, unit_bits, EXP2, family)
            cumulative[first[row] + i] = i + ((ONE - bins[row]) * v >> 16)
            edge += 1
    return Distributions(cumulative, first)


def code_magnitudes(run: Run, density: Density, context: I8, codes: I8 | None) -> I8:
    """Signed codes of a colour channel: passes of classes, of low bits and of signs (spec.md section 15.7)."""
    magnitudes = run.magnitudes(magnitude_distributions(density), context, None if codes is None else np.abs(codes))
    return run.signs(magnitudes, codes)


@kernel()
def read_codes(lanes: Lanes, tables: Distributions, context: I8, codes: I8) -> bool:
    """Signed codes of a colour channel, as `code_magnitudes` has them; whether the words sufficed."""
    if not read_symbols(lanes, tables, context, codes):
        return False
    return read_low_bits(lanes, codes) and read_signs(lanes, codes)


class Windows(NamedTuple):
    """The windows of a plane (15-7) by class: distributions, raw low bits and first bins, (11,) each."""

    distributions: Distributions
    low_bits: I8
    first: I8


@lru_cache(maxsize=64)
def windows_of(plane: Plane, density: Density) -> Windows:
    """The windows of size, aspect or shear."""
    scale, steps = int(exp2(256 * density.scale_code, 4)), STEPS_OF[plane]
    centres = 64 * density.centre + 16 * density.slope * np.arange(CLASSES)
    low = np.array([max(-(-16 * scale // (_MOST_BINS * step)) - 1, 0).bit_length() for step in steps.tolist()])
    first = (centres - 8 * scale) // (steps << low)
    bins = -((-centres - 8 * scale) // (steps << low)) - first + 1
    edges = np.concatenate(
        [(2 * (np.arange(a + 1, a + n) << r) - 1) * step for a, n, r, step in zip(first, bins, low, steps, strict=True)]
    )
    tables = _distributions(bins, edges, centres, density.scale_code, 4, FAMILIES[density.family])
    return Windows(tables, low, first)


def code_windowed(run: Run, windows: Windows, j: I8, codes: I8 | None) -> I8:
    """The codes of a plane with windows, (N,), of splats of the classes j."""
    sizes, first = windows.low_bits[j], windows.first[j]
    bins = run.symbols(windows.distributions, j, None if codes is None else (codes >> sizes) - first)
    low = run.raw_bits(sizes, None if codes is None else codes & ((1 << sizes) - 1))
    return ((bins + first) << sizes) + low


@kernel()
def read_windowed(lanes: Lanes, windows: Windows, j: I8, codes: I8) -> bool:
    """The codes of a plane with windows, as `code_windowed` has them; whether the words sufficed."""
    sizes, low = np.empty(len(j), np.int64), np.empty(len(j), np.int64)
    for i in range(len(j)):
        sizes[i] = windows.low_bits[j[i]]
    if not (read_symbols(lanes, windows.distributions, j, codes) and read_raw(lanes, sizes, low)):
        return False
    for i in range(len(j)):
        codes[i] = ((codes[i] + windows.first[j[i]]) << sizes[i]) + low[i]
    return True
