"""Pictures of 70,006 pixels, 35,003 to a row or to a column: more than 16 bits count, and more than int16 holds."""

from typing import Any, Final

import numpy as np

from gsvc_base.draws import Draws
from gsvc_conformance.case import FULL, Inputs, case
from gsvc_conformance.cases import CAPACITY
from gsvc_conformance.cases.color import described, plane_shape, samples
from gsvc_conformance.cases.large_rows import PERIOD
from gsvc_conformance.cases.metrics import disturbed, scene

LONG: Final = 35_003
SHAPES: Final = {"wide": (2, LONG), "high": (LONG, 2)}
"""Rows and columns."""
SAID: Final = {"wide": "35,003 columns", "high": "35,003 rows"}
PLACES: Final = np.array([1023, 1024, 4095, 4096, 32_767, 32_768, 65_535, 65_536, 2 * LONG - 1])
"""Pixels on both sides of the borders of warps, blocks and 16-bit numbers, and the last one, in the order of rows."""
FLAGS: Final = (CAPACITY, "large-frame")


def picture(pixels: Any, shape: tuple[int, int]) -> Any:
    """Pixels (n, 3) again and again, over a picture (H, W, 3)."""
    return np.resize(pixels, (*shape, 3))


def with_places(image: Any, value: Any) -> Any:
    """The picture with one value at all of PLACES."""
    image.reshape(-1, 3)[PLACES] = value
    return image


# --- Sums and the loss -----------------------------------------------------------------------------------------------


@case("stress", "to_frame", flags=FLAGS, each=SHAPES, said=SAID)
def many_pixels_of_a_sum(value: tuple[int, int], rng: Draws) -> Inputs:
    """A sum of {key} to 8 bits; single pixels at the borders of blocks are white."""
    total = with_places(picture(rng.uniform(0.1, 0.9, (PERIOD, 3)).astype(np.float32), value), 1.5)
    expected = yield {"sum": total, "bit_depth": 8}
    assert np.all(expected["frame"].value.reshape(-1, 3)[PLACES] == 255)


@case("stress", "to_frame_deterministic", flags=FLAGS, each=SHAPES, said=SAID)
def many_pixels_in_binary32(value: tuple[int, int], rng: Draws) -> Inputs:
    """A sum of {key} to 10 bits; single pixels at the borders of blocks are white."""
    total = with_places(picture(rng.uniform(0.1, 0.9, (PERIOD, 3)).astype(np.float32), value), 1.5)
    expected = yield {"sum": total, "bit_depth": 10}
    assert np.all(expected["frame"].value.reshape(-1, 3)[PLACES] == 1023)


@case("stress", "loss", flags=[*FLAGS, "factor"], each=SHAPES, said=SAID)
def loss_of_many_pixels(value: tuple[int, int], rng: Draws) -> Inputs:
    """The loss of 70,006 pixels, {key}: in binary16 their number is infinite.

    Half of the loss comes from nine pixels at the borders of blocks, of which the last is one.
    """
    target = picture(rng.uniform(0.25, 0.75, (PERIOD, 3)).astype(np.float32), value)
    shown = target + picture(rng.normal(0, 0.01, (PERIOD, 3)).astype(np.float32), value)
    expected = yield {"picture": with_places(shown, 1), "target": with_places(target, 0)}
    assert np.isclose(expected["loss"].value, (27 + 0.0001 * 3 * (2 * LONG - 9)) / (2 * LONG), rtol=0.1)


@case("stress", "loss", flags=[CAPACITY, "factor"])
def loss_of_2209_pixels(rng: Draws) -> Inputs:
    """The loss of 47 x 47 pixels: their number is odd and above 2^11, so binary16 does not hold it."""
    target, noise = rng.uniform(0.25, 0.75, (2, 47, 47, 3))
    expected = yield {"picture": (target + 0.1 * noise).astype(np.float32), "target": target.astype(np.float32)}
    assert float(np.float16(47 * 47)) != 47 * 47
    residual = expected["residual"]
    assert np.all(residual.bound < 1e-4 * abs(residual.value))


@case(FULL, "loss", flags=[*FLAGS, "factor"])
def loss_beyond_2_24_pixels(rng: Draws) -> Inputs:
    """The loss of 257 x 65,531 pixels, a number that binary32 does not hold."""
    shape = (257, 65_531)
    target = picture(rng.uniform(0.25, 0.75, (PERIOD, 3)).astype(np.float32), shape)
    shown = target + picture(rng.normal(0, 0.01, (PERIOD, 3)).astype(np.float32), shape)
    expected = yield {"picture": shown, "target": target}
    assert float(np.float32(shape[0] * shape[1])) != shape[0] * shape[1]
    assert expected["loss"].value > 0


# --- Colour and metrics ----------------------------------------------------------------------------------------------


COLOR_SHAPES: Final = {"square": (265, 267), "wide": (3, 4133), "high": (4133, 3)}
"""Rows and columns: plain code multiplies by a matrix of a frame's columns by its chroma samples."""
COLOR_SAID: Final = {"square": "265 by 267 pixels", "wide": "4,133 columns", "high": "4,133 rows"}


@case("stress", "planes_to_frame", flags=FLAGS, each=COLOR_SHAPES, said=COLOR_SAID)
def many_samples(value: tuple[int, int], rng: Draws) -> Inputs:
    """Planes of {key}, 4:2:0, to a frame; the last sample of each plane is bright."""
    shape = plane_shape(*value, 1)
    luma = np.resize(rng.integers(20, 200, PERIOD), value)
    planes = {"y": samples(luma), "cb": samples(np.full(shape, 90)), "cr": samples(np.full(shape, 150))}
    for plane in planes.values():
        plane[-1, -1] = 235
    expected = yield {**planes, **described(chroma_format=1, location=2)}
    assert expected["frame"].value[-1, -1].any()


@case("stress", "frame_to_planes", flags=FLAGS, each=COLOR_SHAPES, said=COLOR_SAID)
def many_pixels_to_planes(value: tuple[int, int], rng: Draws) -> Inputs:
    """A frame of {key} to planes, 4:2:0; its last pixel is white."""
    frame = samples(picture(rng.integers(20, 200, (PERIOD, 3)), value))
    frame[-1, -1] = 255
    expected = yield {"frame": frame, **described(chroma_format=1, location=2)}
    assert expected["y"].value[-1, -1] == 235


@case("stress", "metrics", flags=[*FLAGS, "metric"], each=SHAPES, said=SAID)
def metrics_of_many_pixels(value: tuple[int, int], rng: Draws) -> Inputs:
    """Frames of {key}: a fifth of their error comes from pixels at the borders of blocks, of which the last is one."""
    pixels = scene(rng, PERIOD, 1)[:, 0]
    frame = samples(picture(pixels // 2 + 60, value))
    other = samples(picture(disturbed(rng, pixels[None], (3, 3, 3))[0] // 2 + 60, value))
    expected = yield {"a": with_places(frame, 0), "b": with_places(other, 255), "bit_depth": 8}
    assert 5 < expected["mse"].value < 50
