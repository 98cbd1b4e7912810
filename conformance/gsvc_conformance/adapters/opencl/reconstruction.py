"""Splats from codes, and what is checked of them (spec.md 5, 6.4 and 8)."""

from typing import Any, Final

import numpy as np
import pyopencl as cl

from gsvc_conformance.adapters.opencl.device import (
    Array,
    Floats,
    Values,
    buffer,
    download,
    groups,
    has_binary64,
    lanes,
    launch,
    upload,
)

BLOCK: Final = np.dtype([
    ("positions_present", "u4"), ("cholesky_present", "u4"), ("colors_present", "u4"), ("stage_count", "u4"),
    ("half_width", "f4"), ("half_height", "f4"),
])  # fmt: skip
"""Block of reconstruct.cl."""

WORDS_OF_A_RUN: Final = 32
"""RUN of checks.cl."""


def from_half(bits: Array) -> Values:
    """The values of binary16 patterns, (N,) f4: (8-5)."""
    values = buffer(4 * len(bits))
    launch("from_half", len(bits), upload(bits, "u2"), len(bits), values, exact=True)
    return {"values": download(values, bits.shape, "f4")}


def to_half(values: Floats) -> Values:
    """The binary16 patterns nearest to values, (N,) u2: (8-6)."""
    bits = buffer(2 * len(values))
    launch("to_half", len(values), upload(values, "f4"), len(values), bits, exact=True)
    return {"bits": download(bits, values.shape, "u2")}


def reconstruct_intra(
    width: int, height: int, positions: Array, cholesky: Array, scale: Floats, offset: Floats, color_indices: Array,
    codebook_sizes: Array, codewords: Array,
) -> Values:  # fmt: skip
    """The splats that the codes of an intra block stand for, (N, 8) f4: R-8-1 is for the host to check."""
    count = len(positions)
    codes = uploaded(positions, cholesky, scale, offset, color_indices, codebook_sizes, codewords)
    block = np.array((1, 1, 1, len(codebook_sizes), width / 2, height / 2), BLOCK)
    parameters = buffer(32 * count)
    launch("reconstruct_intra", count, *codes, block, count, parameters, exact=True)
    return {"parameters": download(parameters, (count, 8), "f4")}


def reconstruct_inter(
    width: int, height: int, reference: Floats, survivors: Array, positions: Array, cholesky: Array, scale: Floats,
    offset: Floats, color_indices: Array, codebook_sizes: Array, codewords: Array,
) -> Values:  # fmt: skip
    """The survivors of a frame after the differences of an inter block, (n, 8) f4."""
    before, count = len(reference), int(np.count_nonzero(survivors))
    stays, rank = upload(survivors, "u4"), buffer(8 * (before + 1))
    launch("scan", lanes(), stays, before, rank, exact=True)
    codes = uploaded(positions, cholesky, scale, offset, color_indices, codebook_sizes, codewords)
    present = (len(attribute) > 0 for attribute in (positions, cholesky, color_indices))
    block = np.array((*present, len(codebook_sizes), width / 2, height / 2), BLOCK)
    parameters = buffer(32 * count)
    launch(
        "reconstruct_inter",
        before,
        upload(reference, "f4"),
        stays,
        rank,
        *codes,
        block,
        before,
        parameters,
        exact=True,
    )
    return {"parameters": download(parameters, (count, 8), "f4")}


def uploaded(
    positions: Array, cholesky: Array, scale: Floats, offset: Floats, color_indices: Array, codebook_sizes: Array,
    codewords: Array,
) -> tuple[cl.Buffer, ...]:  # fmt: skip
    """The codes of a block on the device, and where the codewords of each stage begin."""
    first = np.cumsum([0, *codebook_sizes])
    arrays: list[tuple[Array, Any]] = [
        (positions, "u2"), (cholesky, "u2"), (scale, "f4"), (offset, "f4"), (color_indices, "u2"), (first, "u4"),
        (codewords, "u2"),
    ]  # fmt: skip
    return tuple(upload(array, dtype) for array, dtype in arrays)


def rendering_work(parameters: Floats, width: int, height: int) -> Values:
    """The number of pixels in the boxes of splats, () i8: (5-1), in binary64."""
    if not has_binary64():
        raise NotImplementedError("the device has no binary64, which (5-1) asks for")
    partial = buffer(8 * groups(len(parameters)))
    launch(
        "rendering_work",
        len(parameters),
        upload(parameters, "f4"),
        len(parameters),
        width,
        height,
        partial,
        exact=True,
    )
    return {"work": download(partial, (groups(len(parameters)),), "i8").sum(dtype="i8")}


def parameter_checksum(parameters: Floats) -> Values:
    """The CRC-32C of a frame's parameters, () i8: R-6.4-3."""
    checksum = upload(np.array([2**32 - 1]), "u4")
    runs = max(-(-8 * len(parameters) // WORDS_OF_A_RUN), 1)
    launch("parameter_checksum", runs, upload(parameters, "f4"), np.uint64(len(parameters)), checksum, exact=True)
    return {"checksum": download(checksum, (1,), "u4").astype("i8")[0]}
