"""Tasks: runs of strips or of splats that one thread works through; every task writes memory of its own.

A strip's sums have a fixed order and belong to one task, and the work of a task does not depend on the others, so that
all results have the same bits for any number of threads. Each parallel kernel is a loop over tasks and nothing else.
A task works on a run of neighbouring strips, see `run_of_strips`, and task t has row t of the `buffers`, (tasks, floats
of a strip) f4, to itself. `strict` chooses the kernels without contraction. A strip's entries are gathered `SELECTED`
at a time: most strips have fewer, and for those that do not, memory does not grow with the number of splats.
"""

from typing import Any

import numba
import numpy as np

from gsvc_ref._jit import kernel
from gsvc_ref.rendering.fast.lists import SELECTED, Lists, Selection, entries_of, prepare, select_strip
from gsvc_ref.rendering.fast.strip_pictures import read_strip, subtract_target, write_frame, write_picture
from gsvc_ref.rendering.fast.strip_sums import MOMENTS, add_tile, count_strip, grad_add_strip, grad_splat
from gsvc_ref.rendering.fast.strips import F4, F8, I8, RECORD, ROW, SLOT, SPARE_ROWS, STRIP_WIDTH
from gsvc_ref.rendering.fast.tiles import Tiles, any_stale


@kernel(parallel=True)
def prepare_tasks(tasks: int, parameters: F4, width: int, height: int, lists: Lists) -> None:
    """`prepare` for `tasks` runs of splats."""
    count = parameters.shape[0]
    for task in numba.prange(tasks):
        prepare(count * task // tasks, count * (task + 1) // tasks, parameters, width, height, lists)


@kernel(inline=True)
def run_of_strips(task: int, tasks: int, lists: Lists) -> tuple[int, int]:
    """The strips of a task, the first and the one after the last: neighbours, with about as much work as others have.

    Neighbours share cache lines in every row of a picture, which two threads had better not write to in turn. Strips
    outside of the window have no work.
    """
    first = end = 0
    for s in range(lists.positions.size):
        middle = (lists.work[s] + lists.work[s + 1]) / 2 * tasks
        if middle < lists.work[-1] * task:
            first = s + 1
        if middle < lists.work[-1] * (task + 1):
            end = s + 1
    return max(first, lists.window[0]), min(end, lists.window[1])


@kernel()
def room_for_selection(first: int, end: int, lists: Lists) -> Selection:
    """Memory for the selection of any of the strips first to end - 1, but not for more than `SELECTED` entries."""
    largest = np.int64(0)
    for s in range(first, end):
        largest = max(largest, lists.offsets[s + 1] - lists.offsets[s])
    room = min(int(largest), SELECTED)
    return Selection(np.empty((room, 3), np.int32), np.empty((room, RECORD), np.float32))


@kernel(inline=True)
def rows_at_once(s: int, height: int, tiles: Tiles, count: int, lists: Lists) -> int:
    """Rows of a tile of strip s, of whose entries `count` are selected: all rows if it has more.

    To render a tile that is not stale takes time but changes nothing; to select entries for every tile might take more.
    """
    return tiles.rows if count == entries_of(s, lists) else height


@kernel()
def render_tile(
    strip: F4,
    s: int,
    top: int,
    end: int,
    base: F4,
    height: int,
    lists: Lists,
    selection: Selection,
    count: int,
    strict: bool,
) -> None:
    """Render the rows top to end - 1 of strip s, beginning with those of `base` (strips, H * ROW) f4.

    A base without strips is black. The rows below are spoiled as far as `add_tile` says. The first `count` entries are
    selected; if there are others, they are selected next, and it is the last tile of the strip.
    """
    if base.shape[0]:
        strip[top * ROW : end * ROW] = base[s, top * ROW : end * ROW]
    else:
        strip[top * ROW : end * ROW] = np.float32(0)
    strip[end * ROW : (end + SPARE_ROWS) * ROW] = np.float32(0)
    add_tile(strip, s, top, end, selection, count, strict)
    while count < entries_of(s, lists):
        selected = select_strip(s, count, height, lists, selection)
        add_tile(strip, s, top, end, selection, selected, strict)
        count += selected


@kernel()
def grad_strip(
    strip: F4,
    s: int,
    height: int,
    lists: Lists,
    selection: Selection,
    count: int,
    slots: F4,
    moments: F4,
    strict: bool,
) -> None:
    """`grad_add_strip` for all entries of strip s, of which `count` are selected: all of them, or any."""
    done = 0
    while done < entries_of(s, lists):
        if count < entries_of(s, lists):
            count = select_strip(s, done, height, lists, selection)
        grad_add_strip(strip, s, selection, count, slots, moments, strict)
        done += count


@kernel()
def picture_task(
    task: int, tasks: int, strip: F4, lists: Lists, strict: bool, tiles: Tiles, base: F4, picture: F4, clamp: bool
) -> None:
    """Render the stale tiles of the task's strips into the picture (H, 3 W) f4."""
    height = picture.shape[0]
    first, end = run_of_strips(task, tasks, lists)
    selection = room_for_selection(first, end, lists)
    for s in range(first, end):
        if any_stale(tiles, s):
            count = select_strip(s, 0, height, lists, selection)
            rows = rows_at_once(s, height, tiles, count, lists)
            for top in range(0, height, rows):
                if rows == height or tiles.stale[s, top // rows]:
                    below = min(top + rows, height)
                    render_tile(strip, s, top, below, base, height, lists, selection, count, strict)
                    write_picture(strip, s, top, below, picture, clamp)


@kernel(parallel=True)
def picture_tasks(buffers: F4, lists: Lists, strict: bool, tiles: Tiles, base: F4, picture: F4, clamp: bool) -> None:
    """`picture_task` for all strips."""
    for task in numba.prange(buffers.shape[0]):
        picture_task(task, buffers.shape[0], buffers[task], lists, strict, tiles, base, picture, clamp)


@kernel()
def frame_task(
    task: int, tasks: int, strip: F4, lists: Lists, strict: bool, tiles: Tiles, frame: Any, peak: np.float32
) -> None:
    """Render the stale tiles of the task's strips into the frame (H, 3 W) u1 or u2."""
    height = frame.shape[0]
    black = np.empty((0, 0), np.float32)
    first, end = run_of_strips(task, tasks, lists)
    selection = room_for_selection(first, end, lists)
    for s in range(first, end):
        if any_stale(tiles, s):
            count = select_strip(s, 0, height, lists, selection)
            rows = rows_at_once(s, height, tiles, count, lists)
            for top in range(0, height, rows):
                if rows == height or tiles.stale[s, top // rows]:
                    below = min(top + rows, height)
                    render_tile(strip, s, top, below, black, height, lists, selection, count, strict)
                    write_frame(strip, s, top, below, frame, peak)


@kernel(parallel=True)
def frame_tasks(buffers: F4, lists: Lists, strict: bool, tiles: Tiles, frame: Any, peak: np.float32) -> None:
    """`frame_task` for all strips."""
    for task in numba.prange(buffers.shape[0]):
        frame_task(task, buffers.shape[0], buffers[task], lists, strict, tiles, frame, peak)


@kernel()
def grad_picture_task(task: int, tasks: int, strip: F4, lists: Lists, strict: bool, slots: F4, residual: F4) -> None:
    """The transpose of `picture_task`: gather dL/dC (H, 3 W) f4 of the strips into the slots of their entries."""
    moments = np.empty(MOMENTS * STRIP_WIDTH, np.float32)
    first, end = run_of_strips(task, tasks, lists)
    selection = room_for_selection(first, end, lists)
    for s in range(first, end):
        count = select_strip(s, 0, residual.shape[0], lists, selection)
        read_strip(residual, s, strip)
        grad_strip(strip, s, residual.shape[0], lists, selection, count, slots, moments, strict)


@kernel(parallel=True)
def grad_picture_tasks(buffers: F4, lists: Lists, strict: bool, slots: F4, residual: F4) -> None:
    """`grad_picture_task` for all strips."""
    for task in numba.prange(buffers.shape[0]):
        grad_picture_task(task, buffers.shape[0], buffers[task], lists, strict, slots, residual)


@kernel()
def base_task(task: int, tasks: int, strip: F4, lists: Lists, strict: bool, base: F4) -> None:
    """Render the task's strips into the base (strips, H * ROW) f4, in the layout of strips."""
    height = base.shape[1] // ROW
    black = np.empty((0, 0), np.float32)
    first, end = run_of_strips(task, tasks, lists)
    selection = room_for_selection(first, end, lists)
    for s in range(first, end):
        count = select_strip(s, 0, height, lists, selection)
        render_tile(strip, s, 0, height, black, height, lists, selection, count, strict)
        base[s] = strip[: height * ROW]


@kernel(parallel=True)
def base_tasks(buffers: F4, lists: Lists, strict: bool, base: F4) -> None:
    """`base_task` for all strips."""
    for task in numba.prange(buffers.shape[0]):
        base_task(task, buffers.shape[0], buffers[task], lists, strict, base)


@kernel()
def objective_task(
    task: int,
    tasks: int,
    strip: F4,
    lists: Lists,
    strict: bool,
    slots: F4,
    target: F4,
    base: F4,
    width: int,
    losses: F8,
    with_gradient: bool,
) -> None:
    """Forward, residual and, if asked, backward of strip after strip, each while it is in the second-level cache.

    `target` is (strips, H * ROW) f4; `losses` (strips,) f8 receives the sum of the squares of each strip.
    """
    moments = np.empty(MOMENTS * STRIP_WIDTH, np.float32)
    squares = np.empty(STRIP_WIDTH, np.float64)
    height = target.shape[1] // ROW
    first, end = run_of_strips(task, tasks, lists)
    selection = room_for_selection(first, end, lists)
    for s in range(first, end):
        count = select_strip(s, 0, height, lists, selection)
        render_tile(strip, s, 0, height, base, height, lists, selection, count, strict)
        losses[s] = subtract_target(strip, target[s], height, min(STRIP_WIDTH, width - s * STRIP_WIDTH), squares)
        if with_gradient:
            grad_strip(strip, s, height, lists, selection, count, slots, moments, strict)


@kernel(parallel=True)
def objective_tasks(
    buffers: F4,
    lists: Lists,
    strict: bool,
    slots: F4,
    target: F4,
    base: F4,
    width: int,
    losses: F8,
    with_gradient: bool,
) -> None:
    """`objective_task` for all strips."""
    tasks = buffers.shape[0]
    for task in numba.prange(tasks):
        objective_task(
            task, tasks, buffers[task], lists, strict, slots, target, base, width, losses, with_gradient
        )  # fmt: skip


@kernel()
def splat_task(first: int, end: int, lists: Lists, slots: F4, parameters: F4, scale: float, gradients: F4) -> None:
    """The gradients (N, 8) f4 of the splats first to end - 1 from their slots, times `scale`."""
    sums = np.empty(SLOT, np.float64)
    for n in range(first, end):
        grad_splat(slots[lists.base[n] : lists.base[n + 1]], parameters[n], scale, sums, gradients[n])


@kernel(parallel=True)
def splat_tasks(tasks: int, lists: Lists, slots: F4, parameters: F4, scale: float, gradients: F4) -> None:
    """`splat_task` for `tasks` runs of splats."""
    count = parameters.shape[0]
    for task in numba.prange(tasks):
        splat_task(count * task // tasks, count * (task + 1) // tasks, lists, slots, parameters, scale, gradients)


@kernel()
def count_task(first: int, end: int, lists: Lists, width: int, height: int, counts: I8) -> None:
    """The covered pixels (N,) i8 of the splats first to end - 1."""
    for n in range(first, end):
        pixels = np.int64(0)
        for s in range(lists.strips[n, 0], lists.strips[n, 1]):
            pixels += count_strip(s, width, height, lists.records[n])
        counts[n] = pixels


@kernel(parallel=True)
def count_tasks(tasks: int, lists: Lists, width: int, height: int, counts: I8) -> None:
    """`count_task` for `tasks` runs of splats."""
    for task in numba.prange(tasks):
        count_task(counts.size * task // tasks, counts.size * (task + 1) // tasks, lists, width, height, counts)
