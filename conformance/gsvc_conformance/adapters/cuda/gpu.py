"""The kernels on an NVIDIA GPU: memory, compilation and launches by CuPy."""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, Final

import cupy
import numpy as np
from cupy.cuda import driver, nvrtc, runtime
from cupy.cuda.function import Module

from gsvc_conformance.adapters.cuda.errors import NO_NVRTC, advice
from gsvc_conformance.adapters.cuda.sources import KERNELS, PLANTED, ROUNDING, kept, source_of

Array = np.ndarray[Any, Any]

ERRORS: Final = (cupy.cuda.memory.OutOfMemoryError, runtime.CUDARuntimeError, driver.CUDADriverError)


def explained(error: Exception) -> RuntimeError:
    """An error of CUDA or of CuPy's memory as one that says what to do."""
    if isinstance(error, cupy.cuda.memory.OutOfMemoryError):
        return RuntimeError(advice(f"OutOfMemory: {error}"))
    return RuntimeError(advice(str(error)))


@contextmanager
def explaining() -> Iterator[None]:
    """Within it, errors of CUDA become sentences."""
    try:
        yield
    except ERRORS as error:
        raise explained(error) from None


@cache
def compiler() -> tuple[int, int]:
    """The version of NVRTC.

    Raises
    ------
    RuntimeError
        There is none.
    """
    try:
        major, minor = nvrtc.getVersion()
    except RuntimeError as error:
        raise RuntimeError(f"{NO_NVRTC} ({str(error).splitlines()[0]})") from None
    return major, minor


@cache
def architecture() -> str:
    """What to compile for: the device, such as ``sm_90``, or what the driver translates, if NVRTC is older than that.

    Raises
    ------
    RuntimeError
        There is no GPU, its driver is too old, or there is no NVRTC.
    """
    with explaining():
        runtime.getDeviceCount()  # of no device it is an error
        capability = int(cupy.cuda.Device().compute_capability)
    compiler()
    known = [number for number in nvrtc.getSupportedArchs() if number <= capability]
    return f"sm_{capability}" if capability in known else f"compute_{max(known)}"


def storage(size: int) -> cupy.ndarray:
    """So many bytes on the device, all zero."""
    architecture()  # which says what is missing
    with explaining():
        return cupy.zeros(size, np.uint8)


def upload(values: Array) -> cupy.ndarray:
    """A buffer with the bytes of an array."""
    buffer = storage(values.nbytes)
    with explaining():
        buffer.set(values.reshape(-1).view(np.uint8))
    return buffer


def write(buffer: cupy.ndarray, values: Array) -> None:
    """Let a buffer begin with the bytes of an array."""
    with explaining():
        buffer[: values.nbytes].set(values.reshape(-1).view(np.uint8))


def download(buffer: cupy.ndarray, size: int) -> Array:
    """The first bytes of a buffer."""
    with explaining():
        return np.asarray(buffer[:size].get())


def address(buffer: cupy.ndarray) -> int:
    """Where a buffer is."""
    return int(buffer.data.ptr)


def clear(buffer: cupy.ndarray) -> None:
    """Set a buffer to zero, in the order of the current stream."""
    with explaining():
        buffer.data.memset_async(0, buffer.nbytes, cupy.cuda.get_current_stream())


def replay(work: Callable[[], None]) -> Callable[[], None]:
    """Work as a graph, recorded from what it launches on a stream of its own and started on the current one."""
    stream = cupy.cuda.Stream(non_blocking=True)
    with explaining(), stream:
        stream.begin_capture()
        work()
        graph = stream.end_capture()

    def start(_kept: Callable[[], None] = work) -> None:  # with its buffers, whose addresses are in the graph
        graph.launch(cupy.cuda.get_current_stream())

    return start


def synchronize() -> None:
    """Wait for what was launched on the current stream, and hear of its errors."""
    with explaining():
        cupy.cuda.get_current_stream().synchronize()


def stream() -> cupy.cuda.Stream:
    """A stream beside the others: ``with`` makes it the current one."""
    architecture()
    return cupy.cuda.Stream(non_blocking=True)


