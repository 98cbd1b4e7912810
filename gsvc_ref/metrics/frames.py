"""What every metric demands of a pair of frames."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gsvc_ref.errors import UsageError

Frame = NDArray[np.unsignedinteger[Any]]
"""(H, W, 3) u1 or u2, full-range R'G'B'."""

LARGEST_PEAK = 2**16 - 1


def check_pair(a: Frame, b: Frame, peak: int) -> None:
    """Refuse two frames that cannot be compared.

    Raises
    ------
    UsageError
        A frame is not (H, W, 3) u1 or u2, is empty or holds a value above `peak`; the sizes differ; `peak` is not
        in 1..65535.
    """
    if not 1 <= peak <= LARGEST_PEAK:
        raise UsageError(f"peak is {peak}; it must be the largest sample value, 1..{LARGEST_PEAK} (8 bits: 255)")
    for name, frame in (("first", a), ("second", b)):
        if frame.ndim != 3 or frame.shape[2] != 3 or frame.size == 0 or frame.dtype not in (np.uint8, np.uint16):
            raise UsageError(
                f"the {name} frame has shape {frame.shape} and type {frame.dtype}; "
                "it must be (H, W, 3), uint8 or uint16, not empty"
            )
        if (largest := int(frame.max())) > peak:
            raise UsageError(f"the {name} frame holds the value {largest}, above the stated peak {peak}")
    if a.shape != b.shape:
        raise UsageError(f"the frames have shapes {a.shape} and {b.shape}; they must be of one size")
