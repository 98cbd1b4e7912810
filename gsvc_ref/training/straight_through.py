"""The forward and backward direction of fine-tuning a block: values to decoded splats, and straight-through gradients.

These kernels go splat by splat and make no codes in between. Forward they are twins, bit for bit, of
`BlockQuantizer.codes` with `reconstruct`; backward of `lsq_gradients` and `rvq.commitment`.
"""

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4, F8, I8
from gsvc_ref._jit import kernel
from gsvc_ref.paper.half import LARGEST_HALF, nearest_half
from gsvc_ref.paper.rvq import Indices, nearest_codewords

Mask = NDArray[np.bool_]


@kernel()
def difference_of(values: F4, reference: F4, active: Mask, difference: F4) -> None:
    """What is quantised, (n, 8) f4: the values where the reference is (0, 8), else the active differences."""
    for n in range(values.shape[0]):
        for k in range(8):
            if reference.shape[0] == 0:
                difference[n, k] = values[n, k]
            elif active[n, 0 if k < 2 else 1 if k < 5 else 2]:
                difference[n, k] = values[n, k] - reference[n, k]
            else:
                difference[n, k] = np.float32(0)


@kernel()
def decode_positions(difference: F4, reference: F4, size: F4, step_exponent: int, decoded: F4) -> None:
    """Positions through binary16 with low bits cleared (8-1), (8-2); arrays (n, 8) f4, size (2,) f4."""
    offset = np.float32(1 if reference.shape[0] == 0 else 0)
    for n in range(difference.shape[0]):
        for k in range(2):
            normalised = difference[n, k] / size[k] - offset
            normalised = min(max(normalised, np.float32(-LARGEST_HALF)), np.float32(LARGEST_HALF))
            # Binary64 holds every binary32 exactly.
            half = np.float32(nearest_half(np.float64(normalised), step_exponent))
            if reference.shape[0] == 0:
                decoded[n, k] = (half + offset) * size[k]
            else:
                decoded[n, k] = reference[n, k] + half * size[k]


@kernel()
def decode_cholesky(difference: F4, reference: F4, scale: F4, offset: F4, p: np.float32, decoded: F4) -> None:
    """Cholesky factors through LSQ+ (8-3); arrays (n, 8) f4, scale and offset (3,) f4, p the largest code."""
    for n in range(difference.shape[0]):
        for c in range(3):
            t = (difference[n, 2 + c] - offset[c]) / scale[c]  # (10-15)
            value = np.rint(min(max(t, np.float32(0)), p)) * scale[c] + offset[c]
            decoded[n, 2 + c] = value if reference.shape[0] == 0 else reference[n, 2 + c] + value


@kernel()
def decode_colors(difference: F4, reference: F4, books: F4, ends: I8, chosen: Indices, errors: F4, decoded: F4) -> None:
    """Colours through RVQ (8-4): codewords (n, M) u2, and the sum over stages of what each left over, (n, 3) f4.

    `books` are the codebooks one after the other, (sum of B, 3) f4, and `ends` where each ends, (M,) i8.
    """
    nearest_codewords(difference[:, 5:8], books, ends, chosen, errors)
    for n in range(difference.shape[0]):
        for c in range(3):
            value = books[chosen[n, 0], c]  # binary32, stage after stage: the order of (8-4)
            for k in range(1, ends.size):
                value += books[ends[k - 1] + chosen[n, k], c]
            decoded[n, 5 + c] = value if reference.shape[0] == 0 else reference[n, 5 + c] + value


@kernel()
def grad_decode(
    difference: F4,  # (n, 8) f4
    errors: F4,  # (n, 3) f4, what the stages of RVQ left, summed
    active: Mask,  # (n, 3) bool
    scale: F4,  # (3,) f4
    offset: F4,  # (3,) f4
    p: np.float32,  # the largest code
    pull: np.float32,  # 2 / (3 n), the factor of the commitment gradient
    commitment: np.float32,  # the weight of its loss
    grad_decoded: F4,  # (n, 8) f4, dL/ddecoded
    grad_values: F4,  # (n, 8) f4, becomes dL/dvalues
    sums: F8,  # (2, 3) f8, becomes dL/dscale and dL/doffset
) -> None:
    """The straight-through gradients of a block; sums are taken in binary64, in the order of the splats."""
    sums[:] = 0
    for n in range(difference.shape[0]):
        for k in range(2):
            grad_values[n, k] = grad_decoded[n, k] if active[n, 0] else np.float32(0)
        for c in range(3):
            t = (difference[n, 2 + c] - offset[c]) / scale[c]  # (10-15)
            grad, inside = np.float64(grad_decoded[n, 2 + c]), True
            # A clamped code follows the end of its range, not the value (10-18).
            if t < 0:
                inside = False
                sums[1, c] += grad
            elif t > p:
                inside = False
                sums[0, c] += grad * np.float64(p)
                sums[1, c] += grad
            else:
                sums[0, c] += grad * np.float64(np.rint(t) - t)  # (10-18), (10-19)
            grad_values[n, 2 + c] = grad_decoded[n, 2 + c] if inside and active[n, 1] else np.float32(0)
        for c in range(3):
            grad_color = grad_decoded[n, 5 + c] + commitment * (errors[n, c] * pull)  # (10-21)
            grad_values[n, 5 + c] = grad_color if active[n, 2] else np.float32(0)
