"""The Gram matrix of splats: by how much the changes of their colours add up in the picture.

A change dc_n of each colour changes the picture by the sum of dc_n g_n, g being the splats' Gaussians, and its squared
error over all pixels and channels by::

    sum over m, n of K_mn dc_m . dc_n - 2 sum over n of b_n . dc_n,      K_mn = integral of g_m g_n

with b_n the integral of g_n times what the picture lacks. The product of two Gaussians has the integral ::

    K_mn = 2 pi |L_m| |L_n| / sqrt(det S) exp(-d' S^-1 d / 2),      S = L_m L_m' + L_n L_n',  d = mu_m - mu_n

where |L| = l11 l22; K_nn = pi |L_n|. The edge of the frame and the cut-off of the support are left out. Splats reach
few others, so that K is sparse: entries below TOLERANCE sqrt(K_mm K_nn) count as none. As det(S)^(1/2) is at least
|L_m| + |L_n|, an entry is that small wherever d' S^-1 d > -2 ln TOLERANCE.

All is in binary64, with stated operations in a fixed order.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from gsvc_base.arrays import F4, F8, I8
from gsvc_base.portable import exp
from gsvc_ref._jit import kernel
from gsvc_ref.training.coordinates import exp_kernel

TOLERANCE: Final = 0.01
"""Least part of sqrt(K_mm K_nn) that an entry has."""

RIDGE: Final = 0.01
"""Part of the diagonal that is added to it where colours are solved for, since splats on one place are nearly the same
to the picture."""

CELL: Final = 16
"""Side in pixels of the cells in which neighbours are looked for."""

MOST_CELLS: Final = 1024
"""Most cells along an axis; centres beyond count as in the last."""

FARTHEST: Final = 9.210340381186523
"""Beyond this d' S^-1 d an entry is too small: -2 ln TOLERANCE, and a billionth more for what is rounded."""


class Gram(NamedTuple):
    """K by rows."""

    starts: I8
    """(N + 1,), where each row begins in the other two."""
    columns: I8
    """(E,), the index m of an entry, in a fixed order."""
    values: F8
    """(E,)"""
    diagonal: F8
    """(N,), K_nn."""


def gram_plain(parameters: F4) -> F8:
    """The definition of K: (N, N) f8, 0 where it has no entry; `gram` gives the same bits."""
    p = np.asarray(parameters, np.float64)
    xx, xy = p[:, 2] * p[:, 2], p[:, 2] * p[:, 3]
    yy, det = p[:, 3] * p[:, 3] + p[:, 4] * p[:, 4], p[:, 2] * p[:, 4]
    dx, dy = p[:, 0][:, None] - p[:, 0], p[:, 1][:, None] - p[:, 1]  # (N, N)
    sxx, sxy, syy = (a[:, None] + a for a in (xx, xy, yy))
    determinant = sxx * syy - sxy * sxy
    distance = ((syy * dx * dx - 2 * sxy * dx * dy) + sxx * dy * dy) / determinant
    products = det[:, None] * det
    with np.errstate(under="ignore"):
        values = 2 * math.pi * products / np.sqrt(determinant) * exp(-0.5 * np.minimum(distance, 100.0))
    return np.where(values < TOLERANCE * math.pi * np.sqrt(products), 0.0, values)


def gram(parameters: F4) -> Gram:
    """K of splats.

    Parameters
    ----------
    parameters
        (N, 8) f4 in the columns of `Splats.to_array`, with l11 and l22 above 0.
    """
    starts, columns, values, diagonal = _gram(np.asarray(parameters, np.float64))
    return Gram(starts, columns, values, diagonal)


def solved_colors(matrix: Gram, b: F8, steps: int) -> F8:
    """The changes of colours that take the most of the squared error, (N, 3).

    (K + RIDGE diag K) dc = b by conjugate gradients from 0, preconditioned by the diagonal, channel by channel.

    Parameters
    ----------
    matrix
        K.
    b
        (N, 3) f8; -H W / 2 times the gradient of the loss by the colours.
    steps
        How many steps.
    """
    x = np.zeros(b.shape)
    _conjugate_gradients(matrix.starts, matrix.columns, matrix.values, matrix.diagonal, b, steps, x)
    return x


def squared_change(matrix: Gram, changes: F8) -> float:
    """The sum over m, n of K_mn e_m . e_n, for changes e (N, 3) f8."""
    out = np.empty(changes.shape)
    _product(matrix.starts, matrix.columns, matrix.values, changes, out)
    return math.fsum((out * changes).ravel())


