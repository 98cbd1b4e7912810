"""Threads: how many are used, and how kernels get them in a process that may have threads and forks of its own."""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from typing import Any

import numba

from gsvc_ref.errors import UsageError

# GNU OpenMP's threads spin for milliseconds at the end of every loop. On a machine that has anything else to do, that
# steals the very time slice they wait for: four times slower, measured. It reads this when Numba loads it.
os.environ.setdefault("GOMP_SPINCOUNT", "10000")

_numba: Any = numba  # its thread functions carry no types
_workqueue_lock = threading.Lock()
_forked = False


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


def usable(threads: int) -> int:
    """The number of threads if there is a pool of them, and 1 in a forked child, which has none."""
    return 1 if _forked else threads


@contextmanager
def parallel_region(threads: int) -> Iterator[None]:
    """Let parallel kernels use this many threads, and keep Python threads apart where they must not run them at once.

    OpenMP and TBB allow concurrent calls; Numba's fallback layer "workqueue" would end the process. Until the first
    parallel call has chosen the layer, the lock is taken as well.

    Raises
    ------
    UsageError
        The environment names a threading layer that Numba cannot start.
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
        with nullcontext() if safe else _workqueue_lock:
            yield
    finally:
        _numba.set_num_threads(before)


def _note_fork() -> None:
    """In a forked child: do without the pool of threads, if the parent had one, for a fork does not copy its threads.

    GNU OpenMP would end the child at the first parallel kernel. The results have the same bits on one thread.
    """
    global _forked, _workqueue_lock
    _workqueue_lock = threading.Lock()  # another thread of the parent may have held it
    with suppress(ValueError):  # no parallel kernel has run yet
        _forked = bool(_numba.threading_layer())


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_note_fork)
