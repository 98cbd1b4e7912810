"""What the fast renderer keeps between calls: the strips' lists and buffers of one frame size.

Splats come from strangers, and one splat may touch every strip. So the lists of all strips are made at once only while
they are short. Otherwise they are made for one window of neighbouring strips after the other, which changes no bit, as
strips have nothing in common.
"""

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from typing import Any, Final

import numba
import numpy as np

from gsvc_ref.errors import UsageError
from gsvc_ref.rendering.fast.lists import SELECTED, Lists, count_entries, fill_entries, prepare
from gsvc_ref.rendering.fast.strips import F4, I8, RECORD, ROW, SLOT, SPARE_ROWS, aligned, strip_count
from gsvc_ref.rendering.fast.tasks import prepare_tasks
from gsvc_ref.rendering.fast.tiles import Prepared
from gsvc_ref.splats import PARAMETERS_PER_SPLAT, Splats

# GNU OpenMP's threads spin for milliseconds at the end of every loop. On a machine that has anything else to do, that
# steals the very time slice they wait for: four times slower, measured. It reads this when Numba loads it.
os.environ.setdefault("GOMP_SPINCOUNT", "10000")

_WORKQUEUE_LOCK = threading.Lock()
_numba: Any = numba  # its thread functions carry no types

SPLATS_PER_THREAD: Final = 4096
"""Fewer splats than this are not worth waking another thread for."""

LISTED: Final = 1 << 20
"""Most entries, 8 bytes each, that are listed at once, unless there are more splats than that."""

SPLATS_KEPT: Final = 1 << 16
"""Memory of more splats than this is given back to the system between two frames."""

SELECTION_SIZE: Final = SELECTED * (4 * RECORD + 12)
"""Most bytes of a selection."""

BUFFERS_SIZE: Final = 40 << 20
"""Most bytes for strips and selections of all threads; there are fewer threads if strips are very long."""


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


def windows_of(offsets: I8, most: int) -> list[tuple[int, int]]:
    """Windows (first strip, the one after the last) of one strip or at most `most` entries; `offsets` is of `Lists`."""
    windows = []
    first = end = 0
    while end < len(offsets) - 1:
        end = max(first + 1, int(np.searchsorted(offsets, offsets[first] + most, side="right")) - 1)
        windows.append((first, end))
        first = end
    return windows


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
    try:
        before = _numba.get_num_threads()  # which starts the threads
    except ValueError as error:
        reason = " ".join(str(error).split()).rstrip(".")
        raise UsageError(f"Numba cannot start its threads ({reason}): unset NUMBA_THREADING_LAYER") from None
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
        What these parameters need; the entries are those of one window, see `over_strips`.
    buffers
        (threads, floats) f4, room for one strip each.
    """

    def __init__(self, width: int, height: int, threads: int | None = None, *, strict: bool = False) -> None:
        count = strip_count(width)
        self.width, self.height, self.strict = width, height, strict
        # Padded to whole cache lines, so that every thread's buffer starts on one.
        floats = -(-(height + SPARE_ROWS) * ROW // 16) * 16
        most = max(1, BUFFERS_SIZE // (4 * floats + SELECTION_SIZE))
        self.threads = min(thread_count(threads), count, most)
        self.buffers = aligned((self.threads, floats))
        self._slots = aligned((0, SLOT))
        self.parameters = np.zeros((0, PARAMETERS_PER_SPLAT), np.float32)
        self.lists = Lists(
            records=aligned((0, RECORD)),
            strips=np.zeros((0, 2), np.int32),
            base=np.zeros(1, np.int64),
            offsets=np.zeros(count + 1, np.int64),
            window=np.array([0, count]),
            entries=np.zeros((0, 2), np.int32),
            positions=np.zeros(count, np.int64),
            work=np.zeros(count + 1),
        )
        self.load(self.parameters)

    def _resize(self, splats: int) -> None:
        """Make room for exactly this number of splats: most calls come with the number of the call before."""
        self.parameters = np.zeros((splats, PARAMETERS_PER_SPLAT), np.float32)
        self.lists = self.lists._replace(
            records=aligned((splats, RECORD)),
            strips=np.zeros((splats, 2), np.int32),
            base=np.zeros(splats + 1, np.int64),
        )

    def load(self, parameters: F4) -> None:
        """Copy the parameters (N, 8) f4, as `Splats` has them, and count the entries of every strip."""
        if len(parameters) != len(self.parameters):
            self._resize(len(parameters))
        np.copyto(self.parameters, parameters)
        self._list_entries()

    def load_splats(self, splats: Splats) -> None:
        """`load` without a copy of all parameters on the way."""
        if len(splats) != len(self.parameters):
            self._resize(len(splats))
        first = 0
        for part in (splats.positions, splats.cholesky, splats.colors):
            self.parameters[:, first : first + part.shape[1]] = part
            first += part.shape[1]
        self._list_entries()

    def _list_entries(self) -> None:
        self._prepare()
        count_entries(self.height, self.lists)
        # No strip has more entries than there are splats, so that every strip fits, and a pass over the splats for each
        # of at most 2 total / most + 1 windows takes no longer than the entries themselves do.
        most = max(LISTED, len(self.parameters))
        self._windows = windows_of(self.lists.offsets, most)
        total = min(int(self.lists.base[-1]), most)
        if total > len(self.lists.entries):
            self.lists = self.lists._replace(entries=np.zeros((min(total + total // 4, most), 2), np.int32))
        if len(self._windows) == 1:
            self.lists.window[:] = self._windows[0]
            fill_entries(self.lists)

    def _prepare(self) -> None:
        count, threads = len(self.parameters), self._threads_for_splats()
        if threads <= 1:
            prepare(0, count, self.parameters, self.width, self.height, self.lists)
        else:
            with parallel_region(threads):
                prepare_tasks(threads, self.parameters, self.width, self.height, self.lists)

    def exchange(self, other: Prepared | None) -> Prepared:
        """Hand out what was loaded last, and use the memory of `other` for what is loaded next if its size fits."""
        mine = Prepared(self.parameters, self.lists.records, self.lists.strips)
        if len(mine.parameters) > SPLATS_KEPT:
            self._resize(0)
            self.lists = self.lists._replace(entries=np.zeros((0, 2), np.int32))
        elif other is None or len(other.parameters) != len(mine.parameters):
            self._resize(len(mine.parameters))
        else:
            self.parameters = other.parameters
            self.lists = self.lists._replace(records=other.records, strips=other.strips)
        return mine

    @property
    def slots(self) -> F4:
        """Room for the sums of every entry: (entries or more, SLOT) f4. Only those who train splats ask for it."""
        total = int(self.lists.base[-1])
        if total > len(self._slots):
            self._slots = aligned((total + total // 4, SLOT))
        return self._slots

    def over_strips(self, task: Callable[..., None], tasks: Callable[..., None], *arguments: Any) -> None:
        """Run a kernel of `tasks` over all strips, on as many threads as this workspace has."""
        for window in self._windows:
            lists = self.lists if len(self._windows) == 1 else self._list_window(*window)
            if self.threads == 1 or _in_fork:
                task(0, 1, self.buffers[0], lists, self.strict, *arguments)
            else:
                with parallel_region(self.threads):
                    tasks(self.buffers, lists, self.strict, *arguments)

    def _list_window(self, first: int, end: int) -> Lists:
        """The lists with the entries, and the work, of the strips first to end - 1."""
        self.lists.window[:] = first, end
        fill_entries(self.lists)
        work = self.lists.work
        return self.lists._replace(work=np.clip(work, work[first], work[end]) - work[first])

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
