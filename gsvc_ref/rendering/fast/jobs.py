"""Jobs: the loop over tiles that renders pictures and frames, finds losses, and gathers gradients; loops over splats.

A job is shared among tasks, each a run of neighbouring tiles, or of splats, that one thread works through. A tile's
sums have a fixed order and belong to one task, and the work of a task does not depend on the others, so that all
results have the same bits for any number of threads (`threads`).
"""

from typing import Any, NamedTuple

import numpy as np

from gsvc_base.arrays import F4, F8, I8
from gsvc_ref._jit import kernel
from gsvc_ref.rendering.fast.batches import Batch, Buffers, gather_batch, room_for_batch
from gsvc_ref.rendering.fast.binning import Bins, intersections_of
from gsvc_ref.rendering.fast.regions import Regions, any_dirty
from gsvc_ref.rendering.fast.sums import LANE_SUMS, MOMENTS, add_batch, covered_in_tile, grad_add_batch, grad_splat
from gsvc_ref.rendering.fast.tile_pictures import read_tile, subtract_target, write_frame, write_picture
from gsvc_ref.rendering.fast.tiles import EMPTY, ROW, SPARE_ROWS, TILE_WIDTH

PICTURE, FRAME, LOSS, LOSS_AND_GRADIENTS, GRADIENTS = range(5)
"""Kinds of jobs, see `Job`."""


class Job(NamedTuple):
    """The inputs and outputs of a loop over tiles; a kind of job uses some, and the others stay empty.

    `PICTURE`, `FRAME`, `LOSS` and `LOSS_AND_GRADIENTS` sum the splats of each tile, beginning with `base`. The first
    writes the sum into `picture`, the second rounds it into `frame`, and the others compare it with `target`, tile
    after tile while it is in the second-level cache, and write it into `picture` if there is one. `GRADIENTS` reads
    dL/dC from `picture`.
    """

    width: int
    height: int
    strict: bool  # the kernels without contraction sum
    kind: int = PICTURE
    base: F4 = EMPTY  # (tiles, H * ROW); without tiles the sum begins with zero
    picture: F4 = EMPTY  # (H, 3 W)
    clamp: bool = False  # of the picture to [0, 1]
    frame: Any = np.zeros((0, 0), np.uint8)  # (H, 3 W) u1 or u2
    peak: np.float32 = np.float32(255)  # 2^bit_depth - 1
    target: F4 = EMPTY  # (tiles, H * ROW), zero outside the frame
    losses: F8 = np.zeros(0)  # (tiles,): the sums of the squares of the tiles
    moments: F4 = EMPTY  # (intersections, MOMENTS), see `sums`


@kernel(inline=True)
def tiles_of_task(task: int, tasks: int, bins: Bins) -> tuple[int, int]:
    """The tiles of a task, the first and the one after the last: neighbours, with about as much work as others have.

    Neighbours share cache lines in every row of a picture, which two threads should not write to in turn. Tiles
    outside of the window have no work.
    """
    first = end = 0
    for t in range(bins.cursors.size):
        # A tile belongs to the task in whose share of the work its middle lies.
        middle = (bins.work[t] + bins.work[t + 1]) / 2 * tasks
        if middle < bins.work[-1] * task:
            first = t + 1
        if middle < bins.work[-1] * (task + 1):
            end = t + 1
    return max(first, bins.window[0]), min(end, bins.window[1])


