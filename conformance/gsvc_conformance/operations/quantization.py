"""The operations of quantisation in training: LSQ+, residual vector quantisation, and how its codebooks move."""

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.exact.distinct import distinct
from gsvc_base.exact.running_error import Computed, given, rounded_once, stack, with_bound
from gsvc_conformance.expectations import Bounded, Decision, Expectation
from gsvc_conformance.operation import paired
from gsvc_conformance.operations.codebooks import books_of, residual, rvq_update_oracle

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]
I8 = NDArray[np.int64]
U2 = NDArray[np.uint16]
Expected = Mapping[str, Expectation]

DECIDING: Final = 1
"""Components of numbers that are only compared: their errors in binary32 are far larger than those of binary64."""


def lsq_ratio(x: F4, scale: F4, offset: F4) -> Computed:
    """Equation (10-15): t = (x - beta) / s by running error analysis; exact where x - beta is and s a power of two."""
    return (given(x) - given(offset)) / given(scale)


def lsq_quantize_oracle(x: F4, scale: F4, offset: F4, bits: int) -> Expected:
    """The two codes that the ends of the interval around t round to; they are one where t has no error."""
    first, inverse, _ = distinct(x)
    t = lsq_ratio(x[first], scale, offset)
    codes, lowest, highest = (
        np.clip(value, 0, 2**bits - 1).astype(np.uint16)
        for value in (t.number.rint(), np.rint(t.value - t.error), np.rint(t.value + t.error))
    )
    alternative = np.where(lowest != codes, lowest, highest)
    inside = (t.value > -0.5) & (t.value < 2**bits - 0.5) & (alternative == codes) & (t.error > 0)
    both = codes[inverse], alternative[inverse]
    if not inside.any():
        return {"codes": Decision(*both)}
    to_tie = abs(t.value - np.floor(t.value) - 0.5)
    return {"codes": Decision(*both, float(to_tie[inside].min()), float(t.error[inside].max()))}


paired(
    "lsq_quantize",
    "quantization",
    "LSQ+ codes of values.",
    inputs="x: f4 (N, C); scale: f4 (C,); offset: f4 (C,); bits: int",
    outputs="codes: u2 (N, C)",
    equations=("10-15", "10-16", "13-17"),
    rules=("R-10.5-1",),
    oracle=lsq_quantize_oracle,
)


paired(
    "lsq_dequantize",
    "quantization",
    "Values of LSQ+ codes: a rounded product, then a rounded sum.",
    inputs="codes: u2 (N, C); scale: f4 (C,); offset: f4 (C,)",
    outputs="values: f4 (N, C)",
    equations=("10-17",),
    rules=("R-10.5-1",),
)


def lsq_gradients_oracle(x: F4, scale: F4, offset: F4, bits: int, grad_output: F4) -> Expected:
    """Running error analysis: q - t inherits the error of t; sums over splats have any sane order (13-4).

    Raises
    ------
    ValueError
        An error of t could change a code or a region, and with it a sum: the inputs are no vector.
    """
    largest = 2**bits - 1
    first, inverse, times = distinct(x, grad_output)
    x, grad_output = x[first], grad_output[first]
    t = lsq_ratio(x, scale, offset)
    q = np.clip(t.number.rint(), 0, largest)
    below, above = t.value < 0, t.value > largest
    inside = ~below & ~above
    to_decision = np.minimum(abs(t.value), abs(t.value - largest))
    to_decision = np.where(inside, np.minimum(to_decision, abs(abs(t.value - q) - 0.5)), to_decision)
    if ((t.error > 0) & (to_decision <= t.error)).any():
        raise ValueError("a value lies too close to a tie or to the end of the range")
    zero = given(np.zeros(x.shape))
    grad = given(grad_output)
    by_scale = (given(q) - t).where(inside, given(np.where(above, largest, 0.0)))
    return {
        "grad_x": Bounded(*with_bound(grad.where(inside, zero)[inverse])),
        "grad_scale": Bounded(*with_bound((grad * by_scale).where(~below, zero).total(0, times=times))),
        "grad_offset": Bounded(*with_bound(grad.where(~inside, zero).total(0, times=times))),
    }


