"""From coordinates to the codes of an I-frame, and to the parameters that a decoder has of them."""

import math
from typing import Final, NamedTuple

import numpy as np

from gsvc_base.arrays import F4, F8, I8
from gsvc_ref._jit import kernel
from gsvc_ref.main.cells import cell_counts
from gsvc_ref.main.codes import IntraCodes
from gsvc_ref.main.densities import LARGEST_MAGNITUDE
from gsvc_ref.main.state import A_LEAST, A_MOST, MAIN_K1, MAIN_K2, MAIN_K3, S_MOST
from gsvc_ref.main.tables import EXP2
from gsvc_ref.training.coordinates import HALF, ROOT, exp_kernel

LUMA_OFFSET: Final = 0.45
CHROMA_OFFSET: Final = 0.4
"""A colour's code is floor(|n| / D + offset) with the sign of n."""

MOST_SHEAR: Final = 12.0 * 1024
"""Largest |s| of an I-frame in 1/1024: what every density can hold."""

_PER_NEPER: Final = 1024 / math.log(2)


class Rounded(NamedTuple):
    """Splats as an I-frame codes them, in any order.

    Attributes
    ----------
    k
        (N, 3) i8, luma and chroma codes.
    g
        (N, 3) i8, size, aspect and shear.
    cell, place
        (N, 2) i8, x and y of the cell, and of the place in it.
    state
        (N, 8) i8: X, Y, A, B, S, n0, n1, n2.
    parameters
        (N, 8) f4, that a decoder renders.
    """

    k: I8
    g: I8
    cell: I8
    place: I8
    state: I8
    parameters: F4

    def take(self, indices: I8) -> "Rounded":
        """The splats of some indices, in their order."""
        return Rounded(
            self.k[indices], self.g[indices], self.cell[indices], self.place[indices], self.state[indices],
            self.parameters[indices],
        )  # fmt: skip

    def put(self, indices: I8, others: "Rounded") -> None:
        """Put others into the places of some indices."""
        self.k[indices], self.g[indices] = others.k, others.g
        self.cell[indices], self.place[indices] = others.cell, others.place
        self.state[indices], self.parameters[indices] = others.state, others.parameters


def rounded(z: F8, quantizer: int, width: int, height: int) -> Rounded:
    """The codes nearest to coordinates, and what a decoder makes of them.

    Where colours round down, the class j, and with it the steps of the other codes, follows the colour's codes. The
    shear is that which holds l21 / l11 through the rounding of size and aspect, and y makes good for what x lacks along
    the splat, so that long slanted splats need no finer x.

    Parameters
    ----------
    z
        (N, 8) f8, `to_coordinates`.
    quantizer
        D in 1/16, `gsvc_ref.main.tables.step_of`.
    width, height
        The frame's size in pixels; splats outside are moved to its edge.
    """
    k, g, cell, place, state = (np.empty((len(z), columns), np.int64) for columns in (3, 3, 2, 2, 8))
    result = Rounded(k, g, cell, place, state, np.empty((len(z), 8), np.float32))
    cells = cell_counts(width, height)
    round_kernel(z, quantizer, cells[0], cells[1], LUMA_OFFSET, CHROMA_OFFSET, *result)
    return result


@kernel(inline=True)
def _power_of_2(v: int) -> float:
    """2^(v / 1024) by the table, exact in binary32 and binary64."""
    return math.ldexp(np.float64(EXP2[v & 1023]), int(v >> 10) - 15)


@kernel(inline=True)
def _whole(x: float) -> int:
    return math.floor(x + 0.5)


