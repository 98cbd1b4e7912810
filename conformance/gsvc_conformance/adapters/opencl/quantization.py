"""Quantisation in training (spec.md 10.5 and 10.6)."""

import numpy as np

from gsvc_conformance.adapters.opencl.device import (
    Array,
    Floats,
    Values,
    buffer,
    download,
    groups,
    lanes,
    launch,
    upload,
)
from gsvc_conformance.adapters.opencl.training import total


def lsq_quantize(x: Floats, scale: Floats, offset: Floats, bits: int) -> Values:
    """LSQ+ codes of values, (N, C) u2: (10-16)."""
    codes = buffer(2 * x.size)
    quantizer = upload(scale, "f4"), upload(offset, "f4"), x.shape[1], float(2**bits - 1)
    launch("lsq_quantize", x.size, upload(x, "f4"), *quantizer, np.uint64(x.size), codes, exact=True)
    return {"codes": download(codes, x.shape, "u2")}


def lsq_dequantize(codes: Array, scale: Floats, offset: Floats) -> Values:
    """Values of LSQ+ codes, (N, C) f4: (10-17)."""
    values = buffer(4 * codes.size)
    quantizer = upload(scale, "f4"), upload(offset, "f4"), codes.shape[1]
    launch("lsq_dequantize", codes.size, upload(codes, "u2"), *quantizer, np.uint64(codes.size), values, exact=True)
    return {"values": download(values, codes.shape, "f4")}


def lsq_gradients(x: Floats, scale: Floats, offset: Floats, bits: int, grad_output: Floats) -> Values:
    """Straight-through gradients, (N, C), (C,) and (C,) f4: (10-19).

    Compiled exactly: whether t is inside is a decision, and must be that of `lsq_quantize`.
    """
    rows, channels = x.shape
    grad_x, grad_scale, grad_offset = buffer(4 * x.size), buffer(4 * channels), buffer(4 * channels)
    launch(
        "lsq_gradients", lanes() * channels, upload(x, "f4"), upload(scale, "f4"), upload(offset, "f4"),
        float(2**bits - 1), upload(grad_output, "f4"), rows, channels, grad_x, grad_scale, grad_offset, exact=True,
    )  # fmt: skip
    return {
        "grad_x": download(grad_x, x.shape, "f4"),
        "grad_scale": download(grad_scale, scale.shape, "f4"),
        "grad_offset": download(grad_offset, offset.shape, "f4"),
    }


def rvq_assign(x: Floats, codebook_sizes: Array, codebooks: Floats) -> Values:
    """The codeword of each vector in each stage, (N, M) u2: (10-20)."""
    stages, first = len(codebook_sizes), np.cumsum([0, *codebook_sizes])
    indices = buffer(2 * len(x) * stages)
    books = upload(first, "u4"), upload(codebooks, "f4"), stages
    launch("rvq_assign", len(x), upload(x, "f4"), *books, len(x), indices, exact=True)
    return {"indices": download(indices, (len(x), stages), "u2")}


def commitment(x: Floats, indices: Array, codebook_sizes: Array, codebooks: Floats) -> Values:
    """The commitment loss, () f8, and its gradient, (N, 3) f4: (10-21)."""
    components = float(max(3 * len(x), 1))
    first = np.cumsum([0, *codebook_sizes])
    grad_x, partial = buffer(12 * len(x)), buffer(4 * groups(len(x)))
    books = upload(first, "u4"), upload(codebooks, "f4"), len(codebook_sizes)
    launch("commitment", len(x), upload(x, "f4"), upload(indices, "u2"), *books, len(x), components, grad_x, partial)
    return {"loss": total(partial, groups(len(x)), components), "grad_x": download(grad_x, x.shape, "f4")}


def rvq_update(
    x: Floats, indices: Array, codebook_sizes: Array, codebooks: Floats, counts: Array, sums: Array, uniforms: Array,
    decay: float, smoothing: float, dead_count: float,
) -> Values:  # fmt: skip
    """One step of the codebooks' averages: (K,) f8, (K, 3) f8 and (K, 3) f4, all in binary32: R-10.6-3."""
    if len(x) == 0:
        return {"counts": counts, "sums": sums, "codebooks": codebooks}
    stages, first = len(codebook_sizes), upload(np.cumsum([0, *codebook_sizes]), "u4")
    chosen, residuals = upload(indices, "u2"), buffer(12 * len(x) * (stages + 1))
    state = new_counts, new_sums, books = upload(counts, "f4"), upload(sums, "f4"), upload(codebooks, "f4")
    launch("rvq_residuals", len(x), upload(x, "f4"), chosen, first, books, stages, len(x), residuals)
    used = residuals, chosen, first, stages, len(x)
    launch("rvq_average", lanes() * len(counts), *used, decay, 1 - decay, new_counts, new_sums)
    launch("rvq_move", lanes() * stages, first, new_counts, new_sums, smoothing, books)
    draws = dead_count, upload(uniforms, "f4"), buffer(4 * len(x))
    launch("rvq_replace_dead", lanes(), residuals, first, stages, len(x), *draws, *state)
    launch("round_to_half", codebooks.size, books, codebooks.size, buffer(2 * codebooks.size))
    return {
        "counts": download(new_counts, counts.shape, "f4").astype("f8"),
        "sums": download(new_sums, sums.shape, "f4").astype("f8"),
        "codebooks": download(books, codebooks.shape, "f4"),
    }