paired(
    "lsq_gradients",
    "quantization",
    "Straight-through gradients of LSQ+.",
    inputs="x: f4 (N, C); scale: f4 (C,); offset: f4 (C,); bits: int; grad_output: f4 (N, C)",
    outputs="grad_x: f4 (N, C); grad_scale: f4 (C,); grad_offset: f4 (C,)",
    equations=("10-18", "10-19", "13-17"),
    rules=("R-10.5-2",),
    oracle=lsq_gradients_oracle,
)


def rvq_assign_oracle(x: F4, codebook_sizes: I8, codebooks: F4) -> Expected:
    """Running error analysis of the distances of all codewords; equal codewords have equal distances.

    Raises
    ------
    ValueError
        Two distances are closer than their errors, so that what follows is open: the inputs are no vector.
    """
    first, inverse, _ = distinct(x)
    x = x[first]
    chosen: list[F8] = []
    columns, margin, guard = [], np.inf, 0.0
    for book in books_of(codebook_sizes, codebooks.astype(np.float64)):
        r = residual(x, chosen, DECIDING)
        e = r[:, None] - given(book, DECIDING)
        distance = (e * e).total(2)  # (N, B)
        best = distance.value.argmin(axis=1)
        of_best = distance[np.arange(len(x)), best]
        errors = distance.error + of_best.error[:, None]
        rivals = (book != book[best][:, None]).any(axis=2) & (errors > 0)
        gaps = np.where(rivals, distance.value - of_best.value[:, None], np.inf)
        if (gaps <= errors).any():
            raise ValueError("a vector lies too close to the border between two codewords")
        margin, guard = min(margin, gaps.min(initial=np.inf)), max(guard, errors[rivals].max(initial=0.0))
        columns.append(best)
        chosen.append(book[best])
    indices = np.stack(columns, axis=1).astype(np.uint16)[inverse]
    return {"indices": Decision(indices, None, *((margin, guard) if guard else (None, None)))}


paired(
    "rvq_assign",
    "quantization",
    "The codeword of each vector in each stage.",
    inputs="x: f4 (N, 3); codebook_sizes: i8 (M,); codebooks: f4 (K, 3)",
    outputs="indices: u2 (N, M)",
    equations=("10-20", "13-17"),
    rules=("R-10.6-1",),
    oracle=rvq_assign_oracle,
)


paired(
    "rvq_update",
    "quantization",
    "One step of the codebooks' moving averages, with dead codewords replaced.",
    inputs="x: f4 (N, 3); indices: u2 (N, M); codebook_sizes: i8 (M,); codebooks: f4 (K, 3); counts: f8 (K,); "
    "sums: f8 (K, 3); uniforms: f8 (D,); decay: float; smoothing: float; dead_count: float",
    outputs="counts: f8 (K,); sums: f8 (K, 3); codebooks: f4 (K, 3)",
    equations=("10-22", "10-23", "10-24", "13-17"),
    rules=("R-10.6-3", "R-10.6-4"),
    oracle=rvq_update_oracle,
)


def commitment_oracle(x: F4, indices: U2, codebook_sizes: I8, codebooks: F4) -> Expected:
    """Running error analysis of (10-21), in any sane order (13-4) of stages and splats.

    Every term is divided by 3 N before the sum, which costs 3.5 eps of its magnitude: where terms cancel that is more
    than 3.5 eps of the sum, so that dividing at the end, or in between, is covered as well.
    """
    components = given(max(3 * len(x), 1))
    first, inverse, times = distinct(x, indices)
    x, indices = x[first], indices[first]
    chosen: list[F8] = []
    errors: list[Computed] = []
    for k, book in enumerate(books_of(codebook_sizes, codebooks.astype(np.float64))):
        chosen.append(book[indices[:, k]])
        errors.append(residual(x, chosen))
    left = stack(*errors)  # (M, n, 3)
    of_all = np.broadcast_to(times[:, None], left.error.shape).reshape(-1)
    squares = (left * left / components).flat()
    return {
        "loss": Bounded(*with_bound(squares.total(times=of_all)), "<f8"),
        "grad_x": Bounded(*with_bound((rounded_once(2.0) * left / components).total(0)[inverse])),
    }


paired(
    "commitment",
    "quantization",
    "The commitment loss of all stages and its gradient.",
    inputs="x: f4 (N, 3); indices: u2 (N, M); codebook_sizes: i8 (M,); codebooks: f4 (K, 3)",
    outputs="loss: f8 (); grad_x: f4 (N, 3)",
    equations=("10-21", "13-17"),
    rules=("R-10.6-2",),
    oracle=commitment_oracle,
)
