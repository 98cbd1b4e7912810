"""Batches: the splats of one tile side by side in memory.

A loop that only gathers them lets cache misses overlap. There are at most `BATCH` at a time, and at most `KEPT`
weights: most tiles have fewer, and for the others, memory does not grow with the number of splats.
"""

from typing import Final, NamedTuple

import numpy as np

from gsvc_base.arrays import F4, I4
from gsvc_ref._jit import kernel
from gsvc_ref.rendering.fast.binning import Bins, intersections_of
from gsvc_ref.rendering.fast.projection import PROJECTED, row_range
from gsvc_ref.rendering.fast.tiles import ROW, SPARE_ROWS, TILE_WIDTH, aligned

BATCH: Final = 1 << 12
"""Maximum number of intersections in a batch."""

KEPT: Final = 1 << 19
"""Maximum number of weights, 4 bytes each, that a thread keeps from the forward pass for the backward pass. A tile of a
trained population of 1920x1080 pixels has 260,000 (N = 10,000). They are written and read one after the other, so that
it does not matter that a second-level cache holds fewer: with an eighth of this room, the loss and its gradient took a
fifth longer."""

INDEX, KEPT_AT = 2, 3
NOWHERE: Final = -1
"""Columns of `Batch.rows`, and the value of the second for weights that are not kept."""


class Batch(NamedTuple):
    """Intersections of one tile."""

    rows: I4
    """(BATCH or fewer, 4): first row, the one after the last, the intersection's `INDEX` in the order by splat, and
    where its weights begin in `Buffers.kept` (`KEPT_AT`), or `NOWHERE`."""
    splats: F4  # (BATCH or fewer, PROJECTED), copied from `Bins`


class Buffers(NamedTuple):
    """What a thread works in; the system gives memory only to what is used of it."""

    tile: F4  # ((height + SPARE_ROWS) * ROW,): the sum of a tile, and then its e = dL/dC
    weights: F4  # ((height + SPARE_ROWS) * TILE_WIDTH,): those of one splat, by row and lane
    kept: F4  # (KEPT,) or (0,): weights of many splats in a row, for the backward pass

    @classmethod
    def of(cls, height: int) -> "Buffers":
        """Buffers for frames of a height, which keep no weights."""
        rows = height + SPARE_ROWS
        return cls(aligned((rows * ROW,)), aligned((rows * TILE_WIDTH,)), aligned((0,)))

    def keeping(self) -> "Buffers":
        """The same with room for weights, for jobs with a backward pass."""
        return self._replace(kept=aligned((KEPT,)))


def bytes_of_thread(height: int) -> int:
    """The size of a thread's buffers and batch for frames of a height, but for the weights that it keeps."""
    return 4 * (height + SPARE_ROWS) * (ROW + TILE_WIDTH) + BATCH * (4 * PROJECTED + 16)


@kernel()
def room_for_batch(first: int, end: int, bins: Bins) -> Batch:
    """Memory for all intersections of any of the tiles first to end - 1, but for no more than `BATCH`."""
    largest = np.int64(0)
    for t in range(first, end):
        largest = max(largest, bins.tile_offsets[t + 1] - bins.tile_offsets[t])
    room = min(int(largest), BATCH)
    return Batch(np.empty((room, 4), np.int32), np.empty((room, PROJECTED), np.float32))


@kernel()
def gather_batch(t: int, skipped: int, height: int, bins: Bins, batch: Batch) -> int:
    """Fill the batch with intersections of tile t, all but the first `skipped` if it has room; return their number."""
    first = bins.tile_offsets[t] - bins.tile_offsets[bins.window[0]] + skipped
    count: int = min(intersections_of(t, bins) - skipped, batch.rows.shape[0])
    for i in range(count):
        n = bins.intersections[first + i, 0]
        splat = bins.projected[n]
        rows = row_range(splat, t, height)  # in this tile, fewer than in the box around the splat
        batch.rows[i, 0] = rows[0]
        batch.rows[i, 1] = rows[1]
        batch.rows[i, INDEX] = bins.intersections[first + i, 1]
        batch.rows[i, KEPT_AT] = NOWHERE
        for k in range(PROJECTED):
            batch.splats[i, k] = splat[k]
    return count