@kernel()
def round_kernel(
    z: F8, quantizer: int, columns: int, rows: int, luma: float, chroma: float, k: I8, g: I8, cell: I8, place: I8,
    state: I8, parameters: F4,
) -> None:  # fmt: skip
    """`rounded`, written into the arrays of the result."""
    for i in range(len(z)):
        energy = 0
        for c in range(3):
            n = z[i, 5 + c] * 16 / quantizer
            code = min(math.floor(abs(n) + (luma if c == 0 else chroma)), LARGEST_MAGNITUDE)
            energy += min(code, 1024) * min(code, 1024)
            k[i, c] = -code if n < 0 else code
            state[i, 5 + c] = k[i, c] * quantizer
        j = 0
        while j < 10 and energy >= 1 << (2 * j + 1):
            j += 1
        h, shear = 1477 >> j, 2048 >> j
        g[i, 0] = _whole(z[i, 2] * (HALF * _PER_NEPER) / h)
        g[i, 1] = _whole(z[i, 3] * (HALF * _PER_NEPER) / h)
        a = min(max((g[i, 0] + g[i, 1]) * h, A_LEAST), A_MOST)
        b = min(max((g[i, 0] - g[i, 1]) * h, A_LEAST), A_MOST)
        change = min(max((a - b) * (1 / _PER_NEPER) - ROOT * z[i, 3], -20.0), 20.0)
        g[i, 2] = _whole(min(max(z[i, 4] * exp_kernel(change) * 1024, -MOST_SHEAR), MOST_SHEAR) / shear)
        s = min(max(g[i, 2] * shear, -S_MOST), S_MOST)
        ex, ey = min(max((a >> 10) + 1 - j, -4), 2), min(max((b >> 10) + 1 - j, -4), 2)
        l11, l22 = _power_of_2(a), _power_of_2(b)
        cx = min(max(math.floor(z[i, 0] / 4), 0), columns - 1)
        px = min(max(math.floor((z[i, 0] - 4 * cx) * math.ldexp(1.0, -int(ex))), 0), (1 << (2 - ex)) - 1)
        x = cx * 1024 + (px << (ex + 8)) + (1 << (ex + 7))
        wanted = z[i, 1] + s * l22 / (1024 * l11) * (x * (1 / 256) - z[i, 0])
        cy = min(max(math.floor(wanted / 4), 0), rows - 1)
        py = min(max(math.floor((wanted - 4 * cy) * math.ldexp(1.0, -int(ey))), 0), (1 << (2 - ey)) - 1)
        y = cy * 1024 + (py << (ey + 8)) + (1 << (ey + 7))
        cell[i, 0], cell[i, 1], place[i, 0], place[i, 1] = cx, cy, px, py
        state[i, 0], state[i, 1], state[i, 2], state[i, 3], state[i, 4] = x, y, a, b, s
        scale = np.float32(_power_of_2(-(a + b) >> 1))
        grey = np.float32(state[i, 5]) * MAIN_K1
        across = np.float32(state[i, 6]) * MAIN_K2
        green = np.float32(state[i, 7]) * MAIN_K3
        parameters[i, 0], parameters[i, 1] = np.float32(x) / np.float32(256), np.float32(y) / np.float32(256)
        parameters[i, 2], parameters[i, 4] = np.float32(l11), np.float32(l22)
        parameters[i, 3] = np.float32(s) / np.float32(1024) * np.float32(l22)
        parameters[i, 5] = ((grey + across) + green) * scale
        parameters[i, 6] = (grey - np.float32(2) * green) * scale
        parameters[i, 7] = ((grey - across) + green) * scale


@kernel()
def coordinates_of_state(state: I8, z: F8) -> None:
    """The coordinates z (N, 8) of states (N, 8)."""
    for i in range(len(z)):
        z[i, 0], z[i, 1] = state[i, 0] / 256, state[i, 1] / 256
        z[i, 2] = (state[i, 2] + state[i, 3]) * (HALF / _PER_NEPER)
        z[i, 3] = (state[i, 2] - state[i, 3]) * (HALF / _PER_NEPER)
        z[i, 4] = state[i, 4] / 1024
        for c in range(5, 8):
            z[i, c] = state[i, c] / 16


def codes_of(rounded: Rounded) -> IntraCodes:
    """The codes of splats in the order of cells."""
    return IntraCodes(rounded.cell, rounded.k, rounded.g, rounded.place)
