"""The exact picture for any support cut-off, in binary64: what the ladder's rungs are held against."""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_ref.constants import LN_255, SUPPORT_RADIUS
from gsvc_ref.rendering.definition import exp_minus, footprint
from gsvc_ref.splats import Splats

F8 = NDArray[np.float64]

NOTHING_SIGMA: Final = 40.0
"""Without a cut-off the oracle ends here: exp(-40) is 4e-18, which binary64 cannot add to a colour."""


def cut_sum(splats: Splats, width: int, height: int, support_sigma: float = LN_255) -> F8:
    """The sum (9-2) of spec.md with another support: a splat covers a pixel iff sigma <= support_sigma.

    Parameters
    ----------
    splats
        Positions and Cholesky factors in pixels of this frame.
    width, height
        Size of the frame in pixels.
    support_sigma
        At least ln 255; NOTHING_SIGMA for no cut at all. With ln 255 the result has the bits of `render_sum` with
        precision ``exact``.

    Returns
    -------
    (H, W, 3) f8, not clamped.
    """
    C = np.zeros((height, width, 3))  # (H, W, 3) f8
    beyond = math.sqrt(2 * support_sigma) - SUPPORT_RADIUS
    for splat in splats.to_array().astype(np.float64):
        reach = max(splat[2], math.hypot(splat[3], splat[4]))
        pixels = footprint(splat, width, height, margin=math.ceil(beyond * reach))
        if pixels is not None:
            g = np.where(pixels.sigma <= support_sigma, exp_minus(pixels.sigma), 0.0)
            C[pixels.rows, pixels.columns] += g[..., None] * splat[5:]
    return C