def milliseconds(start: cupy.cuda.Event, end: cupy.cuda.Event) -> float:
    """The time between two events that have happened."""
    elapsed: float = cupy.cuda.get_elapsed_time(start, end)
    return elapsed


def pinned(size: int) -> Array:
    """Bytes of the host that the device copies without waiting for anybody, all zero."""
    with explaining():
        memory = cupy.cuda.alloc_pinned_memory(size)
    array = np.frombuffer(memory, np.uint8, size)
    array[:] = 0
    return array


def send(values: Array, buffer: cupy.ndarray) -> None:
    """Copy pinned bytes to the beginning of a buffer, in the order of the current stream."""
    with explaining():
        buffer.data.copy_from_host_async(values.ctypes.data, values.nbytes)


def fetch(buffer: cupy.ndarray, values: Array) -> None:
    """Copy the beginning of a buffer to pinned bytes, in the order of the current stream."""
    with explaining():
        buffer.data.copy_to_host_async(values.ctypes.data, values.nbytes)


def compiled(source: str, exact: bool, machine: str) -> bytes:
    """A file of kernels as a cubin for an architecture, such as ``sm_90``, or as PTX for ``compute_90``; without a GPU.

    Not by RawModule or RawKernel: these add ``-ftz=true`` to the options that they get.
    """
    options = ("--std=c++17", f"--gpu-architecture={machine}", f"--include-path={KERNELS}", *ROUNDING[exact], *PLANTED)
    text = (KERNELS / f"{source}.cu").read_text("utf-8")

    def make(path: Path) -> None:
        program = nvrtc.createProgram(text, f"{source}.cu", (), ())
        try:
            nvrtc.compileProgram(program, options)
            is_ptx = machine.startswith("compute_")
            path.write_bytes(nvrtc.getPTX(program) if is_ptx else nvrtc.getCUBIN(program))
        except nvrtc.NVRTCError as error:
            log = nvrtc.getProgramLog(program)
            raise RuntimeError(f"NVRTC does not compile {source}.cu for {machine}: {error}\n{log}") from None
        finally:
            nvrtc.destroyProgram(program)

    return kept(".cubin", [repr(compiler()), text, *options], make).read_bytes()


@cache
def module(source: str, exact: bool) -> Module:
    """A file of kernels on the device."""
    loaded = Module()
    binary = compiled(source, exact, architecture())
    with explaining():
        loaded.load(binary)
    return loaded


@cache
def function(kernel: str, exact: bool) -> Callable[[tuple[int, ...], tuple[int, ...], Any], None]:
    """What starts a kernel: it takes blocks, threads of a block, and an array of the addresses of its arguments."""
    found = module(source_of(kernel), exact).get_function(kernel)

    def start(blocks: tuple[int, ...], threads: tuple[int, ...], arguments: Any) -> None:
        stream = cupy.cuda.get_current_stream().ptr
        try:
            driver.launchKernel(found.ptr, *blocks, *threads, 0, stream, arguments, 0)
        except ERRORS as error:
            raise explained(error) from None

    return start


def environment() -> dict[str, str]:
    """Card, driver and versions."""
    architecture()  # which says what is missing
    properties = runtime.getDeviceProperties(cupy.cuda.Device().id)
    return {
        "device": properties["name"].decode(),
        "compute_capability": cupy.cuda.Device().compute_capability,
        "driver": _driver(),
        "NVRTC": ".".join(map(str, compiler())),
        "CuPy": cupy.__version__,
    }


def _driver() -> str:
    """The driver's own version, where the system tells it, and that of the CUDA that it can do."""
    file, cuda = Path("/proc/driver/nvidia/version"), runtime.driverGetVersion()
    found = re.search(r"\b\d{3}\.[\d.]*\d\b", file.read_text("utf-8")) if file.exists() else None
    return f"{found.group() if found else 'unknown'}, CUDA {cuda // 1000}.{cuda % 1000 // 10}"
