"""Tasks: runs of strips or of splats that one thread works through; every task writes memory of its own.

A strip's sums have a fixed order and belong to one task, and the work of a task does not depend on the others, so that
all results have the same bits for any number of threads. Each parallel kernel is a loop over tasks and nothing else.
Task t works on the strips t, t + tasks, t + 2 tasks and so on, since neighbours have about the same work, and has
row t of the `buffers`, (tasks, floats of a strip) f4, to itself.
"""

from typing import Any

import numba
import numpy as np

from gsvc_ref._jit import kernel
from gsvc_ref.rendering.lists import Lists, Selection, select_strip
from gsvc_ref.rendering.strip_pictures import read_strip, subtract_target, write_frame, write_picture
from gsvc_ref.rendering.strip_sums import MOMENTS, add_strip, count_strip, grad_add_strip, grad_splat
from gsvc_ref.rendering.strips import F4, F8, I8, RECORD, ROW, SLOT, STRIP_WIDTH


@kernel()
def room_for_selection(first: int, step: int, lists: Lists) -> Selection:
    """Memory for the selection of any of the strips first, first + step and so on."""
    largest = np.int64(0)
    for s in range(first, lists.positions.size, step):
        largest = max(largest, lists.offsets[s + 1] - lists.offsets[s])
    return Selection(np.empty((largest, 3), np.int32), np.empty((largest, RECORD), np.float32))


@kernel()
def picture_task(first: int, step: int, strip: F4, lists: Lists, picture: F4, clamp: bool) -> None:
    """Render every step-th strip from the first into the picture (H, 3 W) f4."""
    selection = room_for_selection(first, step, lists)
    for s in range(first, lists.positions.size, step):
        count = select_strip(s, picture.shape[0], lists, selection)
        add_strip(strip, s, selection, count)
        write_picture(strip, s, picture, clamp)


@kernel(parallel=True)
def picture_tasks(buffers: F4, lists: Lists, picture: F4, clamp: bool) -> None:
    """`picture_task` for all strips."""
    for task in numba.prange(buffers.shape[0]):
        picture_task(task, buffers.shape[0], buffers[task], lists, picture, clamp)


@kernel()
def frame_task(first: int, step: int, strip: F4, lists: Lists, frame: Any, peak: np.float32) -> None:
    """Render every step-th strip from the first into the frame (H, 3 W) u1 or u2."""
    selection = room_for_selection(first, step, lists)
    for s in range(first, lists.positions.size, step):
        count = select_strip(s, frame.shape[0], lists, selection)
        add_strip(strip, s, selection, count)
        write_frame(strip, s, frame, peak)


@kernel(parallel=True)
def frame_tasks(buffers: F4, lists: Lists, frame: Any, peak: np.float32) -> None:
    """`frame_task` for all strips."""
    for task in numba.prange(buffers.shape[0]):
        frame_task(task, buffers.shape[0], buffers[task], lists, frame, peak)


@kernel()
def grad_picture_task(first: int, step: int, strip: F4, lists: Lists, slots: F4, residual: F4) -> None:
    """The transpose of `picture_task`: gather dL/dC (H, 3 W) f4 of the strips into the slots of their entries."""
    moments = np.empty(MOMENTS * STRIP_WIDTH, np.float32)
    selection = room_for_selection(first, step, lists)
    for s in range(first, lists.positions.size, step):
        count = select_strip(s, residual.shape[0], lists, selection)
        read_strip(residual, s, strip)
        grad_add_strip(strip, s, selection, count, slots, moments)


@kernel(parallel=True)
def grad_picture_tasks(buffers: F4, lists: Lists, slots: F4, residual: F4) -> None:
    """`grad_picture_task` for all strips."""
    for task in numba.prange(buffers.shape[0]):
        grad_picture_task(task, buffers.shape[0], buffers[task], lists, slots, residual)


@kernel()
def objective_task(
    first: int, step: int, strip: F4, lists: Lists, slots: F4, target: F4, width: int, losses: F8, with_gradient: bool
) -> None:
    """Forward, residual and, if asked, backward of strip after strip, each while it is in the second-level cache.

    `target` is (strips, H * ROW) f4; `losses` (strips,) f8 receives the sum of the squares of each strip.
    """
    moments = np.empty(MOMENTS * STRIP_WIDTH, np.float32)
    squares = np.empty(STRIP_WIDTH, np.float64)
    height = target.shape[1] // ROW
    selection = room_for_selection(first, step, lists)
    for s in range(first, lists.positions.size, step):
        count = select_strip(s, height, lists, selection)
        add_strip(strip, s, selection, count)
        losses[s] = subtract_target(strip, target[s], height, min(STRIP_WIDTH, width - s * STRIP_WIDTH), squares)
        if with_gradient:
            grad_add_strip(strip, s, selection, count, slots, moments)


@kernel(parallel=True)
def objective_tasks(
    buffers: F4, lists: Lists, slots: F4, target: F4, width: int, losses: F8, with_gradient: bool
) -> None:
    """`objective_task` for all strips."""
    for task in numba.prange(buffers.shape[0]):
        objective_task(
            task, buffers.shape[0], buffers[task], lists, slots, target, width, losses, with_gradient
        )  # fmt: skip


@kernel()
def splat_task(first: int, end: int, lists: Lists, slots: F4, parameters: F4, scale: float, gradients: F4) -> None:
    """The gradients (N, 8) f4 of the splats at places first to end - 1 from their slots, times `scale`."""
    sums = np.empty(SLOT, np.float64)
    for place in range(first, end):
        n = lists.order[place]
        grad_splat(slots[lists.base[place] : lists.base[place + 1]], parameters[n], scale, sums, gradients[n])


@kernel(parallel=True)
def splat_tasks(tasks: int, lists: Lists, slots: F4, parameters: F4, scale: float, gradients: F4) -> None:
    """`splat_task` for `tasks` runs of places."""
    count = parameters.shape[0]
    for task in numba.prange(tasks):
        splat_task(count * task // tasks, count * (task + 1) // tasks, lists, slots, parameters, scale, gradients)


@kernel()
def count_task(first: int, end: int, lists: Lists, width: int, height: int, counts: I8) -> None:
    """The covered pixels (N,) i8 of the splats at places first to end - 1."""
    for place in range(first, end):
        pixels = np.int64(0)
        for s in range(lists.strips[place, 0], lists.strips[place, 1]):
            pixels += count_strip(s, width, height, lists.records[place])
        counts[lists.order[place]] = pixels


@kernel(parallel=True)
def count_tasks(tasks: int, lists: Lists, width: int, height: int, counts: I8) -> None:
    """`count_task` for `tasks` runs of places."""
    for task in numba.prange(tasks):
        count_task(counts.size * task // tasks, counts.size * (task + 1) // tasks, lists, width, height, counts)
