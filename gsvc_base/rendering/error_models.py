"""Error models: what the arithmetic of an implementation may do (spec.md section 13.3, R-13.3-1).

fp32/1 is binary32 with any rounding direction, (13-1) to (13-4). The others round to fewer digits as well (13-19).
tf32/1 rounds both factors of each product, as tensor cores do. bf16/1 and fp16/1 round whatever is stored: every input
and every result. Long sums stay in binary32, but for fp16-sums/1, which adds up to 16 terms in binary16. Positions are
stored relative to a place near the pixel: a bound for positions in the frame would say nothing.
"""

from dataclasses import dataclass
from math import inf
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gsvc_base.arrays import F8
from gsvc_base.constants import SMALLEST_NORMAL

EPS: Final = 2.0**-23
"""Unit roundoff of the error model fp32/1 (13-1)."""

ETA: Final = SMALLEST_NORMAL
"""Maximum loss by an underflow (13-2)."""

LOCAL: Final = 16.0
"""Pixels between a pixel and the place that stored positions are relative to, on each axis."""


def gamma(k: ArrayLike, unit: float = EPS) -> F8:
    """The relative error of k roundings in a row, k eps / (1 - k eps) (13-4); infinite where k eps reaches 1."""
    error = np.asarray(k, np.float64) * unit
    return np.where(error < 1, error / np.maximum(1 - error, ETA), np.inf)


def additions(terms: ArrayLike, rows: int = 0, columns: int = 0) -> F8:
    """The maximum number of additions D(n, r, c) that one of n terms of a sum takes part in, spec.md (13-4).

    Two stages of about sqrt(n) terms, such as threads and blocks, and 64 for what is added in pairs; a sum of r rows
    and c columns of pixels may also go by rows and then columns.
    """
    n = np.asarray(terms, np.float64)
    additions_of_stages = np.maximum(2 * np.ceil(np.sqrt(n)), rows + columns)
    return np.asarray(np.maximum(np.minimum(n - 1, additions_of_stages + 64), 0))


class Roundings(NamedTuple):
    """How often a number is rounded, at most: to binary32, as a factor of a product, and when it is stored."""

    binary32: float
    factors: int
    stored: int


@dataclass(frozen=True)
class ErrorModel:
    """An error model of spec.md section 13.3.

    Attributes
    ----------
    name
        With its version, such as ``tf32/1``.
    factor
        Unit roundoff of each factor of a product beside binary32's own roundings, 0 for none.
    stored
        Unit roundoff of what is stored, 0 for none.
    eta
        Maximum loss by an underflow.
    largest
        The largest number that can be stored.
    terms
        The number of terms that may be added as they are stored.
    local
        Pixels between a pixel and the place that stored positions are relative to.
    """

    name: str
    factor: float = 0.0
    stored: float = 0.0
    eta: float = ETA
    largest: float = inf
    terms: int = 1
    local: float = LOCAL

    @property
    def narrow(self) -> bool:
        """Whether anything is rounded to fewer digits than binary32 has."""
        return self.factor + self.stored > 0

    def digits(self, roundings: Roundings) -> float:
        """The relative error of the roundings to fewer digits alone."""
        return float(gamma(roundings.factors, self.factor) + gamma(roundings.stored, self.stored))

    def growth(self, roundings: Roundings, sums: ArrayLike = 0, terms: ArrayLike = 1) -> F8:
        """The relative error of roundings in a row (13-20), with `sums` more to binary32 in a sum of `terms`."""
        wide = gamma(np.asarray(sums) + roundings.binary32)
        if not self.narrow:
            return wide
        added = np.minimum(np.maximum(np.asarray(terms, np.float64) - 1, 0), self.terms - 1)
        narrow = gamma(roundings.factors, self.factor) + gamma(roundings.stored + added, self.stored)
        with np.errstate(invalid="ignore"):
            return np.where(np.isinf(wide) | np.isinf(narrow), np.inf, wide + narrow + wide * narrow)

    @property
    def position(self) -> float:
        """The absolute error of a stored position and of its distance to a pixel (13-21)."""
        return self.local * (self.stored + EPS) + 2 * self.eta if self.stored else 0.0

    def beyond(self, magnitude: ArrayLike) -> "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]":
        """Where numbers with roundings may be beyond the largest one."""
        return np.asarray(np.asarray(magnitude) >= self.largest / 2)


FP32: Final = ErrorModel("fp32/1")
ERROR_MODELS: Final = {
    model.name: model
    for model in (
        FP32,
        ErrorModel("tf32/1", factor=2.0**-10),
        ErrorModel("fp16/1", stored=2.0**-10, eta=2.0**-14, largest=65504.0),
        ErrorModel("fp16-sums/1", stored=2.0**-10, eta=2.0**-14, largest=65504.0, terms=16),
        ErrorModel("bf16/1", stored=2.0**-7),
    )
}
"""By name, the stricter ones first."""
