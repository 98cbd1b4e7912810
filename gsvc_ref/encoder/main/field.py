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

where the squared error is the quadratic model of the last step. All is in binary64 and a stated order.
"""

import math
from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np

from gsvc_base.arrays import F4, F8, I8
from gsvc_base.portable import log2
from gsvc_ref._jit import kernel
from gsvc_ref.encoder.main.settings import InterSettings
from gsvc_ref.encoder.main.target import SQUARE_OF_8_BITS
from gsvc_ref.encoder.motion import estimated_motion
from gsvc_ref.main.motion import field_shape
from gsvc_ref.rendering import SampledObjective

UNITS: Final = 4  # vectors are in units of 1/4 px
LONGEST_VECTOR: Final = 4096  # longest component of a vector that is looked at, in units

PAIRS: Final = ((0, 0), (0, 1), (1, -1), (1, 0), (1, 1))
"""The neighbors (down, right) of a cell of which H is kept; the others follow by symmetry."""

NEXT: Final = ((0, 1), (0, -1), (1, 0), (-1, 0))  # what lies next to a cell (down, right)

PAIRS_OF_CORNERS: Final = ((0, 1, 3, 4), (1, 0, 2, 3), (3, 2, 0, 1), (4, 3, 1, 0))
"""By which of PAIRS two of four cells lie to each other that stand around a point, row by row."""

FLOW_SPACING: Final = 8  # the optical flow is read every so many pixels
LONGEST_STEP: Final = 8.0  # longest Gauss-Newton step of a component, in units

FIRST_DAMPING: Final = 0.3
LESS_DAMPING: Final = 3.0
MORE_DAMPING: Final = 4.0
"""Share of the stiffness that is added to H; it is divided after a step that helps, and else multiplied."""

LEAST_DAMPING: Final = 1.0  # what is added to the diagonal of H in any case
LITTLE: Final = 0.005  # no further step follows one that takes less than this share off the squared error
SWEEPS: Final = 12  # Gauss-Seidel sweeps of a step
CHOICE_SWEEPS: Final = 4  # how often every vector is looked at when vectors are chosen


VECTOR_BITS: Final[F8] = np.asarray(0.7 + 2 * log2(1.0 + np.arange(2 * LONGEST_VECTOR + 2)), np.float64)
"""About how many bits a component costs, by the magnitude of its difference to its neighbor; fitted to streams."""


class Field(NamedTuple):
    """The side of a cell in pixels, 0 for no field; vectors (gy, gx, 2) i8 in quarter pixels; the squared error."""

    cell: int
    vectors: I8
    error: float


def flow_at_points(before: F4, after: F4) -> tuple[F8, F8]:
    """Points of the picture, (P, 2) f8, and the optical flow there, (P, 2) f8 in pixels."""
    height, width = before.shape[:2]
    y, x = np.mgrid[FLOW_SPACING // 2 : height : FLOW_SPACING, FLOW_SPACING // 2 : width : FLOW_SPACING]
    points = np.stack([x.ravel(), y.ravel()], axis=1).astype(np.float32)
    return points.astype(np.float64), estimated_motion(before, after, points).astype(np.float64)


def best_field(
    objective: SampledObjective,
    reference: F4,
    flow: tuple[F8, F8],
    previous: Field | None,
    settings: InterSettings,
    D: float,
) -> Field:
    """The field with the least squared error plus price times bits, of none and those with cells of `settings`.

    Fields of different cells are compared by the logarithm of the error: later steps take back most of a large error
    for few bits. Where smaller cells are worth no more than those before, still smaller ones are not tried.

    `reference` (N, 8) f4 are the splats before they move, `flow` is by `flow_at_points`, and `previous` the field of
    the frame before.
    """
    price = settings.motion_price * D * D
    search = _Search(objective, reference, price)
    worth = settings.cell_gain * len(reference)
    best = Field(0, np.zeros((1, 1, 2), np.int64), search.error_of_none)
    least, coarser = worth * float(log2(max(best.error, 1.0))), math.inf
    fine: tuple[int, F8] | None = None
    for cell in settings.cells:
        rows, columns = field_shape(objective.width, objective.height, cell)
        if fine is None:
            vectors = cell_means(*flow, cell, rows, columns)
        else:
            vectors = np.zeros((rows, columns, 2))
            read_coarse_field(fine[1], fine[0], cell, vectors)
        vectors = search.descend(cell, vectors, settings.motion_steps)
        fine = cell, vectors
        former = np.zeros(vectors.shape, np.int64)
        if previous is not None and previous.cell == cell:
            former = previous.vectors
        found = search.choose(cell, vectors, former, settings.motion_rounds)
        bits = worth * float(log2(max(found.error, 1.0))) + bits_of_field(found.vectors, VECTOR_BITS)
        if bits < least:
            best, least = found, bits
        if bits > coarser:
            break
        coarser = bits
    return best


class Model(NamedTuple):
    """The squared error around a field, to second order: H as (gy, gx, 5, 3), b and what damps H, (gy, gx, 2) each.

    H has the entries xx, xy, yy for each of PAIRS.
    """

    matrix: F8
    gradient: F8
    damping: F8


class _Search:
    """The error of fields, and steps towards smaller ones."""

    def __init__(self, objective: SampledObjective, reference: F4, price: float) -> None:
        self.objective, self.price = objective, price
        self.reference = np.ascontiguousarray(reference)
        self.moved = self.reference.copy()  # (N, 8) f4
        self.scale = objective.height * objective.width * SQUARE_OF_8_BITS
        self.error_of_none = objective.evaluate(self.reference)[0] * self.scale

    def evaluate(self, vectors: F8, cell: int) -> tuple[float, F8]:
        """The squared error of a field and its gradient by the vectors, (gy, gx, 2)."""
        move_by_field(self.reference, vectors, cell, self.moved)
        loss, gradient = self.objective.evaluate(self.moved, drawn=True)
        by_vector = np.zeros(vectors.shape)
        gather_by_vectors(self.reference, gradient, cell, self.scale / UNITS, by_vector)
        return loss * self.scale, by_vector

    def matrix(self, vectors: F8, cell: int) -> F8:
        """H of the picture drawn last; `quarter` has one in four of its pixels."""
        out = np.zeros((*vectors.shape[:2], len(PAIRS), 3))
        sum_products(self.objective.quarter(), vectors, cell, 2 * SQUARE_OF_8_BITS * 4 / (UNITS * UNITS), out)
        return out

    def descend(self, cell: int, start: F8, steps: int) -> F8:
        """The vectors after some Gauss-Newton steps from a field, or from none if that is better."""

        def stepped(model: Model, vectors: F8) -> F8:
            step = np.zeros(vectors.shape)
            solve(model._replace(damping=model.damping + LEAST_DAMPING), step)
            return np.clip(vectors + step, -LONGEST_VECTOR, LONGEST_VECTOR)

        first = self.evaluate(start, cell)
        if first[0] > self.error_of_none:
            start = np.zeros(start.shape)
            first = self.evaluate(start, cell)
        return self._improved(cell, start, first, steps, stepped)[0]

    def choose(self, cell: int, vectors: F8, former: I8, rounds: int) -> Field:
        """Whole vectors near those given, chosen by error and bits."""

        def chosen(model: Model, vectors: F8) -> F8:
            field = vectors.astype(np.int64)
            choose_vectors(model, former, self.price, VECTOR_BITS, field)
            return field.astype(np.float64)

        def cost(vectors: F8) -> float:
            return self.price * bits_of_field(vectors.astype(np.int64), VECTOR_BITS)

        whole = np.floor(vectors + 0.5)
        vectors, error = self._improved(cell, whole, self.evaluate(whole, cell), rounds, chosen, cost)
        return Field(cell, vectors.astype(np.int64), error)

    def _improved(
        self,
        cell: int,
        vectors: F8,
        evaluated: tuple[float, F8],
        rounds: int,
        propose: Callable[[Model, F8], F8],
        cost: Callable[[F8], float] = lambda vectors: 0.0,
    ) -> tuple[F8, float]:
        """The vectors after damped steps that a model proposes, those that lower error plus cost, and the error."""
        error, gradient = evaluated
        stiff, damping = np.zeros(vectors.shape), FIRST_DAMPING
        stiffness(self.reference, cell, SQUARE_OF_8_BITS * math.pi / (UNITS * UNITS), stiff)
        matrix = self.matrix(vectors, cell)
        for _ in range(rounds):
            trial = propose(Model(matrix, gradient, damping * stiff), vectors)
            if (trial == vectors).all():
                break
            new_error, new_gradient = self.evaluate(trial, cell)
            before, after = error + cost(vectors), new_error + cost(trial)
            if after < before:
                vectors, error, gradient, damping = trial, new_error, new_gradient, damping / LESS_DAMPING
                if after > (1 - LITTLE) * before:
                    break
                matrix = self.matrix(vectors, cell)
            else:
                damping *= MORE_DAMPING
        return vectors, error


@kernel(inline=True)
def place(x: float, y: float, cell: int, rows: int, columns: int) -> tuple[int, int, float, float]:
    """The cell above and left of a point, and how far it is from there to the next, 0 to 1."""
    u = min(max(x / cell - 0.5, 0.0), columns - 1.0)
    v = min(max(y / cell - 0.5, 0.0), rows - 1.0)
    i, j = min(int(u), max(columns - 2, 0)), min(int(v), max(rows - 2, 0))
    return i, j, u - i, v - j


def cell_means(points: F8, motion: F8, cell: int, rows: int, columns: int) -> F8:
    """Means of the motion (P, 2) in pixels of points (P, 2) over cells, (rows, columns, 2) in units."""
    x, y = (points.astype(np.int64) // cell).T
    at = np.minimum(y, rows - 1), np.minimum(x, columns - 1)
    sums, counts = np.zeros((rows, columns, 2)), np.zeros((rows, columns, 1))
    np.add.at(sums, at, motion)
    np.add.at(counts, at, 1.0)
    return np.clip(UNITS * sums / np.maximum(counts, 1.0), -LONGEST_VECTOR, LONGEST_VECTOR)


@kernel(inline=True)
def read_vector(vectors: F8, x: float, y: float, cell: int, k: int) -> float:
    """Component k of the field (gy, gx, 2) at a point, bilinear between the centers of cells."""
    rows, columns = vectors.shape[:2]
    i, j, s, t = place(x, y, cell, rows, columns)
    i1, j1 = min(i + 1, columns - 1), min(j + 1, rows - 1)
    above = (1 - s) * vectors[j, i, k] + s * vectors[j, i1, k]
    below = (1 - s) * vectors[j1, i, k] + s * vectors[j1, i1, k]
    return float((1 - t) * above + t * below)


@kernel(inline=True)
def spread(value: float, x: float, y: float, cell: int, k: int, out: F8) -> None:
    """Add a value at a point to component k of the vectors around it, by their weights: the transpose of reading."""
    rows, columns = out.shape[:2]
    i, j, s, t = place(x, y, cell, rows, columns)
    i1, j1 = min(i + 1, columns - 1), min(j + 1, rows - 1)
    out[j, i, k] += (1 - s) * (1 - t) * value
    out[j, i1, k] += s * (1 - t) * value
    out[j1, i, k] += (1 - s) * t * value
    out[j1, i1, k] += s * t * value


@kernel()
def read_coarse_field(coarse: F8, coarse_cell: int, cell: int, out: F8) -> None:
    """The coarse field read at the centers of smaller cells."""
    for row in range(out.shape[0]):
        for column in range(out.shape[1]):
            for k in range(2):
                out[row, column, k] = read_vector(coarse, (column + 0.5) * cell, (row + 0.5) * cell, coarse_cell, k)


@kernel()
def move_by_field(reference: F4, vectors: F8, cell: int, out: F4) -> None:
    """The positions of splats moved by the field, into the first columns of out (N, 8)."""
    for n in range(len(reference)):
        x, y = np.float64(reference[n, 0]), np.float64(reference[n, 1])
        for k in range(2):
            out[n, k] = np.float64(reference[n, k]) + read_vector(vectors, x, y, cell, k) / UNITS


@kernel()
def gather_by_vectors(reference: F4, gradient: F4, cell: int, scale: float, out: F8) -> None:
    """The gradient by the vectors, from that by positions."""
    for n in range(len(reference)):
        x, y = np.float64(reference[n, 0]), np.float64(reference[n, 1])
        for k in range(2):
            spread(scale * np.float64(gradient[n, k]), x, y, cell, k, out)


@kernel()
def stiffness(reference: F4, cell: int, scale: float, out: F8) -> None:
    """The curvature by the vectors if every splat moved alone, added to out (gy, gx, 2).

    scale times |c|^2 l11 l22 is a splat's energy E^2 in units of the field, and a motion of one deviation along an axis
    costs E^2 / 2 (metric): a motion (dx, dy) is u = dx / l11 and v = (dy - l21 u) / l22.
    """
    for n in range(len(reference)):
        x, y = np.float64(reference[n, 0]), np.float64(reference[n, 1])
        l11, l21 = np.float64(reference[n, 2]), np.float64(reference[n, 3])
        l22 = np.float64(reference[n, 4])
        r, g, b = np.float64(reference[n, 5]), np.float64(reference[n, 6]), np.float64(reference[n, 7])
        e2 = scale * ((r * r + g * g) + b * b) * (l11 * l22)
        shear = l21 / l22
        spread(e2 * (1 + shear * shear) / (l11 * l11), x, y, cell, 0, out)
        spread(e2 / (l22 * l22), x, y, cell, 1, out)


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
                    pair = PAIRS_OF_CORNERS[a][b]
                    out[row, column, pair, 0] += w * xx
                    out[row, column, pair, 1] += w * xy
                    out[row, column, pair, 2] += w * yy


@kernel(inline=True)
def coupling(matrix: F8, step: F8, row: int, column: int) -> tuple[float, float]:
    """The sum of H times the step over the neighbours of a cell."""
    rows, columns = step.shape[:2]
    p, q = 0.0, 0.0
    for pair in range(1, len(PAIRS)):
        down, right = PAIRS[pair]
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
def solve(model: Model, step: F8) -> None:
    """Sweeps over (H + damping) step = -b, components limited to LONGEST_STEP."""
    matrix, gradient, damping = model
    rows, columns = step.shape[:2]
    for _ in range(SWEEPS):
        for row in range(rows):
            for column in range(columns):
                p, q = coupling(matrix, step, row, column)
                p, q = -gradient[row, column, 0] - p, -gradient[row, column, 1] - q
                xx, xy = matrix[row, column, 0, 0] + damping[row, column, 0], matrix[row, column, 0, 1]
                yy = matrix[row, column, 0, 2] + damping[row, column, 1]
                determinant = xx * yy - xy * xy
                step[row, column, 0] = min(max((yy * p - xy * q) / determinant, -LONGEST_STEP), LONGEST_STEP)
                step[row, column, 1] = min(max((xx * q - xy * p) / determinant, -LONGEST_STEP), LONGEST_STEP)


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
def choose_vectors(model: Model, former: I8, price: float, bits: F8, field: I8) -> None:
    """Descent of the quadratic model plus price * bits from the field, vector by vector, in place."""
    matrix, gradient, damping = model
    rows, columns = field.shape[:2]
    start = field.copy()
    step = np.zeros(field.shape)
    tried = np.empty((3 + 2 * len(NEXT), 2), np.int64)
    for _ in range(CHOICE_SWEEPS):
        changed = False
        for row in range(rows):
            for column in range(columns):
                x0, y0 = field[row, column, 0], field[row, column, 1]
                # What it is, none, that of the frame before, those of its neighbors, and the next whole vectors.
                tried[0, 0], tried[0, 1] = x0, y0
                tried[1, 0], tried[1, 1] = 0, 0
                tried[2, 0], tried[2, 1] = former[row, column, 0], former[row, column, 1]
                count = 3
                for down, right in NEXT:
                    r, c = row + down, column + right
                    if 0 <= r < rows and 0 <= c < columns:
                        tried[count, 0], tried[count, 1] = field[r, c, 0], field[r, c, 1]
                        count += 1
                for down, right in NEXT:
                    tried[count, 0], tried[count, 1] = x0 + right, y0 + down
                    count += 1
                p, q = coupling(matrix, step, row, column)
                p, q = p + gradient[row, column, 0], q + gradient[row, column, 1]
                xx, xy = matrix[row, column, 0, 0] + damping[row, column, 0], matrix[row, column, 0, 1]
                yy = matrix[row, column, 0, 2] + damping[row, column, 1]
                best, best_k = np.inf, 0
                for k in range(count):
                    if max(abs(tried[k, 0]), abs(tried[k, 1])) > LONGEST_VECTOR:
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
