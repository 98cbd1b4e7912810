"""Ctrl-C, and the signals that ask a process to end: how they are handled while something is encoded or decoded.

`Interrupts` holds Ctrl-C back while a frame is written. `termination_as_ctrl_c` makes SIGTERM and SIGHUP do what Ctrl-C
does, for programs that want it, and gives the exit code for the signal. `sparing_children` keeps them from what a
library has started.
"""

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType
from typing import Any, Final, Self

TERMINATION: Final = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Signals that end a process politely; not every system has SIGHUP."""

SIGNALS: Final = (signal.SIGINT, *TERMINATION)
"""Signals that may be handled as Ctrl-C: SIGINT by default, the others inside of `termination_as_ctrl_c`."""

SHELL_BASE: Final = 128
"""What shells add to the number of the signal that ended a program."""

INSISTING_S: Final = 1.0
"""Seconds from the first interrupt until a second gets through a hold: a pipe may never take what is written."""

AGAIN_S: Final = 0.001
"""Seconds until an interrupt is looked at again that came during one of UNTOUCHED."""

UNTOUCHED: Final = ("__del__", "close", "detach", "_raw_object_cache_notify", "_raw_object_cache_getbuffer")
"""Functions of llvmlite out of which nothing may be raised: they free memory, or are called by the compiler."""


class Interrupts:
    """Python's own handling of Ctrl-C, `signal.default_int_handler`, with a hold on it; a context manager.

    Only the main thread gets signals, and a handler is replaced only if it is that one or that of
    `termination_as_ctrl_c`. An interrupt that comes while llvmlite frees memory or is called by its compiler waits
    until that is done: raised there, it would be lost, or the same memory be freed twice.

    `patient` lets nothing through a hold: what is written goes to a disk, so it will end. `once` holds from the first
    interrupt on: what was begun is being removed.
    """

    def __init__(self, *, patient: bool, once: bool = False) -> None:
        self.held, self.seen = False, False  # interrupts are noted, not raised; one was noted
        self._patient, self._once, self._since = patient, once, 0.0
        self._replaced: dict[int, Any] = {}  # the handler of each signal before

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if _untouched(frame):
            again = threading.Timer(AGAIN_S, _send, [number])
            again.daemon = True
            again.start()
            return
        _note(number)
        insists = self.seen and not self._patient and time.monotonic() - self._since > INSISTING_S
        through = not self.held or insists
        self.held |= self._once
        if not self.seen and self.held:
            self.seen, self._since = True, time.monotonic()
        if through:
            raise KeyboardInterrupt

    def release(self) -> None:
        """Hold back no longer; an interrupt that was noted is raised now."""
        self.held = False
        if self.seen:
            raise KeyboardInterrupt

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            for number in SIGNALS:
                if (before := signal.getsignal(number)) in (signal.default_int_handler, _terminate):
                    signal.signal(number, self._handle)
                    self._replaced[number] = before
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        mine: Any = self._handle  # equal, though never identical, to what was set
        for number, before in self._replaced.items():
            if signal.getsignal(number) == mine:
                signal.signal(number, before)


def _untouched(frame: FrameType | None) -> bool:
    """Whether one of UNTOUCHED is running, or Numba is being loaded, of which a part would stay."""
    while frame is not None:
        module = frame.f_globals.get("__name__", "")
        # Numba executes text while it is loaded. Python ends by SIGINT once an interrupt has left such an `exec`.
        if frame.f_code.co_name == "<module>" and module.partition(".")[0] in ("numba", "llvmlite"):
            return True
        if frame.f_code.co_name in UNTOUCHED and module.startswith("llvmlite."):
            return True
        frame = frame.f_back
    return False


def _send(number: int) -> None:
    """Send the main thread a signal, so that it does not go on waiting for input."""
    if hasattr(signal, "pthread_kill"):
        signal.pthread_kill(threading.main_thread().ident or 0, number)
    else:
        signal.raise_signal(number)


_noted: list[int] = []
"""The signals beside SIGINT that came inside of `termination_as_ctrl_c`."""


def _note(number: int) -> None:
    if number in TERMINATION:
        _noted.append(number)


def _terminate(number: int, frame: FrameType | None) -> None:
    """Do what Ctrl-C does, and note the signal."""
    _note(number)
    raise KeyboardInterrupt


@contextmanager
def termination_as_ctrl_c() -> Iterator[Callable[[int], int]]:
    """Let SIGTERM and SIGHUP do what Ctrl-C does inside of the block, unless somebody else handles them.

    Yields a function of an exit code, which turns 130, that of Ctrl-C, into 128 + the signal that came, as shells do.
    """
    replaced = []
    _noted.clear()
    if threading.current_thread() is threading.main_thread():
        for number in TERMINATION:
            if signal.getsignal(number) is signal.SIG_DFL:
                signal.signal(number, _terminate)
                replaced.append(number)
    try:
        yield lambda code: SHELL_BASE + _noted[0] if _noted and code == SHELL_BASE + signal.SIGINT else code
    finally:
        for number in replaced:
            signal.signal(number, signal.SIG_DFL)


@contextmanager
def sparing_children() -> Iterator[None]:
    """Let the signals of `termination_as_ctrl_c` reach no process that the block starts.

    Who ends a process often signals its whole group. That ends the compiler or linker that a GPU driver has started,
    and some drivers then abort the process that they are loaded in. A process begins with the mask of the thread that
    starts it, so this thread blocks the signals. Another one takes them, and wakes this one from what it waits for.
    """
    signals = [number for number in TERMINATION if signal.getsignal(number) is _terminate]
    if not signals or not hasattr(signal, "pthread_sigmask"):
        yield
        return
    receive, send = os.pipe()
    os.set_blocking(send, False)

    def take() -> None:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, signals)
        while number := os.read(receive, 1):
            if number[0] in signals:
                _send(signal.SIGURG)

    wakeup = signal.set_wakeup_fd(send)  # gets the number of a signal, whichever thread takes it
    urgent = signal.signal(signal.SIGURG, _ignore)
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, signals)
    taking = threading.Thread(target=take, daemon=True)
    taking.start()
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        signal.signal(signal.SIGURG, urgent)
        signal.set_wakeup_fd(wakeup)
        os.close(send)
        taking.join()
        os.close(receive)


def _ignore(number: int, frame: FrameType | None) -> None:
    """Do nothing but end what the main thread waits for."""
