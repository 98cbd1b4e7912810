"""Densities: how the planes of splats are distributed (spec.md section 15.7)."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, Literal, get_args

import numpy as np

from gsvc_ref._jit import kernel
from gsvc_ref.arrays import I8
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
    _cumulative(edges, centre, scale_code, unit_bits, EXP2, FAMILIES[family], result)
    return result


@kernel()
def _cumulative(
    edges: I8, centre: int, scale_code: int, unit_bits: int, exp2_table: I8, family: I8, result: I8
) -> None:
    bins = len(edges) + 1
    result[0], result[bins] = 0, ONE
    for i in range(1, bins):
        v = density_at(edges[i - 1], centre, scale_code, unit_bits, exp2_table, family)
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
    edges = 16 * (2 * np.arange(1, MAGNITUDE_CLASSES) - 1)
    steps = range(MAGNITUDE_CLASSES if density.slope else 1)
    return Distributions.of(
        [
            cumulative(edges, density.centre + density.slope * q // 4, density.family, density.scale_code, 2)
            for q in steps
        ]
    )


def code_magnitudes(run: Run, density: Density, context: I8, codes: I8 | None) -> I8:
    """Signed codes of a colour channel: passes of classes, of low bits and of signs (spec.md section 15.7)."""
    which = context if density.slope else np.zeros(len(context), np.int64)
    magnitudes = run.magnitudes(magnitude_distributions(density), which, None if codes is None else np.abs(codes))
    return run.signs(magnitudes, codes)


@dataclass(frozen=True, eq=False)
class Windows:
    """The windows of a plane (15-7) by class: distributions, raw low bits and first bins, (11,) each."""

    distributions: Distributions
    low_bits: I8
    first: I8


@lru_cache(maxsize=64)
def windows_of(plane: Plane, density: Density) -> Windows:
    """The windows of size, aspect or shear."""
    scale = int(exp2(256 * density.scale_code, 4))
    tables, low, firsts = [], [], []
    for j in range(CLASSES):
        step, centre = int(STEPS_OF[plane][j]), 64 * density.centre + 16 * density.slope * j
        r = 0
        while 16 * scale > _MOST_BINS * (step << r):
            r += 1
        width = step << r
        first, last = (centre - 8 * scale) // width, -((-centre - 8 * scale) // width)
        edges = (2 * (np.arange(first + 1, last + 1) << r) - 1) * step
        tables.append(cumulative(edges, centre, density.family, density.scale_code, 4))
        low.append(r)
        firsts.append(first)
    return Windows(Distributions.of(tables), np.array(low, np.int64), np.array(firsts, np.int64))


def code_windowed(run: Run, windows: Windows, j: I8, codes: I8 | None) -> I8:
    """The codes of a plane with windows, (N,), of splats of the classes j."""
    sizes, first = windows.low_bits[j], windows.first[j]
    bins = run.symbols(windows.distributions, j, None if codes is None else (codes >> sizes) - first)
    low = run.raw_bits(sizes, None if codes is None else codes & ((1 << sizes) - 1))
    return ((bins + first) << sizes) + low
