"""What the fast renderer keeps between calls: the strips' lists and buffers of one frame size."""

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from typing import Any, Final

import numba
import numpy as np

from gsvc_ref.errors import UsageError
from gsvc_ref.rendering.lists import Lists, count_entries, fill_entries, prepare
from gsvc_ref.rendering.strips import F4, I4, I8, RECORD, ROW, SLOT, SPARE_ROWS, aligned, strip_count
from gsvc_ref.rendering.tasks import prepare_tasks
from gsvc_ref.rendering.tiles import Prepared
from gsvc_ref.splats import PARAMETERS_PER_SPLAT

# GNU OpenMP's threads spin for milliseconds at the end of every loop. On a machine that has anything else to do, that
# steals the very time slice they wait for: four times slower, measured. It reads this when Numba loads it.
os.environ.setdefault("GOMP_SPINCOUNT", "10000")

_WORKQUEUE_LOCK = threading.Lock()
_numba: Any = numba  # its thread functions carry no types

SPLATS_PER_THREAD: Final = 4096
"""Fewer splats than this are not worth waking another thread for."""


def thread_count(threads: int | None) -> int:
    """The number of threads to use: the argument, or one per CPU that this process may run on.

    Raises
    ------
    UsageError
        `threads` is less than 1.
    """
    if threads is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if threads < 1:
        raise UsageError(f"threads is {threads}; it must be at least 1, or None for one per CPU")
    return threads


@contextmanager
def parallel_region(threads: int) -> Iterator[None]:
    """Let parallel kernels use this many threads, and keep Python threads apart where they must not run them at once.

    OpenMP and TBB bear concurrent calls; Numba's fallback layer "workqueue" would end the process. Until the first
    parallel call has chosen the layer, the guard is taken as well.
    """
    try:
        safe = _numba.threading_layer() != "workqueue"
    except ValueError:  # no parallel kernel has run yet
        safe = False
    before = _numba.get_num_threads()
    _numba.set_num_threads(min(threads, _numba.config.NUMBA_NUM_THREADS))
    try:
        with nullcontext() if safe else _WORKQUEUE_LOCK:
            yield
    finally:
        _numba.set_num_threads(before)


_in_fork = False


def _note_fork() -> None:
    """In a forked child: do without the pool of threads, if the parent had one, for a fork does not copy its threads.

    GNU OpenMP would end the child at the first parallel kernel. The results have the same bits on one thread.
    """
    global _in_fork, _WORKQUEUE_LOCK
    _WORKQUEUE_LOCK = threading.Lock()  # another thread of the parent may have held it
    with suppress(ValueError):  # no parallel kernel has run yet
        _in_fork = bool(_numba.threading_layer())


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_note_fork)


class Workspace:
    """The lists and the buffers of every thread for one frame size; made once, then filled for set after set of splats.

    Parameters
    ----------
    width, height
        Of the frame in pixels.
    threads
        None for one per CPU.
    strict
        Whether strips are summed by the kernels without contraction.

    Attributes
    ----------
    parameters
        (N, 8) f4, a copy of what was loaded last.
    lists
        The entries of every strip for these parameters.
    buffers
        (threads, floats) f4, room for one strip each.
    """

    def __init__(self, width: int, height: int, threads: int | None = None, *, strict: bool = False) -> None:
        count = strip_count(width)
        self.width, self.height, self.strict = width, height, strict
        self.threads = min(thread_count(threads), count)
        # Padded to whole cache lines, so that every thread's buffer starts on one.
        self.buffers = aligned((self.threads, -(-(height + SPARE_ROWS) * ROW // 16) * 16))
        self._slots = aligned((0, SLOT))
        self._resize(0, np.zeros((0, 2), np.int32), np.zeros(count + 1, np.int64), np.zeros(count, np.int64))
        self.load(self.parameters)

    def _resize(self, splats: int, entries: I4, offsets: I8, positions: I8) -> None:
        """Make room for exactly this number of splats: most calls come with the number of the call before."""
        self.parameters = np.zeros((splats, PARAMETERS_PER_SPLAT), np.float32)
        self.lists = Lists(
            records=aligned((splats, RECORD)),
            strips=np.zeros((splats, 2), np.int32),
            base=np.zeros(splats + 1, np.int64),
            entries=entries,
            offsets=offsets,
            positions=positions,
            work=np.zeros(len(offsets)),
        )

    def load(self, parameters: F4) -> None:
        """Copy the parameters (N, 8) f4 and list the entries of every strip.

        Raises
        ------
        UsageError
            A parameter is NaN or infinite.
        """
        if len(parameters) != len(self.parameters):
            self._resize(len(parameters), self.lists.entries, self.lists.offsets, self.lists.positions)
        np.copyto(self.parameters, parameters)
        self._prepare()
        count_entries(self.height, self.lists)
        total = int(self.lists.base[-1])
        if total > len(self.lists.entries):
            self.lists = self.lists._replace(entries=np.zeros((total + total // 4, 2), np.int32))
        fill_entries(self.lists)

    def _prepare(self) -> None:
        count, threads = len(self.parameters), self._threads_for_splats()
        if threads <= 1:
            bad = prepare(0, count, self.parameters, self.width, self.height, self.lists)
        else:
            found = np.empty(threads, np.int64)
            with parallel_region(threads):
                prepare_tasks(threads, self.parameters, self.width, self.height, self.lists, found)
            bad = int(found[np.argmax(found >= 0)])
        if bad >= 0:
            raise UsageError(f"splat {bad} has a parameter that is NaN or infinite; every parameter must be finite")

    def exchange(self, other: Prepared | None) -> Prepared:
        """Hand out what was loaded last, and use the memory of `other` for what is loaded next if its size fits."""
        mine = Prepared(self.parameters, self.lists.records, self.lists.strips)
        if other is None or len(other.parameters) != len(mine.parameters):
            self._resize(len(mine.parameters), self.lists.entries, self.lists.offsets, self.lists.positions)
        else:
            self.parameters = other.parameters
            self.lists = self.lists._replace(records=other.records, strips=other.strips)
        return mine

    @property
    def slots(self) -> F4:
        """Room for the sums of every entry: (entries or more, SLOT) f4."""
        total = int(self.lists.base[-1])
        if total > len(self._slots):
            self._slots = aligned((total + total // 4, SLOT))
        return self._slots

    def over_strips(self, task: Callable[..., None], tasks: Callable[..., None], *arguments: Any) -> None:
        """Run a kernel of `tasks` over all strips, on as many threads as this workspace has."""
        if self.threads == 1 or _in_fork:
            task(0, 1, self.buffers[0], self.lists, self.strict, *arguments)
        else:
            with parallel_region(self.threads):
                tasks(self.buffers, self.lists, self.strict, *arguments)

    def over_splats(self, task: Callable[..., None], tasks: Callable[..., None], *arguments: Any) -> None:
        """Run a kernel of `tasks` over all splats."""
        threads = self._threads_for_splats()
        if threads <= 1:
            task(0, len(self.parameters), self.lists, *arguments)
        else:
            with parallel_region(threads):
                tasks(threads, self.lists, *arguments)

    def _threads_for_splats(self) -> int:
        return 1 if _in_fork else min(self.threads, len(self.parameters) // SPLATS_PER_THREAD)
