"""Differences of a P-frame's splats in code units: their values, gradients, and proximal steps, splat by splat.

A difference q (N, 8) counts code steps: (i, i') of the position in the splat's own axes, (km, kr, ks) of its size,
aspect and shear, and three of its color. To second order a change of one splat alone by q costs the picture the
squared error D^2 |q|^2, so the gradient of

    f(q) = SSE(q) / (2 D^2),   SSE in units of 8 bits over pixels and channels,

is q itself for a splat alone, and one step length serves every component. While q is no whole number, it moves the
coordinates of `coordinates`; what whole ones do is `add_differences`. All results are made of stated operations in
binary64, splat by splat, and are the same on every machine for the same gradients.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4, F8, I8
from gsvc_ref._jit import kernel
from gsvc_ref.encoder.main.codes import PER_NEPER, put_coordinates
from gsvc_ref.encoder.main.coordinates import ROOT2, exp_kernel, limited, put_gradient, put_parameters
from gsvc_ref.main.codes import GROUP_ENDS
from gsvc_ref.main.reconstruct import position_step, sheared_step
from gsvc_ref.main.state import A_LEAST, A_MOST, S_MOST, SHEAR_STEPS, SIZE_STEPS, class_of

MIN_LOG: Final = A_LEAST / PER_NEPER  # of ln l11 and ln l22
MAX_LOG: Final = A_MOST / PER_NEPER
MOMENTUM: Final = 0.95  # of proximal descent
SPARSITY: Final = 0.4  # weight of the L1 term
MAX_STEP: Final = 1.5  # longest gradient step of a component of q in proximal descent
MAX_DIFFERENCE: Final = 4095  # largest difference, of the last class of magnitudes
NEAR_DEVIATIONS: Final = 3.0  # splats overlap only where their centers are nearer than this many of both deviations
NEAR_SQUARE: Final = 18.0  # and where the squared distance, in units of both covariances, is below this: e^-9

GX, GS, GY, LOG_SIZE, SHEAR = range(5)
"""The steps of a splat: x by i, y by i and y by i' in pixels, m and r in nepers, and s."""


class Anchors(NamedTuple):
    """What differences refer to."""

    z: F8  # (N, 8), the coordinates of the reference after motion
    steps: F8  # (N, 5), see `GX`
    D: float  # in units of 8 bits
    scale: float  # f over the loss: pixels times 255^2 / (2 D^2)


class Iterate(NamedTuple):
    """A point of the descent, changed in place."""

    q: F8  # (N, 8), the differences
    y: F8  # (N, 8), those at which the gradient is taken
    parameters: F4  # (N, 8), of the splats at y
    length: F8  # (N,), step lengths


@kernel()
def anchors_of(state: I8, motion: I8, step: int, pixels: int) -> Anchors:
    """The anchors of splats (N, 8) i8 that move by `motion` (N, 2) i8 in 1/256 px; `step` is D in 1/16."""
    z, steps, D = np.empty(state.shape), np.empty((len(state), 5)), step / 16
    for i in range(len(state)):
        j = class_of(state[i, 5:], step)
        put_coordinates(state[i], z[i])
        for axis in range(2):
            z[i, axis] += motion[i, axis] / 256
        g_y = position_step(state[i, 3], j)
        steps[i, GX], steps[i, GY] = position_step(state[i, 2], j) / 256, g_y / 256
        steps[i, GS] = sheared_step(state[i, 4], g_y) / 256
        steps[i, LOG_SIZE] = SIZE_STEPS[j] * (ROOT2 / PER_NEPER)  # of m and r: of ln l11 and ln l22 times sqrt 2
        steps[i, SHEAR] = SHEAR_STEPS[j] / 1024
    return Anchors(z, steps, D, pixels * 255.0 * 255.0 / (2 * D * D))


@kernel(inline=True)
def put_value(anchors: Anchors, i: int, q: F8, z: F8, row: F4) -> None:
    """The parameters of splat i with the differences q (8,), into row (8,); z (8,) becomes its coordinates."""
    start, step = anchors.z[i], anchors.steps[i]
    z[0] = start[0] + step[GX] * q[0]
    z[1] = start[1] + (step[GS] * q[0] + step[GY] * q[1])
    z[2], z[3] = limited(start[2] + q[2] * step[LOG_SIZE], start[3] + q[3] * step[LOG_SIZE], MIN_LOG, MAX_LOG)
    shear = start[4]
    if q[3] != 0:  # l21 / l11 holds
        shear = shear * exp_kernel(ROOT2 * (z[3] - start[3]))
    z[4] = min(max(shear + q[4] * step[SHEAR], -S_MOST / 1024), S_MOST / 1024)
    for k in range(5, 8):
        z[k] = start[k] + anchors.D * q[k]
    put_parameters(z, row)


@kernel(inline=True)
def put_slope(anchors: Anchors, i: int, q: F8, row: F4, g: F4, out: F8) -> None:
    """The gradient of f by q, into out (8,), given the parameters `row` of splat i and the loss's gradient g by them.

    It is that by (u, v, m, r, s, n) times the steps, but for two things. A position moves by steps in pixels, so its
    part is that by x and y. And aspect turns the shear of the anchor, without what q itself has added to it.
    """
    step, scale = anchors.steps[i], anchors.scale
    put_gradient(row, g, out)
    by_x, by_y, by_s = np.float64(g[0]), np.float64(g[1]), out[4]
    out[0] = scale * (by_x * step[GX] + by_y * step[GS])
    out[1] = scale * (by_y * step[GY])
    out[2] = scale * (step[LOG_SIZE] * out[2])
    out[3] = scale * (step[LOG_SIZE] * (out[3] - ROOT2 * (q[4] * step[SHEAR]) * by_s))
    out[4] = scale * (step[SHEAR] * by_s)
    for k in range(5, 8):
        out[k] = scale * (anchors.D * out[k])


