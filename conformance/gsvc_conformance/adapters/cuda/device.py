"""The device and the way of arrays there and back: an NVIDIA GPU (gpu.py), or fibers on the CPU (fibers.py).

A kernel is started by its name: ``launch("to_frame", blocks, threads, ...)``. Its arguments become an array of
addresses, as `cuLaunchKernel` wants it, and fibers.h unpacks the same array for the kernel of a C++ compiler. So their
types must be those of the parameters: a buffer or None is a pointer, an ``int`` is ``int``, a ``float`` is ``float``,
and every other argument, such as a structure, is a NumPy scalar.

Launches run in order on CuPy's current stream and nobody waits for them: errors of a kernel come with the next
`download` or `synchronize`.
"""

import ctypes
import os
from collections.abc import Callable
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np

from gsvc_conformance.adapters.cuda.errors import NO_CUPY

Array = np.ndarray[Any, Any]
Floats = np.ndarray[Any, np.dtype[np.float32]]
Values = dict[str, Any]
"""Outputs of an operation by their names."""
Buffer = Any
"""Bytes on the device: a CuPy array u1 (size,), or a NumPy array with fibers; a slice of one is a buffer, too."""
Size = int | tuple[int, ...]
"""Blocks, or threads of a block, in one to three dimensions."""


@cache
def machine() -> ModuleType:
    """Where kernels run: `gpu`, or `fibers` if GSVC_CUDA says so.

    Raises
    ------
    RuntimeError
        CuPy is not installed, or GSVC_CUDA is another word.
    """
    wanted = os.environ.get("GSVC_CUDA")
    if wanted not in (None, "", "gpu", "fibers"):
        raise RuntimeError(f"GSVC_CUDA={wanted} is neither gpu nor fibers")
    if wanted == "fibers":
        from gsvc_conformance.adapters.cuda import fibers

        return fibers
    try:
        from gsvc_conformance.adapters.cuda import gpu
    except ImportError as error:
        raise RuntimeError(f"{NO_CUPY} ({error})") from None
    return gpu


def available() -> bool:
    """Whether kernels can run here."""
    try:
        return bool(environment())
    except (RuntimeError, NotImplementedError):
        return False


def environment() -> dict[str, str]:
    """Device, driver and versions, for the kit's report.

    Raises
    ------
    RuntimeError, NotImplementedError
        There is no GPU, no driver that is new enough, no CuPy, or no C++ compiler for fibers: which, and what to do.
    """
    return dict(machine().environment())


def storage(size: int) -> Buffer:
    """So many bytes on the device, all zero; none at all takes a byte."""
    return machine().storage(max(size, 1))


def upload(array: Any, dtype: Any) -> Buffer:
    """An array on the device, as elements of a type."""
    values = np.ascontiguousarray(array, dtype)
    return machine().upload(values) if values.nbytes else storage(1)


def write(buffer: Buffer, array: Any, dtype: Any) -> None:
    """Let a buffer begin with an array, as elements of a type, in the order of launches."""
    values = np.ascontiguousarray(array, dtype)
    if values.nbytes:
        machine().write(buffer, values)


def address(buffer: Buffer) -> int:
    """Where a buffer is on the device, for a pointer inside of a structure."""
    return int(machine().address(buffer))


def clear(buffer: Buffer) -> None:
    """Set a buffer to zero, in the order of launches."""
    machine().clear(buffer)


def replay(work: Callable[[], None]) -> Callable[[], None]:
    """Do some work, and return a call that starts all that it launched again: a CUDA graph, almost free for the host.

    Parameters
    ----------
    work
        It only launches and clears: it allocates nothing, downloads nothing, and does the same each time. It is done
        once before it is recorded, so that all kernels are compiled.
    """
    work()
    replayed: Callable[[], None] = machine().replay(work)
    return replayed


def download(buffer: Buffer, shape: tuple[int, ...], dtype: Any) -> Array:
    """The array that a buffer begins with; it waits for the kernels before it."""
    count = int(np.prod(shape, dtype=np.int64))
    values: Array = machine().download(buffer, count * np.dtype(dtype).itemsize).view(dtype).reshape(shape)
    return values


def synchronize() -> None:
    """Wait until all that was launched has ended."""
    machine().synchronize()


def stream() -> Any:
    """A stream beside the others, as CuPy has them: ``with`` makes it the current one."""
    return machine().stream()


def milliseconds(start: Any, end: Any) -> float:
    """The time between two events that streams have recorded, once both have happened."""
    return float(machine().milliseconds(start, end))


def pinned(size: int) -> Array:
    """So many bytes of the host, all zero, for `send` and `fetch`."""
    memory: Array = machine().pinned(max(size, 1))
    return memory


def send(values: Array, buffer: Buffer) -> None:
    """Copy pinned bytes to the beginning of a buffer in the order of the current stream: nobody waits."""
    machine().send(values, buffer)


def fetch(buffer: Buffer, values: Array) -> None:
    """Copy the beginning of a buffer to pinned bytes in the order of the current stream: nobody waits."""
    machine().fetch(buffer, values)


class Launch:
    """A kernel with its arguments, which may be started many times: a call of it costs little more than CUDA's own.

    Parameters
    ----------
    kernel
        Its name.
    blocks, threads
        The grid, and a block of it. With an empty grid nothing is started.
    arguments
        They are kept alive, and read when the kernel starts; an array of ctypes is a structure that may change between.
    exact
        Whether it is compiled for identical bytes: nothing fused, EXACT defined.
    """

    def __init__(self, kernel: str, blocks: Size, threads: Size, *arguments: Any, exact: bool = False) -> None:
        self.kernel, self.blocks, self.threads = kernel, _three(blocks), _three(threads)
        self._function = machine().function(kernel, exact)
        self._buffers = arguments
        self._values = [_argument(value) for value in arguments]
        self._addresses = (ctypes.c_void_p * len(arguments))(*map(ctypes.addressof, self._values))
        self._where = ctypes.addressof(self._addresses)

    def __call__(self) -> None:
        """Start the kernel."""
        if 0 not in self.blocks:
            self._function(self.blocks, self.threads, self._where)


def launch(kernel: str, blocks: Size, threads: Size, *arguments: Any, exact: bool = False) -> None:
    """Start a kernel once: see `Launch`."""
    Launch(kernel, blocks, threads, *arguments, exact=exact)()


def _three(size: Size) -> tuple[int, ...]:
    sizes = (size,) if isinstance(size, int) else size
    return *sizes, *(1,) * (3 - len(sizes))


def _argument(value: Any) -> Any:
    """A parameter of a kernel in memory."""
    if isinstance(value, ctypes.Array):
        return value
    if isinstance(value, np.generic):
        return ctypes.create_string_buffer(value.tobytes(), value.nbytes)
    if type(value) is int:
        if not -(2**31) <= value < 2**31:
            raise OverflowError(f"{value} is not in the range of an int")
        return ctypes.c_int(value)
    if type(value) is float:
        return ctypes.c_float(value)
    return ctypes.c_void_p(None if value is None else machine().address(value))
