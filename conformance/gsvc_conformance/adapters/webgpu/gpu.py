"""The little of WebGPU's API that the operations need: a device, buffers, and passes of compute shaders."""

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import wgpu

Array = npt.NDArray[Any]

Pass = tuple[str, Sequence[int], Sequence[int]]
"""An entry point, its workgroups in x, y and z, and the numbers of the bindings that it uses."""

_STORAGE: Final = wgpu.BufferUsage.STORAGE | wgpu.BufferUsage.COPY_SRC | wgpu.BufferUsage.COPY_DST


UNIFORM_STEP: Final = 256
"""Bytes from the uniform of a dispatch to that of the next one: the alignment that every device allows."""


NO_DEVICE: Final = (
    "there is no WebGPU device: install the driver of the GPU for Vulkan, or mesa-vulkan-drivers (Debian, Ubuntu), "
    "whose lavapipe takes the CPU"
)


@cache
def device() -> Any:
    """The device that all operations share; WGPUPY_WGPU_ADAPTER_NAME chooses another one than the fastest.

    Raises
    ------
    RuntimeError
        There is none, or not the one of that name.
    """
    try:
        adapter = wgpu.gpu.request_adapter_sync(power_preference="high-performance")
    except (RuntimeError, ValueError) as error:
        there = ", ".join(other.info["device"] for other in wgpu.gpu.enumerate_adapters_sync())
        raise RuntimeError(f"{error} There are: {there}" if there else NO_DEVICE) from None
    limits = ("max-buffer-size", "max-storage-buffer-binding-size")
    return adapter.request_device_sync(required_limits={name: adapter.limits[name] for name in limits})


@cache
def pipeline(shader: str, entry_point: str) -> Any:
    """The compute pipeline of an entry point; its layout has the bindings that it uses."""
    return device().create_compute_pipeline(
        layout="auto", compute={"module": _module(shader), "entry_point": entry_point}
    )


@cache
def _module(shader: str) -> Any:
    return device().create_shader_module(code=shader)


@cache
def wgsl(name: str) -> str:
    """The text of a shader of this folder."""
    return Path(__file__).with_name(name).read_text(encoding="utf-8")


def storage(size: int) -> Any:
    """A storage buffer of zeros: whole words, and never empty, since an empty one can't be bound."""
    return device().create_buffer(size=max(4, -(-size // 4) * 4), usage=_STORAGE)


def upload(data: Array) -> Any:
    """A storage buffer that holds an array."""
    buffer = storage(data.nbytes)
    if data.nbytes > 0:
        raw = data.tobytes()
        device().queue.write_buffer(buffer, 0, raw + bytes(-len(raw) % 4))
    return buffer


def uniform(*fields: Array | np.generic) -> Any:
    """A uniform buffer of fields, one after the other; the caller knows the alignment."""
    raw = b"".join(field.tobytes() for field in fields)
    return device().create_buffer_with_data(data=raw + bytes(-len(raw) % 16), usage=wgpu.BufferUsage.UNIFORM)


def run(shader: str, passes: Sequence[Pass], buffers: Mapping[int, Any]) -> None:
    """Dispatch passes one after the other; each sees what the ones before have written.

    Parameters
    ----------
    shader
        The text of the module.
    passes
        In their order.
    buffers
        By their binding in group 0.
    """
    encoder = device().create_command_encoder()
    for entry_point, workgroups, bindings in passes:
        chosen = pipeline(shader, entry_point)
        entries = [{"binding": binding, "resource": {"buffer": buffers[binding]}} for binding in bindings]
        group = device().create_bind_group(layout=chosen.get_bind_group_layout(0), entries=entries)
        compute = encoder.begin_compute_pass()
        compute.set_pipeline(chosen)
        compute.set_bind_group(0, group)
        compute.dispatch_workgroups(*workgroups)
        compute.end()
    device().queue.submit([encoder.finish()])


class Recording:
    """Dispatches that are handed to the device together; each sees what the ones before have written."""

    def __init__(self) -> None:
        self._dispatches: list[tuple[Any, int, Mapping[int, Any], bool]] = []
        self._uniforms: list[bytes] = []

    def dispatch(
        self, shader: str, entry_point: str, workgroups: int, buffers: Mapping[int, Any], numbers: Sequence[int]
    ) -> None:
        """Add a dispatch; none if it has no workgroups.

        Parameters
        ----------
        shader
            The text of the module.
        entry_point
            Its name.
        workgroups
            In x.
        buffers
            By their binding in group 0, from binding 1 on.
        numbers
            Integers of 32 bits, signed or not: the structure at binding 0; what is missing at its end is 0. Without any
            there is no binding 0.
        """
        if workgroups > 0:
            self._dispatches.append((pipeline(shader, entry_point), workgroups, buffers, bool(numbers)))
            raw = np.array([number & 0xFFFFFFFF for number in numbers], np.uint32).tobytes()
            self._uniforms.append(raw + bytes(UNIFORM_STEP - len(raw)))

    def submit(self) -> None:
        """Hand everything to the device."""
        if not self._dispatches:
            return
        shared = device().create_buffer_with_data(data=b"".join(self._uniforms), usage=wgpu.BufferUsage.UNIFORM)
        encoder = device().create_command_encoder()
        compute = encoder.begin_compute_pass()
        for place, (chosen, workgroups, buffers, has_uniform) in enumerate(self._dispatches):
            own = {"buffer": shared, "offset": UNIFORM_STEP * place, "size": UNIFORM_STEP}
            entries: list[dict[str, Any]] = [{"binding": 0, "resource": own}] if has_uniform else []
            entries += [{"binding": binding, "resource": {"buffer": buffer}} for binding, buffer in buffers.items()]
            compute.set_pipeline(chosen)
            compute.set_bind_group(0, device().create_bind_group(layout=_layout(chosen), entries=entries))
            compute.dispatch_workgroups(workgroups)
        compute.end()
        device().queue.submit([encoder.finish()])
        self._dispatches.clear()
        self._uniforms.clear()


@cache
def _layout(chosen: Any) -> Any:
    return chosen.get_bind_group_layout(0)


def download(buffer: Any, dtype: npt.DTypeLike, count: int) -> Array:
    """The first `count` numbers of a storage buffer."""
    return np.frombuffer(device().queue.read_buffer(buffer), dtype, count)


def groups(things: int, size: int) -> int:
    """The number of groups of a size that hold all things."""
    return -(-things // size)
