"""Profile `main` on OpenCL: the device on which `gsvc_conformance.adapters.main_frames` runs its kernels."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pyopencl as cl

from gsvc_conformance.adapters.main_frames import MainDecoder
from gsvc_conformance.adapters.opencl import device
from gsvc_conformance.adapters.opencl.device import Array

ONE_GROUP: Final = ("choose", "starts", "offsets")
"""Kernels that are one work-group of LANES."""
LANES: Final = 64
"""MAIN_LANES of main_entropy.cl."""
LANES_OF_GROUPS: Final = {"read_modeled": 32, "read_densities": 32, "encode": 64}
"""Work-items of a work-group of these kernels."""
ITEMS: Final = 256
"""Work-items of what main_frames.py counts as a workgroup of the other kernels."""
NUMBERS: Final = np.dtype([("n", "i4", 24)])
"""Numbers of main_entropy.cl."""


class Recording:
    """Kernels in the order of a queue, which starts them as they come."""

    def dispatch(
        self, module: str, kernel: str, workgroups: int, buffers: Mapping[int, Any], numbers: Sequence[int]
    ) -> None:
        """Start a kernel; its module is a shader of another adapter."""
        arguments = [buffers[number] for number in sorted(buffers)]
        if numbers:
            told = np.zeros((), NUMBERS)
            told["n"][: len(numbers)] = np.array([number & 0xFFFFFFFF for number in numbers], np.uint32).view(np.int32)
            arguments.append(told)
        size: tuple[tuple[int, ...], tuple[int, ...] | None] = ((ITEMS * workgroups,), None)
        if kernel in ONE_GROUP:
            size = (LANES,), (LANES,)
        elif (lanes := LANES_OF_GROUPS.get(kernel)) is not None:
            size = (lanes * workgroups,), (lanes,)
        if workgroups > 0:
            device.kernel(f"main_{kernel}", False)(device.queue(), *size, *arguments)

    def submit(self) -> None:
        """Nothing waits to be handed over."""


class OpenCl:
    """The device, as `gsvc_conformance.adapters.main_operations` asks for it."""

    def storage(self, size: int) -> cl.Buffer:
        """A buffer of so many bytes, all 0."""
        buffer = device.buffer(size)
        if size:
            cl.enqueue_fill_buffer(device.queue(), buffer, np.zeros(1, np.uint8), 0, size)
        return buffer

    def upload(self, data: Array) -> cl.Buffer:
        """A buffer that holds an array."""
        return device.upload(data, data.dtype)

    def download(self, buffer: cl.Buffer, dtype: npt.DTypeLike, count: int) -> Array:
        """The first `count` numbers of a buffer."""
        return device.download(buffer, (count,), dtype)

    def recording(self) -> Recording:
        """An empty recording."""
        return Recording()


MAIN: Final = MainDecoder(OpenCl())