@kernel()
def _gram(p: F8) -> tuple[I8, I8, F8, F8]:
    """`gram`: each splat looks for those that are not larger, in the cells that it reaches were they as large.

    So a few wide splats look far, and the many small ones do not.
    """
    count = len(p)
    xx, xy, yy, det = np.empty(count), np.empty(count), np.empty(count), np.empty(count)
    largest = np.empty(count)
    cell = np.empty((count, 2), np.int64)
    columns, rows = 1, 1
    for i in range(count):
        xx[i], xy[i] = p[i, 2] * p[i, 2], p[i, 2] * p[i, 3]
        yy[i], det[i] = p[i, 3] * p[i, 3] + p[i, 4] * p[i, 4], p[i, 2] * p[i, 4]
        largest[i] = max(xx[i], yy[i])
        for k in range(2):
            cell[i, k] = np.int64(min(max(p[i, k] / CELL, 0.0), MOST_CELLS - 1.0))
        columns, rows = max(columns, cell[i, 0] + 1), max(rows, cell[i, 1] + 1)
    firsts = np.zeros(columns * rows + 1, np.int64)
    for i in range(count):
        firsts[cell[i, 1] * columns + cell[i, 0] + 1] += 1
    for c in range(columns * rows):
        firsts[c + 1] += firsts[c]
    order, filled = np.empty(count, np.int64), firsts.copy()
    for i in range(count):
        c = cell[i, 1] * columns + cell[i, 0]
        order[filled[c]] = i
        filled[c] += 1

    pairs, products, found = np.empty(32 * count + 32, np.int64), np.empty(16 * count + 16), 0
    starts, diagonal = np.zeros(count + 1, np.int64), np.empty(count)
    for i in range(count):
        x, y = p[i, 0], p[i, 1]
        reach_x, reach_y = math.sqrt(FARTHEST * (xx[i] + largest[i])), math.sqrt(FARTHEST * (yy[i] + largest[i]))
        left = np.int64(min(max((x - reach_x) / CELL, 0.0), columns - 1.0))
        right = np.int64(min(max((x + reach_x) / CELL, 0.0), columns - 1.0))
        top = np.int64(min(max((y - reach_y) / CELL, 0.0), rows - 1.0))
        bottom = np.int64(min(max((y + reach_y) / CELL, 0.0), rows - 1.0))
        for row in range(top, bottom + 1):
            for place in range(firsts[row * columns + left], firsts[row * columns + right + 1]):
                j = order[place]
                if largest[j] > largest[i] or (largest[j] == largest[i] and j > i):
                    continue
                dx, dy = x - p[j, 0], y - p[j, 1]
                sxx, sxy, syy = xx[i] + xx[j], xy[i] + xy[j], yy[i] + yy[j]
                determinant = sxx * syy - sxy * sxy
                distance = ((syy * dx * dx - 2 * sxy * dx * dy) + sxx * dy * dy) / determinant
                if distance > FARTHEST:
                    continue
                product = det[i] * det[j]
                value = 2 * math.pi * product / math.sqrt(determinant) * exp_kernel(-0.5 * distance)
                if value < TOLERANCE * math.pi * math.sqrt(product):
                    continue
                if found == len(products):
                    pairs, products = _doubled_i8(pairs), _doubled_f8(products)
                pairs[2 * found], pairs[2 * found + 1], products[found] = i, j, value
                found += 1
                starts[i + 1] += 1
                if j == i:
                    diagonal[i] = value
                else:
                    starts[j + 1] += 1

    for i in range(count):
        starts[i + 1] += starts[i]
    next_of, others, values = starts[:-1].copy(), np.empty(starts[count], np.int64), np.empty(starts[count])
    for k in range(found):
        i, j = pairs[2 * k], pairs[2 * k + 1]
        others[next_of[i]], values[next_of[i]] = j, products[k]
        next_of[i] += 1
        if j != i:
            others[next_of[j]], values[next_of[j]] = i, products[k]
            next_of[j] += 1
    return starts, others, values, diagonal


@kernel()
def _doubled_i8(array: I8) -> I8:
    """The array with as much room again."""
    larger = np.empty(2 * len(array), np.int64)
    for k in range(len(array)):
        larger[k] = array[k]
    return larger


@kernel()
def _doubled_f8(array: F8) -> F8:
    """The array with as much room again."""
    larger = np.empty(2 * len(array))
    for k in range(len(array)):
        larger[k] = array[k]
    return larger


@kernel()
def _product(starts: I8, columns: I8, values: F8, x: F8, out: F8) -> None:
    """Out = K x, (N, 3) each, entry by entry."""
    for i in range(len(x)):
        red, green, blue = 0.0, 0.0, 0.0
        for k in range(starts[i], starts[i + 1]):
            j, value = columns[k], values[k]
            red += value * x[j, 0]
            green += value * x[j, 1]
            blue += value * x[j, 2]
        out[i, 0], out[i, 1], out[i, 2] = red, green, blue


@kernel()
def _conjugate_gradients(starts: I8, columns: I8, values: F8, diagonal: F8, b: F8, steps: int, x: F8) -> None:
    """`solved_colors`, into x (N, 3), which is 0."""
    count = len(b)
    r, p, q = np.zeros(b.shape), np.zeros(b.shape), np.empty(b.shape)
    left = np.zeros(3)  # r . z of each channel, z being r over the diagonal
    for i in range(count):
        for c in range(3):
            r[i, c] = b[i, c]
            p[i, c] = r[i, c] / (diagonal[i] * (1 + RIDGE))
            left[c] += r[i, c] * p[i, c]
    curvature, next_left = np.empty(3), np.empty(3)
    for _ in range(steps):
        _product(starts, columns, values, p, q)
        curvature[:] = 0
        for i in range(count):
            for c in range(3):
                q[i, c] += RIDGE * diagonal[i] * p[i, c]
                curvature[c] += p[i, c] * q[i, c]
        next_left[:] = 0
        for i in range(count):
            for c in range(3):
                if curvature[c] > 0:
                    length = left[c] / curvature[c]
                    x[i, c] += length * p[i, c]
                    r[i, c] -= length * q[i, c]
                    next_left[c] += r[i, c] * r[i, c] / (diagonal[i] * (1 + RIDGE))
        for i in range(count):
            for c in range(3):
                if left[c] > 0:
                    p[i, c] = r[i, c] / (diagonal[i] * (1 + RIDGE)) + next_left[c] / left[c] * p[i, c]
        for c in range(3):
            left[c] = next_left[c]
