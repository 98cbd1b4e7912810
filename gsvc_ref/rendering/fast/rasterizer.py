"""The rasterizer: the binning and the buffers of one frame size, and the threads that jobs are run on."""

from functools import partial
from typing import Any, Final

import numpy as np

from gsvc_base.arrays import F4, I8
from gsvc_base.splats import PARAMETERS_PER_SPLAT
from gsvc_ref.rendering.fast.batches import Buffers, bytes_of_thread
from gsvc_ref.rendering.fast.binning import Binning, Bins
from gsvc_ref.rendering.fast.jobs import LOSS_AND_GRADIENTS, Job, covered_task, gradients_task, run_task
from gsvc_ref.rendering.fast.regions import Regions
from gsvc_ref.rendering.fast.sums import MOMENTS
from gsvc_ref.rendering.fast.threads import run_tasks, thread_count
from gsvc_ref.rendering.fast.tiles import aligned, tile_count

BUFFERS_BYTES: Final = 54 << 20
"""Maximum size of the buffers and batches of all threads, but for weights that are kept; there are fewer threads if
tiles are very long."""

TASKS_PER_THREAD: Final = 4
"""Tasks that a job has for each of several threads: the work of a tile can only be guessed, and with one task each the
slower of two threads took a third longer than the other. A task costs about 10 microseconds."""


class Rasterizer:
    """The binning of one frame size and the buffers of every thread, kept between calls."""

    def __init__(self, width: int, height: int, threads: int | None = None) -> None:
        most = max(1, BUFFERS_BYTES // bytes_of_thread(height))
        self.threads = min(thread_count(threads), tile_count(width), most)
        self.buffers = [Buffers.of(height) for _ in range(self.threads)]
        self.binning = Binning(width, height, self.threads)
        self._moments = aligned((0, MOMENTS))

    def __reduce__(self) -> Any:
        """One that is pickled leaves its buffers behind: another is made, with no splats yet."""
        return Rasterizer, (self.binning.width, self.binning.height, self.threads)

    @property
    def moments(self) -> F4:
        """Room for the moments of every intersection: (intersections or more, MOMENTS) f4, made when asked for."""
        total = self.binning.intersection_count
        if total > len(self._moments):
            # With room to grow: the number changes from step to step.
            self._moments = aligned((total + total // 4, MOMENTS))
        return self._moments

    def run(self, job: Job, regions: Regions) -> None:
        """Do a job for the tiles that have a dirty region."""
        if job.kind == LOSS_AND_GRADIENTS and self.buffers[0].kept.size == 0:
            self.buffers = [buffers.keeping() for buffers in self.buffers]
        tasks = 1 if self.threads == 1 else TASKS_PER_THREAD * self.threads
        for bins in self.binning.windows():
            free = list(self.buffers)  # `append` and `pop` are atomic: a task takes the buffers of no other
            run_tasks(partial(self._run_task, tasks, free, bins, regions, job), tasks, self.threads)

    def _run_task(self, tasks: int, free: list[Buffers], bins: Bins, regions: Regions, job: Job, task: int) -> None:
        buffers = free.pop()
        try:
            run_task(task, tasks, buffers, bins, regions, job)
        finally:
            free.append(buffers)

    def gradients(self, scale: float) -> F4:
        """The gradients (N, 8) f4 from the `moments` that a job has left, times `scale`."""
        binning = self.binning
        gradients = np.empty((len(binning), PARAMETERS_PER_SPLAT), np.float32)  # (N, 8) f4
        binning.over_splats(gradients_task, binning.bins, self.moments, binning.splats.parameters, scale, gradients)
        return gradients

    def covered_pixels(self) -> I8:
        """The number of pixels that each splat covers, (N,) i8."""
        binning = self.binning
        counts = np.zeros(len(binning), np.int64)  # (N,) i8
        binning.over_splats(covered_task, binning.bins, binning.width, binning.height, counts)
        return counts
