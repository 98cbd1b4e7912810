"""Reconstruction: the host's side of reconstruct.wgsl and values.wgsl."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from gsvc_conformance.adapters.webgpu.gpu import Array, download, groups, run, storage, uniform, upload, wgsl

VALUES_OF_SLICE: Final = 2**23
"""A dispatch has at most 65,535 workgroups, of 256 values here."""


def block(
    name: str,
    size: tuple[int, int],
    count: int,
    positions: Array,
    cholesky: Array,
    scale: Array,
    offset: Array,
    color_indices: Array,
    codebook_sizes: Array,
    codewords: Array,
    reference: Array | None = None,
    survivors: Array | None = None,
) -> Array:
    """The splats of a block: f4 (count, 8).

    Parameters
    ----------
    name
        The pass: ``intra`` or ``inter``.
    size
        Width and height of the frame.
    count
        Splats of the block.
    positions, cholesky, scale, offset, color_indices, codebook_sizes, codewords
        As section 4.3 has them; no rows for what is not present.
    reference
        The frame before, f4 (N, 8), for ``inter``.
    survivors
        The numbers of those splats of it that stay, i8 (count,), for ``inter``.
    """
    present = [int(len(codes) > 0) for codes in (positions, cholesky, color_indices)]
    stages = len(codebook_sizes)
    first_of_stage = np.zeros(8, np.uint32)
    first_of_stage[:stages] = np.cumsum(codebook_sizes) - codebook_sizes
    fields: list[Array] = [
        np.array(size, np.float32) / 2,
        np.array([count, stages, *present, 0], np.uint32),  # a vec4 begins at a multiple of 16 bytes
        np.array([*scale, 0, *offset, 0], np.float32),
        first_of_stage,
    ]
    buffers = {
        0: uniform(*fields),
        1: upload(positions),
        2: upload(cholesky.astype(np.uint32)),
        3: upload(color_indices.astype(np.uint32)),
        4: upload(codewords.astype(np.uint32)),
        7: storage(32 * count),
    }
    bindings = [0, 1, 2, 3, 4, 7]
    if reference is not None and survivors is not None:
        buffers |= {5: upload(reference), 6: upload(survivors.astype(np.uint32))}
        bindings += [5, 6]
    run(_shader("reconstruct.wgsl"), [(name, (groups(count, 256),), bindings)], buffers)
    return download(buffers[7], np.float32, 8 * count).reshape(-1, 8)


def each_value(name: str, values: Array, sizes: Sequence[int] = (0, 0, 0, 0), quantizers: Array | None = None) -> Array:
    """The result of a pass of values.wgsl for each number: u4 of the values' shape, binary32 patterns or codes.

    Parameters
    ----------
    name
        The pass.
    values
        Binary32, or codes of 16 bits.
    sizes
        Width and height of a frame, and those that it gets.
    quantizers
        Scale and offset of each column: f4 (C, 2).
    """
    columns = values.shape[1] if values.ndim == 2 else 1
    patterns = values.view(np.uint32) if values.dtype == np.float32 else values.astype(np.uint32)
    most = VALUES_OF_SLICE // columns * columns
    slices = [patterns.ravel()[first : first + most] for first in range(0, values.size, most)]
    results = [_each_of_slice(name, part, (columns, *sizes), quantizers) for part in slices]
    return np.concatenate([np.zeros(0, np.uint32), *results]).reshape(values.shape)


def _each_of_slice(name: str, patterns: Array, columns_and_sizes: Sequence[int], quantizers: Array | None) -> Array:
    count = len(patterns)
    buffers = {
        0: uniform(np.array([count, *columns_and_sizes], np.uint32)),
        1: upload(patterns),
        3: storage(4 * count),
    }
    bindings = [0, 1, 3]
    if quantizers is not None:
        buffers[2] = upload(quantizers)
        bindings.append(2)
    run(_shader("values.wgsl"), [(name, (groups(count, 256),), bindings)], buffers)
    return download(buffers[3], np.uint32, count)


def _shader(name: str) -> str:
    return wgsl("binary32.wgsl") + wgsl(name)
