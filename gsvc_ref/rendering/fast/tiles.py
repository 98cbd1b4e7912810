"""Tiles: pieces of a strip, of a number of rows each, that can be rendered on their own.

A pixel's sum has the same terms in the same order whatever tile it is rendered in, so that the size of the tiles and
the choice of what is rendered again change no bit.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gsvc_ref._jit import kernel
from gsvc_ref.rendering.fast.lists import FIRST_ROW, ROW_COUNT
from gsvc_ref.rendering.fast.strips import F4, F8, I4, I8


class Tiles(NamedTuple):
    """Which tiles of a frame are to be rendered.

    Attributes
    ----------
    rows
        Rows of a tile; the last of a strip may have fewer.
    stale
        (strips, tiles of a strip) bool.
    """

    rows: int
    stale: NDArray[np.bool_]

    @classmethod
    def all_of(cls, strips: int, height: int, rows: int) -> "Tiles":
        """All tiles of a frame."""
        return cls(rows, np.ones((strips, -(-height // rows)), np.bool_))


@kernel(inline=True)
def any_stale(tiles: Tiles, s: int) -> bool:
    """Whether a tile of strip s is to be rendered."""
    found = False
    for tile in range(tiles.stale.shape[1]):
        found |= tiles.stale[s, tile]
    return found


@kernel()
def leave_out_fresh(work: F8, tiles: Tiles) -> None:
    """Turn `Lists.work` into that of the stale tiles alone, so that threads get equal shares of it."""
    before = work[0]
    for s in range(tiles.stale.shape[0]):
        own = work[s + 1] - before
        before = work[s + 1]
        work[s + 1] = work[s] + own * tiles.stale[s].sum() / tiles.stale.shape[1]


class Prepared(NamedTuple):
    """A set of splats as `lists.prepare` leaves it: `parameters` (N, 8) f4, and `records` and `strips` of `Lists`."""

    parameters: F4
    records: F4
    strips: I4


@kernel()
def mark(splats: Prepared, n: int, tiles: Tiles) -> None:
    """Mark the tiles of the box around splat n; the closer rows of each strip would take longer than they save."""
    first, count = int(splats.records[n, FIRST_ROW]), int(splats.records[n, ROW_COUNT])
    for s in range(splats.strips[n, 0], splats.strips[n, 1]):
        for tile in range(first // tiles.rows, (first + count - 1) // tiles.rows + 1):
            tiles.stale[s, tile] = True


@kernel(inline=True)
def unchanged(a: F4, b: F4) -> bool:
    """Whether two splats (8,) f4 have the same parameters."""
    same = True
    for column in range(8):
        same &= a[column] == b[column]
    return same


@kernel()
def mark_changed(before: Prepared, after: Prepared, origins: I8, tiles: Tiles) -> bool:
    """Mark the tiles in which two pictures may differ; False, with nothing to rely on, if all are better rendered.

    A tile is the same in both if the splats that may cover it are the same in the same order. Where more than half of
    the splats changed, hardly any tile is.

    Parameters
    ----------
    origins
        (N,) i8: for every splat after, the splat before that it continues, or -1; ascending where not -1.
    tiles
        None of them stale; changed.
    """
    old, new = before.parameters, after.parameters
    stays = np.zeros(old.shape[0], np.bool_)
    unseen = kept = 0
    for n in range(origins.size):
        o = origins[n]
        if o >= 0:
            if o < unseen or o >= old.shape[0]:
                return False  # another order is another sum
            unseen = o + 1
            stays[o] = unchanged(old[o], new[n])
            kept += stays[o]
    if 2 * kept < max(old.shape[0], new.shape[0]):
        return False
    for o in range(old.shape[0]):
        if not stays[o]:
            mark(before, o, tiles)
    for n in range(new.shape[0]):
        if origins[n] < 0 or not stays[origins[n]]:
            mark(after, n, tiles)
    return True
