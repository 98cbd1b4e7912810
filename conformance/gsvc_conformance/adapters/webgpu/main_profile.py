"""Profile `main` on WebGPU: the device on which `gsvc_conformance.adapters.main_frames` runs its kernels."""

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, Final

import numpy.typing as npt

from gsvc_conformance.adapters.main_frames import MainDecoder
from gsvc_conformance.adapters.webgpu import gpu
from gsvc_conformance.adapters.webgpu.gpu import Array

IN_FRONT: Final[Mapping[str, tuple[str, ...]]] = {
    "main_lists": (),
    "main_encode": (),
    "main_raw": (),
    "main_parameters": ("main_tables",),
}
"""The texts that stand in front of a shader; those that are not named have the last two."""


@cache
def shader(name: str) -> str:
    """The text of a shader of profile `main` with what has to stand in front of it."""
    parts = (*IN_FRONT.get(name, ("main_tables", "main_densities")), name)
    return "\n".join(gpu.wgsl(f"{part}.wgsl") for part in parts)


class Recording(gpu.Recording):
    """Dispatches of shaders of profile `main`."""

    def dispatch(
        self, module: str, kernel: str, workgroups: int, buffers: Mapping[int, Any], numbers: Sequence[int]
    ) -> None:
        """Add a dispatch of a shader of this folder."""
        super().dispatch(shader(module), kernel, workgroups, buffers, numbers)


class WebGpu:
    """The device, as `gsvc_conformance.adapters.main_operations` asks for it."""

    def storage(self, size: int) -> Any:
        """A buffer of so many bytes, all 0."""
        return gpu.storage(size)

    def upload(self, data: Array) -> Any:
        """A buffer that holds an array."""
        return gpu.upload(data)

    def download(self, buffer: Any, dtype: npt.DTypeLike, count: int) -> Array:
        """The first `count` numbers of a buffer."""
        return gpu.download(buffer, dtype, count)

    def recording(self) -> Recording:
        """An empty recording."""
        return Recording()


MAIN: Final = MainDecoder(WebGpu())
