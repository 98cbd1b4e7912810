"""New splats of a P-frame: matching pursuit in what a picture leaves of its target, then Adam.

Candidates of the pursuit are round splats of some sizes s on a grid. One whose color is the residual's projection,

    n = sum over pixels of residual * w / (sqrt(pi) s),    w = exp(-distance^2 / (2 s^2)),

in units of 8 bits takes |n|^2 off the squared error: its gain. The best one is taken, its picture leaves the residual,
and so on until the gain is less than the price of a splat. `NewSplats` then fits them with the other splats of the
frame, in the coordinates of `coordinates`. All results are made of stated operations.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from gsvc_base.arrays import F4, F8, I8
from gsvc_base.portable import exp, log
from gsvc_ref._jit import kernel
from gsvc_ref.encoder.main import coordinates
from gsvc_ref.encoder.main.coordinates import PER_ROOT2, PER_ROOT3, PER_ROOT6, ROOT2, exp_kernel, squared_energies
from gsvc_ref.encoder.main.fitter import keep_inside
from gsvc_ref.rendering.fast.threads import run_tasks

CUTOFF: Final = 3.0  # candidates are cut off at this many deviations

FIRST_DECAY: Final = 0.9
SECOND_DECAY: Final = 0.95
RATE: Final = 0.25
MIN_DEVIATION: Final = 1e-9
"""Adam's averages, its rate in units of D, and what keeps its quotient finite, in squared error per unit."""

BAND: Final = 32  # rows of candidates whose first responses are one task


