"""The motion field of a P-frame: vectors in quarter pixels at the centers of square cells, bilinear between them.

Splats move by the field read at their reference positions. The field of large cells begins with the optical flow, that
of smaller ones with the one before; each is then brought to a smaller error by Gauss-Newton steps. The gradient b is
that of the splats' positions, on a lattice of pixels, summed with their weights; the matrix H takes the picture for
what moves::

    H[c, d] = 2 * sum over pixels and channels of w_c w_d grad R grad R^T

with the bilinear weights w of cells c and d and the gradient of the moved splats' picture R. A step solves
(H + damping) step = -b by Gauss-Seidel sweeps. Then every vector takes of its candidates - what it is, the next
integers, its neighbors' vectors, none, that of the frame before - the one with the least

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
from gsvc_ref.rendering.fast.threads import run_tasks

UNITS: Final = 4  # vectors are in units of 1/4 px
LONGEST_VECTOR: Final = 2047  # longest component of a vector in units, so that every difference of two has a class

PAIRS: Final = ((0, 0), (0, 1), (1, -1), (1, 0), (1, 1))
"""The neighbors (down, right) of a cell of which H is kept; the others follow by symmetry."""

NEXT: Final = ((0, 1), (0, -1), (1, 0), (-1, 0))  # what lies next to a cell (down, right)

PAIRS_OF_CORNERS: Final = ((0, 1, 3, 4), (1, 0, 2, 3), (3, 2, 0, 1), (4, 3, 1, 0))
"""By which of PAIRS two of four cells lie to each other that stand around a point, row by row."""

FLOW_SPACING: Final = 8  # distance in pixels of the points where the optical flow is read
LONGEST_STEP: Final = 8.0  # longest Gauss-Newton step of a component, in units

FIRST_DAMPING: Final = 0.3
LESS_DAMPING: Final = 3.0
MORE_DAMPING: Final = 4.0
"""Share of the stiffness that is added to H; it is divided after a step that helps, and else multiplied."""

MIN_DAMPING: Final = 1.0  # what is added to the diagonal of H in any case
LITTLE: Final = 0.005  # no further step follows one that takes less than this share off the squared error
SWEEPS: Final = 12  # Gauss-Seidel sweeps of a step
CHOICE_SWEEPS: Final = 4  # how often every vector is looked at when vectors are chosen
BIT_PRICE: Final = 1.2  # squared error that a bit of the field is worth, in D^2

VECTOR_BITS: Final[F8] = np.asarray(0.7 + 2 * log2(1.0 + np.arange(2 * LONGEST_VECTOR + 2)), np.float64)
"""About how many bits a component costs, by the magnitude of its difference to its neighbor; fitted to streams."""


class Field(NamedTuple):
    """The side of a cell in pixels, 0 for no field; vectors (gy, gx, 2) i8 in quarter pixels; the squared error."""

    cell: int
    vectors: I8
    error: float


def best_field(
    objective: SampledObjective,
    reference: F4,
    inherited: I8,
    pictures: tuple[F4, F4],
    previous: Field | None,
    settings: InterSettings,
    D: float,
) -> Field:
    """The field of least cost, of none and those with cells of `settings`: `cell_gain` * N * log2(error) + bits.

    Where there is none, splats have an `inherited` motion (N, 2) i8 in 1/256 pixel: in a layer by the base's field.

    The cost has the logarithm of the squared error since later steps take back most of a large one for few bits.
    BIT_PRICE acts only in `choose`, among fields of one cell. Where smaller cells cost more, the search ends.

    `reference` (N, 8) f4 are the splats before they move, `pictures` (H, W, 3) f4 the frame before and the new one, and
    `previous` is the field of the frame before.
    """
    search = _Search(objective, reference, inherited, BIT_PRICE * D * D)
    worth = settings.cell_gain * len(reference)
    best = Field(0, np.zeros((0, 0, 2), np.int64), search.error_of_none)
    least_cost, coarser_cost = worth * float(log2(max(best.error, 1.0))), math.inf
    vectors, coarse_cell = np.zeros((0, 0, 2)), 0
    for cell in settings.cells:
        rows, columns = field_shape(objective.width, objective.height, cell)
        if coarse_cell:
            centers = cell * (np.mgrid[:columns, :rows].T.reshape(-1, 2) + 0.5)  # (x, y), row by row
            vectors = read_field(vectors, coarse_cell, centers).reshape(rows, columns, 2)
        else:
            vectors = mean_flow(*pictures, cell, rows, columns)
        vectors, coarse_cell = search.descend(cell, vectors, settings.motion_steps), cell
        former = previous.vectors if previous and previous.cell == cell else np.zeros(vectors.shape, np.int64)
        found = search.choose(cell, vectors, former, settings.motion_rounds)
        cost = worth * float(log2(max(found.error, 1.0))) + bits_of_field(found.vectors, VECTOR_BITS)
        if cost < least_cost:
            best, least_cost = found, cost
        if cost > coarser_cost:
            break
        coarser_cost = cost
    return best


class Model(NamedTuple):
    """The squared error around a field, to second order: H as (gy, gx, 5, 3), b and what damps H, (gy, gx, 2) each.

    H has the entries xx, xy, yy for each of PAIRS.
    """

    matrix: F8
    gradient: F8
    damping: F8


class _Point(NamedTuple):
    """A field (gy, gx, 2), its squared error, and the gradient by the vectors."""

    vectors: F8
    error: float
    gradient: F8


class _Search:
    """The error of fields, and steps towards smaller ones."""

    def __init__(self, objective: SampledObjective, reference: F4, inherited: I8, price: float) -> None:
        self.objective, self.price = objective, price
        self.reference, self.points = reference, reference[:, :2].astype(np.float64)  # (N, 8) f4, (N, 2)
        self.curvature = curvatures(reference)
        self.scale = objective.height * objective.width * SQUARE_OF_8_BITS
        still = reference.copy()
        still[:, :2] += inherited.astype(np.float32) / np.float32(256)  # exact: whole 1/256 pixels below 2^16
        self.error_of_none = objective.evaluate(still)[0] * self.scale

    def descend(self, cell: int, start: F8, steps: int) -> F8:
        """The vectors after some Gauss-Newton steps from a field, or from none if that is better."""

        def stepped(model: Model, vectors: F8) -> F8:
            step = np.zeros(vectors.shape)
            solve(model._replace(damping=model.damping + MIN_DAMPING), step)
            return np.clip(vectors + step, -LONGEST_VECTOR, LONGEST_VECTOR)

        at = self._evaluate(cell, start)
        if at.error > self.error_of_none:
            at = self._evaluate(cell, np.zeros(start.shape))
        return self._improved(cell, at, steps, stepped, 0.0).vectors

    def choose(self, cell: int, vectors: F8, former: I8, rounds: int) -> Field:
        """Whole vectors near those given, chosen by error and bits."""

        def chosen(model: Model, vectors: F8) -> F8:
            field = vectors.astype(np.int64)
            choose_vectors(model, former, self.price, VECTOR_BITS, field)
            return field.astype(np.float64)

        whole = self._evaluate(cell, np.floor(vectors + 0.5))
        found = self._improved(cell, whole, rounds, chosen, self.price)
        return Field(cell, found.vectors.astype(np.int64), found.error)

    def _evaluate(self, cell: int, vectors: F8) -> _Point:
        moved = self.reference.copy()
        moved[:, :2] = self.points + read_field(vectors, cell, self.points) / UNITS
        loss, gradient = self.objective.evaluate(moved, drawn=True)
        by_position = (self.scale / UNITS) * gradient[:, :2].astype(np.float64)
        return _Point(vectors, loss * self.scale, spread(by_position, cell, self.points, vectors.shape))

    def _matrix(self, cell: int, vectors: F8) -> F8:
        """H of the picture drawn last; `quarter` has one in four of its pixels."""
        out = np.zeros((*vectors.shape[:2], len(PAIRS), 3))
        quarter, bands = self.objective.quarter(), min(len(out), self.objective.threads)
        ends = np.arange(bands + 1) * len(out) // bands  # of the rows of cells that are one task
        run_tasks(lambda i: sum_products(quarter, vectors, cell, (ends[i], ends[i + 1]), out), bands)
        return out

    def _improved(self, cell: int, at: _Point, rounds: int, propose: Callable[[Model, F8], F8], price: float) -> _Point:
        """The field after damped steps that a model proposes, those that lower the error plus price times bits."""

        def cost(point: _Point) -> float:
            return point.error + price * bits_of_field(point.vectors.astype(np.int64), VECTOR_BITS)

        stiffness, damping = spread(self.curvature, cell, self.points, at.vectors.shape), FIRST_DAMPING
        matrix = self._matrix(cell, at.vectors)
        for _ in range(rounds):
            vectors = propose(Model(matrix, at.gradient, damping * stiffness), at.vectors)
            if (vectors == at.vectors).all():
                break
            trial = self._evaluate(cell, vectors)
            before, after = cost(at), cost(trial)
            if after < before:
                at, damping = trial, damping / LESS_DAMPING
                if after > (1 - LITTLE) * before:
                    break
                matrix = self._matrix(cell, vectors)
            else:
                damping *= MORE_DAMPING
        return at


@kernel(inline=True)
def place(x: float, y: float, cell: int, rows: int, columns: int) -> tuple[int, int, float, float]:
    """The cell above and left of a point, and how far it is from there to the next, 0 to 1."""
    u = min(max(x / cell - 0.5, 0.0), columns - 1.0)  # in cells, from the center of the first one on
    v = min(max(y / cell - 0.5, 0.0), rows - 1.0)
    i, j = min(int(u), max(columns - 2, 0)), min(int(v), max(rows - 2, 0))  # with a cell to the right and below
    return i, j, u - i, v - j


def mean_flow(before: F4, after: F4, cell: int, rows: int, columns: int) -> F8:
    """Means of the optical flow from a picture (H, W, 3) to the next over cells, (rows, columns, 2) in units."""
    height, width = before.shape[:2]
    grid = np.mgrid[FLOW_SPACING // 2 : height : FLOW_SPACING, FLOW_SPACING // 2 : width : FLOW_SPACING]
    y, x = grid.reshape(2, -1)
    motion = estimated_motion(before, after, np.stack([x, y], axis=1).astype(np.float32))
    at = np.minimum(y // cell, rows - 1), np.minimum(x // cell, columns - 1)
    sums, counts = np.zeros((rows, columns, 2)), np.zeros((rows, columns, 1))
    np.add.at(sums, at, motion.astype(np.float64))
    np.add.at(counts, at, 1.0)
    return np.clip(UNITS * sums / np.maximum(counts, 1.0), -LONGEST_VECTOR, LONGEST_VECTOR)


@kernel()
def read_field(vectors: F8, cell: int, points: F8) -> F8:
    """The field (gy, gx, 2) at points (P, 2) in pixels, bilinear between the centers of cells: (P, 2)."""
    rows, columns = vectors.shape[:2]
    out = np.empty(points.shape)
    for n in range(len(points)):
        i, j, s, t = place(points[n, 0], points[n, 1], cell, rows, columns)
        i1, j1 = min(i + 1, columns - 1), min(j + 1, rows - 1)
        for k in range(2):
            above = (1 - s) * vectors[j, i, k] + s * vectors[j, i1, k]
            below = (1 - s) * vectors[j1, i, k] + s * vectors[j1, i1, k]
            out[n, k] = (1 - t) * above + t * below
    return out


@kernel()
def spread(values: F8, cell: int, points: F8, shape: tuple[int, int, int]) -> F8:
    """The transpose of `read_field`: values (P, 2) at points added to the vectors around them by their weights."""
    rows, columns = shape[:2]
    out = np.zeros(shape)
    for n in range(len(points)):
        i, j, s, t = place(points[n, 0], points[n, 1], cell, rows, columns)
        i1, j1 = min(i + 1, columns - 1), min(j + 1, rows - 1)
        for k in range(2):
            out[j, i, k] += (1 - s) * (1 - t) * values[n, k]
            out[j, i1, k] += s * (1 - t) * values[n, k]
            out[j1, i, k] += (1 - s) * t * values[n, k]
            out[j1, i1, k] += s * t * values[n, k]
    return out


def curvatures(reference: F4) -> F8:
    """The second derivatives (N, 2) of the squared error by each position (x, y) in units, if its splat moves alone.

    E^2 is 255^2 pi |c|^2 l11 l22, and a motion of one deviation along an axis costs E^2 / 2 (metric). A motion (dx, dy)
    is u = dx / l11 and v = (dy - l21 u) / l22, so that dx alone has the squares 1 / l11^2 and (l21 / l22)^2 / l11^2.
    """
    _, _, l11, l21, l22, r, g, b = reference.astype(np.float64).T
    e2 = SQUARE_OF_8_BITS * math.pi / (UNITS * UNITS) * ((r * r + g * g) + b * b) * (l11 * l22)
    shear = l21 / l22
    return np.stack([e2 * (1 + shear * shear) / (l11 * l11), e2 / (l22 * l22)], axis=1)


@kernel()
def sum_products(quarter: F4, vectors: F8, cell: int, band: tuple[int, int], out: F8) -> None:
    """The matrix H of `motion_field` in a band of rows, added to out (gy, gx, 5, 3): of each of PAIRS xx, xy, yy.

    `quarter` is (h, w, 3), every second pixel of every second row; derivatives are those in the middle of four. Every
    sum is one over pixels row by row, whatever the bands are.
    """
    rows, columns = vectors.shape[:2]
    first, last = band
    weights, scale = np.empty(4), 2 * SQUARE_OF_8_BITS * 4 / (UNITS * UNITS)
    # Above and below these rows of `quarter` no pixel comes from a cell beside the band.
    start = 0 if first == 0 else int((cell * (first - 0.5) + vectors[:, :, 1].min() / UNITS) / 2) - 2
    stop = len(quarter) if last == rows else int((cell * (last + 0.5) + vectors[:, :, 1].max() / UNITS) / 2) + 1
    for above in range(max(start, 0), min(stop, quarter.shape[0] - 1)):
        for left in range(quarter.shape[1] - 1):
            below, right, y, x = above + 1, left + 1, 2 * above + 1, 2 * left + 1
            # The weights are those at the place before the motion, which the vector of a cell beside it leads to.
            i, j, s, t = place(x + 0.5, y + 0.5, cell, rows, columns)
            u = x + 0.5 - vectors[j, i, 0] / UNITS
            v = y + 0.5 - vectors[j, i, 1] / UNITS
            i, j, s, t = place(u, v, cell, rows, columns)
            if j + 1 < first or j >= last:
                continue
            xx, xy, yy = 0.0, 0.0, 0.0
            for c in range(3):
                high_left, high_right = np.float64(quarter[above, left, c]), np.float64(quarter[above, right, c])
                low_left, low_right = np.float64(quarter[below, left, c]), np.float64(quarter[below, right, c])
                dx = ((high_right - high_left) + (low_right - low_left)) / 4
                dy = ((low_left - high_left) + (low_right - high_right)) / 4
                xx += dx * dx
                xy += dx * dy
                yy += dy * dy
            weights[0], weights[1], weights[2], weights[3] = (1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t
            i1, j1 = min(i + 1, columns - 1), min(j + 1, rows - 1)
            xx, xy, yy = scale * xx, scale * xy, scale * yy
            for a in range(4):
                row = j if a < 2 else j1
                if not first <= row < last:
                    continue
                column = i if a % 2 == 0 else i1
                for b in range(a, 4):
                    w = weights[a] * weights[b]
                    if w == 0:  # also where a field has one row or column, and the cell beside is none
                        continue
                    pair = PAIRS_OF_CORNERS[a][b]  # (1, -1), of corners 1 and 2, is kept at the upper right cell
                    out[row, column, pair, 0] += w * xx
                    out[row, column, pair, 1] += w * xy
                    out[row, column, pair, 2] += w * yy


@kernel(inline=True)
def coupling(matrix: F8, step: F8, row: int, column: int) -> tuple[float, float]:
    """The sum of H times the step over the neighbors of a cell."""
    rows, columns = step.shape[:2]
    p, q = 0.0, 0.0
    for pair in range(1, len(PAIRS)):
        down, right = PAIRS[pair]
        for side in range(2):
            r = row + down if side == 0 else row - down
            c = column + right if side == 0 else column - right
            if 0 <= r < rows and 0 <= c < columns:
                x, y = step[r, c, 0], step[r, c, 1]
                m, k = (row, column) if side == 0 else (r, c)  # the cell that H keeps the pair at
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
                p, q = coupling(matrix, step, row, column)  # with the steps of this sweep where there are some
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
                # The error to second order in (dx, dy), the others of `step` being given, and the bits around it.
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
