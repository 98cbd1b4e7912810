"""The exact sums and gradients of splats, rounded once: what `expansions` makes of (9-1), (9-2) and (10-3) to (10-9).

A footprint in binary64 tells which pixels a splat may cover; there its weight is computed to 106 bits or more, and
whether it covers the pixel is decided by its exact sigma. Equal splats are computed once.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.constants import LN_255
from gsvc_base.exact.distinct import distinct
from gsvc_base.exact.expansions import COMPONENT_COUNTS, Expansion, exact, joined, settled, sums_of, where
from gsvc_base.rendering.bounds import SumBound, error_footprints, gradient_bound
from gsvc_base.rendering.error_models import ErrorModel
from gsvc_conformance.elementary import exp

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]
I4 = NDArray[np.int32]
I8 = NDArray[np.int64]

FOR_BINARY64: Final = 1 + 2.0**-20
"""Covers the errors of sums in binary64, which are far below those of models with fewer digits."""
BATCH = 1 << 21
"""Pairs of splats and pixels that are held at a time where they need not be sorted."""


@dataclass(frozen=True)
class Pairs:
    """Splats and pixels that they cover or may cover.

    Attributes
    ----------
    splat
        (K,) i4, rows of the parameters.
    row, column
        (K,) i4.
    """

    splat: I4
    row: I4
    column: I4

    def __getitem__(self, place: slice | I8 | NDArray[np.bool_]) -> "Pairs":
        return Pairs(self.splat[place], self.row[place], self.column[place])


def sum_with_bound(parameters: F4, width: int, height: int) -> tuple[F8, F8]:
    """The sum of (9-2), rounded once to binary64, and the bound (13-11): both (H, W, 3) f8."""
    first, _, counts = distinct(parameters)
    splats = parameters[first]
    bound, found = SumBound(width, height), []
    for n, splat, pixels, errors in error_footprints(splats, width, height):
        bound.add(splat, pixels, errors, int(counts[n]))
        found.append(_pairs(n, pixels.covered | errors.band, pixels.rows, pixels.columns))
    C = np.zeros((height * width, 3))
    if any(len(some.splat) for some in found):
        pairs = _joined(found)
        found.clear()  # a large frame has many
        places = pairs.row.astype(np.int64) * width + pairs.column
        order = np.argsort(places, kind="stable")
        at, ranks = np.unique(places[order], return_inverse=True)
        C[at] = _sums(splats, counts, pairs[order], ranks)
    return C.reshape(height, width, 3), bound.bound()


def _sums(splats: F4, counts: I8, pairs: Pairs, ranks: I8) -> F8:
    """The sums (n, 3) of n pixels; `ranks` 0, 1, .. n - 1 of the pairs ascend."""

    def evaluate(most: int, pixels: I8) -> tuple[Expansion]:
        wanted = np.isin(ranks, pixels)
        some = pairs[wanted]
        weights = Weights(splats, most)

        def terms(chunk: slice) -> Expansion:
            part = some[chunk]
            g = weights.of(part)[0]
            return g[:, None] * exact(splats[part.splat, 5:].astype(np.float64) * counts[part.splat, None])

        return (sums_of(terms, np.searchsorted(pixels, ranks[wanted]), len(pixels)),)

    return settled(evaluate, int(ranks[-1]) + 1)[0]


def gradients_with_bound(parameters: F4, residual: F4) -> tuple[F8, F8]:
    """The gradients of (10-3) to (10-9), rounded once to binary64, and the bounds (13-16): both (N, 8) f8."""
    first, inverse, _ = distinct(parameters)
    splats = parameters[first]
    gradients, bound = np.zeros((2, *splats.shape))
    for batch in _batches(splats, residual.astype(np.float64), bound):
        own, ranks = np.unique(batch.splat, return_inverse=True)
        gradients[own] = _gradients(splats, residual, batch, ranks)
    return gradients[inverse], bound[inverse]


def picture_by_model(model: ErrorModel, parameters: F4, width: int, height: int) -> tuple[F8, F8]:
    """The sum of (9-2) in binary64, and its bound by an error model with fewer digits: both (H, W, 3) f8."""
    first, _, counts = distinct(parameters)
    C, bound = np.zeros((height, width, 3)), SumBound(width, height, model)
    for n, splat, pixels, errors in error_footprints(parameters[first], width, height, model):
        C[pixels.rows, pixels.columns] += pixels.g[..., None] * (splat[5:] * counts[n])
        bound.add(splat, pixels, errors, int(counts[n]))
    return C, bound.bound() * FOR_BINARY64


def gradient_bounds(model: ErrorModel, parameters: F4, residual: F4) -> F8:
    """The bounds (13-16) of gradients by an error model, (N, 8) f8."""
    first, inverse, _ = distinct(parameters)
    splats, e = parameters[first], residual.astype(np.float64)
    bound = np.zeros(splats.shape)
    for n, splat, pixels, errors in error_footprints(splats, e.shape[1], e.shape[0], model):
        bound[n] = gradient_bound(splat, pixels, errors, e[pixels.rows, pixels.columns], model)
    return np.asarray(bound[inverse])


def _batches(splats: F4, residual: F8, bound: F8) -> Iterator[Pairs]:
    """The pairs of all splats, in batches of whole splats; fills in their bounds."""
    height, width = residual.shape[:2]
    found, held = [], 0
    for n, splat, pixels, errors in error_footprints(splats, width, height):
        bound[n] = gradient_bound(splat, pixels, errors, residual[pixels.rows, pixels.columns])
        found.append(_pairs(n, pixels.covered | errors.band, pixels.rows, pixels.columns))
        held += len(found[-1].splat)
        if held > BATCH:
            yield _joined(found)
            found, held = [], 0
    if held:
        yield _joined(found)


def _gradients(splats: F4, residual: F4, pairs: Pairs, ranks: I8) -> F8:
    """The gradients (n, 8) of the n splats that occur among pairs; `ranks` are their places among these."""

    def evaluate(most: int, wanted: I8) -> tuple[Expansion]:
        among = np.isin(ranks, wanted)
        some = pairs[among]
        weights = Weights(splats, most)
        splat = some.splat[np.unique(ranks[among], return_index=True)[1]]
        moments = sums_of(
            lambda chunk: _moments(weights, some[chunk], splats, residual),
            np.searchsorted(wanted, ranks[among]),
            len(wanted),
        )
        i11, i22, l21 = weights.i11[splat], weights.i22[splat], exact(splats[splat, 3])
        u1, u2, u11, u12, u22 = (moments[:, k] for k in range(5))
        shear = l21 * i11 * i22
        columns = (u1 * i11 - u2 * shear, u2 * i22, u11 * i11 - u12 * shear, u12 * i22, u22 * i22)
        return (joined(*(column[:, None] for column in columns), moments[:, 5:], axis=1),)

    return settled(evaluate, int(ranks.max()) + 1)[0]


def _moments(weights: "Weights", pairs: Pairs, splats: F4, residual: F4) -> Expansion:
    """Each pair's q u1, q u2, q u1^2, q u1 u2, q u2^2 and g e, (K, 8), with q = g (e . c')."""
    g, u1, u2 = weights.of(pairs)
    e = residual[pairs.row, pairs.column].astype(np.float64)
    products = exact(e * splats[pairs.splat, 5:])  # 48 bits, without an error
    q = g * products.total(1)
    of_u1, of_u2 = q * u1, q * u2
    columns = (of_u1, of_u2, of_u1 * u1, of_u1 * u2, of_u2 * u2)
    return joined(*(column[:, None] for column in columns), g[:, None] * exact(e), axis=1)


class Weights:
    """Weights exp(-sigma) of splats (n, 8) f4, with so many components.

    Attributes
    ----------
    i11, i22
        (n,), the reciprocals of l11 and l22; what is degenerate has no pairs.
    """

    def __init__(self, splats: F4, most: int) -> None:
        self._splats = splats.astype(np.float64)
        self._most = most
        drawn = np.isfinite(self._splats[:, 2:5]).all(axis=1) & (self._splats[:, 2] > 0) & (self._splats[:, 4] > 0)
        l11, l22 = (np.where(drawn, self._splats[:, column], 1.0) for column in (2, 4))
        self.i11, self.i22 = exact(1.0, most) / exact(l11), exact(1.0, most) / exact(l22)

    def of(self, pairs: Pairs) -> tuple[Expansion, Expansion, Expansion]:
        """The weights g, which are 0 where the pixel is not covered, u1 and u2 of pairs: (K,) each.

        Where the radius of sigma leaves open whether the pixel is covered, g has a radius of 1.

        Raises
        ------
        ArithmeticError
            It is open with the most components that there are.
        """
        x, y, l21 = (exact(self._splats[pairs.splat, column], self._most) for column in (0, 1, 3))
        u1 = (exact(pairs.column + 0.5) - x) * self.i11[pairs.splat]
        u2 = (exact(pairs.row + 0.5) - y - l21 * u1) * self.i22[pairs.splat]
        sigma = (u1 * u1 + u2 * u2).scaled(-1)
        side = (sigma - exact(LN_255)).sign()
        if self._most == COMPONENT_COUNTS[-1] and np.isnan(side).any():
            raise ArithmeticError("whether a splat covers a pixel is open with the most components")
        g = exp(-where(side <= 0, sigma, exact(0.0)))
        g = where(side <= 0, g, exact(0.0))
        return Expansion(g.parts, g.radius + np.isnan(side), self._most), u1, u2


def _pairs(splat: int, at: NDArray[np.bool_], rows: slice, columns: slice) -> Pairs:
    row, column = np.nonzero(at)
    places = (np.full(len(row), splat), row + rows.start, column + columns.start)
    return Pairs(*(place.astype(np.int32) for place in places))


def _joined(parts: list[Pairs]) -> Pairs:
    return Pairs(*(np.concatenate([getattr(part, name) for part in parts]) for name in ("splat", "row", "column")))
