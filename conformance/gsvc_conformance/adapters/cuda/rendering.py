"""Rendering and its gradients (spec.md 9 and 10.3)."""

import numpy as np

from gsvc_conformance.adapters.cuda.device import Buffer, Floats, Values, download, launch, storage, upload


def device_frame(sum: Buffer, samples: int, bit_depth: int) -> Buffer:
    """The samples of a sum, (9-7): u1 or u2, left on the device."""
    frame = storage(samples * (1 if bit_depth == 8 else 2))
    launch("to_frame", -(-samples // 256), 256, sum, np.int64(samples), bit_depth, frame)
    return frame


def to_frame(sum: Floats, bit_depth: int) -> Values:
    """The samples of a sum, (H, W, 3) u1 or u2: R-9.1-1."""
    frame = device_frame(upload(sum, "f4"), sum.size, bit_depth)
    return {"frame": download(frame, sum.shape, "u1" if bit_depth == 8 else "u2")}


def to_frame_deterministic(sum: Floats, bit_depth: int) -> Values:
    """The kernel of `to_frame`: one product, which (9-7) rounds, and no sum that could be fused with it."""
    return to_frame(sum, bit_depth)
