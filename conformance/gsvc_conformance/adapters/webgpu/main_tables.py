"""The tables of profile `main` on the device (spec.md 15.3), and the shaders that have them."""

import math
from functools import cache
from typing import Any, Final

import numpy as np

from gsvc_conformance.adapters.webgpu.gpu import Recording, upload, wgsl

OCTAVE: Final = 1024
ALPHAS: Final = (1, 2, 3, 4, 6, 10, 20, 100)
"""α by `halving_code`."""
MOST_TABLED: Final = 15
HALF_TABLE: Final = 17
"""Splats of the largest part that has a table, and the numbers of a table."""


def _nearest_exp2(i: int) -> int:
    """The integer nearest to 2^(15 + i/1024)."""
    power = 1 << (16 * OCTAVE + i)
    for _ in range(10):
        power = math.isqrt(power)
    return (power + 1) >> 1


@cache
def exp2_table() -> tuple[int, ...]:
    """EXP2."""
    return tuple(_nearest_exp2(i) for i in range(OCTAVE))


def step_of(quantizer: int) -> int:
    """D in 1/16 (15-4)."""
    return exp2_table()[128 * (quantizer % 8)] << (quantizer // 8) >> 12


@cache
def tables() -> Any:
    """The buffer of EXP2, LOGISTIC and LAPLACE, (15-3), and of the tables of (15-8) for all n up to 15 and all α."""
    falling = [96 * (128 - i) for i in range(1, 129)]
    tail = [exp2_table()[v % OCTAVE] << v // OCTAVE for v in falling]
    lower = [[2**31 // (2**15 + t) for t in tail], [2**30 // t for t in tail]]
    families = [[0, *half, *(2**16 - v for v in half[-2::-1]), 2**16] for half in lower]
    room = [0] * (HALF_TABLE * MOST_TABLED * len(ALPHAS))
    buffer = upload(np.array([*exp2_table(), *families[0], *families[1], *room], np.uint32))
    recording = Recording()
    recording.dispatch(shader("main_frequencies"), "half_tables", len(ALPHAS), {3: buffer}, [])
    recording.submit()
    return buffer


@cache
def shader(name: str) -> str:
    """The text of a shader of profile `main` with what has to stand in front of it."""
    in_front = {
        "main_lists": (),
        "main_parameters": ("binary32", "main_tables"),
        "main_passes": ("ballots", "main_tables", "main_densities"),
        "main_encode": (),
    }.get(name, ("main_tables", "main_densities"))
    return "\n".join(wgsl(f"{part}.wgsl") for part in (*in_front, name))
