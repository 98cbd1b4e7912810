"""The motion field of a P-frame: vectors in quarter pixels at the centres of square cells, bilinear between them.

Splats move by the field read at their reference positions. The field of large cells begins with the optical flow, that
of smaller ones with the one before; each is then brought to a smaller error by Gauss-Newton steps. The gradient b is
that of the splats' positions, on a lattice of pixels, summed with their weights; the matrix H takes the picture for
what moves::

    H[c, d] = 2 * sum over pixels and channels of w_c w_d grad R grad R^T

with the bilinear weights w of cells c and d and the gradient of the moved splats' picture R. A step solves
(H + damping) step = -b by Gauss-Seidel sweeps. Then every vector takes of its candidates - what it is, the next
integers, its neighbours' vectors, none, that of the frame before - the one with the least

    squared error + price * bits

where the squared error is the quadratic model of the last step. All sums are in a stated order in binary64.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_ref._jit import kernel
from gsvc_ref.arrays import F4, F8
from gsvc_ref.portable import log2
from gsvc_ref.rendering import SampledObjective
from gsvc_ref.training.motion import estimated_motion

I8 = NDArray[np.int64]

UNITS: Final = 4
"""Vectors are in units of 1/4 px."""

SQUARE: Final = 255.0 * 255.0
"""What a squared error of 1 is in units of 8 bits."""

FLOW_SPACING: Final = 8
"""The optical flow is read every so many pixels."""

LONGEST: Final = 4096
"""Longest component of a vector that is looked at, in units."""

LONGEST_STEP: Final = 8.0
"""Longest Gauss-Newton step of a component, in units."""

FIRST_DAMPING: Final = 0.3
"""Share of the stiffness that is added to H; a third of it after a step that helps, else four times."""

LEAST_DAMPING: Final = 1.0
"""What is added to the diagonal of H in any case."""

LITTLE: Final = 0.005
"""No further step follows one that takes less than this share off the squared error."""

SWEEPS: Final = 12
"""Gauss-Seidel sweeps of a step."""

CHOICE_SWEEPS: Final = 4
"""How often every vector is looked at when vectors are chosen."""

PAIRS: Final = ((0, 0), (0, 1), (1, -1), (1, 0), (1, 1))
"""The neighbours (down, right) of a cell of which H is kept; the others follow by symmetry."""


def _vector_bits(count: int) -> F8:
    return np.asarray(0.7 + 2 * log2(1.0 + np.arange(count)), np.float64)


BITS: Final = _vector_bits(2 * LONGEST + 2)
"""About how many bits the magnitude of a component costs, as a difference to its neighbour."""


@dataclass(frozen=True)
class Field:
    """A motion field and what it costs.

    Attributes
    ----------
    cell
        The side of a cell in pixels, 0 for no field.
    vectors
        (gy, gx, 2) i8 in quarter pixels.
    error
        The squared error with it, in units of 8 bits.
    """

    cell: int
    vectors: I8
    error: float


def flow_at_points(before: F4, after: F4) -> tuple[F8, F8]:
    """Points of the picture, (P, 2) f8, and the optical flow there, (P, 2) f8 in pixels."""
    height, width = before.shape[:2]
    y, x = np.mgrid[FLOW_SPACING // 2 : height : FLOW_SPACING, FLOW_SPACING // 2 : width : FLOW_SPACING]
    points = np.stack([x.ravel(), y.ravel()], axis=1).astype(np.float32)
    return points.astype(np.float64), estimated_motion(before, after, points).astype(np.float64)


def field_bits(vectors: I8) -> float:
    """About how many bits the vectors (gy, gx, 2) cost."""
    return float(_field_bits(vectors, BITS))


def best_field(
    objective: SampledObjective,
    reference: F4,
    flow: tuple[F8, F8],
    past: Field | None,
    price: float,
    gain: float,
    cells: tuple[int, ...],
    steps: int,
    rounds: int,
) -> Field:
    """The field with the least squared error plus price times bits, of none and those with the given cells.

    Parameters
    ----------
    objective
        Of the picture to come.
    reference
        (N, 8) f4, the splats before they move.
    flow
        By `flow_at_points`.
    past
        The field of the frame before, None if it had none.
    price
        Squared error that a bit is worth.
    gain
        Bits that a splat is worth each time that the squared error halves, when fields of different cells are
        compared. Later steps take back most of a large error for few bits, so its logarithm counts here.
    cells
        The sides of cells to try, in pixels, from large to small. Where smaller ones are worth no more than those
        before, still smaller ones are not tried.
    steps
        Gauss-Newton steps for each, at most.
    rounds
        How often vectors are chosen, at most.
    """
    search = _Search(objective, reference, price)
    worth = gain * len(reference)
    best = Field(0, np.zeros((1, 1, 2), np.int64), search.error_of_none)
    least, coarser = worth * float(log2(max(best.error, 1.0))), math.inf
    fine: tuple[int, F8] | None = None
    for cell in cells:
        vectors = np.zeros((-(-objective.height // cell), -(-objective.width // cell), 2))
        if fine is None:
            _cell_means(*flow, cell, vectors)
        else:
            _refine(fine[1], fine[0], cell, vectors)
        former = np.zeros(vectors.shape, np.int64)
        if past is not None and past.cell == cell:
            former = past.vectors
        vectors = search.descend(cell, vectors, steps)
        fine = cell, vectors
        found = search.choose(cell, vectors, former, rounds)
        bits = worth * float(log2(max(found.error, 1.0))) + field_bits(found.vectors)
        if bits < least:
            best, least = found, bits
        if bits > coarser:
            break
        coarser = bits
    return best


class _Search:
    """The error of fields, and steps towards smaller ones."""

    def __init__(self, objective: SampledObjective, reference: F4, price: float) -> None:
        self.objective, self.price = objective, price
        self.reference = np.ascontiguousarray(reference)
        self.moved = self.reference.copy()  # (N, 8) f4
        self.scale = objective.height * objective.width * SQUARE
        self.error_of_none = objective.evaluate(self.reference)[0] * self.scale

    def evaluate(self, vectors: F8, cell: int) -> tuple[float, F8]:
        """The squared error of a field and its gradient by the vectors, (gy, gx, 2)."""
        _move(self.reference, vectors, cell, self.moved)
        loss, gradient = self.objective.evaluate(self.moved)
        by_vector = np.zeros(vectors.shape)
        _gather(self.reference, gradient, cell, self.scale / UNITS, by_vector)
        return loss * self.scale, by_vector

    def matrix(self, vectors: F8, cell: int) -> F8:
        """H, (gy, gx, 5, 3): for each of PAIRS the entries xx, xy, yy."""
        out = np.zeros((*vectors.shape[:2], len(PAIRS), 3))
        _sum_products(self.objective.quarter(), vectors, cell, 2 * SQUARE * 4 / (UNITS * UNITS), out)
        return out

    def descend(self, cell: int, start: F8, steps: int) -> F8:
        """The vectors after some damped Gauss-Newton steps, those that lower the error."""
        vectors = start
        error, gradient = self.evaluate(vectors, cell)
        if error > self.error_of_none:
            vectors = np.zeros(start.shape)
            error, gradient = self.evaluate(vectors, cell)
        stiffness, damping = self.stiffness(start, cell), FIRST_DAMPING
        matrix = self.matrix(vectors, cell)
        for _ in range(steps):
            step = np.zeros(vectors.shape)
            _solve(matrix, gradient, damping * stiffness + LEAST_DAMPING, LONGEST_STEP, SWEEPS, step)
            trial = np.clip(vectors + step, -LONGEST, LONGEST)
            new_error, new_gradient = self.evaluate(trial, cell)
            if new_error < error:
                is_little = new_error > (1 - LITTLE) * error
                vectors, error, gradient, damping = trial, new_error, new_gradient, damping / 3
                if is_little:
                    break
                matrix = self.matrix(vectors, cell)
            else:
                damping *= 4
        return vectors

    def choose(self, cell: int, vectors: F8, former: I8, rounds: int) -> Field:
        """Whole vectors near those given, chosen by error and bits."""
        best = np.floor(vectors + 0.5).astype(np.int64)
        stiffness, damping = self.stiffness(vectors, cell), FIRST_DAMPING
        error, gradient = self.evaluate(best.astype(np.float64), cell)
        cost = error + self.price * field_bits(best)
        matrix = self.matrix(vectors, cell)
        for _ in range(rounds):
            trial = best.copy()
            _choose(matrix, gradient, damping * stiffness, trial, former, self.price, CHOICE_SWEEPS, BITS)
            if (trial == best).all():
                break
            new_error, new_gradient = self.evaluate(trial.astype(np.float64), cell)
            new_cost = new_error + self.price * field_bits(trial)
            if new_cost < cost:
                is_little = new_cost > (1 - LITTLE) * cost
                best, error, cost, gradient, damping = trial, new_error, new_cost, new_gradient, damping / 3
                if is_little:
                    break
                matrix = self.matrix(vectors, cell)
            else:
                damping *= 4
        return Field(cell, best, error)

    def stiffness(self, vectors: F8, cell: int) -> F8:
        """The curvature if every splat moved alone, by (metric) of `coordinates`, (gy, gx, 2)."""
        out = np.zeros(vectors.shape)
        _stiffness(self.reference, cell, SQUARE * math.pi / (UNITS * UNITS), out)
        return out


@kernel(inline=True)
def _place(x: float, y: float, cell: int, rows: int, columns: int) -> tuple[int, int, float, float]:
    """The cell above and left of a point, and how far it is from there to the next, 0 to 1."""
    u = min(max(x / cell - 0.5, 0.0), columns - 1.0)
    v = min(max(y / cell - 0.5, 0.0), rows - 1.0)
    i, j = min(int(u), max(columns - 2, 0)), min(int(v), max(rows - 2, 0))
    return i, j, u - i, v - j


@kernel()
def _cell_means(points: F8, motion: F8, cell: int, out: F8) -> None:
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
def _refine(coarse: F8, coarse_cell: int, cell: int, out: F8) -> None:
    """The coarse field read at the centres of smaller cells."""
    for row in range(out.shape[0]):
        for column in range(out.shape[1]):
            i, j, s, t = _place(
                (column + 0.5) * cell, (row + 0.5) * cell, coarse_cell, coarse.shape[0], coarse.shape[1]
            )
            i1, j1 = min(i + 1, coarse.shape[1] - 1), min(j + 1, coarse.shape[0] - 1)
            for k in range(2):
                above = (1 - s) * coarse[j, i, k] + s * coarse[j, i1, k]
                below = (1 - s) * coarse[j1, i, k] + s * coarse[j1, i1, k]
                out[row, column, k] = (1 - t) * above + t * below


@kernel()
def _move(reference: F4, vectors: F8, cell: int, out: F4) -> None:
    """The positions of splats moved by the field, into the first columns of out (N, 8)."""
    rows, columns = vectors.shape[:2]
    for n in range(len(reference)):
        x, y = np.float64(reference[n, 0]), np.float64(reference[n, 1])
        i, j, s, t = _place(x, y, cell, rows, columns)
        i1, j1 = min(i + 1, columns - 1), min(j + 1, rows - 1)
        for k in range(2):
            above = (1 - s) * vectors[j, i, k] + s * vectors[j, i1, k]
            below = (1 - s) * vectors[j1, i, k] + s * vectors[j1, i1, k]
            out[n, k] = np.float64(reference[n, k]) + ((1 - t) * above + t * below) / UNITS


@kernel()
def _gather(reference: F4, gradient: F4, cell: int, scale: float, out: F8) -> None:
    """The gradient by the vectors, from that by positions."""
    rows, columns = out.shape[:2]
    for n in range(len(reference)):
        i, j, s, t = _place(np.float64(reference[n, 0]), np.float64(reference[n, 1]), cell, rows, columns)
        i1, j1 = min(i + 1, columns - 1), min(j + 1, rows - 1)
        for k in range(2):
            g = scale * np.float64(gradient[n, k])
            out[j, i, k] += (1 - s) * (1 - t) * g
            out[j, i1, k] += s * (1 - t) * g
            out[j1, i, k] += (1 - s) * t * g
            out[j1, i1, k] += s * t * g


@kernel()
def _stiffness(reference: F4, cell: int, scale: float, out: F8) -> None:
    """`_Search.stiffness`, added to out; scale times |c|^2 l11 l22 is a splat's energy in units of the field."""
    rows, columns = out.shape[:2]
    for n in range(len(reference)):
        i, j, s, t = _place(np.float64(reference[n, 0]), np.float64(reference[n, 1]), cell, rows, columns)
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
def _sum_products(quarter: F4, vectors: F8, cell: int, scale: float, out: F8) -> None:
    """H of `_Search.matrix`, from the centres between four of every second pixel of every second row (h, w, 3)."""
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
            i, j, s, t = _place(x + 0.5, y + 0.5, cell, rows, columns)
            u = x + 0.5 - vectors[j, i, 0] / UNITS  # where this came from, nearly
            v = y + 0.5 - vectors[j, i, 1] / UNITS
            i, j, s, t = _place(u, v, cell, rows, columns)
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
def _rest(matrix: F8, step: F8, row: int, column: int) -> tuple[float, float]:
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
def _solve(matrix: F8, gradient: F8, damping: F8, longest: float, sweeps: int, step: F8) -> None:
    """Sweeps over (H + damping) step = -gradient, components limited to `longest`."""
    rows, columns = step.shape[:2]
    for _ in range(sweeps):
        for row in range(rows):
            for column in range(columns):
                p, q = _rest(matrix, step, row, column)
                p, q = -gradient[row, column, 0] - p, -gradient[row, column, 1] - q
                xx, xy = matrix[row, column, 0, 0] + damping[row, column, 0], matrix[row, column, 0, 1]
                yy = matrix[row, column, 0, 2] + damping[row, column, 1]
                determinant = xx * yy - xy * xy
                step[row, column, 0] = min(max((yy * p - xy * q) / determinant, -longest), longest)
                step[row, column, 1] = min(max((xx * q - xy * p) / determinant, -longest), longest)


