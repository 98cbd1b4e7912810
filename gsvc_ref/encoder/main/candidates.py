"""Candidates for new splats of a P-frame: matching pursuit in what a picture leaves of its target.

Candidates are round splats of some sizes s on a grid. One whose colour is the residual's projection on it,

    n = sum over pixels of residual * w / (sqrt(pi) s),    w = exp(-distance^2 / (2 s^2)),

in units of 8 bits takes |n|^2 off the squared error: its gain. The best one is taken, its picture leaves the residual,
and so on until the gain is less than the price of a splat. All results are made of stated operations.
"""

import math
from typing import Final

import numpy as np

from gsvc_base.arrays import F4, F8, I8
from gsvc_base.portable import exp
from gsvc_ref._jit import kernel
from gsvc_ref.rendering.fast.threads import run_tasks
from gsvc_ref.training.coordinates import exp_kernel, log_kernel

REACH: Final = 3.0
"""Candidates are cut off at so many deviations."""

BAND: Final = 32
"""Rows of candidates whose first responses are one task, or of pixels in opponent colours."""


class _Candidates:
    """The responses of round splats of one size to what is left of a residual.

    Parameters
    ----------
    rest
        (H, W, 3) f8, the residual in opponent colours; it may change, if `update` is told where.
    size
        Their deviation s in pixels.
    threads
        The number of threads that find the first responses, None: one per CPU.

    Attributes
    ----------
    spacing, radius
        The distance between them, and how far one reaches, in pixels.
    response
        (rows, columns, 3) f8, n.
    gains, columns
        (rows,) f8 and i8: the largest gain in each row, and where it is.
    """

    def __init__(self, rest: F8, size: float, threads: int | None) -> None:
        height, width = rest.shape[:2]
        self.size, self.spacing, self.radius = size, max(1, int(size / 2)), math.ceil(REACH * size)
        places = np.arange(-self.radius - self.spacing, self.radius + self.spacing + 1) / size
        self._rest, self._weights = rest, exp(-0.5 * (places * places))
        rows, columns = -(-height // self.spacing), -(-width // self.spacing)
        self.response = np.zeros((rows, columns, 3))
        self.gains, self.columns = np.zeros(rows), np.zeros(rows, np.int64)
        bands = -(-rows // BAND)
        run_tasks(lambda i: self._respond(i * BAND, 0, min((i + 1) * BAND, rows), columns), bands, threads)

    def best(self) -> tuple[float, int, int]:
        """The largest gain, its row and its column; the first of equal ones."""
        row = int(self.gains.argmax())
        return float(self.gains[row]), row, int(self.columns[row])

    def update(self, x: int, y: int, radius: int) -> None:
        """Respond anew to what is left around a pixel."""
        reach = radius + self.radius
        self._respond(
            max(0, (y - reach) // self.spacing),
            max(0, (x - reach) // self.spacing),
            min(self.response.shape[0], (y + reach) // self.spacing + 1),
            min(self.response.shape[1], (x + reach) // self.spacing + 1),
        )

    def _respond(self, top: int, left: int, bottom: int, right: int) -> None:
        _respond(
            self._rest, self.size, self.spacing, self.radius, self._weights, self.response, top, left, bottom, right
        )  # fmt: skip
        _find_best(self.response, top, bottom, self.gains, self.columns)


def best_candidates(residual: F4, sizes: tuple[float, ...], least: float, most: int, threads: int | None = None) -> F8:
    """The coordinates (n, 8) f8 of new splats, best first.

    Parameters
    ----------
    residual
        (H, W, 3) f4, target minus picture.
    sizes
        The deviations to try, in pixels.
    least
        A splat's gain must be above this, in squared error of 8-bit units.
    most
        Most splats to give.
    threads
        None: one per CPU; the result does not depend on it.
    """
    height, width = residual.shape[:2]
    rest = np.empty((height, width, 3))
    given = np.ascontiguousarray(residual)
    bands = -(-height // BAND)
    run_tasks(lambda i: _opponent(given, rest, i * BAND, min((i + 1) * BAND, height)), bands, threads)
    layers = [_Candidates(rest, size, threads) for size in sizes]
    found: list[list[float]] = []
    while len(found) < most:
        (gain, row, column), layer = max(((layer.best(), layer) for layer in layers), key=lambda one: one[0][0])
        if gain <= least:
            break
        n = layer.response[row, column].copy()
        x, y = column * layer.spacing + layer.spacing // 2, row * layer.spacing + layer.spacing // 2
        _subtract(rest, x, y, layer.size, layer.radius, n)
        log_size = math.sqrt(2.0) * float(_log(layer.size))
        found.append([x + 0.5, y + 0.5, log_size, 0.0, 0.0, *n])
        for other in layers:
            other.update(x, y, layer.radius)
    return np.array(found, np.float64).reshape(-1, 8)


@kernel()
def _log(x: float) -> float:
    return log_kernel(x)


@kernel()
def _opponent(residual: F4, out: F8, top: int, bottom: int) -> None:
    """The rows top..bottom of the residual, in orthonormal opponent colours and units of 8 bits."""
    third, half, sixth = 255 / math.sqrt(3.0), 255 / math.sqrt(2.0), 255 / math.sqrt(6.0)
    for y in range(top, bottom):
        for x in range(residual.shape[1]):
            r, g, b = np.float64(residual[y, x, 0]), np.float64(residual[y, x, 1]), np.float64(residual[y, x, 2])
            out[y, x, 0], out[y, x, 1], out[y, x, 2] = ((r + g) + b) * third, (r - b) * half, ((r - 2 * g) + b) * sixth


@kernel()
def _respond(
    rest: F8, size: float, spacing: int, radius: int, weights: F8, response: F8, top: int, left: int, bottom: int,
    right: int,
) -> None:  # fmt: skip
    """The responses of rows top..bottom and columns left..right of the candidates of one size."""
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


@kernel()
def _find_best(response: F8, top: int, bottom: int, gains: F8, columns: I8) -> None:
    """The largest gain in each of the rows top..bottom, and the first column that has it."""
    for row in range(top, bottom):
        gains[row] = -1.0
        for column in range(response.shape[1]):
            a, b, c = response[row, column, 0], response[row, column, 1], response[row, column, 2]
            gain = (a * a + b * b) + c * c
            if gain > gains[row]:
                gains[row], columns[row] = gain, column


@kernel()
def _subtract(rest: F8, x: int, y: int, size: float, radius: int, n: F8) -> None:
    """Take the picture of a round splat off the residual."""
    norm = 1 / (math.sqrt(math.pi) * size)
    for row in range(max(0, y - radius), min(rest.shape[0], y + radius + 1)):
        for column in range(max(0, x - radius), min(rest.shape[1], x + radius + 1)):
            square = np.float64((row - y) * (row - y) + (column - x) * (column - x))
            w = norm * exp_kernel(-0.5 * square / (size * size))
            for c in range(3):
                rest[row, column, c] -= w * n[c]
