"""Quantisers as they get written, in binary32."""

import numpy as np
from numpy.typing import NDArray

from gsvc_conformance.operation import Values
from gsvc_conformance.operations.codebooks import books_of
from gsvc_conformance.spec import namespace
from tests.hard_cases.measuring import Variant

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]
I8 = NDArray[np.int64]
U2 = NDArray[np.uint16]


def lsq_quantizer(form: str) -> Variant:
    """Codes by another rounding or another order of operations."""

    def lsq_quantize(x: F4, scale: F4, offset: F4, bits: int) -> Values:
        t = (x - offset) / scale
        largest = np.float32(2**bits - 1)
        if form == "x / s - beta / s":
            t = x / scale - offset / scale
        clamped = np.clip(t, np.float32(0), largest)
        codes = np.rint(clamped)
        if form == "an integer before the clamp":
            codes = np.clip(np.rint(t).astype(np.int32), 0, int(largest))
        return {"codes": codes.astype(np.uint16)}

    return lsq_quantize


def lsq_gradient(form: str) -> Variant:
    """Gradients by masks, by signs, or by two sums."""

    def lsq_gradients(x: F4, scale: F4, offset: F4, bits: int, grad_output: F4) -> Values:
        largest = np.float32(2**bits - 1)
        t = (x - offset) / scale
        q = np.rint(np.clip(t, np.float32(0), largest))
        below, above = (np.signbit(t) if form == "the sign of t" else t < 0), t > largest
        inside = (~(below | above)).astype(np.float32)
        of_scale = np.where(below, np.float32(0), np.where(above, largest, q - t))
        if form == "masks as factors":
            of_scale = inside * (q - t) + above * largest
        total = np.sum(grad_output * of_scale, axis=0, dtype=np.float32)
        if form == "two sums":
            total = np.sum(grad_output * q, axis=0) - np.sum(grad_output * t, axis=0)
        return {
            "grad_x": grad_output * inside, "grad_scale": total, "grad_offset": np.sum(grad_output * (1 - inside), 0),
        }  # fmt: skip

    return lsq_gradients


def rvq_assigner(form: str) -> Variant:
    """Codewords by another formula for the distance, or another one of equals."""

    def rvq_assign(x: F4, codebook_sizes: I8, codebooks: F4) -> Values:
        r, columns = x, []
        for book in books_of(codebook_sizes, codebooks):
            e = r[:, None] - book
            distance = (e * e).sum(2)
            if form == "squares in binary16":
                distance = (e.astype(np.float16) ** 2).sum(2)
            best = distance.argmin(1)
            columns.append(best)
            r = r - book[best]
        return {"indices": np.stack(columns, 1).astype(np.uint16)}

    return rvq_assign


def commitment_expanded(x: F4, indices: U2, codebook_sizes: I8, codebooks: F4) -> Values:
    """The sum of all residuals as M x - M C1 - (M - 1) C2 - ..."""
    chosen = [book[indices[:, k]] for k, book in enumerate(books_of(codebook_sizes, codebooks))]
    M = np.float32(len(chosen))
    total = M * x
    for k, codewords in enumerate(chosen):
        total = total - (M - k) * codewords
    loss: Values = namespace()["commitment"](x, indices, codebook_sizes, codebooks)
    return {"loss": loss["loss"], "grad_x": total * np.float32(2 / (3 * len(x)))}


def rvq_update(
    x: F4, indices: U2, codebook_sizes: I8, codebooks: F4, counts: F8, sums: F8, uniforms: F8, decay: float,
    smoothing: float, dead_count: float,
) -> Values:  # fmt: skip
    """One stage, whose dead codewords are drawn by errors divided by their sum, and which divides by any count."""
    counts, sums, moved = counts.copy(), sums.copy(), codebooks.astype(np.float64)
    error = np.square(x - codebooks[indices[:, 0]]).sum(1)
    for b in range(len(counts)):
        users = x[indices[:, 0] == b].astype(np.float64)
        counts[b] = decay * counts[b] + (1 - decay) * len(users)
        sums[b] = decay * sums[b] + (1 - decay) * users.sum(0)
    smoothed = (counts + smoothing) / (counts.sum() + len(counts) * smoothing) * counts.sum()
    moved = sums / smoothed[:, None]
    probability = np.cumsum(error / error.sum())
    for uniform, b in zip(uniforms, np.flatnonzero(counts < dead_count), strict=False):
        drawn = min(int(np.searchsorted(probability, uniform, side="right")), len(x) - 1)
        moved[b], counts[b], sums[b] = x[drawn], 1, x[drawn]
    return {"counts": counts, "sums": sums, "codebooks": moved.astype(np.float16).astype(np.float32)}


def to_half(form: str) -> Variant:
    """Patterns by whole-number arithmetic on those of binary32, as one finds them."""

    def convert(values: F4) -> Values:
        pattern = values.view(np.uint32).astype(np.int64)
        sign, magnitude = pattern >> 31 << 15, pattern & 0x7FFFFFFF
        rebased = magnitude - (112 << 23)
        if form == "cut, then rounded":  # bits below the one that decides are lost before
            cut = rebased >> 12
            bits = (cut >> 1) + (cut & 1 & (cut >> 1))
        else:
            bits = rebased >> 13
        subnormal = np.floor(np.ldexp(abs(values.astype(np.float64)), 24))
        bits = np.where(rebased < 1 << 23, subnormal.astype(np.int64), bits)
        if form == "beyond 65504 is infinity":
            bits = np.where(abs(values) > 65504, 0x7C00, bits)
        return {"bits": (sign | bits).astype(np.uint16)}

    return convert
