"""New splats of a P-frame: how they are fitted, and their codes.

They begin where `candidates` puts them, are fitted by Adam in the coordinates of `coordinates`, whose steps are in
units of D, and rounded to their codes. All results are made of stated operations.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4, F8, I8
from gsvc_ref._jit import kernel
from gsvc_ref.encoder.main.differences import LN2, put
from gsvc_ref.training.coordinates import HALF, LEAST_ENERGY, ROOT, exp_kernel

FIRST_DECAY: Final = 0.9
SECOND_DECAY: Final = 0.95
"""Adam's averages."""

LUMA_OFFSET: Final = 0.45
CHROMA_OFFSET: Final = 0.4
"""Codes are rounded away from 0 from 1 - offset on."""

CELL: Final = 4
"""The side of the cells in pixels to which positions refer."""

A_LOW: Final = -3072
A_HIGH: Final = 13311
S_MOST: Final = 32767


class NewSplats:
    """New splats in fitting.

    Parameters
    ----------
    z
        (n, 8) f8, their coordinates.
    quantizer
        D in units of 8 bits.
    width, height
        The frame's size in pixels; centres stay inside.
    """

    def __init__(self, z: F8, quantizer: float, width: int, height: int) -> None:
        self.z, self.quantizer, self.width, self.height = z, quantizer, width, height
        self.first, self.second = np.zeros(z.shape), np.zeros(z.shape)
        self._one = self._two = 1.0  # powers of the decays

    def __len__(self) -> int:
        return len(self.z)

    def put_parameters(self, out: F4) -> None:
        """Their parameters, into out (n, 8)."""
        _parameters(self.z, out)

    def step(self, parameters: F4, gradient: F4, scale: float, rate: float) -> None:
        """One step of Adam, given the gradient of the loss by parameters; `scale` is SSE over loss."""
        self._one, self._two = self._one * FIRST_DECAY, self._two * SECOND_DECAY
        _adam(
            self.z, parameters, gradient, self.first, self.second, self.quantizer, scale, rate,
            1 - self._one, 1 - self._two, np.float64(self.width), np.float64(self.height),
        )  # fmt: skip

    def keep(self, least: float) -> None:
        """Drop the splats whose energy is below `least` times D."""
        lowest = least * self.quantizer
        kept = _energies(self.z) >= lowest * lowest
        self.z, self.first, self.second = self.z[kept], self.first[kept], self.second[kept]


@dataclass(frozen=True)
class NewCodes:
    """The codes of new splats.

    Attributes
    ----------
    cells
        (n, 2) i8, column and row of their 4x4 cells.
    colors
        (n, 3) i8.
    shapes
        (n, 3) i8: size, aspect, shear.
    places
        (n, 2) i8, positions inside the cell.
    state
        (n, 8) i8, what they decode to.
    """

    cells: I8
    colors: I8
    shapes: I8
    places: I8
    state: I8

    def take(self, index: NDArray[np.intp]) -> "NewCodes":
        """Some of them, in the order of the index."""
        return NewCodes(
            self.cells[index], self.colors[index], self.shapes[index], self.places[index], self.state[index]
        )


