"""Numbers that are a function of the right ones, element by element: curves, clamps, formats of fewer bits."""

from collections.abc import Callable, Iterator
from typing import Final

import numpy as np

from gsvc_conformance.diagnosis.failures import F8, Array, Part
from gsvc_conformance.diagnosis.regions import Candidate

DISTINCT: Final = 16
"""Minimum number of different numbers that must fit a format, or a curve."""

ROUND: Final = 0.5
"""A format says nothing where more of the right numbers fit it, too."""


def _encoded(x: F8) -> F8:
    """The transfer function of sRGB."""
    x = np.maximum(x, 0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def _decoded(x: F8) -> F8:
    x = np.maximum(x, 0)
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)


CURVES: Final[tuple[tuple[str, Callable[[F8], F8]], ...]] = (
    ("numbers clamped to 0..1", lambda x: np.clip(x, 0, 1)),
    ("negative numbers taken as 0", lambda x: np.maximum(x, 0)),
    ("numbers above 1 taken as 1", lambda x: np.minimum(x, 1)),
    ("numbers clamped to -1..1", lambda x: np.clip(x, -1, 1)),
    ("magnitudes: negative numbers made positive", np.abs),
    ("the transfer function (gamma) of sRGB applied, as a target with sRGB does", _encoded),
    ("the inverse of the transfer function (gamma) of sRGB applied, as a texture with sRGB does", _decoded),
    ("a gamma of 1/2.2 applied", lambda x: np.maximum(x, 0) ** (1 / 2.2)),
    ("a gamma of 2.2 applied", lambda x: np.maximum(x, 0) ** 2.2),
    ("squares of the right numbers", np.square),
    ("roots of the right numbers", lambda x: np.sqrt(np.maximum(x, 0))),
    ("1 minus the right numbers", lambda x: 1 - x),
    ("reciprocals of the right numbers", lambda x: 1 / x),
    ("logarithms of the right numbers", np.log),
    ("exponentials of the right numbers", np.exp),
    ("steps of 1/255 from 0 to 1, as in a target of 8 bits", lambda x: np.rint(np.clip(x, 0, 1) * 255) / 255),
    ("steps of 1/255, as in 8 bits", lambda x: np.rint(x * 255) / 255),
    ("numbers cut to whole ones", np.trunc),
    ("numbers rounded to whole ones", np.rint),
)
"""Curves by name, the plainer first: an implementation may send its numbers through one."""


def curve_candidates(part: Part) -> Iterator[Candidate]:
    """Which function of the right numbers was given, or which format all given numbers fit."""
    if part.given.dtype.kind != "f" or len(np.unique(part.right)) < DISTINCT:
        return
    with np.errstate(all="ignore"):
        for sentence, curve in CURVES:
            if part.agrees(curve(part.right)):
                yield Candidate(sentence)
                return
    for sentence, fits in FORMATS:
        if _all_fit(part.given[part.wrong], part.expectation.value[part.wrong], fits):
            yield Candidate(sentence)
            return


def _all_fit(given: Array, right: Array, fits: Callable[[Array], Array]) -> bool:
    """Whether all that was given is of a format, which the right numbers are not."""
    numbers = given[np.isfinite(given) & (given != 0)].astype(np.float32)
    others = right[np.isfinite(right) & (right != 0)].astype(np.float32)
    if len(np.unique(numbers)) < DISTINCT or not others.size:
        return False
    return bool(fits(numbers).all() and fits(others).mean() < ROUND)


def _half(numbers: Array) -> Array:
    with np.errstate(over="ignore"):
        return np.asarray(numbers.astype(np.float16).astype(np.float32) == numbers)


def _brain(numbers: Array) -> Array:
    return np.asarray(np.ascontiguousarray(numbers).view(np.uint32) & 0xFFFF == 0)


FORMATS: Final[tuple[tuple[str, Callable[[Array], Array]], ...]] = (
    ("numbers that all fit in bfloat16 (8 significant bits)", _brain),
    ("numbers that all fit in binary16 (half precision, 11 significant bits)", _half),
)
"""Formats of fewer bits than binary32 has, the smaller first."""
