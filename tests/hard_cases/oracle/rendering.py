"""Sums, frames and gradients in 60 digits, pixel by pixel from (9-1), (9-2) and (10-3) to (10-9)."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from mpmath import exp, log, mpf
from numpy.typing import NDArray

from tests.hard_cases.measuring import Objects, Truth, exactly, precise

F4 = NDArray[np.float32]

SMALLEST_NORMAL = mpf(2) ** -126
HALF = mpf(1) / 2


class Weight(NamedTuple):
    """One splat at one pixel (i, j) that it covers."""

    i: int
    j: int
    u1: mpf
    u2: mpf
    g: mpf


def weights(splat: Objects, width: int, height: int) -> Iterator[Weight]:
    """The pixels that a splat (8,) covers: sigma is compared with ln 255 to all digits."""
    x, y, l11, l21, l22 = splat[:5]
    if l11 < SMALLEST_NORMAL or l22 < SMALLEST_NORMAL:
        return
    ln_255 = log(255)
    for i in range(width):
        u1 = (i + HALF - x) / l11
        for j in range(height):
            u2 = ((j + HALF - y) - l21 * u1) / l22
            sigma = (u1 * u1 + u2 * u2) / 2
            if sigma <= ln_255:
                yield Weight(i, j, u1, u2, exp(-sigma))


def zeros(*shape: int) -> Objects:
    """Zeros of any precision."""
    return np.full(shape, mpf(0), object)


@precise
def render_sum(parameters: F4, width: int, height: int) -> Mapping[str, Truth]:
    """(9-2)."""
    C = zeros(height, width, 3)
    for splat in exactly(parameters):
        for at in weights(splat, width, height):
            C[at.j, at.i] += splat[5:] * at.g
    return {"sum": Truth(C)}


@precise
def render_gradients(parameters: F4, residual: F4) -> Mapping[str, Truth]:
    """(10-7) to (10-9), term by term."""
    height, width, _ = residual.shape
    e = exactly(residual)
    gradients = zeros(len(parameters), 8)
    for gradient, splat in zip(gradients, exactly(parameters), strict=True):
        l11, l21, l22 = splat[2:5]
        for i, j, u1, u2, g in weights(splat, width, height):
            v2 = u2 / l22
            v1 = (u1 - l21 * v2) / l11
            q = g * sum(e[j, i] * splat[5:])
            gradient += np.array([q * v1, q * v2, q * v1 * u1, q * v2 * u1, q * v2 * u2, *(g * e[j, i])], object)
    return {"gradients": Truth(gradients)}


def _clamped(value: Any) -> mpf:
    return min(max(value, mpf(0)), mpf(1))


@precise
def scaled(C: Objects, bit_depth: int) -> Objects:
    """R-9.1-1 but for the rounding: clamp, and scale to the peak."""
    return np.array([_clamped(value) * (2**bit_depth - 1) for value in C.flat], object).reshape(C.shape)


@precise
def rounded(C: Objects, bit_depth: int) -> Objects:
    """R-9.1-1: clamp, scale, and round half to even, as integers."""
    return np.array([_nearest(value) for value in scaled(C, bit_depth).flat], object).reshape(C.shape)


def _nearest(value: mpf) -> int:
    low = int(value)  # value >= 0
    part = value - low
    return low + (part > HALF or (part == HALF and low % 2 == 1))


def to_frame(sum: F4, bit_depth: int) -> Mapping[str, Truth]:
    """R-9.1-1 of a given sum."""
    return {"frame": Truth(rounded(exactly(sum), bit_depth))}


def render_frame(parameters: F4, width: int, height: int, bit_depth: int) -> Mapping[str, Truth]:
    """R-9.1-1 of (9-2)."""
    return {"frame": Truth(rounded(render_sum(parameters, width, height)["sum"].value, bit_depth))}
