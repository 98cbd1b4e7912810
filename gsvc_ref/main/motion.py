"""The motion field of a P-frame (spec.md section 15.10)."""

from typing import Final

import numpy as np

from gsvc_base.arrays import I8
from gsvc_ref._jit import kernel
from gsvc_ref.main.models import Models
from gsvc_ref.main.passes import Run, magnitude_classes

X_CLASSES: Final = (0, 2, 7)
"""The largest class of a magnitude in x of each context of the magnitude in y but the last one."""

UNRESTS: Final = (2, 7)
"""The largest unrest of a splat's cell of each context of its mode but the last one."""

OUTSIDE: Final = 9
"""The context of the mode of a splat that leaves the frame."""


def field_shape(width: int, height: int, side: int) -> tuple[int, int]:
    """Rows and columns of the field of a frame with cells of that many pixels."""
    return -(-height // side), -(-width // side)


def code_field(run: Run, models: Models, shape: tuple[int, int], field: I8 | None = None) -> I8:
    """The vectors (rows, columns, 2) in quarter pixels, each by its difference to the one to the left or above.

    x is the first pass of a frame, y the second.
    """
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
    x = run.signs(1, models.code_magnitudes(run, 1, "vector", none, x if x is None else np.abs(x)), x)
    contexts = 1 + np.searchsorted(X_CLASSES, magnitude_classes(np.abs(x))).astype(np.int64)
    y = run.signs(2, models.code_magnitudes(run, 2, "vector", contexts, y if y is None else np.abs(y)), y)
    return field_vectors(np.stack([x, y], axis=1).reshape(rows, columns, 2))


def field_vectors(differences: I8) -> I8:
    """The vectors (rows, columns, 2) of a field, by the differences that are coded."""
    vectors = differences.copy()
    vectors[:, 0] = np.cumsum(vectors[:, 0], axis=0)
    return _wrapped(np.cumsum(vectors, axis=1))


def _wrapped(vectors: I8) -> I8:
    return ((vectors + 2**15) & 0xFFFF) - 2**15


def field_motion(state: I8, field: I8, side: int) -> I8:
    """By how much splats (N, 8) move with a field (rows, columns, 2) in 1/4 pixel, (N, 2) in 1/256 pixel (15-12)."""
    motion = np.empty((len(state), 2), np.int64)
    find_motion(state, field, side, motion)
    return motion


@kernel()
def find_motion(state: I8, field: I8, side: int, motion: I8) -> None:
    """`field_motion`, put into `motion` (N, 2); 0 where `side` is 0."""
    b = 0
    while 1 << b < 256 * side:
        b += 1
    for splat in range(len(state)):
        if side == 0:
            motion[splat, 0] = motion[splat, 1] = 0
            continue
        i, i1, f = _between(state[splat, 0], side, b, field.shape[1])
        j, j1, h = _between(state[splat, 1], side, b, field.shape[0])
        for axis in range(2):
            # bilinear between the centres of four cells, in 64ths; quarter pixels times 64 are 1/256 pixel
            upper = (64 - f) * field[j, i, axis] + f * field[j, i1, axis]
            lower = (64 - f) * field[j1, i, axis] + f * field[j1, i1, axis]
            motion[splat, axis] = ((64 - h) * upper + h * lower + 32) >> 6


@kernel(inline=True)
def _between(position: int, side: int, b: int, cells: int) -> tuple[int, int, int]:
    """The cells around a position, and how far it is between their centres, in 64ths; 2^b = 256 side."""
    u = min(max(position - 128 * side, 0), (cells - 1) << b)
    i = min(u >> b, max(cells - 2, 0))
    return i, min(i + 1, cells - 1), (u - (i << b)) >> (b - 6)


def mode_contexts(state: I8, motion: I8, past: I8, field: I8, side: int, width: int, height: int) -> I8:
    """The context of the mode of each splat (N,) (spec.md section 15.11).

    `state` (N, 8) and `past` (N,) are the splats of the frame before and what it did with them, and `motion` (N, 2) is
    that of the field, in 1/256 pixel; where there is none, `side` is 0.
    """
    contexts = np.empty(len(state), np.int64)
    find_mode_contexts(state, motion, past, field, side, width, height, contexts)
    return contexts


@kernel()
def find_mode_contexts(
    state: I8, motion: I8, past: I8, field: I8, side: int, width: int, height: int, contexts: I8
) -> None:
    """`mode_contexts`, put into `contexts` (N,)."""
    unrest = field_unrest(field)
    for splat in range(len(state)):
        x, y = state[splat, 0] + motion[splat, 0], state[splat, 1] + motion[splat, 1]
        if x < 0 or x >= 256 * width or y < 0 or y >= 256 * height:
            contexts[splat] = OUTSIDE
            continue
        contexts[splat] = 3 * past[splat]
        if side > 0:
            column = min(max(state[splat, 0] // (256 * side), 0), field.shape[1] - 1)
            row = min(max(state[splat, 1] // (256 * side), 0), field.shape[0] - 1)
            for bound in UNRESTS:
                contexts[splat] += unrest[row, column] > bound


@kernel()
def field_unrest(field: I8) -> I8:
    """How much the vector of each cell differs from those of its neighbours, (rows, columns) in quarter pixels."""
    rows, columns = field.shape[:2]
    unrest = np.zeros((rows, columns), np.int64)
    for j in range(rows):
        for i in range(columns):
            for right in range(2):
                j1, i1 = j + 1 - right, i + right
                if j1 < rows and i1 < columns:
                    difference = abs(field[j, i, 0] - field[j1, i1, 0]) + abs(field[j, i, 1] - field[j1, i1, 1])
                    unrest[j, i] = max(unrest[j, i], difference)
                    unrest[j1, i1] = max(unrest[j1, i1], difference)
    return unrest
