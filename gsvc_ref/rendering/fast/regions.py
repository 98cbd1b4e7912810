"""Regions: runs of rows of a tile that can be rendered alone; those that must be are dirty.

A pixel's sum has the same terms in the same order whatever region it is rendered in, so that the size of the regions
and the choice of what is rendered again change no bit.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4, F8, I8
from gsvc_ref._jit import kernel
from gsvc_ref.rendering.fast.projection import FIRST_ROW, ROW_COUNT, ProjectedSplats


class Regions(NamedTuple):
    """The regions of a frame, and which of them must be rendered."""

    rows: int  # of a region; the last of a tile may have fewer
    dirty: NDArray[np.bool_]  # (tiles, regions of a tile)

    @classmethod
    def all_of(cls, tiles: int, height: int, rows: int) -> "Regions":
        """All regions of a frame, dirty."""
        return cls(rows, np.ones((tiles, -(-height // rows)), np.bool_))

    @classmethod
    def none_of(cls, tiles: int, height: int, rows: int) -> "Regions":
        """All regions of a frame, clean."""
        return cls(rows, np.zeros((tiles, -(-height // rows)), np.bool_))


@kernel(inline=True)
def any_dirty(regions: Regions, t: int) -> bool:
    """Whether a region of tile t is dirty."""
    found = False
    for region in range(regions.dirty.shape[1]):
        found |= regions.dirty[t, region]
    return found


@kernel()
def leave_out_clean(work: F8, regions: Regions) -> None:
    """Turn `Bins.work` into that of the dirty regions alone, so that threads get equal shares of it."""
    before = work[0]
    for t in range(regions.dirty.shape[0]):
        own = work[t + 1] - before
        before = work[t + 1]
        work[t + 1] = work[t] + own * regions.dirty[t].sum() / regions.dirty.shape[1]


@kernel()
def mark(splats: ProjectedSplats, n: int, regions: Regions) -> None:
    """Mark the regions of the box around splat n; the closer rows of each tile would take longer than they save."""
    first, count = int(splats.projected[n, FIRST_ROW]), int(splats.projected[n, ROW_COUNT])
    for t in range(splats.tile_ranges[n, 0], splats.tile_ranges[n, 1]):
        for region in range(first // regions.rows, (first + count - 1) // regions.rows + 1):
            regions.dirty[t, region] = True


@kernel(inline=True)
def unchanged(a: F4, b: F4) -> bool:
    """Whether two splats (8,) f4 have the same parameters."""
    same = True
    for column in range(8):
        same &= a[column] == b[column]
    return same


@kernel()
def mark_changed(before: ProjectedSplats, after: ProjectedSplats, origins: I8, regions: Regions) -> bool:
    """Mark the regions in which two pictures may differ; False, with nothing to rely on, if all are better rendered.

    A region is the same in both if the splats that may cover it are the same in the same order. Where more than half of
    the splats changed, hardly any region is. `origins` (N,) i8 has for every splat after the splat before that it
    continues, or -1; ascending where not -1. No region is dirty before.
    """
    old, new = before.parameters, after.parameters
    stays = np.zeros(old.shape[0], np.bool_)
    unseen = kept = 0  # the first splat before that may still follow in this order, and how many stay
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
    # A changed splat is taken out where it was, and added where it is.
    for o in range(old.shape[0]):
        if not stays[o]:
            mark(before, o, regions)
    for n in range(new.shape[0]):
        if origins[n] < 0 or not stays[origins[n]]:
            mark(after, n, regions)
    return True
