"""Hypothesis strategies of data that need no stream: splats, planes, videos.

Structure (counts, sizes, kinds) is drawn by Hypothesis and shrinks; the bulk is painted from a drawn seed, which keeps
examples fast.
"""

from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st

from gsvc_ref.arrays import F4, U2, Frame
from gsvc_ref.draws import Draws
from gsvc_ref.splats import Splats
from gsvc_ref.testing.random_streams import SYMBOL_KINDS, paint_symbols

HARD_NUMBERS = (0.0, -0.0, 2.0**-149, -(2.0**-149), 2.0**-127, 2.0**-126, 1.0, -1.0, 1e6, -1e6, 3e38, -3e38)
"""Numbers at which implementations break: signed zeros, subnormals, the smallest normal, far and huge ones."""


@st.composite
def painters(draw: st.DrawFn) -> np.random.Generator:
    """Random generators, each of its own seed."""
    return np.random.default_rng(draw(st.integers(0, 2**32 - 1)))


@st.composite
def splat_sets(
    draw: st.DrawFn,
    width: int = 64,
    height: int = 48,
    *,
    min_count: int = 0,
    max_count: int = 40,
    hard: bool = False,
) -> Splats:
    """Splats for a frame of `width` by `height` pixels: mostly on it, some over its edges, round ones and needles.

    With `hard`, some parameters are taken from `HARD_NUMBERS`: degenerate factors, huge extents, far positions.
    """
    count = draw(st.integers(min_count, max_count))
    rng = draw(painters())
    size = np.array([width, height])
    positions = rng.uniform(-0.1, 1.1, (count, 2)) * size
    deviation = np.exp(rng.uniform(np.log(0.3), np.log(0.2 * size.max() + 1), (count, 2)))  # pixels
    shear = rng.normal(0, 1, count) * deviation.mean(axis=1)
    cholesky = np.column_stack([deviation[:, 0], shear, deviation[:, 1]])
    colors = rng.normal(0.1, 0.4, (count, 3))
    parameters: F4 = np.concatenate([positions, cholesky, colors], axis=1).astype(np.float32)  # (count, 8) f4
    if hard and count:
        where = rng.random(parameters.shape) < draw(st.sampled_from((0.05, 0.5)))
        parameters[where] = rng.choice(np.array(HARD_NUMBERS, np.float32), np.count_nonzero(where))
    return Splats.from_array(parameters)


@dataclass(frozen=True, eq=False)
class Plane:
    """`symbols` (count,) u2, each below `alphabet`."""

    symbols: U2
    alphabet: int


@st.composite
def planes(draw: st.DrawFn, *, max_count: int = 600, alphabets: st.SearchStrategy[int] | None = None) -> Plane:
    """Planes that make an encoder use every `plane_mode`: one symbol, noise, peaks, few symbols, one odd among many."""
    if alphabets is None:
        alphabets = st.one_of(st.integers(1, 20), st.sampled_from((64, 256, 1000, 1024, 4096)))
    alphabet = draw(alphabets)
    count = draw(st.integers(1, max_count))
    rng = Draws(draw(st.integers(0, 2**32 - 1)))
    return Plane(paint_symbols(rng, draw(st.sampled_from(SYMBOL_KINDS)), count, alphabet), alphabet)


@st.composite
def videos(
    draw: st.DrawFn,
    *,
    max_frames: int = 4,
    max_size: int = 24,
    bit_depths: st.SearchStrategy[int] | None = None,
) -> tuple[list[Frame], int]:
    """Small videos: frames (H, W, 3) of one size, u1 for 8 bits and u2 for 9 to 16; and their bit depth."""
    bit_depth = draw(st.sampled_from((8, 10, 12, 16)) if bit_depths is None else bit_depths)
    width, height = draw(st.integers(1, max_size)), draw(st.integers(1, max_size))
    rng = draw(painters())
    kind = draw(st.sampled_from(("noise", "flat", "extremes", "moving")))
    peak, dtype = 2**bit_depth - 1, np.uint8 if bit_depth == 8 else np.uint16
    shape = (height, width, 3)
    still = rng.integers(0, peak, shape, endpoint=True)
    frames: list[Frame] = []
    for number in range(draw(st.integers(1, max_frames))):
        if kind == "noise":
            frame = rng.integers(0, peak, shape, endpoint=True)
        elif kind == "flat":
            frame = np.broadcast_to(still[0, 0], shape)
        elif kind == "extremes":
            frame = rng.choice(np.array([0, peak]), shape)
        else:
            frame = np.roll(still, number, axis=1)
        frames.append(frame.astype(dtype))
    return frames, bit_depth
