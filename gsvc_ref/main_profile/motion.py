"""The motion field of a P-frame (spec.md section 15.10)."""

from typing import Final

import numpy as np

from gsvc_ref.arrays import I8
from gsvc_ref.main_profile.models import Models
from gsvc_ref.main_profile.passes import Run, magnitude_classes

X_CLASSES: Final = (0, 2, 7)
"""The largest class of a magnitude in x of each context of the magnitude in y but the last one."""

UNRESTS: Final = (2, 7)
"""The largest unrest of a splat's cell of each context of its mode but the last one."""

OUTSIDE: Final = 9
"""The context of the mode of a splat that leaves the frame."""


def field_shape(width: int, height: int, side: int) -> tuple[int, int]:
    """Rows and columns of the field of a frame with cells of so many pixels."""
    return -(-height // side), -(-width // side)


def code_field(run: Run, models: Models, shape: tuple[int, int], field: I8 | None = None) -> I8:
    """The vectors (rows, columns, 2) in quarter pixels, each by its difference to the one to the left or above."""
    rows, columns = shape
    given: tuple[I8 | None, I8 | None] = (None, None)
    if field is not None:
        differences = field.copy()
        differences[:, 1:] -= field[:, :-1]
        differences[1:, 0] -= field[:-1, 0]
        differences = _wrapped(differences).reshape(-1, 2)
        given = differences[:, 0], differences[:, 1]
    x, y = given
    none = np.zeros(rows * columns, np.int64)
    magnitudes_x = models.code_magnitudes(run, "vector", none, x if x is None else np.abs(x))
    contexts = 1 + np.searchsorted(X_CLASSES, magnitude_classes(magnitudes_x)).astype(np.int64)
    magnitudes_y = models.code_magnitudes(run, "vector", contexts, y if y is None else np.abs(y))
    x, y = run.signs(magnitudes_x, x), run.signs(magnitudes_y, y)
    vectors = np.stack([x, y], axis=1).reshape(rows, columns, 2)
    vectors[:, 0] = np.cumsum(vectors[:, 0], axis=0)
    return _wrapped(np.cumsum(vectors, axis=1))


def _wrapped(vectors: I8) -> I8:
    return ((vectors + 2**15) & 0xFFFF) - 2**15


def field_motion(state: I8, field: I8, side: int) -> I8:
    """By how much each splat moves with the field (15-12).

    Parameters
    ----------
    state
        (N, 8), the splats of the frame before.
    field
        (rows, columns, 2), vectors in quarter pixels.
    side
        Side of a cell in pixels.

    Returns
    -------
    (N, 2) in 1/256 pixel.
    """
    rows, columns, _ = field.shape
    i, i1, f = _between(state[:, 0], side, columns)
    j, j1, h = _between(state[:, 1], side, rows)
    upper = (64 - f) * field[j, i] + f * field[j, i1]
    lower = (64 - f) * field[j1, i] + f * field[j1, i1]
    motion: I8 = ((64 - h) * upper + h * lower + 32) >> 6
    return motion


def _between(positions: I8, side: int, cells: int) -> tuple[I8, I8, I8]:
    """The cell before each position, the one behind it, and the 64ths (N, 1) of the way between their centres."""
    b = (256 * side).bit_length() - 1
    u = np.clip(positions - 128 * side, 0, (cells - 1) << b)
    i = np.minimum(u >> b, max(cells - 2, 0))
    return i, np.minimum(i + 1, cells - 1), ((u - (i << b)) >> (b - 6))[:, None]


def mode_contexts(state: I8, motion: I8, past: I8, field: I8, side: int, width: int, height: int) -> I8:
    """The context of the mode of each splat (N,) (spec.md section 15.11).

    Parameters
    ----------
    state, past
        (N, 8) and (N,), the splats of the frame before, and what that frame did with them.
    motion
        (N, 2) in 1/256 pixel.
    field, side
        As in `field_motion`; side 0: there is no field.
    width, height
        Size of the frame in pixels.
    """
    moved = state[:, :2] + motion
    outside = ((moved < 0) | (moved >= (256 * width, 256 * height))).any(axis=1)
    unrest = np.zeros(len(state), np.int64)
    if side:
        rows, columns, _ = field.shape
        cells = np.clip(state[:, :2] // (256 * side), 0, (columns - 1, rows - 1))
        unrest = field_unrest(field)[cells[:, 1], cells[:, 0]]
    return np.where(outside, OUTSIDE, 3 * past + np.searchsorted(UNRESTS, unrest))


def field_unrest(field: I8) -> I8:
    """How much the vector of each cell differs from those of its neighbours, (rows, columns) in quarter pixels."""
    unrest = np.zeros(field.shape[:2], np.int64)
    for axis in range(2):
        step = np.abs(np.diff(field, axis=axis)).sum(axis=2)
        none = np.zeros_like(unrest.take([0], axis=axis))
        unrest = np.maximum(unrest, np.maximum(np.append(none, step, axis=axis), np.append(step, none, axis=axis)))
    return unrest
