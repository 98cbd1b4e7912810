"""The state of splats in integers, their classes, and their parameters (spec.md section 15.4).

A state is an array (N, 8) i8 with the columns X, Y (1/256 pixel), A, B (log2 of l11 and l22 in 1/1024), S (l21 / l22 in
1/1024) and n0, n1, n2 (1/16). In these coordinates the squared error of a picture changes alike with each (15-1).
"""

from typing import Final

import numpy as np

from gsvc_base.arrays import F4, I8
from gsvc_base.splats import Splats
from gsvc_ref._jit import kernel
from gsvc_ref.main.tables import EXP2, OCTAVE

X_MOST: Final = 2**24
A_LEAST: Final = -3072
A_MOST: Final = 13311
S_MOST: Final = 32767
N_MOST: Final = 2**28
CLASS_MOST: Final = 10
CLASSES: Final = CLASS_MOST + 1

MAIN_K: Final = (42862, 52495, 30308)
"""2^29 / (16 · 255 · √π) by √3, √2 and √6: from the axes n of colours to R, G and B."""

MAIN_REACH: Final = 54544
"""The radius of the support in 2^-14 of a deviation, rounded up."""

HALVED_REACH: Final = (0, 427, 953, 1953)
"""How far the filter of (9-9) carries a splat at so many halvings, in 1/256 pixel, rounded up."""

_LEAST_EXPONENT: Final = -42
_POWERS: Final[F4] = np.ldexp(np.float32(1), np.arange(_LEAST_EXPONENT, 0))
"""The powers of two of (15-5), from that of the least exponent on."""

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
    """The splats of a state (N, 8), bit for bit those of every decoder (15-5)."""
    positions, cholesky, colors = (np.empty((len(state), columns), np.float32) for columns in (2, 3, 3))
    _find_parameters(np.ascontiguousarray(state), positions, cholesky, colors)
    return Splats(positions, cholesky, colors)


def parameters_of(state: I8) -> F4:
    """The parameters (N, 8) f4 of a state (N, 8): (15-5)."""
    return to_splats(state).to_array()


@kernel()
def _find_parameters(state: I8, positions: F4, cholesky: F4, colors: F4) -> None:
    for i in range(len(state)):
        A, B = state[i, 2], state[i, 3]
        positions[i, 0] = _number(state[i, 0], -8)
        positions[i, 1] = _number(state[i, 1], -8)
        cholesky[i, 0] = _number(EXP2[A & (OCTAVE - 1)], (A >> 10) - 15)
        cholesky[i, 1] = _number(state[i, 4] * EXP2[B & (OCTAVE - 1)], (B >> 10) - 25)  # l21 = S l22
        cholesky[i, 2] = _number(EXP2[B & (OCTAVE - 1)], (B >> 10) - 15)
        most, s = max(abs(state[i, 5]), abs(state[i, 6]), abs(state[i, 7])), 0
        while most >> (14 + s):
            s += 1
        a, b, c = (state[i, 5] * MAIN_K[0]) >> s, (state[i, 6] * MAIN_K[1]) >> s, (state[i, 7] * MAIN_K[2]) >> s
        v = -(A + B) >> 1  # 1 / sqrt(l11 l22): n is a color times the root of the area
        G, exponent = EXP2[v & (OCTAVE - 1)], s + (v >> 10) - 29
        colors[i, 0] = _color(a + b + c, G, exponent)  # R, G, B: the transpose of the orthonormal opponent axes
        colors[i, 1] = _color(a - 2 * c, G, exponent)
        colors[i, 2] = _color(a - b + c, G, exponent)


@kernel(inline=True)
def _number(p: int, exponent: int) -> float:
    """The binary32 number p 2^exponent, |p| < 2^32: an integer is converted as r24 of (15-5) rounds it."""
    return float(np.float32(p) * _POWERS[exponent - _LEAST_EXPONENT])


@kernel(inline=True)
def _color(T: int, G: int, exponent: int) -> float:
    """T G 2^(exponent - 15) in binary32, the magnitude of T G / 2^15 rounded down first (15-5)."""
    p = (abs(T) * G) >> 15
    return _number(-p if T < 0 else p, exponent)


def work_of(state: I8, width: int, height: int, halvings: int = 0) -> int:
    """The rendering work of a state (N, 8) on a frame of that size in pixels, halved so often, in pairs (5-2)."""
    return int(_find_work(np.ascontiguousarray(state), width, height, halvings, HALVED_REACH[halvings]))


@kernel()
def _find_work(state: I8, width: int, height: int, halvings: int, filtered: int) -> int:
    work = 0
    for i in range(len(state)):
        e = _reach(state[i, 3])
        E_x, E_y = _reach(state[i, 2]), ((e * (1024 + abs(state[i, 4]))) >> 10) + 1
        columns = _side(state[i, 0], E_x + filtered, width, halvings)
        work += columns * _side(state[i, 1], E_y + filtered, height, halvings)
    return work


@kernel(inline=True)
def _reach(v: int) -> int:
    """The reach of a deviation of 2^(v/1024) pixels in 1/256 pixel, rounded up: E_x and e of (5-2)."""
    return int((EXP2[v & (OCTAVE - 1)] * MAIN_REACH) >> (21 - (v >> 10))) + 1


@kernel(inline=True)
def _side(middle: int, reach: int, size: int, h: int) -> int:
    """The columns or rows of a box in a frame of `size` of them, halved h times."""
    end = min((size + (1 << h) - 1) >> h, (middle + reach + (256 << h) - 1) >> (8 + h))
    return int(max(0, end - max(0, (middle - reach) >> (8 + h))))
