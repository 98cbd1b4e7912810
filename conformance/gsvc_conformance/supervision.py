"""Runs a program for some seconds so that nothing of it stays: no process, and of its output what people read.

A process that a program started ends with the program's process group. One that made a group or session of its own
is found on Linux: whoever loses its parent there becomes a child of the kit (PR_SET_CHILD_SUBREAPER).
"""

import ctypes
import os
import secrets
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO, Final

LOG_BYTES: Final = 4096
"""Number of bytes of a process's output that are kept: the beginning and the end, each about a half."""
CUT: Final = "\n[...]\n"
"""Stands between them."""
INTERVAL_S: Final = 0.1
"""Interval at which a program's output files are measured, in seconds."""
PATIENCE_S: Final = 2.0
"""Time to wait for processes that were killed, in seconds: one that sleeps in a driver may take its time."""
MARK: Final = "GSVC_CONFORMANCE_RUN"
"""Variable of the environment that marks the processes of a program."""
PR_SET_CHILD_SUBREAPER: Final = 36
"""A constant of Linux, see prctl(2)."""

_starting = threading.Lock()
_programs: set[int] = set()
"""Process numbers of the programs that run; changed under the lock only."""
_others: set[int] = set()
"""Children that the kit had before the first of these programs began; nothing of them is touched."""


class Log:
    """The beginning and the end of what is printed: some runtimes print the message first, others last."""

    def __init__(self) -> None:
        self._first = self._last = b""
        self._size = 0

    def add(self, data: bytes) -> None:
        """Take note of what was printed next."""
        self._size += len(data)
        self._first += data[: LOG_BYTES - len(self._first)]
        self._last = (self._last + data)[-_HALF:]

    def __str__(self) -> str:
        if self._size <= LOG_BYTES:
            return _text(self._first)
        return _text(self._first[:_HALF]) + CUT + _text(self._last)


_HALF: Final = (LOG_BYTES - len(CUT)) // 2


def _text(data: bytes) -> str:
    return data.decode(errors="replace").strip()


class Program:
    """A program that runs, of which nothing stays once it is closed: it is a context.

    Parameters
    ----------
    words
        The program and its arguments.
    log
        Takes what it prints.
    variables
        Variables of its environment, besides the kit's own.
    talks
        Whether its standard input and output are pipes of the caller's; what it prints is then its standard error.

    Raises
    ------
    OSError
        It cannot be started.
    """

    def __init__(self, words: list[str], log: Log, variables: Mapping[str, str], talks: bool = False) -> None:
        self.log = log
        self._mark = secrets.token_hex(8)
        self._talks, self._closed = talks, False
        environment = {**os.environ, **variables, MARK: self._mark}
        given, printed = (subprocess.PIPE, subprocess.PIPE) if talks else (subprocess.DEVNULL, subprocess.STDOUT)
        with _starting:
            _adopt()
            self.process = subprocess.Popen(
                words, bufsize=0, stdin=given, stdout=subprocess.PIPE, stderr=printed, env=environment,
                start_new_session=True,
            )  # fmt: skip
            _programs.add(self.process.pid)
        self._reader = threading.Thread(
            target=self._read, args=(self.process.stderr if talks else self.process.stdout,), daemon=True
        )
        self._reader.start()

    def __enter__(self) -> "Program":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def wait(self, timeout: float, check: Callable[[], object] = int) -> int | None:
        """The exit status at its end, or None if it goes on for longer than the timeout, in seconds.

        Parameters
        ----------
        timeout
            In seconds.
        check
            Is called again and again while it runs; what it raises is raised here.
        """
        end = time.monotonic() + timeout
        while (left := end - time.monotonic()) > 0:
            with suppress(subprocess.TimeoutExpired):
                return self.process.wait(min(left, INTERVAL_S))
            check()
        return None

    def close(self) -> None:
        """End it and whatever it started, once: its number may then be another program's."""
        if self._closed:
            return
        self._closed = True
        _kill(self.process)
        with _starting:
            _programs.discard(self.process.pid)
        _kill_strays(self.process.pid, self._mark, self._talks)
        self._reader.join(PATIENCE_S)  # it ends with the last process that may print

    def _read(self, printed: IO[bytes]) -> None:
        with printed:
            while data := os.read(printed.fileno(), 1 << 16):
                self.log.add(data)


def _kill(process: "subprocess.Popen[bytes]") -> None:
    """End a program with its process group."""
    if sys.platform == "win32":
        process.kill()
    else:
        with suppress(ProcessLookupError, PermissionError):  # nobody is left; macOS says so of a group of zombies
            os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _adopt() -> None:
    """Become the parent of all descendants whose parents end, where that can be done, and note who is none of them."""
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    if not _programs:
        _others.clear()
        _others.update(_children())


def _children() -> Iterator[int]:
    """The children of the kit, where Linux lists them."""
    with suppress(OSError):
        for task in Path("/proc/self/task").iterdir():
            with suppress(OSError):  # the thread has just ended
                yield from map(int, (task / "children").read_text().split())


def _kill_strays(group: int, mark: str, its_own_only: bool) -> None:
    """End what a program left behind; each that ends may leave children of its own.

    A process that hides its environment is known by being nobody else's: while other programs run it may be theirs,
    and ends with the last of them. A program that talks may live as long as the kit, or as the tests of others that
    the kit is a part of: what came since then may be theirs, so that only what is known to be its own is ended.
    """
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        with _starting:
            strays = [child for child in _children() if child not in _programs and child not in _others]
            strays = [child for child in strays if not (_programs or its_own_only) or _is_of(child, group, mark)]
            for stray in strays:
                with suppress(ProcessLookupError, ChildProcessError):
                    os.kill(stray, signal.SIGKILL)
                    os.waitpid(stray, os.WNOHANG)
        if not strays:
            return
        time.sleep(0.001)


def _is_of(process: int, group: int, mark: str) -> bool:
    """Whether a process is of the group of a program, or has its mark; one that has ended has none."""
    try:
        return os.getpgid(process) == group or f"{MARK}={mark}".encode() in Path(
            f"/proc/{process}/environ"
        ).read_bytes().split(b"\0")
    except OSError:  # it has just ended, or belongs to another user
        return False