@kernel()
def proximal_step(anchors: Anchors, at: Iterate, g: F4, price: float) -> None:
    """One step of accelerated proximal descent, in place: q, the point y where the gradient is taken, its parameters.

    From y goes a gradient step of `length`, at most MAX_STEP in each component. Then each component moves towards 0 by
    length * SPARSITY (L1), and a group whose squared length is below 2 * length * price becomes 0 (L0). The price of a
    group that has any difference is in 2 D^2. The next y is q + MOMENTUM (q - q before), or q where a splat's step goes
    against its last one.
    """
    q, y, parameters, length = at
    step, z = np.empty(8), np.empty(8)
    for i in range(len(q)):
        put_slope(anchors, i, y[i], parameters[i], g[i], step)
        eta = length[i]
        shrink = eta * SPARSITY
        for group in range(3):
            square = 0.0
            for k in range(GROUP_ENDS[group], GROUP_ENDS[group + 1]):
                value = y[i, k] - min(max(eta * step[k], -MAX_STEP), MAX_STEP)
                value = value - shrink if value > shrink else (value + shrink if value < -shrink else 0.0)
                step[k] = value
                square += value * value
            if square < 2 * eta * price:
                for k in range(GROUP_ENDS[group], GROUP_ENDS[group + 1]):
                    step[k] = 0.0
        against = 0.0
        for k in range(8):
            against += (y[i, k] - step[k]) * (step[k] - q[i, k])
        momentum = 0.0 if against > 0 else MOMENTUM
        changed = False
        for k in range(8):
            ahead = step[k] + momentum * (step[k] - q[i, k])
            q[i, k] = step[k]
            changed |= ahead != y[i, k]
            y[i, k] = ahead
        if changed:
            put_value(anchors, i, y[i], z, parameters[i])


def idle(anchors: Anchors, at: Iterate, g: F4, price: float) -> NDArray[np.bool_]:
    """Which splats (N,) have no difference, and would have none after a `proximal_step` at this price."""
    after = Iterate(at.q.copy(), at.y.copy(), at.parameters.copy(), at.length)
    proximal_step(anchors, after, g, price)
    return np.asarray(~(at.q.any(axis=1) | at.y.any(axis=1) | after.q.any(axis=1)))


@kernel()
def rounded_step(anchors: Anchors, at: Iterate, g: F4, offset: float, mask: NDArray[np.bool_]) -> None:
    """One step with rounding, in place; the parameters become those of other differences, and are to be found anew.

    q goes along the gradient at the whole y in the groups that `mask` (N, 3) names; then y is q rounded, away from 0
    from 1 - offset on.
    """
    q, y, parameters, length = at
    step = np.empty(8)
    for i in range(len(q)):
        if not (mask[i, 0] or mask[i, 1] or mask[i, 2]):
            continue
        put_slope(anchors, i, y[i], parameters[i], g[i], step)
        for group in range(3):
            if mask[i, group]:
                for k in range(GROUP_ENDS[group], GROUP_ENDS[group + 1]):
                    q[i, k] -= length[i] * step[k]
                    whole = min(math.floor(abs(q[i, k]) + offset), MAX_DIFFERENCE)
                    y[i, k] = whole if q[i, k] >= 0 else -whole


def crowding(parameters: F4) -> F8:
    """How much every splat overlaps with all, (N,) f8 from 1: the sum of its normalized inner products with each.

    It bounds the curvature of f along a splat's components by their row of J^T J, so 1 / crowding is a safe step.
    """
    x, y, a, b, c = np.ascontiguousarray(parameters[:, :5].T, np.float64)  # (N,) f8 each
    reach = NEAR_DEVIATIONS * np.sqrt(b * b + c * c)  # along y
    order = np.argsort(y - reach, kind="stable")
    sums = np.ones(len(parameters))
    top, bottom = (y - reach)[order], (y + reach)[order]
    _crowding(x[order], y[order], a[order], b[order], c[order], top, bottom, sums)
    out = np.empty(len(parameters))
    out[order] = sums
    return out


@kernel()
def _crowding(x: F8, y: F8, a: F8, b: F8, c: F8, top: F8, bottom: F8, out: F8) -> None:
    """`crowding`, added to out, of splats in the order of their tops; a, b and c stand for l11, l21 and l22.

    The inner product of two Gaussians is that of their covariances' sum at the distance of their centers.
    """
    for i in range(len(x)):
        for j in range(i + 1, len(x)):
            if top[j] > bottom[i]:
                break
            dx, dy = x[j] - x[i], y[j] - y[i]
            if abs(dx) > NEAR_DEVIATIONS * (a[i] + a[j]):
                continue
            xx, xy = a[i] * a[i] + a[j] * a[j], a[i] * b[i] + a[j] * b[j]
            yy = ((b[i] * b[i] + c[i] * c[i]) + b[j] * b[j]) + c[j] * c[j]
            determinant = xx * yy - xy * xy
            distance = ((yy * dx * dx - 2 * xy * dx * dy) + xx * dy * dy) / determinant
            if distance < NEAR_SQUARE:
                overlap = 2 * math.sqrt(a[i] * c[i] * (a[j] * c[j]) / determinant) * exp_kernel(-0.5 * distance)
                out[i] += overlap
                out[j] += overlap
