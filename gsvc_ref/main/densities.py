"""Densities: how the planes of splats are distributed (spec.md section 15.7)."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, Literal, NamedTuple, get_args

import numpy as np

from gsvc_base.arrays import I8
from gsvc_ref._jit import kernel
from gsvc_ref.main.passes import TOTAL, Distributions, Run, magnitude_classes
from gsvc_ref.main.state import SHEAR_STEPS, SIZE_STEPS
from gsvc_ref.main.tables import EXP2, LAPLACE, LOGISTIC, exp2

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

MAX_BINS: Final = 512
"""Most bins of 16 scales; a window with more has raw low bits (15-7)."""


@dataclass(frozen=True)
class Density:
    """The density of a plane."""

    family: int = 0  # `density_family`: 0 logistic, 1 Laplace
    scale_code: int = 0  # 0..31: the scale is 2^(scale_code / 4) units
    centre: int = 0  # -512..511
    slope: int = 0  # -128..127; 0 for luma and shear


@dataclass(frozen=True)
class Densities:
    """What densities() says: the density of each plane, and the `halving_code` of each halving."""

    planes: tuple[Density, ...]
    halving_codes: tuple[int, ...]

    def of(self, plane: Plane) -> Density:
        """The density of a plane."""
        return self.planes[PLANES.index(plane)]


def cumulative(edges: I8, centre: int, family: int, scale_code: int, unit_bits: int) -> I8:
    """Cumulative frequencies (K + 1,) of K bins with the doubled inner edges (K - 1,), 2^unit_bits to a unit (15-6)."""
    one = np.array([len(edges) + 1]), edges, np.array([centre])
    return _distributions(*one, scale_code, unit_bits, family_of(family)).cumulative


def family_of(density_family: int) -> I8:
    """The T of a `density_family`, (257,)."""
    return LAPLACE if density_family else LOGISTIC


@kernel(inline=True)
def density_at(edge: int, centre: int, scale_code: int, unit_bits: int, exp2_table: I8, family: I8) -> int:
    """V of (15-6) at a doubled edge: the distribution function in 2^-16."""
    shift = 2 - (-scale_code // 4) + unit_bits  # EXP2 has 15 - 2 bits after the point here; 16 scales are 2^16 of u
    u = 2**15 + ((edge - 2 * centre) * (exp2_table[-256 * scale_code & 1023] >> 2) >> shift)  # in 1/4096 of a scale
    u = min(max(u, 0), 2**16 - 1)
    place = u >> 8
    return int(family[place] + ((family[place + 1] - family[place]) * (u & 255) >> 8))


@kernel(inline=True)
def cumulative_at(
    i: int, bins: int, edge: int, centre: int, scale_code: int, unit_bits: int, exp2_table: I8, family: I8
) -> int:
    """C[i] of (15-6), 0 < i < bins, at the doubled edge in front of bin i; every bin has at least a frequency of 1."""
    return i + ((TOTAL - bins) * density_at(edge, centre, scale_code, unit_bits, exp2_table, family) >> 16)


@lru_cache(maxsize=64)
def magnitude_distributions(density: Density) -> Distributions:
    """The distributions of classes of magnitudes, by the class that the centre slopes with."""
    bins = np.full(MAGNITUDE_CLASSES, MAGNITUDE_CLASSES)
    edges = np.concatenate([_MAGNITUDE_EDGES] * MAGNITUDE_CLASSES)
    centres = density.centre + density.slope * np.arange(MAGNITUDE_CLASSES) // 4
    return _distributions(bins, edges, centres, density.scale_code, 2, family_of(density.family))


@kernel()
def _distributions(bins: I8, edges: I8, centres: I8, scale_code: int, unit_bits: int, family: I8) -> Distributions:
    """The distributions of densities of so many bins each, by their inner edges, one after the other, and centres."""
    first = np.zeros(len(bins) + 1, np.int64)
    for row in range(len(bins)):
        first[row + 1] = first[row] + bins[row] + 1
    cumulative, edge = np.empty(first[len(bins)], np.int64), 0
    for row in range(len(bins)):
        cumulative[first[row]], cumulative[first[row + 1] - 1] = 0, TOTAL
        for i in range(1, bins[row]):
            C = cumulative_at(i, bins[row], edges[edge], centres[row], scale_code, unit_bits, EXP2, family)
            cumulative[first[row] + i] = C
            edge += 1
    return Distributions(cumulative, first)


def code_magnitudes(run: Run, at: int, density: Density, context: I8, codes: I8 | None) -> I8:
    """Magnitudes of the codes of a colour channel: classes in the pass `at`, and low bits (spec.md section 15.7)."""
    magnitudes = None if codes is None else np.abs(codes)
    classes = None if magnitudes is None else magnitude_classes(magnitudes)
    return run.low_bits(at, run.symbols(at, magnitude_distributions(density), context, classes), magnitudes)


class Windows(NamedTuple):
    """The windows of a plane (15-7) by class: distributions, raw low bits and first bins, (11,) each."""

    distributions: Distributions
    low_bits: I8
    first: I8


@lru_cache(maxsize=64)
def windows_of(plane: Plane, density: Density) -> Windows:
    """The windows of size, aspect or shear."""
    steps = STEPS_OF[plane]
    centres = 64 * density.centre + 16 * density.slope * np.arange(len(steps))
    return windows_at(centres, steps, density.family, density.scale_code)


def windows_at(centres: I8, steps: I8, density_family: int, scale_code: int) -> Windows:
    """The windows around some centres, of codes of some steps."""
    return _windows(steps, centres, scale_code, int(exp2(256 * scale_code, 4)), family_of(density_family))


@kernel()
def _windows(steps: I8, centres: I8, scale_code: int, scale: int, family: I8) -> Windows:
    """(15-7) of each step; `scale` is 2^(scale_code / 4) in the unit of the steps."""
    low, first = np.empty(len(steps), np.int64), np.empty(len(steps), np.int64)
    begins = np.zeros(len(steps) + 1, np.int64)
    for j in range(len(steps)):
        middle, r = centres[j], 0
        while 16 * scale > MAX_BINS * (steps[j] << r):
            r += 1
        width = steps[j] << r
        low[j], first[j] = r, (middle - 8 * scale) // width
        last = -((-middle - 8 * scale) // width)
        begins[j + 1] = begins[j] + last - first[j] + 2
    cumulative = np.empty(begins[len(steps)], np.int64)
    for j in range(len(steps)):
        middle, bins = centres[j], begins[j + 1] - begins[j] - 1
        cumulative[begins[j]], cumulative[begins[j + 1] - 1] = 0, TOTAL
        for i in range(1, bins):
            edge = (2 * ((first[j] + i) << low[j]) - 1) * steps[j]
            cumulative[begins[j] + i] = cumulative_at(i, bins, edge, middle, scale_code, 4, EXP2, family)
    return Windows(Distributions(cumulative, begins), low, first)


def code_windowed(run: Run, at: int, windows: Windows, j: I8, codes: I8 | None, *, late: bool) -> I8:
    """The codes of a plane with windows, (N,), of splats of the classes j: bins in the pass `at`, and low bits."""
    sizes, first = windows.low_bits[j], windows.first[j]
    bins = run.symbols(at, windows.distributions, j, None if codes is None else (codes >> sizes) - first)
    low = run.raw_bits(None if late else at, sizes, None if codes is None else codes & ((1 << sizes) - 1))
    return ((bins + first) << sizes) + low
