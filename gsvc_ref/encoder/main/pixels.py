"""Frames of fewer pixels than one splat stands for by default: each pixel gets a splat, so nothing is left to search.

The rules for larger pictures fail here. They weigh the bits of a splat against its error, so the color of a picture
of one splat would have steps of a seventh of its value, although nearly all of the file is its header.
"""

import math
from typing import Final

import numpy as np

from gsvc_base.arrays import F4, F8
from gsvc_base.portable import exp
from gsvc_ref.encoder.main.codes import nearest_codes
from gsvc_ref.encoder.main.coordinates import to_coordinates
from gsvc_ref.encoder.main.intra import ordered
from gsvc_ref.main.codes import IntraCodes, MainCodes
from gsvc_ref.main.reconstruct import intra_state
from gsvc_ref.main.state import parameters_of
from gsvc_ref.main.tables import step_of

PIXEL_SIZE: Final = 0.5
"""l11 and l22 in pixels: the larger, the finer the steps of colors, and the more a splat covers its neighbors."""

PIXEL_SWEEPS: Final = 16
"""Number of times that each color is chosen; noise in 6x6 pixels takes about ten until all errors are roundings."""

PIXEL_SPLATS: Final = "each pixel has a splat, so that nothing is to be predicted"
"""Why a frame of few pixels is an I-frame."""


def encode_pixels(picture: F4, bit_depth: int) -> MainCodes:
    """The codes of an I-frame with a splat on each pixel of a picture (H, W, 3) f4, at the finest step.

    Colors are solved for pixel by pixel (Gauss and Seidel), given what the others have been rounded to; the sweep with
    the smallest error is kept.
    """
    height, width = picture.shape[:2]
    drawn = pixel_splats(picture, bit_depth)
    rows, columns = np.divmod(np.arange(len(drawn)), width)
    step, z, codes = step_of(0), to_coordinates(drawn), [IntraCodes()] * len(drawn)
    drawn[:, 5:] = 0
    missing, least, best = 255 * picture.reshape(-1, 3).astype(np.float64), math.inf, codes
    for _ in range(PIXEL_SWEEPS):
        for i in range(len(drawn)):
            weights = _weights(drawn[i], columns, rows)
            missing = missing + weights * (255 * drawn[i, 5:].astype(np.float64))
            drawn[i, 5:] = _total(weights * missing) / (255 * _total(weights * weights))
            z[i, 5:] = to_coordinates(drawn[i : i + 1])[0, 5:]
            codes[i] = nearest_codes(z[i : i + 1], step, width, height)
            drawn[i] = parameters_of(intra_state(codes[i], step))[0]
            missing = missing - _weights(drawn[i], columns, rows) * (255 * drawn[i, 5:].astype(np.float64))
        error = float(_total(_total(missing * missing)))
        if error < least:
            least, best = error, [*codes]
    return ordered(0, IntraCodes.joined(best), width, height)


def pixel_splats(picture: F4, bit_depth: int) -> F4:
    """A splat (H W, 8) on each pixel of a picture (H, W, 3) f4, with its color."""
    height, width = picture.shape[:2]
    splats = np.zeros((height * width, 8), np.float32)
    rows, columns = np.divmod(np.arange(len(splats)), width)
    splats[:, 0], splats[:, 1] = columns + 0.5, rows + 0.5
    # Without neighbors a splat may be larger, which makes the steps of its color finer.
    splats[:, 2] = splats[:, 4] = PIXEL_SIZE if len(splats) > 1 else math.ldexp(PIXEL_SIZE, bit_depth - 8)
    splats[:, 5:] = picture.reshape(-1, 3)
    return splats


def _weights(row: F4, columns: F8, rows: F8) -> F8:
    """The Gaussian of a splat (8,) at the center of each pixel, (N, 1)."""
    x, y, l11, l21, l22 = row[:5].astype(np.float64)
    u = ((columns + 0.5) - x) / l11
    v = (((rows + 0.5) - y) - l21 * u) / l22
    return np.asarray(exp(-0.5 * (u * u + v * v)))[:, None]


def _total(terms: F8) -> F8:
    """The sum over the first axis, in its order on every machine."""
    return np.asarray(np.cumsum(terms, axis=0)[-1])
