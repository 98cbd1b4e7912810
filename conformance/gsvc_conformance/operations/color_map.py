"""Colour conversion in rational numbers, straight from (11-1) to (11-4): the oracle of the colour operations."""

from collections.abc import Sequence
from fractions import Fraction
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.constants import LUMA_WEIGHTS
from gsvc_base.exact.distinct import distinct
from gsvc_base.rendering.error_models import gamma
from gsvc_conformance.expectations import Decision

F8 = NDArray[np.float64]
Matrix = list[list[Fraction]]
Taps = tuple[NDArray[np.int64], F8]
"""The places and weights of the inputs of each output sample, both (samples, taps)."""

COLOR_ROUNDINGS: Final = 8
"""Roundings of a term of the affine map: coefficient, product, two sums, offset, and three to spare for numbers that
are brought to 0..1 and back."""


class ColorMap:
    """A conversion in rational numbers, straight from (11-1) to (11-4)."""

    def __init__(
        self,
        size: tuple[int, ...],
        chroma_format: int,
        matrix: int,
        full_range: int,
        location: int,
        bit_depth: int,
    ) -> None:
        height, width = self.size = size
        matrix = matrix if matrix != 2 else (6 if height <= 576 else 1)
        self.peak = 2**bit_depth - 1
        unit = 2 ** (bit_depth - 8)
        self.forward, self.inverse = _matrices(matrix)
        luma = (self.peak, 0) if full_range else (219 * unit, 16 * unit)
        chroma = (self.peak if full_range else 224 * unit, 128 * unit)
        if matrix == 8:
            chroma = (luma[0], chroma[1])
        self.scales = [luma, luma, luma] if matrix == 0 else [luma, chroma, chroma]
        self.places = (
            _sites(height, chroma_format == 1, Fraction((1, 1, 0, 0, 2, 2)[location], 2)),
            _sites(width, chroma_format in (1, 2), Fraction((0, 1, 0, 1, 0, 1)[location], 2)),
        )

    def up(self, plane: F8) -> F8:
        """A chroma plane (h, w) interpolated linearly at luma samples (H, W); without an error, like `down`."""
        taps = [_hats(np.arange(size), sites) for size, sites in zip(self.size, self.places, strict=True)]
        return _filtered(plane, taps)

    def down(self, plane: F8) -> F8:
        """The means (h, w) of a plane (H, W) over the length of two luma samples around each chroma sample's site."""
        taps = [
            (np.arange(size)[:, None], np.ones((size, 1))) if len(sites) == size else _boxes(size, sites)
            for size, sites in zip(self.size, self.places, strict=True)
        ]
        return _filtered(plane, taps)

    def samples(self, rows: Matrix, offsets: Sequence[int], terms: Sequence[F8], into: Sequence[int]) -> list[Decision]:
        """Each row's sum of coefficient * (term - offset), plus `into`, rounded in 0..peak.

        Binary32 may be off by gamma_8 times the sum of the magnitudes of coefficient * (|term| + offset). Where all
        coefficients are multiples of 1/256 it has no error.
        """
        shape = terms[0].shape
        first, inverse, _ = distinct(*(term.reshape(-1) for term in terms))
        terms = [term.reshape(-1)[first] for term in terms]
        decisions = []
        for row, zero in zip(rows, into, strict=True):
            exact = all((256 * c).denominator == 1 for c in row)
            shifted = [_rational(term) - offset for term, offset in zip(terms, offsets, strict=True)]
            value = sum(c * term for c, term in zip(row, shifted, strict=True)) + zero  # (n,) of Fraction
            magnitude = sum(
                abs(float(c)) * (term + offset) for c, term, offset in zip(row, terms, offsets, strict=True)
            )
            guard = np.zeros(terms[0].shape) if exact else gamma(COLOR_ROUNDINGS) * (magnitude + zero)
            decisions.append(self._decision(value, guard, inverse.reshape(shape)))
        return decisions

    def _decision(self, value: NDArray[np.object_], guard: F8, places: NDArray[np.int64]) -> Decision:
        dtype = np.uint8 if self.peak == 255 else np.uint16
        fractions = _rational(guard)
        rounded, lowest, highest = (
            np.vectorize(round, otypes=[np.int64])(np.clip(ends, 0, self.peak)).astype(dtype)
            for ends in (value, value - fractions, value + fractions)
        )
        alternative = np.where(lowest != rounded, lowest, highest)
        clear = (alternative == rounded) & (guard > 0)
        if not clear.any():
            return Decision(rounded[places], alternative[places])
        to_tie = np.vectorize(lambda v: float(abs(v - v.__floor__() - Fraction(1, 2))), otypes=[np.float64])(value)
        return Decision(rounded[places], alternative[places], float(to_tie[clear].min()), float(guard.max()))


