"""Differences of a P-frame's splats in code units: their values, gradients, and proximal steps, splat by splat.

A difference q (N, 8) counts code steps: (i, i') of the position in the splat's own axes, (km, kr, ks) of its size,
aspect and shear, and three of its colour. To second order a change of one splat alone by q costs the picture the
squared error D^2 |q|^2, so the gradient of

    f(q) = SSE(q) / (2 D^2),   SSE in units of 8 bits over pixels and channels,

is q itself for a splat alone, and one step length serves every component. All results are made of stated operations in
binary64, splat by splat, and are the same on every machine for the same gradients.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4, F8, I8
from gsvc_ref._jit import kernel
from gsvc_ref.training.coordinates import ENERGY_SCALE, HALF, SIXTH, THIRD, exp_kernel

LN2: Final = 0.6931471805599453
ANCHOR: Final = 13
"""Columns of an anchor: x, y after motion; the steps x by i, y by i, y by i' in pixels; ln l11, ln l22, l21/l22; the
steps of size and aspect in nepers and of shear; n0, n1, n2 in units of 8 bits."""

LEAST_LOG: Final = -3072 * LN2 / 1024
MOST_LOG: Final = 13311 * LN2 / 1024
MOST_SHEAR: Final = 32767 / 1024

FIRST: Final = (0, 2, 5, 8)
"""The first component of each group - position, shape, colour -, and the number of components."""

GROUPS: Final = ((0, 2), (2, 5), (5, 8))
"""The first component of each group, and the one behind it."""


def anchors(state: I8, shift: tuple[I8, I8], steps: tuple[I8, I8], level: I8, sizes: I8, shears: I8) -> F8:
    """What differences refer to, (N, ANCHOR) f8.

    Parameters
    ----------
    state
        (N, 8) i8, the reference: X, Y, A, B, S, n0, n1, n2.
    shift
        By how much the splats move with the field, two (N,) i8 in 1/256 px.
    steps
        The steps of positions along x and y, two (N,) i8 in 1/256 px.
    level
        The classes j, (N,) i8.
    sizes, shears
        The steps of size and aspect (1/1024 octave) and shear (1/1024) of every class.
    """
    out = np.empty((len(state), ANCHOR))
    anchor_kernel(state, *shift, *steps, level, sizes, shears, out)
    return out


@kernel()
def anchor_kernel(
    state: I8, right: I8, down: I8, step_x: I8, step_y: I8, level: I8, sizes: I8, shears: I8, out: F8
) -> None:
    """`anchors`, written into out (N, ANCHOR)."""
    for i in range(len(state)):
        j, shear = level[i], state[i, 4]
        across = abs(shear) * step_y[i] >> 10
        out[i, 0] = (state[i, 0] + right[i]) / 256
        out[i, 1] = (state[i, 1] + down[i]) / 256
        out[i, 2] = step_x[i] / 256
        out[i, 3] = (across if shear >= 0 else -across) / 256
        out[i, 4] = step_y[i] / 256
        out[i, 5], out[i, 6] = state[i, 2] * (LN2 / 1024), state[i, 3] * (LN2 / 1024)
        out[i, 7] = shear / 1024
        out[i, 8], out[i, 9] = sizes[j] * (LN2 / 1024), shears[j] / 1024
        for k in range(3):
            out[i, 10 + k] = state[i, 5 + k] / 16


@kernel(inline=True)
def put(x: float, y: float, a: float, b: float, s: float, n0: float, n1: float, n2: float, row: F4) -> None:
    """The parameters of a splat from its coordinates, into row (8,) f4."""
    l11, l22 = exp_kernel(a), exp_kernel(b)
    scale = 1 / (ENERGY_SCALE * math.sqrt(l11 * l22))
    grey, across, green = n0 * THIRD, n1 * HALF, n2 * SIXTH
    row[0], row[1], row[2], row[3], row[4] = x, y, l11, s * l22, l22
    row[5] = ((grey + across) + green) * scale
    row[6] = (grey - 2 * green) * scale
    row[7] = ((grey - across) + green) * scale


@kernel(inline=True)
def put_value(anchor: F8, q: F8, quantizer: float, row: F4) -> None:
    """The parameters (8,) f4 of one splat with the differences q (8,)."""
    a = min(max(anchor[5] + (q[2] + q[3]) * anchor[8], LEAST_LOG), MOST_LOG)
    b = min(max(anchor[6] + (q[2] - q[3]) * anchor[8], LEAST_LOG), MOST_LOG)
    shear = anchor[7]
    if q[3] != 0:
        shear = shear * exp_kernel((a - anchor[5]) - (b - anchor[6]))
    shear = min(max(shear + q[4] * anchor[9], -MOST_SHEAR), MOST_SHEAR)
    x = anchor[0] + anchor[2] * q[0]
    y = anchor[1] + (anchor[3] * q[0] + anchor[4] * q[1])
    put(
        x, y, a, b, shear,
        anchor[10] + quantizer * q[5], anchor[11] + quantizer * q[6], anchor[12] + quantizer * q[7], row,
    )  # fmt: skip


@kernel(inline=True)
def put_gradient(anchor: F8, q: F8, row: F4, g: F4, quantizer: float, scale: float, out: F8) -> None:
    """The gradient (8,) of f by q, given the parameters `row` and the gradient g by them of f / scale."""
    l11, l21, l22 = np.float64(row[2]), np.float64(row[3]), np.float64(row[4])
    g0, g1, g2, g3, g4 = np.float64(g[0]), np.float64(g[1]), np.float64(g[2]), np.float64(g[3]), np.float64(g[4])
    g5, g6, g7 = np.float64(g[5]), np.float64(g[6]), np.float64(g[7])
    by_scale = 0.5 * ((g5 * np.float64(row[5]) + g6 * np.float64(row[6])) + g7 * np.float64(row[7]))
    by_a = g2 * l11 - by_scale
    by_b = (g4 * l22 + g3 * l21) - by_scale
    by_shear = g3 * l22
    sheared = l21 / l22 - q[4] * anchor[9]
    out[0] = scale * (g0 * anchor[2] + g1 * anchor[3])
    out[1] = scale * (g1 * anchor[4])
    out[2] = scale * ((by_a + by_b) * anchor[8])
    out[3] = scale * (((by_a - by_b) + 2 * by_shear * sheared) * anchor[8])
    out[4] = scale * (by_shear * anchor[9])
    energy = scale * quantizer / (ENERGY_SCALE * math.sqrt(l11 * l22))
    out[5] = energy * (((g5 + g6) + g7) * THIRD)
    out[6] = energy * ((g5 - g7) * HALF)
    out[7] = energy * (((g5 - 2 * g6) + g7) * SIXTH)


@kernel()
def values(anchor: F8, q: F8, quantizer: float, parameters: F4) -> None:
    """The parameters (N, 8) f4 of splats with the differences q (N, 8)."""
    for i in range(len(q)):
        put_value(anchor[i], q[i], quantizer, parameters[i])


@kernel()
def gradients(anchor: F8, q: F8, parameters: F4, g: F4, quantizer: float, scale: float, out: F8) -> None:
    """The gradient of f by q, (N, 8), given that of the loss by the parameters."""
    for i in range(len(q)):
        put_gradient(anchor[i], q[i], parameters[i], g[i], quantizer, scale, out[i])


@kernel()
def proximal_step(
    anchor: F8, parameters: F4, g: F4, quantizer: float, scale: float,
    y: F8, q: F8, length: F8, beta: float, sparsity: float, price: float,
) -> None:  # fmt: skip
    """One step of accelerated proximal descent, in place: q, the point y where the gradient is taken, its parameters.

    From y goes a gradient step of `length` (N,), at most 1.5 in each component. Then each component moves towards 0 by
    length * sparsity (L1), and a group whose squared length is below 2 * length * price becomes 0 (L0). The next y is
    q + beta (q - q before), or q where a splat's step goes against its last one.
    """
    step = np.empty(8)
    for i in range(len(q)):
        put_gradient(anchor[i], y[i], parameters[i], g[i], quantizer, scale, step)
        eta = length[i]
        shrink = eta * sparsity
        for group in range(3):
            square = 0.0
            for k in range(FIRST[group], FIRST[group + 1]):
                move = min(max(eta * step[k], -1.5), 1.5)
                value = y[i, k] - move
                value = value - shrink if value > shrink else (value + shrink if value < -shrink else 0.0)
                step[k] = value
                square += value * value
            if square < 2 * eta * price:
                for k in range(FIRST[group], FIRST[group + 1]):
                    step[k] = 0.0
        against = 0.0
        for k in range(8):
            against += (y[i, k] - step[k]) * (step[k] - q[i, k])
        momentum = 0.0 if against > 0 else beta
        changed = False
        for k in range(8):
            ahead = step[k] + momentum * (step[k] - q[i, k])
            q[i, k] = step[k]
            changed |= ahead != y[i, k]
            y[i, k] = ahead
        if changed:
            put_value(anchor[i], y[i], quantizer, parameters[i])


@kernel()
def idle(
    anchor: F8, parameters: F4, g: F4, quantizer: float, scale: float, y: F8, q: F8, length: F8, sparsity: float,
    price: float,
) -> NDArray[np.bool_]:  # fmt: skip
    """Which splats (N,) have no difference, and would have none after a `proximal_step` at this price."""
    out, step = np.empty(len(q), np.bool_), np.empty(8)
    for i in range(len(q)):
        out[i] = True
        for k in range(8):
            out[i] &= q[i, k] == 0 and y[i, k] == 0
        if not out[i]:
            continue
        put_gradient(anchor[i], y[i], parameters[i], g[i], quantizer, scale, step)
        for group in range(3):
            square = 0.0
            for k in range(FIRST[group], FIRST[group + 1]):
                value = length[i] * max(abs(step[k]) - sparsity, 0.0)
                square += value * value
            out[i] &= square < 2 * length[i] * price
    return out


@kernel()
def rounded_step(
    anchor: F8, parameters: F4, g: F4, quantizer: float, scale: float, y: F8, q: F8, length: F8, offset: float,
    mask: NDArray[np.bool_],
) -> None:  # fmt: skip
    """One step with rounding, in place.

    q goes along the gradient at the rounded y in the groups that `mask` (N, 3) names; then y is q rounded, away from 0
    from 1 - offset on.
    """
    step = np.empty(8)
    for i in range(len(q)):
        if not (mask[i, 0] or mask[i, 1] or mask[i, 2]):
            continue
        put_gradient(anchor[i], y[i], parameters[i], g[i], quantizer, scale, step)
        changed = False
        for group in range(3):
            if mask[i, group]:
                for k in range(FIRST[group], FIRST[group + 1]):
                    q[i, k] -= length[i] * step[k]
                    whole = math.floor(abs(q[i, k]) + offset)
                    whole = whole if q[i, k] >= 0 else -whole
                    changed |= whole != y[i, k]
                    y[i, k] = whole
        if changed:
            put_value(anchor[i], y[i], quantizer, parameters[i])


def crowding(parameters: F4) -> F8:
    """How much every splat overlaps with all, (N,) f8 from 1: the sum of its normalised inner products with each.

    It bounds the curvature of f along a splat's components by their row of J^T J, so 1 / crowding is a safe step.
    """
    x, y, a, b, c = np.ascontiguousarray(parameters[:, :5].T, np.float64)  # (N,) f8 each
    reach = 3 * np.sqrt(b * b + c * c)  # along y
    order = np.argsort(y - reach, kind="stable")
    sums = np.ones(len(parameters))
    top, bottom = (y - reach)[order], (y + reach)[order]
    _crowding(x[order], y[order], a[order], b[order], c[order], top, bottom, sums)
    out = np.empty(len(parameters))
    out[order] = sums
    return out


@kernel()
def _crowding(x: F8, y: F8, a: F8, b: F8, c: F8, top: F8, bottom: F8, out: F8) -> None:
    """`crowding`, added to out, of splats in the order of their tops; a, b and c stand for l11, l21 and l22."""
    for i in range(len(x)):
        for j in range(i + 1, len(x)):
            if top[j] > bottom[i]:
                break
            dx, dy = x[j] - x[i], y[j] - y[i]
            if abs(dx) > 3 * (a[i] + a[j]):
                continue
            xx, xy = a[i] * a[i] + a[j] * a[j], a[i] * b[i] + a[j] * b[j]
            yy = ((b[i] * b[i] + c[i] * c[i]) + b[j] * b[j]) + c[j] * c[j]
            determinant = xx * yy - xy * xy
            distance = ((yy * dx * dx - 2 * xy * dx * dy) + xx * dy * dy) / determinant
            if distance < 18:
                overlap = 2 * math.sqrt(a[i] * c[i] * (a[j] * c[j]) / determinant) * exp_kernel(-0.5 * distance)
                out[i] += overlap
                out[j] += overlap
