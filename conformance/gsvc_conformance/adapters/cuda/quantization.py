"""Quantisation in training (spec.md 10.5 and 10.6)."""

import numpy as np

from gsvc_conformance.adapters.cuda.device import Array, Buffer, Floats, Values, download, launch, storage, upload
from gsvc_conformance.adapters.cuda.training import THREADS, blocks, total


def lsq_quantize(x: Floats, scale: Floats, offset: Floats, bits: int) -> Values:
    """LSQ+ codes of values, (N, C) u2: (10-16)."""
    codes = storage(2 * x.size)
    quantizer = upload(scale, "f4"), upload(offset, "f4"), x.shape[1], float(2**bits - 1)
    launch("lsq_quantize", blocks(x.size), THREADS, upload(x, "f4"), *quantizer, np.int64(x.size), codes, exact=True)
    return {"codes": download(codes, x.shape, "u2")}


def lsq_dequantize(codes: Array, scale: Floats, offset: Floats) -> Values:
    """Values of LSQ+ codes, (N, C) f4: (10-17)."""
    values, count = storage(4 * codes.size), np.int64(codes.size)
    quantizer = upload(scale, "f4"), upload(offset, "f4"), codes.shape[1]
    launch("lsq_dequantize", blocks(codes.size), THREADS, upload(codes, "u2"), *quantizer, count, values, exact=True)
    return {"values": download(values, codes.shape, "f4")}


def lsq_gradients(x: Floats, scale: Floats, offset: Floats, bits: int, grad_output: Floats) -> Values:
    """Straight-through gradients, (N, C), (C,) and (C,) f4: (10-19)."""
    rows, channels = x.shape
    grad_x, grad_scale, grad_offset = storage(4 * x.size), storage(4 * channels), storage(4 * channels)
    launch(
        "lsq_gradients", channels, THREADS, upload(x, "f4"), upload(scale, "f4"), upload(offset, "f4"),
        float(2**bits - 1), upload(grad_output, "f4"), rows, channels, grad_x, grad_scale, grad_offset,
    )  # fmt: skip
    return {
        "grad_x": download(grad_x, x.shape, "f4"),
        "grad_scale": download(grad_scale, scale.shape, "f4"),
        "grad_offset": download(grad_offset, offset.shape, "f4"),
    }


def _first_of_stages(codebook_sizes: Array) -> Buffer:
    """The first codeword of each stage, and the number of all."""
    return upload(np.cumsum([0, *codebook_sizes]), "i4")


def rvq_assign(x: Floats, codebook_sizes: Array, codebooks: Floats) -> Values:
    """The codeword of each vector in each stage, (N, M) u2: (10-20)."""
    stages, count = len(codebook_sizes), len(x)
    indices = storage(2 * count * stages)
    books = _first_of_stages(codebook_sizes), upload(codebooks, "f4"), stages
    launch("rvq_assign", blocks(count), THREADS, upload(x, "f4"), *books, count, indices, exact=True)
    return {"indices": download(indices, (count, stages), "u2")}


def commitment(x: Floats, indices: Array, codebook_sizes: Array, codebooks: Floats) -> Values:
    """The commitment loss, () f8, and its gradient, (N, 3) f4: (10-21)."""
    count, components = len(x), max(3 * len(x), 1)
    grad_x, losses = storage(12 * count), storage(8 * blocks(count))
    books = _first_of_stages(codebook_sizes), upload(codebooks, "f4"), len(codebook_sizes)
    uses = upload(x, "f4"), upload(indices, "u2"), *books
    launch("commitment", blocks(count), THREADS, *uses, count, float(components), grad_x, losses)
    return {"loss": total(losses, blocks(count), components), "grad_x": download(grad_x, x.shape, "f4")}


def rvq_update(
    x: Floats, indices: Array, codebook_sizes: Array, codebooks: Floats, counts: Array, sums: Array, uniforms: Array,
    decay: float, smoothing: float, dead_count: float,
) -> Values:  # fmt: skip
    """One step of the codebooks' averages: (K,) f8, (K, 3) f8 and (K, 3) f4: R-10.6-3."""
    count, stages = len(x), len(codebook_sizes)
    if count == 0:
        return {"counts": counts, "sums": sums, "codebooks": codebooks}
    first, chosen, residuals = (
        _first_of_stages(codebook_sizes),
        upload(indices, "u2"),
        storage(12 * count * (stages + 1)),
    )
    new_counts, new_sums, books = upload(counts, "f8"), upload(sums, "f8"), upload(codebooks, "f4")
    launch("rvq_residuals", blocks(count), THREADS, upload(x, "f4"), chosen, first, books, stages, count, residuals)
    means = np.float64(decay), new_counts, new_sums
    launch("rvq_average", len(counts), THREADS, residuals, chosen, first, stages, count, *means)
    launch("rvq_move", stages, THREADS, first, new_counts, new_sums, np.float64(smoothing), books)
    draws = np.float64(dead_count), upload(uniforms, "f8"), storage(8 * count)
    launch("rvq_replace_dead", 1, THREADS, residuals, first, stages, count, *draws, new_counts, new_sums, books)
    launch("round_to_half", blocks(codebooks.size), THREADS, books, codebooks.size)
    return {
        "counts": download(new_counts, counts.shape, "f8"),
        "sums": download(new_sums, sums.shape, "f8"),
        "codebooks": download(books, codebooks.shape, "f4"),
    }
