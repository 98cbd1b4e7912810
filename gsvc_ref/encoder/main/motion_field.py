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

where the squared error is the quadratic model of the last step. The loops are in `field_kernels`.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from gsvc_base.arrays import F4, F8, I8
from gsvc_base.portable import log2
from gsvc_ref.encoder.main.field_kernels import (
    LONGEST,
    PAIRS,
    UNITS,
    bits_of_field,
    cell_means,
    choose_vectors,
    gather_by_vectors,
    move_by_field,
    refine,
    solve,
    stiffness,
    sum_products,
)
from gsvc_ref.rendering import SampledObjective
from gsvc_ref.training.motion import estimated_motion

SQUARE: Final = 255.0 * 255.0
"""What a squared error of 1 is in units of 8 bits."""

FLOW_SPACING: Final = 8
"""The optical flow is read every so many pixels."""

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
    return float(bits_of_field(vectors, BITS))


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
            cell_means(*flow, cell, vectors)
        else:
            refine(fine[1], fine[0], cell, vectors)
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
        move_by_field(self.reference, vectors, cell, self.moved)
        loss, gradient = self.objective.evaluate(self.moved, drawn=True)
        by_vector = np.zeros(vectors.shape)
        gather_by_vectors(self.reference, gradient, cell, self.scale / UNITS, by_vector)
        return loss * self.scale, by_vector

    def matrix(self, vectors: F8, cell: int) -> F8:
        """H, (gy, gx, 5, 3): for each of PAIRS the entries xx, xy, yy."""
        out = np.zeros((*vectors.shape[:2], len(PAIRS), 3))
        sum_products(self.objective.quarter(), vectors, cell, 2 * SQUARE * 4 / (UNITS * UNITS), out)
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
            solve(matrix, gradient, damping * stiffness + LEAST_DAMPING, LONGEST_STEP, SWEEPS, step)
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
            choose_vectors(matrix, gradient, damping * stiffness, trial, former, self.price, CHOICE_SWEEPS, BITS)
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
        stiffness(self.reference, cell, SQUARE * math.pi / (UNITS * UNITS), out)
        return out
