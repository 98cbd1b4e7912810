"""binary16: the positions and codebook entries of profile `paper` (paper section 3.8, Q_mu)."""

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_base.checks import door
from gsvc_base.errors import UsageError
from gsvc_ref._jit import kernel

LARGEST_HALF: Final = 65504.0
"""(2 - 2^-10) * 2^15, the largest finite binary16."""

MIN_EXPONENT: Final = -14
"""Exponent of the smallest normal binary16, whose spacing subnormals have too."""

FRACTION_BITS: Final = 10

FINEST_HALF: Final = MIN_EXPONENT - FRACTION_BITS
"""Binary logarithm of the spacing of subnormals; every binary16 is a multiple of it."""

EXPONENT_MASK: Final = 0x7C00
"""All exponent bits of a binary16: set in infinities and NaNs."""


# twin of spec.to_half
@door
def to_half(values: ArrayLike) -> NDArray[np.uint16]:
    """Patterns of the binary16 nearest to each value, ties to even (8-6), R-8-3.

    Parameters
    ----------
    values
        Any shape, f4 or f8; each is rounded once.

    Returns
    -------
    NDArray[np.uint16]
        The same shape.

    Raises
    ------
    UsageError
        A value is NaN, or rounds to a number above 65504.
    """
    array = np.asarray(values)
    with np.errstate(over="ignore", under="ignore"):
        halves = np.asarray(array.astype(np.float16))
    _refuse_first(~np.isfinite(halves), array)
    return halves.view(np.uint16)


# twin of spec.from_half
@door
def from_half(bits: ArrayLike) -> NDArray[np.float32]:
    """Values of 16-bit patterns, exactly (8-5), R-8-3.

    The patterns of infinities and NaN give just these: test `half_is_finite` first where they are not allowed.

    Parameters
    ----------
    bits
        Any shape, u2.

    Returns
    -------
    NDArray[np.float32]
        The same shape.

    Raises
    ------
    UsageError
        The array is not of unsigned 16-bit integers.
    """
    with np.errstate(invalid="ignore"):  # some machines warn of the patterns of signalling NaNs
        return np.asarray(_patterns(bits).view(np.float16).astype(np.float32))


def half_is_finite(bits: ArrayLike) -> NDArray[np.bool_]:
    """Whether each 16-bit pattern is a number, neither infinite nor NaN; same shape as `bits` (u2)."""
    return np.asarray((_patterns(bits) & np.uint16(EXPONENT_MASK)) != EXPONENT_MASK)


def coarsen_half(values: ArrayLike, step_exponent: int) -> NDArray[np.float32]:
    """Nearest multiples of 2^step_exponent that are binary16, f4 of the same shape; ties to the even multiple.

    An encoder's choice: low fraction bits that are always zero cost an entropy coder nothing. From step exponent -24
    downwards (the spacing of subnormals) this is plain rounding to binary16. A value without a finite binary16 is a
    UsageError.
    """
    wide = np.asarray(values, dtype=np.float64)
    flat = np.where(np.isfinite(wide), wide, 0.0).ravel()
    _coarsen(flat, step_exponent)
    rounded = flat.reshape(wide.shape)
    _refuse_first(~np.isfinite(wide) | (np.abs(rounded) > LARGEST_HALF), wide)
    return np.asarray(rounded.astype(np.float32))


@kernel()
def _coarsen(values: NDArray[np.float64], step_exponent: int) -> None:
    """Replace each of the values (n,) by its `nearest_half`."""
    for n in range(len(values)):
        values[n] = nearest_half(values[n], step_exponent)


@kernel(inline=True)
def nearest_half(value: float, step_exponent: int) -> float:
    """`coarsen_half` of one finite number; nothing is checked."""
    exponent = max(math.frexp(value)[1] - 1, MIN_EXPONENT)  # 2^exponent <= |value|; frexp gives 0.5..1
    step = math.ldexp(1.0, max(exponent - FRACTION_BITS, step_exponent))
    return float(np.rint(value / step) * step)


def _patterns(bits: ArrayLike) -> NDArray[np.uint16]:
    array = np.asarray(bits)
    if array.dtype != np.uint16:
        raise UsageError(f"binary16 patterns have dtype {array.dtype}; they must be uint16")
    return np.ascontiguousarray(array).reshape(array.shape)


def _refuse_first(bad: NDArray[np.bool_], values: NDArray[np.generic]) -> None:
    if bad.any():
        place = int(np.flatnonzero(bad)[0])
        raise UsageError(
            f"value {place} is {values.ravel()[place]}, not a finite binary16; "
            f"the largest magnitude is {LARGEST_HALF:.0f}"
        )
