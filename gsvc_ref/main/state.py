"""The state of splats in integers, their classes, and their parameters (spec.md section 15.4).

A state is an array (N, 8) i8 with the columns X, Y (1/256 pixel), A, B (log2 of l11 and l22 in 1/1024), S (l21 / l22 in
1/1024) and n0, n1, n2 (1/16). In these coordinates the squared error of a picture changes alike with each (15-1).
"""

from typing import Final

import numpy as np

from gsvc_base.arrays import F4, I8
from gsvc_base.splats import Splats
from gsvc_ref._jit import kernel
from gsvc_ref.main.tables import power_of_two

X_MOST: Final = 2**25
A_LEAST: Final = -3072
A_MOST: Final = 13311
S_MOST: Final = 32767
N_MOST: Final = 2**28
CLASS_MOST: Final = 10
CLASSES: Final = CLASS_MOST + 1

MAIN_K1: Final = np.float32(float.fromhex("0x1.4edc560000000p-14"))
MAIN_K2: Final = np.float32(float.fromhex("0x1.9a1e720000000p-14"))
MAIN_K3: Final = np.float32(float.fromhex("0x1.d990860000000p-15"))
"""1/√3, 1/√2 and 1/√6, divided by 16 · 255 · √π, as binary32."""

SIZE_STEPS: Final[I8] = 1477 >> np.arange(CLASSES)
"""h of each class: the step of A and B that a code of size or aspect stands for, in 1/1024 octave."""

SHEAR_STEPS: Final[I8] = 2048 >> np.arange(CLASSES)
"""The step of S that a code of shear stands for, by class, in 1/1024."""


def no_splats() -> I8:
    """The state of no splats, (0, 8)."""
    return np.zeros((0, 8), np.int64)


def classes(colors: I8, step: int) -> I8:
    """The class j of each splat (15-4), 0..10, (N,), of colors n (N, 3) and a step D in 1/16."""
    found = np.empty(len(colors), np.int64)
    _find_classes(np.ascontiguousarray(colors), step, found)
    return found


@kernel()
def _find_classes(colors: I8, step: int, found: I8) -> None:
    for splat in range(len(colors)):
        found[splat] = class_of(colors[splat], step)


@kernel(inline=True)
def class_of(color: I8, step: int) -> int:
    """The class of the splat of a colour (3,) (15-4)."""
    energy = 0  # E^2 in D^2; a class is an octave of E, so that its bounds are odd powers of 2
    for i in range(3):
        k = min((abs(color[i]) + step // 2) // step, 1024)
        energy += k * k
    j = 0
    while j < CLASS_MOST and energy >= 2 << (2 * j):
        j += 1
    return j


def to_splats(state: I8) -> Splats:
    """The splats of a state, bit for bit those of every decoder (15-5)."""
    return Splats.from_array(parameters_of(state))


def parameters_of(state: I8) -> F4:
    """The parameters (N, 8) f4 of a state (N, 8): (15-5)."""
    parameters = np.empty((len(state), 8), np.float32)
    _find_parameters(np.ascontiguousarray(state), parameters)
    return parameters


@kernel()
def _find_parameters(state: I8, parameters: F4) -> None:
    for i in range(len(state)):
        # Every operation is rounded to binary32 in the order of (15-5).
        A, B = state[i, 2], state[i, 3]
        l11, l22 = np.float32(power_of_two(A)), np.float32(power_of_two(B))
        g = np.float32(power_of_two(-(A + B) >> 1))  # 1 / sqrt(l11 l22): n is a color times the root of the area
        a = np.float32(state[i, 5]) * MAIN_K1
        b = np.float32(state[i, 6]) * MAIN_K2
        c = np.float32(state[i, 7]) * MAIN_K3
        parameters[i, 0] = np.float32(state[i, 0]) / np.float32(256)  # x, y in pixels
        parameters[i, 1] = np.float32(state[i, 1]) / np.float32(256)
        parameters[i, 2] = l11
        parameters[i, 3] = (np.float32(state[i, 4]) / np.float32(1024)) * l22  # l21 = s l22
        parameters[i, 4] = l22
        parameters[i, 5] = ((a + b) + c) * g  # R, G, B: the transpose of the orthonormal opponent axes
        parameters[i, 6] = (a - np.float32(2) * c) * g
        parameters[i, 7] = ((a - b) + c) * g
