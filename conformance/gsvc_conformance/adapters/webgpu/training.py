"""Gradients: the host's side of gradients.wgsl."""

from typing import Any

import numpy as np

from gsvc_conformance.adapters.webgpu.gpu import Array, download, groups, run, storage, uniform, upload, wgsl
from gsvc_conformance.adapters.webgpu.rendering import SPLATS_OF_SLICE, bands


def gradients(parameters: Array, residual: Array) -> Array:
    """(10-7) to (10-9) of splats f4 (N, 8), from dL/dC f4 (H, W, 3): f4 (N, 8)."""
    slices = range(0, len(parameters), SPLATS_OF_SLICE)
    parts = [_gradients_of_slice(parameters[first : first + SPLATS_OF_SLICE], residual) for first in slices]
    return np.concatenate([np.zeros((0, 8), np.float32), *parts])


def _gradients_of_slice(parameters: Array, residual: Array) -> Array:
    height, width, _ = residual.shape
    splats = len(parameters)
    buffers: dict[int, Any] = {1: upload(parameters), 3: storage(48 * splats), 4: storage(32 * splats)}
    for first_row, rows in bands(width, height):
        buffers[0] = uniform(np.array([width, first_row, rows, splats], np.uint32))
        buffers[2] = upload(residual[first_row : first_row + rows])
        run(wgsl("gradients.wgsl"), [("moments", (splats,), (0, 1, 2, 3))], buffers)
    run(wgsl("gradients.wgsl"), [("finish", (groups(splats, 64),), (0, 1, 3, 4))], buffers)
    return download(buffers[4], np.float32, 8 * splats).reshape(-1, 8)
