"""Splats by the tens of thousands on one tile, splats that lie over tens of thousands of pixels, and their gradients.

A tile, a pixel, a list or an index that holds 32 to 65,536 of them leaves some out. Long frames are black but for a
few places, and crowds repeat 251 splats, so that files stay small (`gsvc_conformance.runs`).
"""

from typing import Any, Final

import numpy as np

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases import CAPACITY
from gsvc_conformance.cases.building import Array
from gsvc_conformance.cases.large_pictures import LONG, SAID, SHAPES
from gsvc_conformance.cases.large_rows import PERIOD, repeated
from gsvc_conformance.cases.splat_sets import population, splat, splats

FLAGS: Final = (CAPACITY, "large-frame", "tile-edge")
COLUMNS: Final = (31.5, 32.5, 255.5, 256.5, 1023.5, 4096.5, 16_384.5, 32_767.5, 32_768.5, 35_002.5)
"""Where small splats stand along a long frame: in pixels on both sides of the borders of tiles, blocks and int16."""
TILE: Final = (13, 11)
"""Width and height of a frame that is less than one tile."""
SMALL: Final = (5, 3)
"""Width and height of a frame for the largest crowds, on which plain code takes seconds."""
LARGEST: Final = 65_699
CROWDS: Final = {"1109": 1109, "2111": 2111, "4133": 4133, "9001": 9001, "65699": LARGEST}
LARGE_CROWDS: Final = {"9001": 9001, "65699": LARGEST}


def along(shape: tuple[int, int]) -> Array:
    """Small splats along a long frame of this shape, in its first row or column; the last is brightest."""
    places = [(x, 0.5) if shape[1] == LONG else (0.5, x) for x in COLUMNS]
    rows = [splat(*place, 0.7, 0.0, 0.7, (0.25 + n / 16, 0.5, 0.125)) for n, place in enumerate(places)]
    return splats(*rows)


def over_all(shape: tuple[int, int]) -> Array:
    """The same, and a splat of 2^60 pixels: it covers all of the frame with a weight of 1 in any arithmetic."""
    return splats(splat(1.5, 1.5, 2.0**60, 0.0, 2.0**60, (0.25, 0.125, 0.0625)), along(shape))


def crowd(rng: Draws, count: int) -> tuple[Array, dict[str, int]]:
    """Splats (count, 8) that add up to little, of which the last one alone is bright, and the size of their frame."""
    width, height = SMALL if count == LARGEST else TILE
    few = population(rng, PERIOD, width, height, radius=3.0)
    few[:, :2] = rng.uniform(0.5, (width - 0.5, height - 0.5), (PERIOD, 2))
    few[:, 5:] = rng.uniform(-1, 1, (PERIOD, 3)) * 2.0**-17
    rows = repeated(few, count)
    rows[-1] = splat(width / 2, height / 2, 2.1, 0.3, 1.9, (0.75, 0.5, 0.25))
    return rows, frame((height, width))


def frame(shape: tuple[int, int]) -> dict[str, int]:
    """Width and height of a shape (rows, columns)."""
    return {"width": shape[1], "height": shape[0]}


# --- Pictures --------------------------------------------------------------------------------------------------------


@case("stress", "render_sum", flags=FLAGS, each=SHAPES, said=SAID)
def long_frame(value: tuple[int, int]) -> Inputs:
    """A frame of {key}, which one splat covers whole; small ones are on both sides of the borders of blocks."""
    expected = yield {"parameters": over_all(value), **frame(value)}
    total = expected["sum"].value
    assert (total > 0.06).all()
    assert (total[0, -1] if value[1] == LONG else total[-1, 0])[0] > 1


@case("stress", "render_sum_deterministic", flags=FLAGS, each=SHAPES, said=SAID)
def long_frame_in_order(value: tuple[int, int]) -> Inputs:
    """A frame of {key}, which one splat covers whole; small ones are on both sides of the borders of blocks."""
    expected = yield {"parameters": over_all(value), **frame(value)}
    assert (expected["sum"].value > 0.06).all()


@case("stress", "render_frame", flags=FLAGS, each=SHAPES, said=SAID)
def long_frame_of_8_bits(value: tuple[int, int]) -> Inputs:
    """A frame of {key}, which one splat covers whole; small ones are on both sides of the borders of blocks."""
    expected = yield {"parameters": over_all(value), **frame(value), "bit_depth": 8}
    assert expected["frame"].value.min() > 10


@case("stress", "render_sum", flags=[CAPACITY, "many"], each=CROWDS)
def crowded_tile(value: int, rng: Draws) -> Inputs:
    """{key} splats on one tile, of which only the last is bright: a list that is too short loses it."""
    parameters, size = crowd(rng, value)
    expected = yield {"parameters": parameters, **size}
    assert expected["sum"].value.max() > 0.7


@case("stress", "render_sum_deterministic", flags=[CAPACITY, "many", "order"], each=LARGE_CROWDS)
def crowded_tile_in_order(value: int, rng: Draws) -> Inputs:
    """{key} splats on one tile, added in the order of their indices, of which only the last is bright."""
    parameters, size = crowd(rng, value)
    expected = yield {"parameters": parameters, **size}
    assert expected["sum"].value.max() > 0.7


@case("stress", "render_frame", flags=[CAPACITY, "many"], each=LARGE_CROWDS)
def crowded_tile_of_8_bits(value: int, rng: Draws) -> Inputs:
    """{key} splats on one tile, of which only the last is bright: a list that is too short loses it."""
    parameters, size = crowd(rng, value)
    expected = yield {"parameters": parameters, **size, "bit_depth": 8}
    assert expected["frame"].value.max() > 180


# --- Gradients -------------------------------------------------------------------------------------------------------


def bright_at_the_end(residual: Any) -> Any:
    """A residual (H, W, 3) whose last pixel alone is large."""
    residual[-1, -1] = 64, -32, 16
    return residual


@case("stress", "render_gradients", flags=FLAGS, each=SHAPES, said=SAID)
def gradients_of_long_frames(value: tuple[int, int]) -> Inputs:
    """A residual of {key}: the gradient of one splat comes from all of its 70,006 pixels, and most from the last."""
    residual = bright_at_the_end(np.full((*value, 3), 2.0**-12, np.float32))
    expected = yield {"parameters": over_all(value), "residual": residual}
    assert expected["gradients"].value[0, 5] > 64
    assert expected["gradients"].value[1:, 5:].all()


@case("stress", "render_gradients", flags=[CAPACITY, "many"], each=CROWDS)
def gradients_of_a_crowd(value: int, rng: Draws) -> Inputs:
    """{key} splats over one tile, each with a gradient: those that its list does not hold would have none."""
    parameters, size = crowd(rng, value)
    residual = rng.normal(0, 1, (size["height"], size["width"], 3)).astype(np.float32)
    expected = yield {"parameters": parameters, "residual": residual}
    assert expected["gradients"].value[:, 5:].any(axis=1).all()


@case("stress", "render_gradients", flags=FLAGS)
def gradients_of_many_tiles(rng: Draws) -> Inputs:
    """2,111 splats on 265 x 267 pixels, some over a hundred tiles, with other neighbours in each."""
    parameters = population(rng, 2111, 265, 267)
    parameters[:60] = population(rng, 60, 265, 267, radius=40.0)
    residual = np.resize(rng.normal(0, 1, (PERIOD, 3)).astype(np.float32), (267, 265, 3))
    expected = yield {"parameters": parameters, "residual": residual}
    assert np.count_nonzero(expected["gradients"].value.any(axis=1)) > 2000
