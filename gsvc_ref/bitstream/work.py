"""The work that a frame asks of a renderer, which a level limits (spec.md section 5)."""

from operator import index

import numpy as np
from numpy.typing import ArrayLike

from gsvc_base.arrays import F4
from gsvc_base.checks import door
from gsvc_base.constants import REACH, SMALLEST_NORMAL
from gsvc_base.splats import Splats
from gsvc_ref._jit import kernel


@kernel()
def _work_kernel(positions: F4, cholesky: F4, width: float, height: float) -> float:
    """The work in binary64, exact since all counts are below 2⁵³."""
    work = 0.0
    for n in range(len(positions)):
        l11, l21, l22 = np.float64(cholesky[n, 0]), np.float64(cholesky[n, 1]), np.float64(cholesky[n, 2])
        x, y = np.float64(positions[n, 0]), np.float64(positions[n, 1])
        total = x + y + l11 + l21 + l22  # of binary32 numbers: finite if all of them are
        if l11 < SMALLEST_NORMAL or l22 < SMALLEST_NORMAL or not np.isfinite(total):
            continue
        e_x, e_y = REACH * l11, REACH * (abs(l21) + l22)
        # Whole pixels, clamped to the frame.
        columns = max(0.0, min(width, np.ceil(x + e_x)) - max(0.0, np.floor(x - e_x)))
        rows = max(0.0, min(height, np.ceil(y + e_y)) - max(0.0, np.floor(y - e_y)))
        work += columns * rows  # (5-1)
    return work


# twin of spec.rendering_work
@door
def rendering_work(parameters: Splats | ArrayLike, width: int, height: int) -> int:
    """The number of (splat, pixel) pairs in the splats' boxes on a frame, (5-1): the work that a level limits (R-5-4).

    No renderer finds a pixel covered outside of these boxes, so that the work bounds the time that a frame takes. A
    splat with an infinite position or factor has no box.

    Parameters
    ----------
    parameters
        The splats, or their parameters (N, 8) f4.
    width, height
        Size of the frame in pixels.

    Returns
    -------
    int
        The work.

    Raises
    ------
    UsageError
        The parameters do not describe splats.
    """
    splats = Splats.of(parameters)
    with np.errstate(invalid="ignore"):  # infinity minus infinity, of which a kernel that is not compiled would warn
        return int(_work_kernel(splats.positions, splats.cholesky, float(index(width)), float(index(height))))
