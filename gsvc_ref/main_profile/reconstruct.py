"""Codes of profile `main` to states, in integers (spec.md sections 15.9 and 15.11)."""

from typing import Final

import numpy as np

from gsvc_ref.arrays import I8
from gsvc_ref.main_profile.cells import CELL
from gsvc_ref.main_profile.codes import IntraCodes
from gsvc_ref.main_profile.state import A_LEAST, A_MOST, N_MOST, S_MOST, SHEAR_STEPS, SIZE_STEPS, classes, clipped
from gsvc_ref.main_profile.tables import EXP2, exp2

STEP_MOST: Final = 2**17 - 1
"""The largest step of a position in 1/256 pixel."""


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
    """The state (N, 8) that the codes of an I-frame, or of new splats, stand for (15-10), (15-15).

    Parameters
    ----------
    codes
        The codes.
    step
        D in 1/16.
    """
    colors = colors_of(codes.colors, step)
    j = classes(colors, step)
    h = SIZE_STEPS[j]
    size, aspect, shear = codes.shapes.T
    unit = 10 - place_bits(codes.shapes, j)  # a step is 2^unit of 1/256 pixel
    positions = 256 * CELL * codes.cells + (codes.places << unit) + (1 << (unit - 1))
    shape = np.stack([(size + aspect) * h, (size - aspect) * h, shear * SHEAR_STEPS[j]], axis=1)
    return clipped(np.concatenate([positions, shape, colors], axis=1))


def position_steps(state: I8, j: I8) -> tuple[I8, I8, I8]:
    """g_x, g_y and g_s of (15-13), (N,) each, in 1/256 pixel."""
    A, B, S = state[:, 2:5].T
    g_x, g_y = (np.clip(exp2(v + 512 - 1024 * j, 8), 1, STEP_MOST) for v in (A, B))
    return g_x, g_y, np.sign(S) * np.minimum(np.abs(S) * g_y >> 10, STEP_MOST)


def add_differences(state: I8, motion: I8, differences: I8, step: int) -> I8:
    """The splats of the frame before that stay, after motion and differences (15-13).

    Parameters
    ----------
    state
        (N, 8), the reference.
    motion
        (N, 2) in 1/256 pixel.
    differences
        (N, 8), q.
    step
        D in 1/16.

    Returns
    -------
    (N, 8), their state.
    """
    j = classes(state[:, 5:], step)
    h = SIZE_STEPS[j]
    g_x, g_y, g_s = position_steps(state, j)
    q = differences
    after = state.copy()
    after[:, 0] += motion[:, 0] + q[:, 0] * g_x
    after[:, 1] += motion[:, 1] + q[:, 0] * g_s + q[:, 1] * g_y
    after[:, 2] = np.clip(state[:, 2] + (q[:, 2] + q[:, 3]) * h, A_LEAST, A_MOST)
    after[:, 3] = np.clip(state[:, 3] + (q[:, 2] - q[:, 3]) * h, A_LEAST, A_MOST)
    v = after[:, 2] - state[:, 2] - after[:, 3] + state[:, 3]
    after[:, 4] = sheared(state[:, 4], v) + q[:, 4] * SHEAR_STEPS[j]
    after[:, 5:] += q[:, 5:] * step
    return clipped(after)


def sheared(S: I8, v: I8) -> I8:
    """S times 2^(v/1024), rounded towards 0, at most 32767 in magnitude."""
    product, shift = np.abs(S) * EXP2[v & 1023], np.clip((v >> 10) - 15, -62, 16)
    magnitude: I8 = np.where(shift >= 0, product << np.maximum(shift, 0), product >> np.maximum(-shift, 0))
    result: I8 = np.sign(S) * np.minimum(magnitude, S_MOST)
    return result
