"""Colour conversion in rational numbers, straight from (11-1) to (11-4): the oracle of the colour stages."""

from collections.abc import Sequence
from fractions import Fraction
from typing import Final

import numpy as np
from numpy.typing import NDArray

from conformance.expectations import Decision
from gsvc_ref.rendering.bounds import gamma

F8 = NDArray[np.float64]
Matrix = list[list[Fraction]]
Taps = tuple[NDArray[np.int64], F8]
"""The samples that each result is a weighted sum of, and their weights: (taps, results) both."""

LUMA_WEIGHTS: Final = {
    1: ("0.2126", "0.0722"),
    4: ("0.30", "0.11"),
    5: ("0.299", "0.114"),
    6: ("0.299", "0.114"),
    7: ("0.212", "0.087"),
    9: ("0.2627", "0.0593"),
}
"""K_R and K_B by matrix_coefficients, ITU-T H.273 table 4."""

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

    def up(self) -> list[Taps]:
        """The linear interpolation of chroma samples at luma samples, of rows and of columns."""
        return [_hats(np.arange(size), sites) for size, sites in zip(self.size, self.places, strict=True)]

    def down(self) -> list[Taps]:
        """The means over a chroma sample's two luma samples' length, of rows and of columns."""
        return [
            (np.arange(size)[None], np.ones((1, size))) if len(sites) == size else _boxes(size, sites)
            for size, sites in zip(self.size, self.places, strict=True)
        ]

    def samples(self, rows: Matrix, offsets: Sequence[int], terms: Sequence[F8], into: Sequence[int]) -> list[Decision]:
        """Each row's sum of coefficient * (term - offset), plus `into`, rounded in 0..peak.

        Binary32 may be off by gamma_8 times the sum of the magnitudes of coefficient * (|term| + offset). Where all
        coefficients are multiples of 1/256 it has no error.
        """
        decisions = []
        for row, zero in zip(rows, into, strict=True):
            exact = all((256 * c).denominator == 1 for c in row)
            shifted = [_rational(term) - offset for term, offset in zip(terms, offsets, strict=True)]
            value = sum(c * term for c, term in zip(row, shifted, strict=True)) + zero  # (H, W) of Fraction
            magnitude = sum(
                abs(float(c)) * (term + offset) for c, term, offset in zip(row, terms, offsets, strict=True)
            )
            guard = np.zeros(terms[0].shape) if exact else gamma(COLOR_ROUNDINGS) * (magnitude + zero)
            decisions.append(self._decision(value, guard))
        return decisions

    def _decision(self, value: NDArray[np.object_], guard: F8) -> Decision:
        dtype = np.uint8 if self.peak == 255 else np.uint16
        fractions = _rational(guard)
        rounded, lowest, highest = (
            np.vectorize(round, otypes=[np.int64])(np.clip(ends, 0, self.peak)).astype(dtype)
            for ends in (value, value - fractions, value + fractions)
        )
        alternative = np.where(lowest != rounded, lowest, highest)
        clear = (alternative == rounded) & (guard > 0)
        if not clear.any():
            return Decision(rounded, alternative)
        to_tie = np.vectorize(lambda v: float(abs(v - v.__floor__() - Fraction(1, 2))), otypes=[np.float64])(value)
        return Decision(rounded, alternative, float(to_tie[clear].min()), float(guard.max()))


def _matrices(matrix: int) -> tuple[Matrix, Matrix]:
    if matrix == 0:  # G', B', R'
        g_b_r = [[0, 1, 0], [0, 0, 1], [1, 0, 0]]
        return _fractions(g_b_r), _fractions(np.transpose(g_b_r).tolist())
    if matrix == 8:  # Y, Cg, Co
        quarters = _fractions([[1, 2, 1], [-1, 2, -1], [2, 0, -2]])
        return [[c / 4 for c in row] for row in quarters], _fractions([[1, -1, 1], [1, 1, 0], [1, -1, -1]])
    r, b = (Fraction(text) for text in LUMA_WEIGHTS[matrix])
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


def _hats(places: NDArray[np.int64], sites: F8) -> Taps:
    """The two sites on either side of each place, by linear interpolation; the outermost ones go on beyond."""
    right = np.clip(np.searchsorted(sites, places, side="right"), min(1, len(sites) - 1), len(sites) - 1)
    left = np.maximum(right - 1, 0)
    apart = np.where(right > left, sites[right] - sites[left], 1.0)
    of_right = np.clip((places - sites[left]) / apart, 0, 1)
    return np.stack([left, right]), np.stack([1 - of_right, of_right])


def _boxes(size: int, sites: F8) -> Taps:
    """What each sample covers of the two samples' length around a site, halved; the outermost samples go on beyond."""
    places = np.floor(sites) + np.arange(-1, 3)[:, None]
    overlap = np.minimum(sites + 1, places + 0.5) - np.maximum(sites - 1, places - 0.5)
    return np.clip(places, 0, size - 1).astype(np.int64), np.maximum(overlap, 0) / 2


def weighted(plane: F8, taps: Sequence[Taps]) -> F8:
    """The weighted sums of a plane's rows, then of its columns; weights are multiples of 1/4, so sums are exact."""
    (rows, of_rows), (columns, of_columns) = taps
    half = sum(plane[row] * weight[:, None] for row, weight in zip(rows, of_rows, strict=True))
    return np.asarray(sum(half[:, c] * weight for c, weight in zip(columns, of_columns, strict=True)))
