"""The device, its kernels, and the way of arrays there and back."""

import os
import warnings
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyopencl as cl

Floats = np.ndarray[Any, np.dtype[np.float32]]
Array = np.ndarray[Any, Any]
Values = dict[str, Any]
"""Outputs of an operation by their names."""

KERNELS: Final = Path(__file__).parent / "kernels"
SOURCES: Final = (
    "splats",
    "lists",
    "render",
    "gradients",
    "reconstruct",
    "training",
    "pruning",
    "quantization",
    "codebooks",
    "checks",
    "main_entropy",
    "main_splats",
)
"""One program: what a file defines, those after it may use."""
NO_DEVICE: Final = (
    "there is no OpenCL device: install the driver of the GPU, or pocl-opencl-icd (Debian, Ubuntu), which takes the CPU"
)


@cache
def context() -> cl.Context:
    """The context of PYOPENCL_CTX, else of the first GPU, else of the first device; it is never given back.

    Raises
    ------
    RuntimeError
        There is no device, or not the one that PYOPENCL_CTX names.
    """
    try:
        platforms = cl.get_platforms()
    except cl.LogicError:  # what the loader says if it finds no driver
        platforms = []
    devices = [device for platform in platforms for device in platform.get_devices()]
    if not devices:
        raise RuntimeError(NO_DEVICE)
    if wanted := os.environ.get("PYOPENCL_CTX"):
        try:
            return cl.create_some_context(interactive=False)
        except cl.Error:
            there = [
                f"{number}:{place} ({device.name.strip()})"
                for number, platform in enumerate(platforms)
                for place, device in enumerate(platform.get_devices())
            ]
            raise RuntimeError(f"PYOPENCL_CTX={wanted} is not a device; there are {', '.join(there)}") from None
    gpus = [device for device in devices if device.type & cl.device_type.GPU]
    return cl.Context([(gpus or devices)[0]])


@cache
def device() -> cl.Device:
    """The first device of the context."""
    return context().devices[0]


@cache
def queue() -> cl.CommandQueue:
    """The only queue: what is launched runs in order, so that no kernel needs to be waited for."""
    return cl.CommandQueue(context(), device())


def has_binary64() -> bool:
    """Whether kernels may use double."""
    return bool(device().double_fp_config)


@cache
def tile() -> int:
    """Width and height of a tile: 16 pixels, or 8 where a work-group of 256 is too large."""
    return 16 if device().max_work_group_size >= 256 else 8


def lanes() -> int:
    """Work-items of a work-group: as many as a tile has pixels."""
    return tile() ** 2


def groups(items: int) -> int:
    """The number of work-groups for a number of work-items; the last one may have more than needed."""
    return -(-items // lanes())


@cache
def program(exact: bool) -> cl.Program:
    """All kernels, compiled for identical bytes (EXACT of splats.cl) or for speed.

    Raises
    ------
    NotImplementedError
        The device cannot do what identical bytes need; OpenCL leaves that to it.
    """
    options = ["-cl-std=CL1.2", f"-DTILE={tile()}"]
    if exact:
        options.append("-DEXACT")
        able = cl.device_fp_config
        if not device().single_fp_config & able.DENORM:
            raise NotImplementedError("the device has no subnormal binary32 numbers")
        if device().single_fp_config & able.CORRECTLY_ROUNDED_DIVIDE_SQRT:
            options.append("-cl-fp32-correctly-rounded-divide-sqrt")
        elif has_binary64():
            options.append("-DDIVIDE_IN_BINARY64")
        else:
            raise NotImplementedError("the device has no correctly rounded division")
    text = "".join(f'#line 1 "{name}.cl"\n' + (KERNELS / f"{name}.cl").read_text("utf-8") for name in SOURCES)
    with warnings.catch_warnings(action="ignore", category=cl.CompilerWarning):  # some drivers always report something
        built: cl.Program = cl.Program(context(), text).build(options=options, devices=[device()])
    return built


@cache
def kernel(name: str, exact: bool) -> cl.Kernel:
    """A kernel by its name."""
    return cl.Kernel(program(exact), name)


def launch(
    name: str, size: int | tuple[int, ...], *arguments: Any, group: tuple[int, ...] = (), exact: bool = False
) -> None:
    """Start a kernel; not if there are no work-items, which OpenCL 1.2 does not allow.

    Parameters
    ----------
    size
        Work-items. In one dimension they are rounded up to whole work-groups, so kernels look whether theirs exists.
    arguments
        Buffers, numbers and structures of NumPy, and plain ``int`` for ``uint``, ``float`` for ``float``.
    group
        Work-items of a work-group, where these are not `lanes`.
    """
    if size == 0 or (isinstance(size, tuple) and 0 in size):
        return
    whole, part = ((lanes() * groups(size),), (lanes(),)) if isinstance(size, int) else (size, group)
    plain = {int: np.uint32, float: np.float32}
    converted = [plain[type(value)](value) if type(value) in plain else value for value in arguments]
    kernel(name, exact)(queue(), whole, part, *converted)


def buffer(size: int) -> cl.Buffer:
    """A buffer of so many bytes on the device; an empty one, which OpenCL does not have, takes a byte."""
    return cl.Buffer(context(), cl.mem_flags.READ_WRITE, max(size, 1))


def upload(array: Array, dtype: Any) -> cl.Buffer:
    """An array on the device, as elements of a type."""
    values = np.ascontiguousarray(array, dtype)
    there = buffer(values.nbytes)
    if values.nbytes:
        cl.enqueue_copy(queue(), there, values)
    return there


def download(there: cl.Buffer, shape: tuple[int, ...], dtype: Any) -> Array:
    """The array that a buffer begins with."""
    array = np.empty(shape, dtype)
    if array.nbytes:
        cl.enqueue_copy(queue(), array, there)
    return array


def environment() -> dict[str, str]:
    """Device, driver and versions, for the kit's report."""
    return {
        "device": device().name.strip(),
        "platform": device().platform.version.strip(),
        "driver": device().driver_version.strip(),
        "opencl_c": device().opencl_c_version.strip(),
        "pyopencl": cl.VERSION_TEXT,
    }