def rounded(z: F8, step: int, width: int, height: int, sizes: I8, shears: I8, limits: I8) -> NewCodes:
    """The codes of splats with the coordinates z (n, 8).

    Parameters
    ----------
    z
        (n, 8) f8.
    step
        D in 1/16.
    width, height
        The frame's size in pixels.
    sizes, shears
        The steps of size and aspect (1/1024 octave) and shear (1/1024) of every class.
    limits
        (3, classes, 2) i8: the least and the greatest code of size, aspect and shear in every class.
    """
    count = len(z)
    out = NewCodes(
        np.zeros((count, 2), np.int64), np.zeros((count, 3), np.int64), np.zeros((count, 3), np.int64),
        np.zeros((count, 2), np.int64), np.zeros((count, 8), np.int64),
    )  # fmt: skip
    columns, rows = -(-width // CELL), -(-height // CELL)
    _round(z, step, columns, rows, sizes, shears, limits, out.cells, out.colors, out.shapes, out.places, out.state)
    return out


def state_parameters(state: I8, out: F4) -> None:
    """The parameters of states (n, 8) i8, within rounding, into out (n, 8) f4."""
    _state_parameters(state, out)


@kernel()
def _parameters(z: F8, out: F4) -> None:
    for i in range(len(z)):
        a, b = (z[i, 2] + z[i, 3]) * HALF, (z[i, 2] - z[i, 3]) * HALF
        put(z[i, 0], z[i, 1], a, b, z[i, 4], z[i, 5], z[i, 6], z[i, 7], out[i])


@kernel()
def _state_parameters(state: I8, out: F4) -> None:
    for i in range(len(state)):
        put(
            state[i, 0] / 256, state[i, 1] / 256, state[i, 2] * (LN2 / 1024), state[i, 3] * (LN2 / 1024),
            state[i, 4] / 1024, state[i, 5] / 16, state[i, 6] / 16, state[i, 7] / 16, out[i],
        )  # fmt: skip


@kernel()
def _energies(z: F8) -> F8:
    """|n|^2 of every splat."""
    out = np.empty(len(z))
    for i in range(len(z)):
        out[i] = (z[i, 5] * z[i, 5] + z[i, 6] * z[i, 6]) + z[i, 7] * z[i, 7]
    return out


@kernel()
def _adam(
    z: F8, parameters: F4, gradient: F4, first: F8, second: F8, quantizer: float, scale: float, rate: float,
    one: float, two: float, width: float, height: float,
) -> None:  # fmt: skip
    """One step of Adam by (u, v, m, r, s, n), steps in units of D, in place."""
    g = np.empty(8)
    third, half, sixth = 1 / math.sqrt(3.0), 1 / math.sqrt(2.0), 1 / math.sqrt(6.0)
    for i in range(len(z)):
        energy = math.sqrt((z[i, 5] * z[i, 5] + z[i, 6] * z[i, 6]) + z[i, 7] * z[i, 7])
        relative = quantizer / max(energy, LEAST_ENERGY * quantizer)
        l11, l21 = np.float64(parameters[i, 2]), np.float64(parameters[i, 3])
        l22 = np.float64(parameters[i, 4])
        g0, g1, g2 = np.float64(gradient[i, 0]), np.float64(gradient[i, 1]), np.float64(gradient[i, 2])
        g3, g4, g5 = np.float64(gradient[i, 3]), np.float64(gradient[i, 4]), np.float64(gradient[i, 5])
        g6, g7 = np.float64(gradient[i, 6]), np.float64(gradient[i, 7])
        by_scale = 0.5 * (
            (g5 * np.float64(parameters[i, 5]) + g6 * np.float64(parameters[i, 6])) + g7 * np.float64(parameters[i, 7])
        )
        by_a = g2 * l11 - by_scale
        by_b = (g4 * l22 + g3 * l21) - by_scale
        share = quantizer / (255 * math.sqrt(math.pi) * math.sqrt(l11 * l22))
        g[0] = (g0 * l11 + g1 * l21) * (ROOT * relative)
        g[1] = (g1 * l22) * (ROOT * relative)
        g[2] = (by_a + by_b) * relative
        g[3] = (by_a - by_b) * relative
        g[4] = g3 * l22 * (2 * relative)
        g[5] = ((g5 + g6) + g7) * (third * share)
        g[6] = (g5 - g7) * (half * share)
        g[7] = ((g5 - 2 * g6) + g7) * (sixth * share)
        for k in range(8):
            value = g[k] * scale
            first[i, k] = FIRST_DECAY * first[i, k] + (1 - FIRST_DECAY) * value
            second[i, k] = SECOND_DECAY * second[i, k] + (1 - SECOND_DECAY) * (value * value)
            unit = quantizer if k >= 5 else (2 * relative if k == 4 else ROOT * relative)
            g[k] = -rate * unit * ((first[i, k] / one) / (math.sqrt(second[i, k] / two) + 1e-9))
        z[i, 0] = min(max(z[i, 0] + l11 * g[0], 0.01), width - 0.01)
        z[i, 1] = min(max(z[i, 1] + (l21 * g[0] + l22 * g[1]), 0.01), height - 0.01)
        for k in range(2, 8):
            z[i, k] += g[k]
        a, b = (z[i, 2] + z[i, 3]) * HALF, (z[i, 2] - z[i, 3]) * HALF
        a, b = min(max(a, -1.3), 5.0), min(max(b, -1.3), 5.0)
        z[i, 2], z[i, 3] = (a + b) * HALF, (a - b) * HALF
        z[i, 4] = min(max(z[i, 4], -30.0), 30.0)


@kernel(inline=True)
def _nearest(value: float, least: int, most: int) -> int:
    return int(min(max(math.floor(value + 0.5), np.float64(least)), np.float64(most)))


@kernel()
def _round(
    z: F8, step: int, columns: int, rows: int, sizes: I8, shears: I8, limits: I8, cells: I8, colors: I8, shapes: I8,
    places: I8, state: I8,
) -> None:  # fmt: skip
    """`rounded`, written into the last five."""
    for i in range(len(z)):
        square = 0
        for c in range(3):
            offset = LUMA_OFFSET if c == 0 else CHROMA_OFFSET
            size = int(min(math.floor(abs(z[i, 5 + c]) * 16 / step + offset), 1024.0))
            colors[i, c] = size if z[i, 5 + c] >= 0 else -size
            state[i, 5 + c] = colors[i, c] * step
            square += size * size
        j = 0
        while j < 10 and square >= 2 << 2 * j:
            j += 1
        a, b = (z[i, 2] + z[i, 3]) * HALF, (z[i, 2] - z[i, 3]) * HALF
        h = sizes[j]
        shapes[i, 0] = _nearest((a + b) * (512 / LN2) / h, limits[0, j, 0], limits[0, j, 1])
        shapes[i, 1] = _nearest((a - b) * (512 / LN2) / h, limits[1, j, 0], limits[1, j, 1])
        A = min(max((shapes[i, 0] + shapes[i, 1]) * h, A_LOW), A_HIGH)
        B = min(max((shapes[i, 0] - shapes[i, 1]) * h, A_LOW), A_HIGH)
        shear = z[i, 4] * exp_kernel((A - B) * (LN2 / 1024) - (a - b))
        shapes[i, 2] = _nearest(shear * 1024 / shears[j], limits[2, j, 0], limits[2, j, 1])
        S = min(max(shapes[i, 2] * shears[j], -S_MOST), S_MOST)
        ex, ey = min(max((A >> 10) + 1 - j, -4), 2), min(max((B >> 10) + 1 - j, -4), 2)
        cx = min(max(int(z[i, 0]) // CELL, 0), columns - 1)
        wide = math.ldexp(1.0, int(ex))
        px = min(max(math.floor((z[i, 0] - CELL * cx) / wide), 0), (1 << (2 - ex)) - 1)
        X = cx * 1024 + (px << (ex + 8)) + (1 << (ex + 7))
        y = z[i, 1] + S / 1024 * exp_kernel((B - A) * (LN2 / 1024)) * (X / 256 - z[i, 0])
        cy = min(max(math.floor(y) // CELL, 0), rows - 1)
        high = math.ldexp(1.0, int(ey))
        py = min(max(math.floor((y - CELL * cy) / high), 0), (1 << (2 - ey)) - 1)
        cells[i, 0], cells[i, 1], places[i, 0], places[i, 1] = cx, cy, px, py
        state[i, 0], state[i, 1] = X, cy * 1024 + (py << (ey + 8)) + (1 << (ey + 7))
        state[i, 2], state[i, 3], state[i, 4] = A, B, S
