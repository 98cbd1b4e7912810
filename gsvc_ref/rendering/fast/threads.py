"""Threads: how many are used, and how the tasks of a job are shared among them.

Kernels let other Python threads run, so a job needs no more than those: one that calls, and those of a pool that all
jobs of the process share. Several threads may have jobs at the same time, and a forked child makes a pool of its own.
"""

import os
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import suppress
from typing import Any

from gsvc_base.errors import UsageError
from gsvc_base.processors import processors

_pool: ThreadPoolExecutor | None = None


def thread_count(threads: int | None) -> int:
    """The number of threads to use: the argument, at least 1, or one per CPU that this process may run on."""
    if threads is None:
        return processors()
    if threads < 1:
        raise UsageError(f"threads is {threads}; it must be at least 1, or None for one per CPU")
    return threads


def run_tasks(task: Callable[[int], None], tasks: int, threads: int | None = None) -> None:
    """Call task(0), ..., task(tasks - 1), on the calling thread and those of the pool that are free.

    Each thread takes the next task when it is done with one. At most `threads` have a part in it; None: any number.
    It returns, or raises what the tasks or Ctrl-C raised, when no task is at work any more: they write into memory that
    the caller will use again. Where there can be no more threads, as at the end of a process, the caller does it all.
    """
    numbers = iter(range(tasks))  # its `next` is atomic, so that each number goes to one thread

    def work() -> None:
        for number in numbers:
            task(number)

    others: list[Future[None]] = []
    with suppress(RuntimeError):  # no thread can be started
        for _ in range(min(tasks, threads or tasks, _most_threads()) - 1):
            others.append(_workers().submit(work))
    try:
        work()
    finally:
        _wait_for(others)
    for other in others:
        other.result()


def _wait_for(others: list[Future[None]]) -> None:
    """Wait until all have ended; an interrupt meanwhile is raised afterwards."""
    late: BaseException | None = None
    while others:
        try:
            wait(others)
            break
        except BaseException as error:
            late = error
    if late is not None:
        raise late


def _most_threads() -> int:
    """One per CPU, or what NUMBA_NUM_THREADS says."""
    from gsvc_ref._compiler import numba

    config: Any = numba.config
    most: int = config.NUMBA_NUM_THREADS
    return most


def _workers() -> ThreadPoolExecutor:
    """The pool, which is made when it is first needed."""
    global _pool
    if _pool is None:
        _pool = ThreadPoolExecutor(max(1, _most_threads() - 1), thread_name_prefix="gsvc_ref")
    return _pool


def _forget_pool() -> None:
    """In a forked child: make a new pool when it is needed, for a fork does not copy threads."""
    global _pool
    _pool = None


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_pool)
