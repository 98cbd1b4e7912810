"""Processes of one machine as a `concurrent.futures.Executor` that outlives the death of any of them.

A process is spawned, not forked: the caller has threads, whose locks a fork would copy as they stand, and files that no
other process should hold open. It takes one call after the other from its own pipe, which a thread of the caller
waits for. So a process that is killed takes one call with it, and the next call gets another process.

This module imports little, so that a command may start its processes first of all, and load what it needs itself while
they load what they will need.

They leave Ctrl-C and the end of a terminal, which are sent to all of its processes, to the caller; and they end when it
does, however that ends.
"""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from importlib import import_module
from queue import LifoQueue
from typing import TYPE_CHECKING, Any, Final, ParamSpec, TypeVar

from gsvc_base.errors import UsageError

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

P = ParamSpec("P")
R = TypeVar("R")

MAX_JOBS: Final = 1024
"""Maximum number of groups of pictures that are encoded at the same time."""

LEFT_TO_CALLER: Final = tuple(getattr(signal, name) for name in ("SIGINT", "SIGHUP") if hasattr(signal, name))
"""Signals that the processes do not take; not every system has SIGHUP."""


def check_jobs(jobs: int) -> None:
    """Refuse a number of jobs that is not in 1..MAX_JOBS with a UsageError."""
    if isinstance(jobs, bool) or not isinstance(jobs, int) or not 1 <= jobs <= MAX_JOBS:
        raise UsageError(f"jobs is {jobs!r}; it must be a whole number in 1..{MAX_JOBS}")


class DeadProcessError(BrokenExecutor):
    """The process ended before its call did: it was killed, or found no memory."""


class Processes(Executor):
    """An executor with up to `count` processes, each of them started when a call first needs it, or by `start`."""

    # A module that each process imports before its first call
    def __init__(self, count: int, preload: str | None = None) -> None:  # the number of calls at the same time
        self._is_over = False
        self._threads = ThreadPoolExecutor(count, thread_name_prefix="gsvc_ref processes")
        self._workers = [_Worker(preload) for _ in range(count)]
        self._free: LifoQueue[_Worker] = LifoQueue()  # a call that is made again gets the process that was started anew
        for worker in reversed(self._workers):  # the first call gets the first
            self._free.put(worker)

    def start(self, count: int) -> None:
        """Start up to `count` processes now, before calls for them come; each takes half a second.

        Without this each is started by the first call that it gets.
        """
        for worker in self._workers[: 0 if self._is_over else count]:
            with suppress(OSError):  # the call that needs it will fail in the same way, and tell
                worker.start()

    def submit(self, function: Callable[P, R], /, *arguments: P.args, **options: P.kwargs) -> Future[R]:
        """Call a function of a module in a process; its arguments and what it returns or raises are pickled.

        The future raises a DeadProcessError if the process ends before.
        """
        return self._threads.submit(self._call, function, arguments, options)

    def _call(self, *call: Any) -> Any:
        worker = self._free.get()
        try:
            return worker.call(call)
        finally:
            self._free.put(worker)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more calls; with `wait` the processes have ended when this returns, otherwise they do when we end."""
        self._is_over = True
        self._threads.shutdown(wait, cancel_futures=cancel_futures)
        if wait:
            for worker in self._workers:
                worker.end()

    def kill(self) -> None:
        """End the processes now, and for good; calls that are not done fail."""
        self._is_over = True
        for worker in self._workers:
            worker.kill()
        self.shutdown(cancel_futures=True)


class _Worker:
    """A process, and the pipe to it, while there is one."""

    def __init__(self, preload: str | None) -> None:
        self._preload = preload
        self._changing = threading.Lock()  # locked while a process is started or killed
        self._process: Any = None
        self._connection: Connection[Any, Any] | None = None
        self._killed = False

    def call(self, call: tuple[Any, ...]) -> Any:
        """Let the process make a call; what it returns."""
        connection = self._connected()
        try:
            connection.send(call)
            is_done, result = connection.recv()
        except (EOFError, ConnectionError):
            self.end()
            raise DeadProcessError("a process ended before its call did") from None
        if not is_done:
            raise result
        return result

    def start(self) -> None:
        """Start the process, if there is none and it may be."""
        import multiprocessing  # which no other command needs

        with self._changing:
            if self._connection is None and not self._killed:
                context = multiprocessing.get_context("spawn")
                ours, theirs = context.Pipe()
                process = context.Process(target=_serve, args=(theirs, self._preload), name="gsvc_ref", daemon=True)
                with _signals_blocked():  # they may be raised at its end, where the process must be known
                    process.start()
                    self._process, self._connection = process, ours
                theirs.close()  # the end of the process is then that of the pipe

    def _connected(self) -> "Connection[Any, Any]":
        """The pipe to the process, which is started if there is none, or one that was killed while it had no call."""
        if self._connection is not None and not self._process.is_alive():
            self.end()
        self.start()
        if self._connection is None or self._killed:
            raise DeadProcessError("the processes were ended")
        return self._connection

    def end(self) -> None:
        """Close the pipe, which the process takes for its end, and wait for it."""
        with self._changing:
            if self._connection is not None:
                self._connection.close()
                self._process.join()
                self._process.close()
                self._connection = None

    def kill(self) -> None:
        """End the process at once, and start no other."""
        with self._changing:
            self._killed = True
            if self._connection is not None:
                self._process.kill()


@contextmanager
def _signals_blocked() -> Iterator[None]:
    """Let a process that is started here have blocked signals from its first moment on, before it can ignore them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()  # its start would let the signals through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, LEFT_TO_CALLER)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _serve(connection: "Connection[Any, Any]", preload: str | None) -> None:
    """Make the calls that come through a pipe, until it is closed; then end at once, without taking modules apart."""
    for number in LEFT_TO_CALLER:
        signal.signal(number, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if preload is not None:
        with suppress(Exception):  # the call that needs it will fail in the same way, and tell
            import_module(preload)
    while True:
        try:
            function, arguments, options = connection.recv()
        except EOFError:
            break
        answer: tuple[bool, Any]
        try:
            answer = True, function(*arguments, **options)
        except BaseException as error:
            answer = False, error
        try:
            connection.send(answer)
        except ConnectionError:  # nobody waits for it any more
            break
        except Exception as error:  # it cannot be pickled
            connection.send((False, RuntimeError(f"{type(error).__name__}: {error}")))
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            with suppress(OSError, ValueError):  # nobody reads it, or it is closed
                stream.flush()
    os._exit(0)


def _end_with_parent() -> None:
    """End this process at once when the one that started it has ended."""
    import multiprocessing

    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
