"""Hard cases of metrics and of colour: `tests/hard_cases` measures them against 60 digits."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases.color import described, samples
from gsvc_conformance.cases.metrics import Frame

NEAR_ZERO = 34
"""The seed from 0 to 39 whose MS-SSIM is closest to 0 without being 0."""


def flat(value: int, height: int = 12, width: int = 11) -> Frame:
    """A frame of one grey."""
    return np.full((height, width, 3), value, np.uint8)


@case("stress", "metrics", flags=["hard", "overflow"])
def hard_hot_pixel() -> Inputs:
    """Black, and black with one sample of 255: its square is 1 modulo 256."""
    frame = flat(0)
    frame[4, 7, 2] = 255
    expected = yield {"a": flat(0), "b": frame, "bit_depth": 8}
    assert expected["mse"].value == 65025 / 396


@case("stress", "metrics", flags=["hard", "cancellation", "metric"])
def hard_flat_frames() -> Inputs:
    """White, and one step below: no variance, no covariance, hardly a difference."""
    expected = yield {"a": flat(255), "b": flat(254), "bit_depth": 8}
    assert expected["mse"].value == 1
    assert 0.9999 < expected["ms_ssim"].value < 1


@case("stress", "metrics", flags=["hard", "nan", "metric"])
def hard_structure_near_zero() -> Inputs:
    """Noise against other noise of 21x21 pixels: the mean of a scale is a hair above 0 in some channel.

    The result goes with its 0.3th power or so, so that small errors become large; below 0 it counts as 0, and a power
    of it would be no number.
    """
    noise = Draws(NEAR_ZERO).integers(0, 256, (2, 21, 21, 3)).astype(np.uint8)
    expected = yield {"a": noise[0], "b": noise[1], "bit_depth": 8}
    assert 0 < expected["ms_ssim"].value < 0.02


def all_of(values: Any, bit_depth: int = 8) -> NDArray[Any]:
    """All triples of some sample values: (3, n, n * n)."""
    grid = np.stack(np.meshgrid(values, values, values, indexing="ij")).reshape(3, len(values), -1)
    return samples(grid, bit_depth)


RANGES = {
    "limited": {"matrix": 1, "full_range": 0},
    "full": {"matrix": 6, "full_range": 1},
}


@case("stress", "planes_to_frame", flags=["hard", "range", "clamp"])
def hard_corners() -> Inputs:
    """Planes of limited range with all triples of 0, 16, 128, 240 and 255, most of them no colour at all."""
    y, cb, cr = all_of([0, 16, 128, 240, 255])
    expected = yield {"y": y, "cb": cb, "cr": cr, **described()}
    assert np.count_nonzero(expected["frame"].value % 255 == 0) > 100


@case("stress", "planes_to_frame", flags=["hard", "range", "bit-depth"])
def hard_corners_of_16_bits() -> Inputs:
    """Planes of 16 bits with all triples of the ends of both ranges and the middle: limited range, BT.2020."""
    y, cb, cr = all_of([0, 4096, 32768, 65535], 16)
    expected = yield {"y": y, "cb": cb, "cr": cr, **described(matrix=9, bit_depth=16)}
    assert {0, 65535} < set(expected["frame"].value.ravel().tolist())


@case("stress", "frame_to_planes", flags=["hard", "range", "ties"], each=RANGES)
def hard_cube(value: dict[str, int]) -> Inputs:
    """Frames with all triples of 0, 1, 127, 128, 254 and 255: {key} range."""
    frame = np.moveaxis(all_of([0, 1, 127, 128, 254, 255]), 0, -1)
    expected = yield {"frame": frame, **described(**value)}
    assert expected["cb"].value.max() == (255 if value["full_range"] else 240)


@case("stress", "frame_to_planes", flags=["hard", "ties", "siting"])
def hard_pixels_on_black_and_white() -> Inputs:
    """Hot samples on black above dark samples on white, 4:2:0, Y, Cg, Co in full range: quarters end on ties."""
    frame = np.zeros((8, 6, 3), np.uint8)
    frame[4:] = 255
    frame[1, 2], frame[2, 5, 1], frame[5, 1], frame[6, 4, 2] = (250, 0, 0), 255, (255, 255, 253), 1
    expected = yield {"frame": frame, **described(chroma_format=1, matrix=8, full_range=1)}
    assert (expected["y"].value[1, 2], expected["y"].value[5, 1]) == (62, 254)
