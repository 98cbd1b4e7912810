"""Loops over the splats, pixels and vectors of a motion field (`motion_field`), in binary64 and a stated order."""

from typing import Final

import numpy as np

from gsvc_base.arrays import F4, F8, I8
from gsvc_ref._jit import kernel

UNITS: Final = 4
"""Vectors are in units of 1/4 px."""

LONGEST: Final = 4096
"""Longest component of a vector that is looked at, in units."""

PAIRS: Final = ((0, 0), (0, 1), (1, -1), (1, 0), (1, 1))
"""The neighbours (down, right) of a cell of which H is kept; the others follow by symmetry."""


@kernel(inline=True)
def place(x: float, y: float, cell: int, rows: int, columns: int) -> tuple[int, int, float, float]:
    """The cell above and left of a point, and how far it is from there to the next, 0 to 1."""
    u = min(max(x / cell - 0.5, 0.0), columns - 1.0)
    v = min(max(y / cell - 0.5, 0.0), rows - 1.0)
    i, j = min(int(u), max(columns - 2, 0)), min(int(v), max(rows - 2, 0))
    return i, j, u - i, v - j


@kernel()
def cell_means(points: F8, motion: F8, cell: int, out: F8) -> None:
    """Means of the motion (P, 2) in pixels over cells, into out (gy, gx, 2) in units."""
    rows, columns = out.shape[:2]
    counts = np.zeros((rows, columns))
    for p in range(len(points)):
        row, column = min(int(points[p, 1]) // cell, rows - 1), min(int(points[p, 0]) // cell, columns - 1)
        counts[row, column] += 1
        for k in range(2):
            out[row, column, k] += motion[p, k]
    for row in range(rows):
        for column in range(columns):
            for k in range(2):
                value = UNITS * out[row, column, k] / max(counts[row, column], 1.0)
                out[row, column, k] = min(max(value, -np.float64(LONGEST)), np.float64(LONGEST))


@kernel()
def refine(coarse: F8, coarse_cell: int, cell: int, out: F8) -> None:
    """The coarse field read at the centres of smaller cells."""
    for row in range(out.shape[0]):
        for column in range(out.shape[1]):
            i, j, s, t = place((column + 0.5) * cell, (row + 0.5) * cell, coarse_cell, coarse.shape[0], coarse.shape[1])
            i1, j1 = min(i + 1, coarse.shape[1] - 1), min(j + 1, coarse.shape[0] - 1)
            for k in range(2):
                above = (1 - s) * coarse[j, i, k] + s * coarse[j, i1, k]
                below = (1 - s) * coarse[j1, i, k] + s * coarse[j1, i1, k]
                out[row, column, k] = (1 - t) * above + t * below


@kernel()
def move_by_field(reference: F4, vectors: F8, cell: int, out: F4) -> None:
    """The positions of splats moved by the field, into the first columns of out (N, 8)."""
    rows, columns = vectors.shape[:2]
    for n in range(len(reference)):
        x, y = np.float64(reference[n, 0]), np.float64(reference[n, 1])
        i, j, s, t = place(x, y, cell, rows, columns)
        i1, j1 = min(i + 1, columns - 1), min(j + 1, rows - 1)
        for k in range(2):
            above = (1 - s) * vectors[j, i, k] + s * vectors[j, i1, k]
            below = (1 - s) * vectors[j1, i, k] + s * vectors[j1, i1, k]
            out[n, k] = np.float64(reference[n, k]) + ((1 - t) * above + t * below) / UNITS


@kernel()
def gather_by_vectors(reference: F4, gradient: F4, cell: int, scale: float, out: F8) -> None:
    """The gradient by the vectors, from that by positions."""
    rows, columns = out.shape[:2]
    for n in range(len(reference)):
        i, j, s, t = place(np.float64(reference[n, 0]), np.float64(reference[n, 1]), cell, rows, columns)
        i1, j1 = min(i + 1, columns - 1), min(j + 1, rows - 1)
        for k in range(2):
            g = scale * np.float64(gradient[n, k])
            out[j, i, k] += (1 - s) * (1 - t) * g
            out[j, i1, k] += s * (1 - t) * g
            out[j1, i, k] += (1 - s) * t * g
            out[j1, i1, k] += s * t * g


@kernel()
def stiffness(reference: F4, cell: int, scale: float, out: F8) -> None:
    """The curvature by the vectors if every splat moved alone, added to out (gy, gx, 2).

    scale times |c|^2 l11 l22 is a splat's energy in units of the field.
    """
    rows, columns = out.shape[:2]
    for n in range(len(reference)):
        i, j, s, t = place(np.float64(reference[n, 0]), np.float64(reference[n, 1]), cell, rows, columns)
        i1, j1 = min(i + 1, columns - 1), min(j + 1, rows - 1)
        l11, l21 = np.float64(reference[n, 2]), np.float64(reference[n, 3])
        l22 = np.float64(reference[n, 4])
        r, g, b = np.float64(reference[n, 5]), np.float64(reference[n, 6]), np.float64(reference[n, 7])
        energy = scale * ((r * r + g * g) + b * b) * (l11 * l22)
        shear = l21 / l22
        for k in range(2):
            h = energy * (1 + shear * shear) / (l11 * l11) if k == 0 else energy / (l22 * l22)
            out[j, i, k] += (1 - s) * (1 - t) * h
            out[j, i1, k] += s * (1 - t) * h
            out[j1, i, k] += (1 - s) * t * h
            out[j1, i1, k] += s * t * h


@kernel()
def sum_products(quarter: F4, vectors: F8, cell: int, scale: float, out: F8) -> None:
    """The matrix H of `motion_field`, added to out (gy, gx, 5, 3): for each of PAIRS the entries xx, xy, yy.

    `quarter` is (h, w, 3), every second pixel of every second row; derivatives are those in the middle of four.
    """
    rows, columns = vectors.shape[:2]
    weights = np.empty(4)
    for above in range(quarter.shape[0] - 1):
        for left in range(quarter.shape[1] - 1):
            below, right, y, x = above + 1, left + 1, 2 * above + 1, 2 * left + 1
            xx, xy, yy = 0.0, 0.0, 0.0
            for c in range(3):
                high_left, high_right = np.float64(quarter[above, left, c]), np.float64(quarter[above, right, c])
                low_left, low_right = np.float64(quarter[below, left, c]), np.float64(quarter[below, right, c])
                dx = ((high_right - high_left) + (low_right - low_left)) / 4
                dy = ((low_left - high_left) + (low_right - high_right)) / 4
                xx += dx * dx
                xy += dx * dy
                yy += dy * dy
            i, j, s, t = place(x + 0.5, y + 0.5, cell, rows, columns)
            u = x + 0.5 - vectors[j, i, 0] / UNITS  # where this came from, nearly
            v = y + 0.5 - vectors[j, i, 1] / UNITS
            i, j, s, t = place(u, v, cell, rows, columns)
            weights[0], weights[1], weights[2], weights[3] = (1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t
            i1, j1 = min(i + 1, columns - 1), min(j + 1, rows - 1)
            xx, xy, yy = scale * xx, scale * xy, scale * yy
            for a in range(4):
                row = j if a < 2 else j1
                column = i if a % 2 == 0 else i1
                for b in range(a, 4):
                    w = weights[a] * weights[b]
                    if w == 0:
                        continue
                    if a == b:
                        pair = 0
                    elif a == 0:
                        pair = 1 if b == 1 else (3 if b == 2 else 4)
                    elif a == 1:
                        pair = 2 if b == 2 else 3
                    else:
                        pair = 1
                    out[row, column, pair, 0] += w * xx
                    out[row, column, pair, 1] += w * xy
                    out[row, column, pair, 2] += w * yy


@kernel(inline=True)
def coupling(matrix: F8, step: F8, row: int, column: int) -> tuple[float, float]:
    """The sum of H times the step over the neighbours of a cell."""
    rows, columns = step.shape[:2]
    p, q = 0.0, 0.0
    for pair in range(1, 5):
        down, right = (0, 1) if pair == 1 else ((1, -1) if pair == 2 else ((1, 0) if pair == 3 else (1, 1)))
        for side in range(2):
            r = row + down if side == 0 else row - down
            c = column + right if side == 0 else column - right
            if 0 <= r < rows and 0 <= c < columns:
                x, y = step[r, c, 0], step[r, c, 1]
                m, k = (row, column) if side == 0 else (r, c)
                xx, xy, yy = matrix[m, k, pair, 0], matrix[m, k, pair, 1], matrix[m, k, pair, 2]
                p += xx * x + xy * y
                q += xy * x + yy * y
    return p, q


@kernel()
def solve(matrix: F8, gradient: F8, damping: F8, longest: float, sweeps: int, step: F8) -> None:
    """Sweeps over (H + damping) step = -gradient, components limited to `longest`."""
    rows, columns = step.shape[:2]
    for _ in range(sweeps):
        for row in range(rows):
            for column in range(columns):
                p, q = coupling(matrix, step, row, column)
                p, q = -gradient[row, column, 0] - p, -gradient[row, column, 1] - q
                xx, xy = matrix[row, column, 0, 0] + damping[row, column, 0], matrix[row, column, 0, 1]
                yy = matrix[row, column, 0, 2] + damping[row, column, 1]
                determinant = xx * yy - xy * xy
                step[row, column, 0] = min(max((yy * p - xy * q) / determinant, -longest), longest)
                step[row, column, 1] = min(max((xx * q - xy * p) / determinant, -longest), longest)


@kernel()
def bits_of_field(field: I8, bits: F8) -> float:
    """About how many bits the vectors (gy, gx, 2) cost, given those of each magnitude."""
    total = 0.0
    for row in range(field.shape[0]):
        for column in range(field.shape[1]):
            total += own_bits(field, row, column, bits)
    return total


@kernel(inline=True)
def own_bits(field: I8, row: int, column: int, bits: F8) -> float:
    """Bits of the difference of one vector to the left one, in the first column to the one above."""
    total = 0.0
    for k in range(2):
        value = field[row, column, k]
        if column > 0:
            value -= field[row, column - 1, k]
        elif row > 0:
            value -= field[row - 1, column, k]
        total += bits[abs(value)]
    return total


@kernel(inline=True)
def bits_around(field: I8, row: int, column: int, bits: F8) -> float:
    """Bits of all differences that depend on one vector."""
    total = own_bits(field, row, column, bits)
    if column + 1 < field.shape[1]:
        total += own_bits(field, row, column + 1, bits)
    if column == 0 and row + 1 < field.shape[0]:
        total += own_bits(field, row + 1, column, bits)
    return total


@kernel()
def choose_vectors(
    matrix: F8, gradient: F8, damping: F8, field: I8, former: I8, price: float, sweeps: int, bits: F8
) -> None:
    """Descent of the quadratic model plus price * bits from the field, vector by vector, in place."""
    rows, columns = field.shape[:2]
    start = field.copy()
    step = np.zeros(field.shape)
    tried = np.empty((14, 2), np.int64)
    for _ in range(sweeps):
        changed = False
        for row in range(rows):
            for column in range(columns):
                x0, y0 = field[row, column, 0], field[row, column, 1]
                tried[0, 0], tried[0, 1] = x0, y0
                tried[1, 0], tried[1, 1] = 0, 0
                tried[2, 0], tried[2, 1] = former[row, column, 0], former[row, column, 1]
                count = 3
                for near in range(4):
                    r = row + (-1 if near == 1 else (1 if near == 3 else 0))
                    c = column + (-1 if near == 0 else (1 if near == 2 else 0))
                    if 0 <= r < rows and 0 <= c < columns:
                        tried[count, 0], tried[count, 1] = field[r, c, 0], field[r, c, 1]
                        count += 1
                for k in range(4):
                    tried[count, 0] = x0 + (1 if k == 0 else (-1 if k == 1 else 0))
                    tried[count, 1] = y0 + (1 if k == 2 else (-1 if k == 3 else 0))
                    count += 1
                p, q = coupling(matrix, step, row, column)
                p, q = p + gradient[row, column, 0], q + gradient[row, column, 1]
                xx, xy = matrix[row, column, 0, 0] + damping[row, column, 0], matrix[row, column, 0, 1]
                yy = matrix[row, column, 0, 2] + damping[row, column, 1]
                best, best_k = np.inf, 0
                for k in range(count):
                    if max(abs(tried[k, 0]), abs(tried[k, 1])) > LONGEST:
                        continue
                    field[row, column, 0], field[row, column, 1] = tried[k, 0], tried[k, 1]
                    dx = np.float64(tried[k, 0] - start[row, column, 0])
                    dy = np.float64(tried[k, 1] - start[row, column, 1])
                    cost = (p * dx + q * dy) + 0.5 * ((xx * dx * dx + 2 * xy * dx * dy) + yy * dy * dy)
                    cost += price * bits_around(field, row, column, bits)
                    if cost < best:
                        best, best_k = cost, k
                field[row, column, 0], field[row, column, 1] = tried[best_k, 0], tried[best_k, 1]
                for k in range(2):
                    step[row, column, k] = np.float64(field[row, column, k] - start[row, column, k])
                changed |= best_k != 0
        if not changed:
            break