@kernel(inline=True)
def render_tile(buffers: Buffers, t: int, bins: Bins, batch: Batch, count: int, regions: Regions, job: Job) -> None:
    """Sum the dirty regions of tile t, and write them into the picture or the frame.

    The first `count` intersections of the tile are in the batch. If it has no room for all, all rows are one region,
    since to gather the others for every region might take longer than to render what is not dirty, which changes
    nothing; the batch is filled with them one after the other.

    Weights are kept for the backward pass where it begins from this batch. The rows below a region are spoiled as far
    as `add_batch` says.
    """
    tile = buffers.tile
    rows = regions.rows if count == intersections_of(t, bins) else job.height
    keep = job.kind == LOSS_AND_GRADIENTS and rows == job.height
    for top in range(0, job.height, rows):
        if rows == job.height or regions.dirty[t, top // rows]:
            end = min(top + rows, job.height)
            if job.base.shape[0]:
                part, base = tile[top * ROW : end * ROW], job.base[t, top * ROW : end * ROW]
                for i in range(part.size):  # slices assigned would make the compiler write its message of unequal ones
                    part[i] = base[i]
            else:
                tile[top * ROW : end * ROW] = np.float32(0)
            tile[end * ROW : (end + SPARE_ROWS) * ROW] = np.float32(0)  # full groups of rows add to these
            added = gathered = count
            add_batch(buffers, t, top, end, batch, gathered, keep, job.strict)
            while added < intersections_of(t, bins):
                gathered = gather_batch(t, added, job.height, bins, batch)
                add_batch(buffers, t, top, end, batch, gathered, False, job.strict)
                added += gathered
            if job.picture.shape[0]:
                write_picture(tile, t, top, end, job.picture, job.clamp)
            elif job.kind == FRAME:
                write_frame(tile, t, top, end, job.frame, job.peak)


@kernel(inline=True)
def grad_tile(buffers: Buffers, t: int, bins: Bins, batch: Batch, count: int, lane_sums: F4, job: Job) -> None:
    """`grad_add_batch` for all intersections of tile t, of which `count` are in the batch: all of them, or any."""
    done = 0
    while done < intersections_of(t, bins):
        if count < intersections_of(t, bins):
            count = gather_batch(t, done, job.height, bins, batch)
        grad_add_batch(buffers, t, batch, count, job.moments, lane_sums, job.strict)
        done += count


@kernel()
def run_task(task: int, tasks: int, buffers: Buffers, bins: Bins, regions: Regions, job: Job) -> None:
    """Do the job for the task's tiles that have a dirty region."""
    lane_sums = np.empty(LANE_SUMS, np.float32)
    squares = np.empty(TILE_WIDTH, np.float64)
    first, end = tiles_of_task(task, tasks, bins)
    batch = room_for_batch(first, end, bins)
    for t in range(first, end):
        if any_dirty(regions, t):
            count = gather_batch(t, 0, job.height, bins, batch)
            if job.kind == GRADIENTS:
                read_tile(job.picture, t, buffers.tile)
            else:
                render_tile(buffers, t, bins, batch, count, regions, job)
            # The tile holds C now, and e = dL/dC times H W / 2 after this: 2 / (H W) comes with the gradients.
            if job.kind == LOSS or job.kind == LOSS_AND_GRADIENTS:
                lanes = min(TILE_WIDTH, job.width - t * TILE_WIDTH)
                job.losses[t] = subtract_target(buffers.tile, job.target[t], job.height, lanes, squares)
            if job.kind == GRADIENTS or job.kind == LOSS_AND_GRADIENTS:
                grad_tile(buffers, t, bins, batch, count, lane_sums, job)


@kernel()
def gradients_task(first: int, end: int, bins: Bins, moments: F4, parameters: F4, scale: float, gradients: F4) -> None:
    """The gradients (N, 8) f4 of the splats first to end - 1 from the moments of their intersections, times `scale`."""
    S = np.empty(MOMENTS, np.float64)
    for n in range(first, end):
        own = moments[bins.splat_offsets[n] : bins.splat_offsets[n + 1]]
        grad_splat(own, parameters[n], scale, S, gradients[n])


@kernel()
def covered_task(first: int, end: int, bins: Bins, width: int, height: int, counts: I8) -> None:
    """The numbers of covered pixels (N,) i8 of the splats first to end - 1."""
    for n in range(first, end):
        pixels = np.int64(0)
        for t in range(bins.tile_ranges[n, 0], bins.tile_ranges[n, 1]):
            pixels += covered_in_tile(t, width, height, bins.projected[n])
        counts[n] = pixels
