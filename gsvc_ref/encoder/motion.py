"""Where splats go from one frame to the next: a dense optical flow of reduced frames, read at the splats' centres.

A guess to begin a P-frame with; ours, not the paper's. Decoders know nothing of it.
"""

from typing import Final

import numpy as np

from gsvc_ref.encoder.frame_types import reduced
from gsvc_ref.encoder.optical_flow import SMALLEST_SIDE, optical_flow, read_flow
from gsvc_ref.splats import F4

LONGEST_SIDE: Final = 128
"""Flow is estimated on frames reduced to at most this many pixels on the longer side."""


def estimated_motion(before: F4, after: F4, positions: F4) -> F4:
    """How far splats of the frame before should move, (N, 2) f4 in pixels.

    Parameters
    ----------
    before, after
        (H, W, 3) f4, the pictures of two successive frames.
    positions
        (N, 2) f4, centres of splats in the first one, in pixels.
    """
    old, new = (reduced(picture, LONGEST_SIDE).mean(axis=2, dtype=np.float64) for picture in (before, after))
    if min(old.shape) < SMALLEST_SIDE or np.array_equal(old, new):
        return np.zeros_like(positions)
    step = -(-max(before.shape[:2]) // LONGEST_SIDE)
    motion = np.empty((len(positions), 2), np.float32)
    read_flow(optical_flow(old, new), positions.astype(np.float64) / step - 0.5, float(step), motion)
    return motion
