"""The right numbers in other places, in another byte order, or none at all."""

from collections.abc import Iterator
from itertools import permutations
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

NOTHING_WRITTEN: Final = "an output that nothing was written to"

LEAST: Final = 0.99
"""Fraction of the elements that a layout must give."""

NEAR: Final = 1e-4
"""Tolerance relative to the largest element: a layout is looked for, not judged."""

PITCHES: Final = (256, 512, 64, 128, 16, 32)
"""Bytes to multiples of which rows of textures and buffers are padded."""

NEARER: Final = 0.25
"""Maximum distance of a wrong element from the layout, as a fraction of that from the right output."""

ROUNDING: Final = 1e-5
"""Differences of so much, of the largest number of a column, are no matter of order."""

MOSTLY: Final = 0.9
"""Fraction of the wrong elements that must be."""

MAX_ROWS: Final = 1000
"""Rows of larger tables are not looked for in other places."""

MIN_MOVED: Final = 0.25
"""Fraction of the rows that must stand elsewhere."""

FEWEST: Final = 5
"""Fewer different numbers agree with some order by chance."""


def never_written(value: Array, mine: Array) -> str:
    """Every element is 0, or NaN, or the same number; it is not meant to be so."""
    if mine.size < 2:
        return ""
    first = mine.flat[0]
    if not np.array_equal(mine, np.full_like(mine, first), equal_nan=mine.dtype.kind == "f"):
        return ""
    if not (value != value.flat[0]).any():
        return ""
    return f"{NOTHING_WRITTEN}: every element is {first:g}"


def layout_cause(value: Array, mine: Array, names: tuple[str, ...] = ()) -> str:
    """The layout of a wrong output, in words: empty, or the right one in another order; '' if like none.

    Parameters
    ----------
    value
        The expected output.
    mine
        The wrong output, of the same shape.
    names
        Those of the columns of a table.
    """
    if value.shape != mine.shape or mine.size < 2:
        return ""
    if sentence := never_written(value, mine) or _other_bytes(value, mine):
        return sentence
    right, given = value.astype(np.float64), mine.astype(np.float64)
    if not (np.isfinite(right).all() and np.isfinite(given).all()):
        return ""
    for sentence, other in _layouts(right, names):
        if _same(given, other) and not _same(right, other) and _nearer(given, right, other):
            return sentence
    return _permuted(right, given)


def _nearer(given: Array, right: Array, other: Array) -> bool:
    """Whether a layout is much nearer to what was given than the right output is, wherever that is wrong."""
    away, left = abs(given - right), abs(given - other)
    wrong = away > ROUNDING * abs(right).reshape(-1, right.shape[-1]).max(axis=0)
    return bool(wrong.any() and (left[wrong] <= NEARER * away[wrong]).mean() >= MOSTLY)


def _permuted(right: Array, given: Array) -> str:
    """The rows of a table in another order; '' if they are not, or if too few differ."""
    if right.ndim != 2 or not FEWEST <= len(np.unique(right, axis=0)) <= len(right) <= MAX_ROWS:
        return ""
    scale = np.maximum(abs(right).max(axis=0), 1e-30)
    apart = abs(given[:, None] / scale - right[None] / scale).max(axis=2)
    nearest = apart.argmin(axis=1)
    moved = nearest != np.arange(len(right))
    if (apart.min(axis=1) > NEAR).any() or len(np.unique(nearest)) < LEAST * len(right):
        return ""
    return "the right rows in another order (sorted, and not put back?)" if moved.mean() >= MIN_MOVED else ""


def _other_bytes(value: Array, mine: Array) -> str:
    """The bytes of each element in the other order, or the bits of each byte."""
    if value.dtype.kind == "f":
        value, mine = (array.astype(f"<f{array.dtype.itemsize}") for array in (value, mine.astype(value.dtype)))
    wrong = value != mine
    if value.dtype.itemsize > 1 and value.dtype == mine.dtype and _all_of(mine, value.byteswap(), wrong):
        return "bytes of each element in the other order (big-endian in place of little-endian)"
    if value.dtype == np.int64:
        for size in (2, 4):
            swapped = (value & (256**size - 1)).astype(f"<u{size}").byteswap().astype(np.int64)
            if _all_of(mine, swapped, wrong) and (value[wrong] < 256**size).all():
                return f"{size}-byte numbers read with their bytes in the other order"
    if value.dtype == np.uint8:
        reversed_bits = np.packbits(np.unpackbits(value[..., None], axis=-1)[..., ::-1], axis=-1)[..., 0]
        if _all_of(mine, reversed_bits, wrong):
            return "bits of each byte in the other order"
    return ""


