"""Where splats go from one frame to the next: a dense optical flow of reduced frames, read at the splats' centres.

A guess to begin a P-frame with; ours, not the paper's. Decoders know nothing of it.
"""

from typing import Final

import numpy as np

from gsvc_ref.codec.detection import reduced
from gsvc_ref.splats import F4

LONGEST_SIDE: Final = 128
"""Flow is estimated on frames reduced to at most this many pixels on the longer side."""

RADIUS: Final = 7
"""Half the side of the window over which flow is taken as constant, in reduced pixels."""

WARPS: Final = 3
"""Refinements of the flow; on three clips more than these changed the prediction by less than 0.1 dB."""

SMALLEST_SIDE: Final = 16
"""Frames with a shorter reduced side are not searched for motion."""


def estimated_motion(before: F4, after: F4, positions: F4) -> F4:
    """How far splats of the frame before should move, (N, 2) f4 in pixels.

    Parameters
    ----------
    before, after
        (H, W, 3) f4, the pictures of two successive frames.
    positions
        (N, 2) f4, centres of splats in the first one, in pixels.
    """
    # Imported here, since these two take half a second that decoding need not wait for.
    from scipy.ndimage import map_coordinates
    from skimage.registration import optical_flow_ilk

    old, new = (reduced(picture, LONGEST_SIDE).mean(axis=2) for picture in (before, after))
    if min(old.shape) < SMALLEST_SIDE or np.array_equal(old, new):
        return np.zeros_like(positions)
    step = -(-max(before.shape[:2]) // LONGEST_SIDE)
    places = [positions[:, 1] / step - 0.5, positions[:, 0] / step - 0.5]
    rows, columns = optical_flow_ilk(old, new, radius=RADIUS, num_warp=WARPS)  # type: ignore[no-untyped-call]
    motion = [step * map_coordinates(part, places, order=1, mode="nearest") for part in (columns, rows)]
    return np.asarray(np.nan_to_num(np.stack(motion, axis=1)), np.float32)
