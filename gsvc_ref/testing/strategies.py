"""Hypothesis strategies of data that need no stream: splats, planes, videos.

What makes a difference is drawn value by value, the simple values first, so that Hypothesis shrinks to the one splat,
run or colour that matters, with round numbers. Only large amounts are painted from a drawn seed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from hypothesis import strategies as st

from gsvc_base.arrays import F4, U2, Frame
from gsvc_base.draws import Draws
from gsvc_base.splats import PARAMETERS_PER_SPLAT, Splats
from gsvc_ref.testing.random_streams import SYMBOL_KINDS, paint_symbols

HARD_NUMBERS = (0.0, -0.0, 2.0**-149, -(2.0**-149), 2.0**-127, 2.0**-126, 1.0, -1.0, 1e6, -1e6, 3e38, -3e38)
"""Numbers at which implementations break: signed zeros, subnormals, the smallest normal, far and huge ones."""

FEW: Final = 64
"""Number of splats that are drawn one by one; what exceeds it is painted."""

SIMPLE_SPLAT: Final = (0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0)
"""The splat that all others shrink to: at the origin, L the identity, black."""

ALL_PARAMETERS: Final = (1 << PARAMETERS_PER_SPLAT) - 1


@st.composite
def painters(draw: st.DrawFn) -> np.random.Generator:
    """Random generators, each of another seed."""
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

    Each splat is drawn by itself and shrinks to ``(0, 0, 1, 0, 1, 0, 0, 0)``; what more than 64 splats have beyond
    these is painted, and shrinks in number. `hard` takes some parameters from `HARD_NUMBERS`: degenerate factors, huge
    extents, far positions.
    """
    single = _single_splats(width, height, hard)
    most = min(max_count, FEW)
    # Lists shrink well and are mostly short; a drawn count makes the long ones.
    rows = draw(st.one_of(st.lists(single, min_size=min(min_count, most), max_size=most), _counted(single, most)))
    least = max(0, min_count - len(rows))
    painted = np.empty((0, PARAMETERS_PER_SPLAT), np.float32)
    if least or (max_count > FEW and draw(st.booleans())):
        count = draw(st.integers(least, max_count - len(rows)))
        painted = _painted(draw, count, width, height, hard)
    drawn = np.array(rows, np.float32).reshape(-1, PARAMETERS_PER_SPLAT)
    return Splats.from_array(np.concatenate([drawn, painted]))


@st.composite
def _counted(draw: st.DrawFn, single: st.SearchStrategy[list[float]], most: int) -> list[list[float]]:
    return [draw(single) for _ in range(draw(st.integers(0, most)))]


def _single_splats(width: int, height: int, hard: bool) -> st.SearchStrategy[list[float]]:
    """The parameters (8) of single splats.

    Which of them are not simple is drawn first, as one integer: a splat that does not matter is two choices, not ten,
    which Hypothesis soon deletes.
    """
    across, down, colors = _numbers(-0.1 * width, 1.1 * width), _numbers(-0.1 * height, 1.1 * height), _numbers(-1, 2)
    larger = max(width, height)
    kinds = []
    for reach in (2.0, 0.2 * larger + 1, max(2.0, larger)):  # pixels
        extents = _numbers(0.125, reach)
        kinds.append((across, down, extents, _numbers(-reach, reach), extents, colors, colors, colors))
    many = 2 * (ALL_PARAMETERS + 1)  # every second splat has no simple parameter
    choices = st.integers(0, len(kinds) * many - 1)
    hard_places = st.one_of(
        st.just(0), st.sampled_from([1 << k for k in range(PARAMETERS_PER_SPLAT)]), st.integers(0, ALL_PARAMETERS)
    )

    @st.composite
    def splat(draw: st.DrawFn) -> list[float]:
        kind, places = divmod(draw(choices), many)
        places = min(places, ALL_PARAMETERS)
        row = [draw(kinds[kind][k]) if places >> k & 1 else simple for k, simple in enumerate(SIMPLE_SPLAT)]
        if hard:
            places = draw(hard_places)
            row = [draw(st.sampled_from(HARD_NUMBERS)) if places >> k & 1 else value for k, value in enumerate(row)]
        return row

    return splat()


def _numbers(lowest: float, highest: float) -> st.SearchStrategy[float]:
    """Binary32 numbers of a range; Hypothesis shrinks them to small integers."""
    return st.floats(float(np.float32(lowest)), float(np.float32(highest)), width=32, allow_subnormal=False)


