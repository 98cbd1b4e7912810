"""Batches: the splats of one tile side by side in memory.

They are gathered in a loop of their own, where cache misses overlap, and at most `BATCH` at a time: most tiles have
fewer, and for those that have more, memory does not grow with the number of splats.
"""

from typing import Final, NamedTuple

import numpy as np

from gsvc_ref._jit import kernel
from gsvc_ref.rendering.fast.binning import Bins, intersections_of
from gsvc_ref.rendering.fast.projection import PROJECTED, row_range
from gsvc_ref.rendering.fast.tiles import F4, I4

BATCH: Final = 1 << 12
"""Maximum number of intersections in a batch."""

BATCH_BYTES: Final = BATCH * (4 * PROJECTED + 12)
"""Maximum size of a batch."""


class Batch(NamedTuple):
    """Intersections of one tile.

    Attributes
    ----------
    rows
        Per intersection (3,) i4: first row, the one after the last, and the intersection's index in the order by splat.
    splats
        Per intersection (PROJECTED,) f4, copied from `Bins`.
    """

    rows: I4
    splats: F4


@kernel()
def room_for_batch(first: int, end: int, bins: Bins) -> Batch:
    """Memory for all intersections of any of the tiles first to end - 1, but for no more than `BATCH`."""
    largest = np.int64(0)
    for t in range(first, end):
        largest = max(largest, bins.tile_offsets[t + 1] - bins.tile_offsets[t])
    room = min(int(largest), BATCH)
    return Batch(np.empty((room, 3), np.int32), np.empty((room, PROJECTED), np.float32))


@kernel()
def gather_batch(t: int, skipped: int, height: int, bins: Bins, batch: Batch) -> int:
    """Fill the batch with intersections of tile t, all but the first `skipped` if it has room; return their number."""
    first = bins.tile_offsets[t] - bins.tile_offsets[bins.window[0]] + skipped
    count: int = min(intersections_of(t, bins) - skipped, batch.rows.shape[0])
    for i in range(count):
        n = bins.intersections[first + i, 0]
        splat = bins.projected[n]
        rows = row_range(splat, t, height)
        batch.rows[i, 0] = rows[0]
        batch.rows[i, 1] = rows[1]
        batch.rows[i, 2] = bins.intersections[first + i, 1]
        for k in range(PROJECTED):
            batch.splats[i, k] = splat[k]
    return count
