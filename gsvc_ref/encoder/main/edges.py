"""New splats where a picture is worst, stretched along its edges."""

import math
from typing import Final

import numpy as np
from numpy.random import Generator

from gsvc_base.arrays import F4, F8
from gsvc_ref.encoder.initialization import residual_splats

NEW_SIZE: Final = 0.165
"""Deviation of a splat that is added where the residual is, in units of the mean distance between splats; measured."""

STRETCH: Final = 4.0
"""Length over width of a new splat on a straight edge; 1 where there is none."""

MIN_WIDTH: Final = 0.25  # smallest l22 of a new splat in pixels
MIN_TRACE: Final = 1e-5  # trace of a tensor that is noise: such splats are round
MIN_SPREAD: Final = 1e-30  # keeps the quotient of a tensor without direction finite

MAX_PER_SQUARE: Final = 0.25
"""Most new splats that are expected in a square of their size.

Without a limit they pile up where a picture is worst, add up to several times what is missing there, and descent with
them steps too far, until no step of the whole picture is short enough for that place: a frame of 640x272 with 3,000
splats came to 39.7 dB, and with this limit to 51.3.
"""


def edge_splats(tensor: F8, missing: F4, count: int, total: int, rng: Generator) -> F4:
    """Splats (count, 8) f4, drawn in proportion to the cube of what is missing, colored with half of it.

    `missing` (H, W, 3) f4 is the target minus the picture so far, and `tensor` the target's `structure_tensor`. The
    number of splats in `total` makes the size of the new ones.
    """
    height, width = missing.shape[:2]
    size = NEW_SIZE * math.sqrt(width * height / total)
    p = residual_splats(missing, count, size, rng, max_per_square=MAX_PER_SQUARE).to_array()
    x = np.minimum(p[:, 0].astype(np.int64), width - 1)
    y = np.minimum(p[:, 1].astype(np.int64), height - 1)
    p[:, 2:5] = _along(tensor[y, x], size)
    return p


def _along(tensor: F8, size: float) -> F8:
    """Cholesky factors (n, 3) of splats of one area, stretched where their tensor (n, 3) has one direction."""
    xx, xy, yy = tensor.T
    spread = np.sqrt((xx - yy) * (xx - yy) + 4 * xy * xy)
    stretch = 1 + (STRETCH - 1) * (spread / (xx + yy + MIN_TRACE))
    across, along = size * size / stretch, size * size * stretch  # the eigenvalues of the covariance
    mean, half = (across + along) / 2, (across - along) / (2 * np.maximum(spread, MIN_SPREAD))
    l11 = np.sqrt(mean + half * (xx - yy))
    l21 = half * (2 * xy) / l11
    l22 = np.sqrt(np.maximum(mean - half * (xx - yy) - l21 * l21, MIN_WIDTH * MIN_WIDTH))
    return np.stack([l11, l21, l22], axis=1)


def structure_tensor(picture: F4) -> F8:
    """The structure tensor (H, W, 3) f8 of a picture, xx, xy and yy: which way its edges lie.

    It is that of central differences of the mean of the channels, smoothed with a deviation of 1 px.
    """
    grey = np.pad((picture[..., 0] + picture[..., 1] + picture[..., 2]).astype(np.float64) / 3, 1, mode="edge")
    dx = (grey[1:-1, 2:] - grey[1:-1, :-2]) / 2
    dy = (grey[2:, 1:-1] - grey[:-2, 1:-1]) / 2
    return np.stack([_smoothed(p) for p in (dx * dx, dx * dy, dy * dy)], axis=2)


def _smoothed(plane: F8) -> F8:
    """(1 2 1) / 4 twice along both axes: a deviation of 1 px; the edges are repeated."""
    for _ in range(2):
        p = np.pad(plane, 1, mode="edge")
        p = (p[:-2] + 2 * p[1:-1] + p[2:]) / 4
        plane = (p[:, :-2] + 2 * p[:, 1:-1] + p[:, 2:]) / 4
    return plane
