"""The kernels without a GPU: compiled by a C++ compiler, threads are fibers (kernels/fibers.h) and buffers arrays."""

import ctypes
import os
import shlex
import subprocess
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from gsvc_conformance.adapters.cuda.sources import KERNELS, kept, kernels, source_of

Array = np.ndarray[Any, Any]

OPTIONS: Final = (
    "-x", "c++", "-std=c++17", "-O2", "-fPIC", "-shared", "-DFIBERS", "-fno-strict-aliasing", "-U_FORTIFY_SOURCE",
    "-ffp-contract=off",
)  # fmt: skip


def storage(size: int) -> Array:
    """So many bytes, all zero."""
    return np.zeros(size, np.uint8)


def upload(values: Array) -> Array:
    """A buffer with the bytes of an array."""
    return np.frombuffer(bytearray(values.tobytes()), np.uint8)


def write(buffer: Array, values: Array) -> None:
    """Let a buffer begin with the bytes of an array."""
    buffer[: values.nbytes] = values.reshape(-1).view(np.uint8)


def download(buffer: Array, size: int) -> Array:
    """The first bytes of a buffer."""
    return buffer[:size].copy()


def address(buffer: Array) -> int:
    """Where a buffer is."""
    return buffer.ctypes.data


def clear(buffer: Array) -> None:
    """Set a buffer to zero."""
    buffer[:] = 0


def replay(work: Callable[[], None]) -> Callable[[], None]:
    """The work itself: to start a kernel costs little here."""
    return work


def synchronize() -> None:
    """There is nothing to wait for: a launch returns when the kernel has ended."""


class Event:
    """What has happened, and when."""

    def __init__(self) -> None:
        self.time = time.perf_counter()

    def synchronize(self) -> None:
        """It has happened."""


class Stream:
    """Nothing runs at the same time as anything else, so nobody waits: see `gpu.stream`."""

    def __enter__(self) -> "Stream":
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def record(self) -> Event:
        """An event that happens now."""
        return Event()

    def wait_event(self, event: Event) -> None:
        """It has happened."""


def milliseconds(start: Event, end: Event) -> float:
    """See `gpu.milliseconds`."""
    return 1000 * (end.time - start.time)


def stream() -> Stream:
    """See `gpu.stream`."""
    return Stream()


def pinned(size: int) -> Array:
    """Bytes, all zero."""
    return np.zeros(size, np.uint8)


def send(values: Array, buffer: Array) -> None:
    """Copy bytes to the beginning of a buffer."""
    buffer[: values.nbytes] = values


def fetch(buffer: Array, values: Array) -> None:
    """Copy the beginning of a buffer."""
    values[:] = buffer[: values.nbytes]


@cache
def compiler() -> tuple[tuple[str, ...], str]:
    """The command of CXX, or g++, and the first line that it says of its version.

    Raises
    ------
    NotImplementedError
        There is no such compiler.
    """
    command = shlex.split(os.environ.get("CXX", "g++"))
    try:
        version = subprocess.run([*command, "--version"], capture_output=True, text=True, check=True).stdout
    except (OSError, subprocess.CalledProcessError):
        raise NotImplementedError(f"there is no C++ compiler {command[0]}: install one, or name one in CXX") from None
    return tuple(command), version.splitlines()[0]


@cache
def library(source: str, exact: bool) -> ctypes.CDLL:
    """A file of kernels, compiled."""
    command, version = compiler()
    text = f'#include "{source}.cu"\n' + "".join(f"KERNEL_OF_FIBERS({name})\n" for name in kernels(source))
    options = [*command, *OPTIONS, *(["-DEXACT"] if exact else [])]

    def make(path: Path) -> None:
        files = ["-I", str(KERNELS), "-o", str(path), "-"]
        done = subprocess.run([*options, *files], input=text, capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(f"{command[0]} does not compile {source}.cu: {done.stderr.strip()}")

    return ctypes.CDLL(str(kept(".so", [version, text, *options], make)))


@cache
def function(kernel: str, exact: bool) -> Callable[[tuple[int, ...], tuple[int, ...], Any], None]:
    """What starts a kernel: it takes blocks, threads of a block, and an array of the addresses of its arguments."""
    entry = library(source_of(kernel), exact)["fibers_" + kernel]
    entry.argtypes = [ctypes.c_void_p, ctypes.c_void_p]

    def start(blocks: tuple[int, ...], threads: tuple[int, ...], arguments: Any) -> None:
        if entry((ctypes.c_uint * 6)(*blocks, *threads), arguments):
            raise RuntimeError(f"{kernel}: a thread waits for others that never come (a collective in a branch)")

    return start


def environment() -> dict[str, str]:
    """What the kernels run on."""
    return {"device": "CPU: every thread a fiber (GSVC_CUDA=fibers)", "compiler": compiler()[1]}