def _all_of(mine: Array, other: Array, wrong: Array) -> bool:
    return bool(wrong.any() and np.array_equal(mine[wrong], other[wrong], equal_nan=mine.dtype.kind == "f"))


def _layouts(right: Array, names: tuple[str, ...]) -> Iterator[tuple[str, Array]]:
    """The right output as plausible mistakes of order would leave it."""
    if right.ndim == 3 and right.shape[2] == 3:
        yield "channels in the order B, G, R", right[:, :, ::-1]
        yield from _exchanged(right, ("red", "green", "blue"), "channels")
        yield "the y axis upwards", right[::-1]
        yield "the x axis to the left", right[:, ::-1]
        yield "the picture turned by half a turn", right[::-1, ::-1]
        yield "planes one after the other (3, H, W) in place of (H, W, 3)", _in_shape(right.transpose(2, 0, 1), right)
        yield "columns one after the other (W, H, 3) in place of (H, W, 3)", _in_shape(right.transpose(1, 0, 2), right)
        yield from _moved(right)
    elif right.ndim == 2:
        yield (
            "columns one after the other in place of rows (fields of splats in place of splats)",
            _in_shape(right.T, right),
        )
        yield from _exchanged(right, names, "columns")
    if right.ndim <= 2 and len(np.unique(right)) >= FEWEST:
        yield "the last element first: rows in reverse order", right[::-1]
        yield "rows shifted by one, to the next place", np.roll(right, 1, axis=0)
        yield "rows shifted by one, to the place before", np.roll(right, -1, axis=0)
        if right.ndim == 2:
            yield "columns in reverse order", right[:, ::-1]


def _exchanged(right: Array, names: tuple[str, ...], what: str) -> Iterator[tuple[str, Array]]:
    """Two columns exchanged, or three in another order."""
    count = right.shape[-1]
    label = names if len(names) == count else tuple(str(column) for column in range(count))
    for a in range(count):
        for b in range(a + 1, count):
            order = list(range(count))
            order[a], order[b] = b, a
            yield f"{what} {label[a]} and {label[b]} exchanged", right[..., order]
    if count <= 3:
        for places in permutations(range(count)):
            yield f"{what} in the order {', '.join(label[place] for place in places)}", right[..., list(places)]
    for a in range(count):
        for b in range(count):
            if a != b:
                order = list(range(count))
                order[a] = b
                yield f"{label[b]} in place of {label[a]}", right[..., order]


def _moved(right: Array) -> Iterator[tuple[str, Array]]:
    """A picture one pixel off, with zeros or the other edge where nothing comes from, or rows of another length."""
    for axis, name in ((0, "down"), (1, "to the right")):
        for step, word in ((1, name), (-1, {"down": "up", "to the right": "to the left"}[name])):
            yield f"the picture one pixel {word}", np.roll(right, step, axis)
            cut = np.roll(right, step, axis)
            edge: list[slice | int] = [slice(None)] * 3
            edge[axis] = 0 if step == 1 else -1
            cut[tuple(edge)] = 0
            yield f"the picture one pixel {word}", cut
    flat = right.reshape(-1, 3)
    four = np.zeros((len(flat), 4))
    four[:, :3] = flat
    yield (
        "pixels of 4 numbers (vec4, or vec3 with its padding) in place of 3",
        four.ravel()[: right.size].reshape(right.shape),
    )
    for pitch in PITCHES:
        length = right.shape[1] * 3
        padded = np.zeros((right.shape[0], -(-length * 4 // pitch) * pitch // 4))
        padded[:, :length] = right.reshape(right.shape[0], -1)
        yield (
            f"rows padded to multiples of {pitch} bytes (a row pitch)",
            padded.ravel()[: right.size].reshape(right.shape),
        )
    for wider in (1, -1):
        rows = np.arange(right.shape[0])[:, None] * (right.shape[1] + wider) + np.arange(right.shape[1])
        sheared = np.zeros_like(flat)
        inside = (rows < len(flat)) & (rows >= 0)
        sheared[rows[inside]] = right[inside]
        yield (
            f"rows stored {'W + 1' if wider == 1 else 'W - 1'} pixels apart in place of W",
            sheared.reshape(right.shape),
        )


def _in_shape(array: Array, like: Array) -> Array:
    return np.ascontiguousarray(array).reshape(like.shape)


def _same(a: Array, b: Array) -> bool:
    near = abs(a - b) <= NEAR * max(float(abs(b).max()), 1e-30)
    return bool(near.mean() >= LEAST)