class Grid(NamedTuple):
    """Round splats of one size, on a grid, and their responses to what is left of the residual."""

    rest: F8  # (H, W, 3), what is left of the residual in opponent colors
    size: float  # their deviation s in pixels
    spacing: int  # the distance between them in pixels
    radius: int  # how far one reaches in pixels
    weights: F8  # (2 (radius + spacing) + 1,), exp(-x^2 / (2 s^2)) of the pixels around a center along an axis
    response: F8  # (rows, columns, 3), n of each
    gains: F8  # (rows,), the largest gain in a row
    best: I8  # (rows,), the first column that has it

    @classmethod
    def of(cls, rest: F8, size: float, threads: int | None) -> "Grid":
        """The candidates of a size."""
        spacing, radius = max(1, int(size / 2)), math.ceil(CUTOFF * size)
        places = np.arange(-radius - spacing, radius + spacing + 1) / size
        rows, columns = -(-rest.shape[0] // spacing), -(-rest.shape[1] // spacing)
        results = np.zeros((rows, columns, 3)), np.zeros(rows), np.zeros(rows, np.int64)
        grid = cls(rest, size, spacing, radius, exp(-0.5 * (places * places)), *results)
        bands = -(-rows // BAND)
        run_tasks(lambda i: _respond(grid, i * BAND, 0, min((i + 1) * BAND, rows), columns), bands, threads)
        return grid

    def update(self, x: int, y: int, radius: int) -> None:
        """Respond anew to what is left around a pixel."""
        reach, (rows, columns) = radius + self.radius, self.response.shape[:2]
        top, left = max(0, (y - reach) // self.spacing), max(0, (x - reach) // self.spacing)
        bottom, right = (y + reach) // self.spacing + 1, (x + reach) // self.spacing + 1
        _respond(self, top, left, min(rows, bottom), min(columns, right))


def best_candidates(residual: F4, sizes: tuple[float, ...], least: float, most: int, threads: int | None = None) -> F8:
    """The coordinates (n, 8) f8 of at most `most` new splats, best first.

    `residual` (H, W, 3) f4 is target minus picture, `sizes` are the deviations to try in pixels. A splat's gain must be
    above `least`, in squared error of 8-bit units. The result does not depend on the threads.
    """
    rest = _opponent(residual)
    grids = [Grid.of(rest, size, threads) for size in sizes]
    found: list[list[float]] = []
    while len(found) < most:
        grid = max(grids, key=lambda one: one.gains.max())  # the first of equal ones, and so the first row and column
        row = int(grid.gains.argmax())
        if grid.gains[row] <= least:
            break
        column = int(grid.best[row])
        n = grid.response[row, column].copy()
        x, y = column * grid.spacing + grid.spacing // 2, row * grid.spacing + grid.spacing // 2
        _subtract(grid, x, y, n)
        found.append([x + 0.5, y + 0.5, ROOT2 * float(log(grid.size)), 0.0, 0.0, *n])
        for other in grids:
            other.update(x, y, grid.radius)
    return np.array(found, np.float64).reshape(-1, 8)


class NewSplats:
    """New splats in fitting, by Adam in steps of D, with the coordinates z (n, 8) f8."""

    def __init__(self, z: F8, D: float, width: int, height: int) -> None:
        self.z, self._D, self._width, self._height = z, D, width, height
        self._first, self._second = np.zeros(z.shape), np.zeros(z.shape)  # averages of gradients and of their squares
        self._decayed = 1.0, 1.0  # the powers of both decays

    def step(self, parameters: F4, gradient: F4, scale: float) -> None:
        """One step, given the parameters (n, 8) and the gradient of the loss by them; `scale` is SSE over loss."""
        unit = coordinates.units(self.z, self._D)
        g = coordinates.gradient_by_coordinates(parameters, gradient) * unit * scale
        self._first = FIRST_DECAY * self._first + (1 - FIRST_DECAY) * g
        self._second = SECOND_DECAY * self._second + (1 - SECOND_DECAY) * (g * g)
        one, two = self._decayed = self._decayed[0] * FIRST_DECAY, self._decayed[1] * SECOND_DECAY
        ratio = (self._first / (1 - one)) / (np.sqrt(self._second / (1 - two)) + MIN_DEVIATION)
        self.z = coordinates.moved(self.z, -RATE * unit * ratio)
        keep_inside(self.z, self._width, self._height)

    def keep(self, least: float) -> None:
        """Drop the splats whose energy is below `least` times D."""
        kept = squared_energies(self.z) >= (least * self._D) * (least * self._D)
        self.z, self._first, self._second = self.z[kept], self._first[kept], self._second[kept]


@kernel()
def _opponent(residual: F4) -> F8:
    """The residual (H, W, 3) in orthonormal opponent colors and units of 8 bits."""
    out = np.empty(residual.shape)
    for y in range(residual.shape[0]):
        for x in range(residual.shape[1]):
            r, g, b = np.float64(residual[y, x, 0]), np.float64(residual[y, x, 1]), np.float64(residual[y, x, 2])
            out[y, x, 0] = ((r + g) + b) * (255 * PER_ROOT3)
            out[y, x, 1] = (r - b) * (255 * PER_ROOT2)
            out[y, x, 2] = ((r - 2 * g) + b) * (255 * PER_ROOT6)
    return out


@kernel()
def _respond(grid: Grid, top: int, left: int, bottom: int, right: int) -> None:
    """The responses of rows top..bottom and columns left..right of a grid, and the largest gains of these rows."""
    rest, size, spacing, radius, weights, response, gains, best = grid
    height, width = rest.shape[:2]
    if right <= left or bottom <= top:
        return
    first = left * spacing + spacing // 2 - radius  # the first column that counts, and how many do
    count = (right - 1 - left) * spacing + 2 * radius + 1
    start, end = max(0, first), min(width, first + count)
    middle = (len(weights) - 1) // 2
    norm = 1 / (math.sqrt(math.pi) * size)
    sums, across = np.zeros(3 * count), np.empty(3 * (count - 2 * radius))  # flat loops over both become vector code
    inside = sums[3 * (start - first) : 3 * (end - first)]  # the others are outside of the picture, and stay zero
    for row in range(top, bottom):
        cy = row * spacing + spacing // 2
        inside[:] = 0
        for y in range(max(0, cy - radius), min(height, cy + radius + 1)):
            w, line = weights[y - cy + middle], rest[y, start:end].reshape(-1)
            for i in range(inside.size):
                inside[i] += w * line[i]
        across[:] = 0
        for x in range(2 * radius + 1):
            w, line = weights[x - radius + middle], sums[3 * x :]
            for i in range(across.size):
                across[i] += w * line[i]
        for place in range(left, right):
            for c in range(3):
                response[row, place, c] = across[3 * spacing * (place - left) + c] * norm
        gains[row] = -1.0
        for column in range(response.shape[1]):
            n0, n1, n2 = response[row, column, 0], response[row, column, 1], response[row, column, 2]
            gain = (n0 * n0 + n1 * n1) + n2 * n2
            if gain > gains[row]:
                gains[row], best[row] = gain, column


@kernel()
def _subtract(grid: Grid, x: int, y: int, n: F8) -> None:
    """Take the picture of a round splat off the residual."""
    rest, size, radius = grid.rest, grid.size, grid.radius
    norm = 1 / (math.sqrt(math.pi) * size)
    for row in range(max(0, y - radius), min(rest.shape[0], y + radius + 1)):
        for column in range(max(0, x - radius), min(rest.shape[1], x + radius + 1)):
            square = np.float64((row - y) * (row - y) + (column - x) * (column - x))
            w = norm * exp_kernel(-0.5 * square / (size * size))
            for c in range(3):
                rest[row, column, c] -= w * n[c]
