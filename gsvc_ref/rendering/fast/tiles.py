"""The layout of the fast renderer: a frame as tiles of 16 columns and all rows.

A picture in tile layout is one flat binary32 buffer per tile with index (row, channel, lane), so that the 16 columns
of a tile are the lanes of a vector and every inner loop has the same 16 turns. In a tile a splat is a run of rows.
"""

import math
from typing import Final

import numpy as np

from gsvc_base.arrays import F4

TILE_WIDTH: Final = 16
# Any power of two gives the same picture. Another one adds the gradients in another order, so that even deterministic
# encodes have other bytes.
assert TILE_WIDTH.bit_count() == 1 < TILE_WIDTH, "lanes are added half to half: a power of two"
CHANNELS: Final = 3
ROW: Final = CHANNELS * TILE_WIDTH
"""Floats in a row of a tile."""

GROUP_ROWS: Final = 3
"""Rows that the inner loops handle at once, to hide latency. Four spill the 16 vector registers of AVX2, and from about
eight on LLVM gives up and emits scalar code, ten times slower."""

SPARE_ROWS: Final = GROUP_ROWS - 1
"""Rows that a buffer holds below the frame, since the last rows of a splat are handled by full groups."""

ZERO: Final = np.float32(0)
LANES: Final = np.arange(TILE_WIDTH, dtype=np.float32)  # (16,) f4


def tile_count(width: int) -> int:
    """Tiles that a frame of this width has; the last one may stick out."""
    return -(-width // TILE_WIDTH)


def aligned(shape: tuple[int, ...]) -> F4:
    """Zeros in C order whose first element lies on a 64-byte boundary, so that no vector crosses a cache line."""
    size = math.prod(shape)
    raw = np.zeros(size + 16, np.float32)
    start = -(raw.ctypes.data // 4) % 16
    return raw[start : start + size].reshape(shape)


EMPTY: Final = aligned((0, 0))
"""No tiles: the base of a sum that begins with zero."""