def _matrices(matrix: int) -> tuple[Matrix, Matrix]:
    if matrix == 0:  # G', B', R'
        g_b_r = [[0, 1, 0], [0, 0, 1], [1, 0, 0]]
        return _fractions(g_b_r), _fractions(np.transpose(g_b_r).tolist())
    if matrix == 8:  # Y, Cg, Co
        quarters = _fractions([[1, 2, 1], [-1, 2, -1], [2, 0, -2]])
        return [[c / 4 for c in row] for row in quarters], _fractions([[1, -1, 1], [1, 1, 0], [1, -1, -1]])
    r, b = (Fraction(repr(weight)) for weight in LUMA_WEIGHTS[matrix])  # the decimals as they are written
    luma = [r, 1 - r - b, b]
    of_b, of_r = 2 * (1 - b), 2 * (1 - r)
    forward = [
        luma,
        [(is_b - c) / of_b for is_b, c in zip((0, 0, 1), luma, strict=True)],
        [(is_r - c) / of_r for is_r, c in zip((1, 0, 0), luma, strict=True)],
    ]
    one, zero = Fraction(1), Fraction(0)
    return forward, [[one, zero, of_r], [one, -of_b * b / luma[1], -of_r * r / luma[1]], [one, of_b, zero]]


def _fractions(rows: Sequence[Sequence[int]]) -> Matrix:
    return [[Fraction(c) for c in row] for row in rows]


def _rational(values: F8) -> NDArray[np.object_]:
    return np.asarray(np.vectorize(Fraction, otypes=[object])(values))


def _sites(size: int, subsampled: bool, phase: Fraction) -> F8:
    """Luma coordinates of the chroma samples of one side."""
    places = 2.0 * np.arange((size + 1) // 2) + float(phase) if subsampled else np.arange(float(size))
    return np.asarray(places, np.float64)


def _filtered(plane: F8, taps: Sequence[Taps]) -> F8:
    """Weighted sums along both axes: all weights are multiples of 1/4, so that no sum is rounded."""
    for places, weights in taps:
        plane = np.add.accumulate([w[:, None] * plane[at] for at, w in zip(places.T, weights.T, strict=True)])[-1].T
    return np.asarray(plane)


def _hats(places: NDArray[np.int64], sites: F8) -> Taps:
    """Linear interpolation between sites at equal distances; the outermost ones go on beyond."""
    last = len(sites) - 1
    step = sites[1] - sites[0] if last else 1.0
    at = np.clip((places - sites[0]) / step, 0, last)
    left = np.floor(at).astype(np.int64)
    return np.stack([left, np.minimum(left + 1, last)], axis=1), np.stack([1 - (at - left), at - left], axis=1)


def _boxes(size: int, sites: F8) -> Taps:
    """The part of two samples' length around a site that each luma sample covers, halved; border samples go on."""
    places = np.floor(sites - 1.5)[:, None] + np.arange(4)
    ends = np.minimum(sites[:, None] + 1, places + 0.5), np.maximum(sites[:, None] - 1, places - 0.5)
    return np.clip(places, 0, size - 1).astype(np.int64), np.maximum(ends[0] - ends[1], 0) / 2