def _painted(draw: st.DrawFn, count: int, width: int, height: int, hard: bool) -> F4:
    """`count` splats of an endless sequence, (count, 8) f4.

    Both ends of the stretch can shrink: its count leaves out the first ones, its end the last ones.
    """
    rng = Draws(draw(st.integers(0, 2**32 - 1)))
    end = draw(st.integers(count, count + 1000))
    share = draw(st.sampled_from((0.0, 0.05, 0.5))) if hard else 0.0
    u = rng.random((end, 3 * PARAMETERS_PER_SPLAT))[end - count :]  # every row has its own numbers
    size = np.array([width, height])
    positions = (1.2 * u[:, :2] - 0.1) * size
    deviation = 0.3 * ((0.2 * size.max() + 1) / 0.3) ** u[:, 2:4]  # pixels
    shear = (4 * u[:, 4] - 2) * deviation.mean(axis=1)
    splats = np.column_stack([positions, deviation[:, 0], shear, deviation[:, 1], 1.5 * u[:, 5:8] - 0.5])
    which = (u[:, 16:] * len(HARD_NUMBERS)).astype(np.int64)
    splats = np.where(u[:, 8:16] < share, np.array(HARD_NUMBERS)[which], splats)
    return splats.astype(np.float32)


@dataclass(frozen=True, eq=False)
class Plane:
    """`symbols` (count,) u2, each below `alphabet`."""

    symbols: U2
    alphabet: int

    def __repr__(self) -> str:
        return f"Plane(symbols={self.symbols.tolist()}, alphabet={self.alphabet})"


@st.composite
def planes(draw: st.DrawFn, *, max_count: int = 600, alphabets: st.SearchStrategy[int] | None = None) -> Plane:
    """Planes that make an encoder use every `plane_mode`: few runs of symbols, noise, peaks, one odd among many.

    Runs are drawn one by one and shrink; the other kinds are painted, and shrink in number. There is one symbol at
    least; alphabets have 1 to 20 and some more symbols up to 4096 if None.
    """
    if alphabets is None:
        alphabets = st.one_of(st.integers(1, 20), st.sampled_from((64, 256, 1000, 1024, 4096)))
    alphabet = draw(alphabets)
    symbols = st.integers(0, alphabet - 1)
    if draw(st.booleans()):
        count = draw(st.integers(1, max_count))
        rng = Draws(draw(st.integers(0, 2**32 - 1)))
        return Plane(paint_symbols(rng, draw(st.sampled_from(SYMBOL_KINDS)), count, alphabet), alphabet)
    lengths = st.one_of(st.just(1), st.integers(1, max_count))
    runs = draw(st.lists(st.tuples(symbols, lengths), min_size=1, max_size=12))
    values = np.repeat([symbol for symbol, _ in runs], [length for _, length in runs])
    return Plane(values[:max_count].astype(np.uint16), alphabet)


@st.composite
def videos(
    draw: st.DrawFn,
    *,
    max_frames: int = 4,
    max_size: int = 24,
    bit_depths: st.SearchStrategy[int] | None = None,
) -> tuple[list[Frame], int]:
    """Small videos: frames (H, W, 3) of one size, u1 for 8 bits and u2 for 9 to 16; and their bit depth.

    Most have one to four drawn colours, which shrink to black and to one; others are noise. Some move by a pixel a
    frame. The bit depths are 8, 10, 12 and 16 if None.
    """
    bit_depth = draw(st.sampled_from((8, 10, 12, 16)) if bit_depths is None else bit_depths)
    width, height = draw(st.integers(1, max_size)), draw(st.integers(1, max_size))
    count, moving, noisy = draw(st.integers(1, max_frames)), draw(st.booleans()), draw(st.integers(0, 3)) == 3
    samples = st.one_of(st.sampled_from((0, 2**bit_depth - 1)), st.integers(0, 2**bit_depth - 1))
    colors = [] if noisy else draw(st.lists(st.tuples(samples, samples, samples), min_size=1, max_size=4))
    seed = draw(st.integers(0, 2**32 - 1)) if len(colors) != 1 else 0
    pictures = _pictures(Draws(seed), (1 if moving else count, height, width), colors, bit_depth)
    frames = [np.roll(pictures[0], number, axis=1) for number in range(count)] if moving else list(pictures)
    return frames, bit_depth


def _pictures(rng: Draws, shape: tuple[int, int, int], colors: Sequence[tuple[int, ...]], bit_depth: int) -> Frame:
    """Pictures (count, H, W, 3) whose pixels have some colours, or any if there are none."""
    dtype = np.uint8 if bit_depth == 8 else np.uint16
    if not colors:
        return np.asarray(rng.integers(0, 2**bit_depth, (*shape, 3), dtype))
    return np.asarray(np.array(colors, dtype)[rng.integers(0, len(colors), shape)])
