"""Causes that need no bug to be tried: the right numbers in other places, or none at all."""

from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

TILES: Final = (16, 8, 32)
"""Sides of the blocks of pixels beyond whose last whole one a picture may have been left out."""

NOTHING_WRITTEN: Final = "an output that nothing was written to"

LEAST: Final = 0.99
"""Fraction of the elements that a layout must give."""

NEAR: Final = 1e-4
"""How near, of the largest element: a layout is looked for, not judged."""


def layout_cause(value: Array, mine: Array) -> str:
    """What a wrong output looks like: empty, the right one in another order or scale, or a part of it; '' if like none.

    Parameters
    ----------
    value
        What is expected.
    mine
        The wrong output, of the same shape.
    """
    if value.shape != mine.shape or mine.size < 2:
        return ""
    if sentence := _never_written(value, mine):
        return sentence
    right, given = value.astype(np.float64), mine.astype(np.float64)
    if not (np.isfinite(right).all() and np.isfinite(given).all()):
        return ""
    for sentence, other in _layouts(right):
        if _same(given, other) and not _same(right, other):
            return sentence
    return _left_out(right, given)


def _never_written(value: Array, mine: Array) -> str:
    """Every element is 0, or NaN, or the same number; it is not meant to be so."""
    first = mine.flat[0]
    if not np.array_equal(mine, np.full_like(mine, first), equal_nan=mine.dtype.kind == "f"):
        return ""
    if not (value != value.flat[0]).any():
        return ""
    return f"{NOTHING_WRITTEN}: every element is {first:g}"


def _layouts(right: Array) -> Iterator[tuple[str, Array]]:
    """The right output as plausible mistakes of order and scale would leave it."""
    if right.ndim == 3 and right.shape[2] == 3:
        yield "channels in the order B, G, R", right[:, :, ::-1]
        yield "the y axis upwards", right[::-1]
        yield "the x axis to the left", right[:, ::-1]
        yield "planes one after the other (3, H, W) in place of (H, W, 3)", _in_shape(right.transpose(2, 0, 1), right)
        yield "columns one after the other (W, H, 3) in place of (H, W, 3)", _in_shape(right.transpose(1, 0, 2), right)
    elif right.ndim == 2:
        yield (
            "columns one after the other in place of rows (fields of splats in place of splats)",
            _in_shape(right.T, right),
        )
    yield "numbers 255 times as large", right * 255
    yield "numbers divided by 255", right / 255
    yield "numbers with the other sign", -right


def _in_shape(array: Array, like: Array) -> Array:
    return np.ascontiguousarray(array).reshape(like.shape)


def _same(a: Array, b: Array) -> bool:
    near = abs(a - b) <= NEAR * max(float(abs(b).max()), 1e-30)
    return bool(near.mean() >= LEAST)


def _left_out(right: Array, given: Array) -> str:
    """Right but for zeros beyond the last whole tile."""
    if right.ndim != 3:
        return ""
    height, width = right.shape[:2]
    for tile in TILES:
        part = right.copy()
        part[height // tile * tile :] = 0
        part[:, width // tile * tile :] = 0
        if part.any() and not _same(right, part) and _same(given, part):
            return f"pixels left out that lie beyond the last whole tile of {tile}x{tile}"
    return ""
