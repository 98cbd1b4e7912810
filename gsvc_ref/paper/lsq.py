"""LSQ+: asymmetric uniform quantisation with a learned scale s and offset beta per channel (paper section 3.8, Q_l).

The codes of a channel are 0..p with p = 2^b - 1::

    t  = (x - beta) / s                     (10-15)
    q  = round_half_even(clamp(t, 0, p))    (10-16)
    xq = q * s + beta                       (10-17)

This is R-10.5-1 of spec.md. The paper's equation writes a floor where this rounds; rounding halves the largest error
and is what the authors train.
Every function takes all channels at once: x is (N, C), scale and offset are (C,), and channel c uses scale[c] and
offset[c]. The plain forms are those of `gsvc_base.spec`; `gradients_plain` fixes the order of the sums, too.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_base.arrays import F4 as F4
from gsvc_base.arrays import F8 as F8
from gsvc_base.checks import door
from gsvc_base.errors import UsageError
from gsvc_ref._jit import kernel

Codes = NDArray[np.uint16]

MAX_BITS: Final = 16


class LsqGradients(NamedTuple):
    """Gradients of a loss through `lsq_quantize` and `lsq_dequantize`, all f4."""

    grad_x: F4
    """(N, C)"""
    grad_scale: F4
    """(C,)"""
    grad_offset: F4
    """(C,)"""


def largest_code(bits: int) -> int:
    """The largest code, p = 2^bits - 1; raises UsageError unless bits is in 1..16."""
    if not 1 <= bits <= MAX_BITS:
        raise UsageError(f"bits is {bits}; it must be in 1..{MAX_BITS}")
    return (1 << bits) - 1


# twin of spec.lsq_quantize
@door
def lsq_quantize(x: ArrayLike, scale: ArrayLike, offset: ArrayLike, bits: int) -> Codes:
    """Codes of values: round half to even of the clamped fl(fl(x - beta) / s), all in binary32.

    Parameters
    ----------
    x
        (N, C) f4, in the unit of scale and offset.
    scale, offset
        (C,) f4.
    bits
        b, 1..16.

    Returns
    -------
    Codes
        (N, C) u2 in 0..2^b - 1.

    Raises
    ------
    UsageError
        A value is NaN or infinite, a scale is not positive, a shape does not fit, or bits is out of range.
    """
    p = largest_code(bits)
    values = _checked_values(x)
    s, beta = _checked_channels(scale, offset, values.shape[1])
    codes = np.empty(values.shape, np.uint16)  # (N, C)
    with np.errstate(over="ignore", invalid="ignore"):
        finite = _quantize(values, s, beta, np.float32(p), codes)
    if not finite:
        raise UsageError("a value to quantize is NaN or infinite; every value must be finite")
    return codes


# twin of spec.lsq_dequantize
@door
def lsq_dequantize(codes: ArrayLike, scale: ArrayLike, offset: ArrayLike) -> F4:
    """Values of codes: fl(fl(q * s) + beta) in binary32, never fused; what every decoder computes bit for bit.

    Parameters
    ----------
    codes
        (N, C) unsigned integers of at most 16 bits.
    scale, offset
        (C,) f4.

    Returns
    -------
    F4
        (N, C), in the unit of scale and offset.

    Raises
    ------
    UsageError
        The codes are not such integers, a scale is not positive, a shape does not fit, or a result overflows binary32.
    """
    q = np.asarray(codes)
    if q.ndim != 2 or q.dtype.kind != "u" or q.dtype.itemsize > 2:
        raise UsageError(f"codes are {q.dtype} of shape {q.shape}; they must be uint8 or uint16 of shape (N, channels)")
    s, beta = _checked_channels(scale, offset, q.shape[1])
    values = np.empty(q.shape, np.float32)  # (N, C)
    with np.errstate(over="ignore"):
        finite = dequantize_kernel(np.ascontiguousarray(q, np.uint16), s, beta, values)
    if not finite:
        raise UsageError("a dequantised value overflows binary32; scale and offset are too large for these codes")
    return values


# twin of spec.lsq_gradients
@door
def lsq_gradients(
    x: ArrayLike,
    scale: ArrayLike,
    offset: ArrayLike,
    bits: int,
    grad_output: ArrayLike,
    *,
    gradient_scale: bool = False,
) -> LsqGradients:
    """Straight-through gradients of a loss with respect to values, scale and offset (R-10.5-2).

    The bounds count as inside::

        0 <= t <= p:  d xq/dx = 1,  d xq/ds = q - t,  d xq/dbeta = 0      (10-18)
        t < 0:        d xq/dx = 0,  d xq/ds = 0,      d xq/dbeta = 1
        t > p:        d xq/dx = 0,  d xq/ds = p,      d xq/dbeta = 1

    Parameters
    ----------
    x, scale, offset, bits
        As for `lsq_quantize`.
    grad_output
        (N, C) f4, dL/dxq.
    gradient_scale
        Multiply the gradients of scale and offset by 1 / sqrt(N p), as the LSQ literature offers; the authors do not.

    Returns
    -------
    LsqGradients
        dL/dx (N, C), dL/ds (C,), dL/dbeta (C,); the sums over splats run in binary64 in the order of the splats.

    Raises
    ------
    UsageError
        As for `lsq_quantize`, or the shape of grad_output differs.
    """
    p = largest_code(bits)
    values, grad = _checked_values(x), _checked_values(grad_output)
    if grad.shape != values.shape:
        raise UsageError(f"grad_output has shape {grad.shape}, x has {values.shape}; they must be equal")
    s, beta = _checked_channels(scale, offset, values.shape[1])
    grad_x = np.empty_like(values)  # (N, C) f4
    sums = np.empty((2, values.shape[1]))  # (2, C) f8
    with np.errstate(over="ignore", invalid="ignore"):
        finite = _gradients(values, s, beta, np.float32(p), grad, grad_x, sums)
    if not finite:
        raise UsageError("a value to quantize is NaN or infinite; every value must be finite")
    if gradient_scale:
        sums /= np.sqrt(max(len(values), 1) * p)
    return LsqGradients(grad_x, sums[0].astype(np.float32), sums[1].astype(np.float32))


@kernel()
def _quantize(x: F4, s: F4, beta: F4, p: np.float32, codes: Codes) -> bool:
    """`spec.lsq_quantize` without checks; False where a value is not finite."""
    finite = True
    for n in range(x.shape[0]):
        for c in range(x.shape[1]):
            finite &= bool(np.isfinite(x[n, c]))
            t = (x[n, c] - beta[c]) / s[c]  # (10-15)
            codes[n, c] = np.uint16(np.rint(min(max(t, np.float32(0)), p)))  # (10-16)
    return finite


@kernel()
def dequantize_kernel(codes: Codes, s: F4, beta: F4, values: F4) -> bool:
    """`spec.lsq_dequantize` without checks; False where a value is not finite."""
    finite = True
    for n in range(codes.shape[0]):
        for c in range(codes.shape[1]):
            value = np.float32(codes[n, c]) * s[c] + beta[c]  # (10-17)
            values[n, c] = value
            finite &= bool(np.isfinite(value))
    return finite


def gradients_plain(x: F4, s: F4, beta: F4, p: int, grad_output: F4) -> tuple[F4, F8, F8]:
    """The definition of the gradients (without the scale 1 / sqrt(N p)): dL/dx f4, dL/ds f8, dL/dbeta f8."""
    with np.errstate(over="ignore"):
        t = (x - beta) / s  # (10-15)
    q = np.rint(np.clip(t, np.float32(0), np.float32(p)))
    below, above = t < 0, t > p
    inside = ~(below | above)
    dxq_ds = np.where(inside, q - np.where(inside, t, 0), np.where(above, np.float32(p), np.float32(0)))
    dxq_dbeta = np.where(inside, np.float32(0), np.float32(1))  # (10-18)
    wide = grad_output.astype(np.float64)
    zero = np.zeros((1, x.shape[1]))
    grad_s = np.concatenate([zero, wide * dxq_ds]).cumsum(axis=0)[-1]  # cumsum adds one splat after the other
    grad_beta = np.concatenate([zero, wide * dxq_dbeta]).cumsum(axis=0)[-1]
    return np.where(inside, grad_output, np.float32(0)), grad_s, grad_beta  # (10-19)


@kernel()
def _gradients(x: F4, s: F4, beta: F4, p: np.float32, grad_output: F4, grad_x: F4, sums: F8) -> bool:
    """`gradients_plain`, with the same order of sums; False where a value is not finite."""
    finite = True
    # Each channel apart, so that its sums run over the splats in their order, in binary64.
    for c in range(x.shape[1]):
        grad_s, grad_beta = 0.0, 0.0
        for n in range(x.shape[0]):
            finite &= bool(np.isfinite(x[n, c]))
            t = (x[n, c] - beta[c]) / s[c]  # (10-15)
            grad = np.float64(grad_output[n, c])
            if t < 0:
                grad_x[n, c] = 0
                grad_beta += grad
            elif t > p:
                grad_x[n, c] = 0
                grad_s += grad * np.float64(p)
                grad_beta += grad
            else:
                grad_x[n, c] = grad_output[n, c]
                grad_s += grad * np.float64(np.rint(t) - t)  # (10-18)
        sums[0, c], sums[1, c] = grad_s, grad_beta  # (10-19)
    return finite


def _checked_values(x: ArrayLike) -> F4:
    values = np.ascontiguousarray(x, np.float32)
    if values.ndim != 2:
        raise UsageError(f"the values have shape {values.shape}; they must be (N, channels)")
    return values


def _checked_channels(scale: ArrayLike, offset: ArrayLike, channels: int) -> tuple[F4, F4]:
    s, beta = np.ascontiguousarray(scale, np.float32), np.ascontiguousarray(offset, np.float32)
    if s.shape != (channels,) or beta.shape != (channels,):
        raise UsageError(f"scale has shape {s.shape} and offset {beta.shape}; both must be ({channels},)")
    if not (np.isfinite(s).all() and np.isfinite(beta).all() and (s > 0).all()):
        raise UsageError(f"scale {s} must be positive, scale and offset {beta} finite")
    return s, beta
