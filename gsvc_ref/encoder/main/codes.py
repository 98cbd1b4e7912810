"""From coordinates to the nearest codes of an I-frame, or of the new splats of a P-frame."""

import math
from typing import Final

import numpy as np

from gsvc_base.arrays import F8, I8
from gsvc_ref._jit import kernel
from gsvc_ref.encoder.main.coordinates import PER_ROOT2, ROOT2, exp_kernel
from gsvc_ref.encoder.main.fitter import MAX_SHEAR
from gsvc_ref.main.cells import CELL, cell_counts
from gsvc_ref.main.codes import CodeArrays, IntraCodes
from gsvc_ref.main.densities import LARGEST_MAGNITUDE, PLANES, Densities, windows_of
from gsvc_ref.main.reconstruct import log_size, middle_of_place, place_unit
from gsvc_ref.main.state import A_MOST, CLASSES, N_MOST, S_MOST, SHEAR_STEPS, SIZE_STEPS, class_of
from gsvc_ref.main.tables import power_of_two

LUMA_OFFSET: Final = 0.45
CHROMA_OFFSET: Final = 0.4
"""A color's code is floor(|n| / D + offset) with the sign of n."""

PER_NEPER: Final = 1024 / math.log(2)  # units of A and B, 1/1024 octave, in a neper

MAX_ASPECT_CHANGE: Final = 20.0
"""Largest change of ln(l11 / l22) by rounding that a shear goes along with; it keeps exp within its range."""


_INTRA_MOST: Final = np.stack([*np.full((2, CLASSES), A_MOST), int(MAX_SHEAR * 1024) // SHEAR_STEPS])
INTRA_LIMITS: Final[I8] = _INTRA_MOST[:, :, None] * np.array([-1, 1])
"""Limits before densities are chosen to fit: any size and aspect that a state can hold, and the shear's."""


def limits_of(densities: Densities) -> I8:
    """The least and the greatest code of size, aspect and shear in their windows, (3, classes, 2)."""
    limits = np.empty((3, CLASSES, 2), np.int64)
    for row, plane in enumerate(PLANES[3:]):
        windows = windows_of(plane, densities.of(plane))
        bins = np.diff(windows.distributions.first) - 1
        limits[row, :, 0] = windows.first << windows.low_bits
        limits[row, :, 1] = ((windows.first + bins) << windows.low_bits) - 1
    return limits


def nearest_codes(z: F8, step: int, width: int, height: int, limits: I8 = INTRA_LIMITS) -> IntraCodes:
    """The codes nearest to coordinates; what they mean is `intra_state`.

    Where colors round down, the class j, and with it the steps of the other codes, follows the color's codes. The shear
    is that which holds l21 / l11 through the rounding of size and aspect, and y compensates for what x lacks along the
    splat, so that long slanted splats need no finer x.

    `z` is (N, 8) f8, and `step` D in 1/16; splats outside the frame are moved to its edge. `limits` (3, classes, 2) i8
    are the least and the greatest code of size, aspect and shear in every class.
    """
    codes = CodeArrays.empty(len(z))
    columns, rows = cell_counts(width, height)
    _find_nearest(z, step, columns, rows, limits, codes)
    return IntraCodes(*codes)


@kernel()
def _find_nearest(z: F8, step: int, columns: int, rows: int, limits: I8, codes: CodeArrays) -> None:
    color = np.empty(3, np.int64)
    most = min(LARGEST_MAGNITUDE, N_MOST // step)
    for i in range(len(z)):
        for c in range(3):
            n = z[i, 5 + c] * 16 / step
            code = min(math.floor(abs(n) + (LUMA_OFFSET if c == 0 else CHROMA_OFFSET)), most)
            codes.colors[i, c] = -code if n < 0 else code
            color[c] = codes.colors[i, c] * step
        j = class_of(color, step)
        # A and B are ln l11 and ln l22 in 1/1024 octave; their half sum and difference are m and r over sqrt 2.
        size = _nearest(z[i, 2] * (PER_ROOT2 * PER_NEPER) / SIZE_STEPS[j], limits[0, j])
        aspect = _nearest(z[i, 3] * (PER_ROOT2 * PER_NEPER) / SIZE_STEPS[j], limits[1, j])
        A, B = log_size(size, aspect, j, 0), log_size(size, aspect, j, 1)
        change = min(max((A - B) * (1 / PER_NEPER) - ROOT2 * z[i, 3], -MAX_ASPECT_CHANGE), MAX_ASPECT_CHANGE)
        shear = _nearest(z[i, 4] * exp_kernel(change) * 1024 / SHEAR_STEPS[j], limits[2, j])
        codes.shapes[i, 0], codes.shapes[i, 1], codes.shapes[i, 2] = size, aspect, shear
        cell, place = _place_in_cell(z[i, 0], columns, place_unit(A, j))
        codes.cells[i, 0], codes.places[i, 0] = cell, place
        X, S = middle_of_place(cell, place, place_unit(A, j)), min(max(shear * SHEAR_STEPS[j], -S_MOST), S_MOST)
        along = S * power_of_two(B) / (1024 * power_of_two(A))  # l21 / l11: by how much y goes with x
        y = z[i, 1] + along * (X * (1 / 256) - z[i, 0])
        codes.cells[i, 1], codes.places[i, 1] = _place_in_cell(y, rows, place_unit(B, j))


@kernel(inline=True)
def _place_in_cell(position: float, cells: int, g: int) -> tuple[int, int]:
    """The cell of a position in pixels along one axis, and its place there: a place is 2^g pixels wide."""
    cell = min(max(math.floor(position / CELL), 0), cells - 1)
    place = math.floor((position - CELL * cell) * math.ldexp(1.0, -int(g)))
    return cell, min(max(place, 0), (1 << (2 - g)) - 1)


@kernel(inline=True)
def _nearest(value: float, limits: I8) -> int:
    return int(min(max(math.floor(value + 0.5), limits[0]), limits[1]))


@kernel(inline=True)
def put_coordinates(state: I8, z: F8) -> None:
    """The coordinates z (8,) of a state (8,), in pixels, nepers and units of 8 bits."""
    z[0], z[1] = state[0] / 256, state[1] / 256
    z[2] = (state[2] + state[3]) * (PER_ROOT2 / PER_NEPER)
    z[3] = (state[2] - state[3]) * (PER_ROOT2 / PER_NEPER)
    z[4] = state[4] / 1024
    for k in range(5, 8):
        z[k] = state[k] / 16