@kernel()
def _field_bits(field: I8, bits: F8) -> float:
    total = 0.0
    for row in range(field.shape[0]):
        for column in range(field.shape[1]):
            total += _own_bits(field, row, column, bits)
    return total


@kernel(inline=True)
def _own_bits(field: I8, row: int, column: int, bits: F8) -> float:
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
def _bits_around(field: I8, row: int, column: int, bits: F8) -> float:
    """Bits of all differences that depend on one vector."""
    total = _own_bits(field, row, column, bits)
    if column + 1 < field.shape[1]:
        total += _own_bits(field, row, column + 1, bits)
    if column == 0 and row + 1 < field.shape[0]:
        total += _own_bits(field, row + 1, column, bits)
    return total


@kernel()
def _choose(matrix: F8, gradient: F8, damping: F8, field: I8, former: I8, price: float, sweeps: int, bits: F8) -> None:
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
                p, q = _rest(matrix, step, row, column)
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
                    cost += price * _bits_around(field, row, column, bits)
                    if cost < best:
                        best, best_k = cost, k
                field[row, column, 0], field[row, column, 1] = tried[best_k, 0], tried[best_k, 1]
                for k in range(2):
                    step[row, column, k] = np.float64(field[row, column, k] - start[row, column, k])
                changed |= best_k != 0
        if not changed:
            break
