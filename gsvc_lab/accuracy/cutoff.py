"""The exact picture with another support cut-off: an analysis with the definition in binary64."""

import math
from typing import Final

import numpy as np

from gsvc_base.arrays import F8
from gsvc_base.constants import LN_255, SUPPORT_RADIUS
from gsvc_base.rendering.definition import footprint
from gsvc_base.splats import Splats

UNCUT_SIGMA: Final = 40.0
"""Support where nothing is cut: exp(-40) is 4e-18, which binary64 cannot add to a colour."""


def support_sigma(cutoff: float) -> float:
    """The largest sigma of a support whose smallest weight exp(-sigma) is `cutoff`; 0 cuts nothing."""
    if cutoff == 1 / 255:
        return LN_255
    return -math.log(cutoff) if cutoff else UNCUT_SIGMA


def cut_sum(splats: Splats, width: int, height: int, cutoff: float) -> F8:
    """The sum (9-2) of spec.md with another support: a splat covers a pixel iff exp(-sigma) >= cutoff.

    `splats`: positions and Cholesky factors in pixels of this frame. `width` and `height`: size of the frame in pixels.
    `cutoff`: at most 1/255, which is that of the definition; 0 cuts nothing. Returns (H, W, 3) f8, not clamped.
    """
    support = support_sigma(cutoff)
    C = np.zeros((height, width, 3))  # (H, W, 3) f8
    beyond = math.sqrt(2 * support) - SUPPORT_RADIUS
    for splat in splats.to_array().astype(np.float64):
        reach = max(splat[2], math.hypot(splat[3], splat[4]))
        pixels = footprint(splat, width, height, margin=math.ceil(beyond * reach))
        if pixels is not None:
            g = np.where(pixels.sigma <= support, np.exp(-pixels.sigma), 0.0)
            C[pixels.rows, pixels.columns] += g[..., None] * splat[5:]
    return C
