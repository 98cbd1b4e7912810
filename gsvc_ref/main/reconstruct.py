"""Codes of profile `main` to states, in integers (spec.md sections 15.9 and 15.11)."""

from typing import Final

import numpy as np

from gsvc_base.arrays import I8
from gsvc_ref._jit import kernel
from gsvc_ref.main.cells import CELL
from gsvc_ref.main.codes import REMOVED, CodeArrays, IntraCodes
from gsvc_ref.main.state import A_LEAST, A_MOST, N_MOST, S_MOST, SHEAR_STEPS, SIZE_STEPS, X_MOST, class_of
from gsvc_ref.main.tables import EXP2

STEP_MOST: Final = 2**17 - 1
"""The largest step of a position in 1/256 pixel."""

CHANGED: Final = 1
"""Any mode of a splat that has differences."""


def colors_of(codes: I8, step: int) -> I8:
    """The colours n (N, 3) of the codes (N, 3) of an I-frame, D being `step`."""
    most = N_MOST // step
    return np.clip(codes, -most, most) * step


def place_bits(shapes: I8, j: I8) -> I8:
    """How many bits x and y of the place in the cell have (N, 2), from the codes of shape (N, 3) and the classes."""
    h = SIZE_STEPS[j]
    logs = np.stack([(shapes[:, 0] + shapes[:, 1]) * h, (shapes[:, 0] - shapes[:, 1]) * h], axis=1)
    bits: I8 = 2 - np.clip((np.clip(logs, A_LEAST, A_MOST) >> 10) + 1 - j[:, None], -4, 2)
    return bits


def intra_state(codes: IntraCodes, step: int) -> I8:
    """The state (N, 8) that codes of an I-frame, or of new splats, stand for: (15-10), (15-15); `step` is D in 1/16."""
    state = np.empty((len(codes), 8), np.int64)
    find_intra_state(codes.arrays, step, state)
    return state


@kernel()
def find_intra_state(codes: CodeArrays, step: int, state: I8) -> None:
    """`intra_state`, put into `state` (N, 8)."""
    most = N_MOST // step
    for splat in range(len(state)):
        for axis in range(3):
            state[splat, 5 + axis] = min(max(codes.colors[splat, axis], -most), most) * step
        j = class_of(state[splat, 5:], step)  # the colour says how fine the other codes are
        for axis in range(2):
            size = log_size(codes.shapes[splat, 0], codes.shapes[splat, 1], j, axis)
            middle = middle_of_place(codes.cells[splat, axis], codes.places[splat, axis], place_unit(size, j))
            state[splat, axis] = min(max(middle, -X_MOST), X_MOST)
            state[splat, 2 + axis] = size
        state[splat, 4] = min(max(codes.shapes[splat, 2] * SHEAR_STEPS[j], -S_MOST), S_MOST)


@kernel(inline=True)
def log_size(size: int, aspect: int, j: int, axis: int) -> int:
    """A (axis 0) or B (axis 1) of the codes of size and aspect (15-10)."""
    code = size - aspect if axis else size + aspect
    return int(min(max(code * SIZE_STEPS[j], A_LEAST), A_MOST))


@kernel(inline=True)
def place_unit(size: int, j: int) -> int:
    """The g of spec.md section 15.9: a step of a place in the cell is 2^g pixels."""
    return min(max((size >> 10) + 1 - j, -4), 2)


@kernel(inline=True)
def middle_of_place(cell: int, place: int, g: int) -> int:
    """X or Y of the middle of a place in a cell (15-15), in 1/256 pixel: a place is 2^(g + 8) of them wide."""
    return 256 * CELL * cell + (place << (g + 8)) + (1 << (g + 7))


def add_differences(state: I8, motion: I8, differences: I8, step: int) -> I8:
    """The state (N, 8) of splats that stay, after motion (N, 2) in 1/256 pixel and differences q (N, 8) (15-13)."""
    after, past = np.empty((len(state), 8), np.int64), np.empty(len(state), np.int64)
    find_after(state, motion, np.full(len(state), CHANGED), differences, step, after, past)
    return after


@kernel()
def find_after(state: I8, motion: I8, modes: I8, differences: I8, step: int, after: I8, past: I8) -> int:
    """`add_differences` of the splats that are not removed, put into `after` (N, 8) from its start; how many there are.

    What was done with each is put into `past` (N,): whether its mode is not 0. One of mode 0 has no differences.
    """
    stay = 0
    for splat in range(len(state)):
        if modes[splat] == REMOVED:
            continue
        q, X, Y = differences[splat], state[splat, 0] + motion[splat, 0], state[splat, 1] + motion[splat, 1]
        A, B, S = state[splat, 2], state[splat, 3], state[splat, 4]
        if modes[splat]:
            j = class_of(state[splat, 5:], step)
            g_x, g_y = position_step(A, j), position_step(B, j)
            X += q[0] * g_x
            Y += q[0] * sheared_step(S, g_y) + q[1] * g_y
            A = min(max(A + (q[2] + q[3]) * SIZE_STEPS[j], A_LEAST), A_MOST)
            B = min(max(B + (q[2] - q[3]) * SIZE_STEPS[j], A_LEAST), A_MOST)
            S = _sheared(S, A - state[splat, 2] - B + state[splat, 3]) + q[4] * SHEAR_STEPS[j]
        after[stay, 0], after[stay, 1] = min(max(X, -X_MOST), X_MOST), min(max(Y, -X_MOST), X_MOST)
        after[stay, 2], after[stay, 3], after[stay, 4] = A, B, min(max(S, -S_MOST), S_MOST)
        for i in range(5, 8):
            after[stay, i] = min(max(state[splat, i] + q[i] * step, -N_MOST), N_MOST)
        past[stay] = min(modes[splat], 1)
        stay += 1
    return stay


@kernel(inline=True)
def position_step(size: int, j: int) -> int:
    """The g_x or g_y of (15-13), from A or B."""
    v = size + 512 - 1024 * j
    shift = (v >> 10) - 7
    power = EXP2[v & 1023] << shift if shift >= 0 else EXP2[v & 1023] >> -shift
    return int(min(max(power, 1), STEP_MOST))


@kernel(inline=True)
def sheared_step(S: int, g_y: int) -> int:
    """The g_s of (15-13): by how much y goes along with a step of x, in 1/256 pixel."""
    g_s = min(abs(S) * g_y >> 10, STEP_MOST)
    return -g_s if S < 0 else g_s


@kernel(inline=True)
def _sheared(S: int, v: int) -> int:
    """S times 2^(v/1024), rounded towards 0, at most 32767 in magnitude."""
    shift = min(max(15 - (v >> 10), 0), 31)  # EXP2 is at least 2^15: without a shift all but 0 is above the range
    magnitude = min((abs(S) * EXP2[v & 1023]) >> shift, S_MOST)
    return int(-magnitude if S < 0 else magnitude)
