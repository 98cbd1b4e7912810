"""Coordinates of splats in which every change of the same length costs the picture about the same.

A splat has the coordinates (x, y, m, r, s, n0, n1, n2), where x, y are its position in pixels and ::

    a = ln l11,  b = ln l22
    m = (a + b) / sqrt 2            log size
    r = (a - b) / sqrt 2            log aspect
    s = l21 / l22                   shear
    n = 255 M c sqrt(pi l11 l22)    its color in opponent axes, times the root of its energy for a color of length 1

The rows of M are orthonormal: (1, 1, 1) / sqrt 3, (1, 0, -1) / sqrt 2 and (1, -2, 1) / sqrt 6. A position changes in
the splat's own axes (u, v): (dx, dy) = (l11 u, l21 u + l22 v). A change of size or aspect holds l21 / l11, so that s
goes along with exp(sqrt 2 dr), before ds is added. With E = |n|, a change of one splat alone changes the picture, in
units of 8 bits and summed over pixels and channels, to second order by the squared error ::

    |dn|^2 + E^2 ((du^2 + dv^2) / 2 + (dm^2 + dr^2) / 2 + ds^2 / 4)                                         (metric)

so that a step D of n, sqrt 2 D / E of u, v, m, r and 2 D / E of s are each worth D^2: they are the `units` of D.

Where this comes from: the Gaussian g = exp(-(w1^2 + w2^2) / 2) with w = L^-1 (x - mu) changes by w1 g du + w2 g dv for
a motion in its own axes, and by (w1^2 p + w2^2 q + w1 w2 t) g for relative changes p = dl11 / l11, q = dl22 / l22 and
t = (dl21 - l21 p) / l22 of its factor. Under g^2, whose integral is A = pi l11 l22, w1 and w2 are independent and
normal with the variance 1/2, so that their moments are ::

    E w^2 = 1/2,    E w^4 = 3/4,    E w1^2 w2^2 = 1/4,    and those of odd powers are 0.

A change of the color c, k along it and dc' across, thus gives the Gauss-Newton matrix of a splat, its block of J'J::

    A |c|^2 ((du^2 + dv^2) / 2 + t^2 / 4 + 3/4 (p^2 + q^2) + p q / 2 + k (p + q) + k^2) + A |dc'|^2

Shape and color are coupled: a larger splat and a brighter one are partly the same. With n, the color times the root
of the area, the relative change along the color is h = k + (p + q) / 2, and the last terms in p, q, k become
h^2 + (p^2 + q^2) / 2, where p^2 + q^2 = dm^2 + dr^2. The block is diagonal in (u, v, m, r, s, n), and its inverse is
one division for each coordinate: what `descent` begins every inverse Hessian with.

Every result is made of stated operations in binary64 and is the same on every machine.
"""

import math
from typing import Final

import numpy as np

from gsvc_base.arrays import F4, F8
from gsvc_base.portable import LN2_PARTS
from gsvc_ref._jit import kernel

PER_ROOT3: Final = 1 / math.sqrt(3.0)
PER_ROOT2: Final = 1 / math.sqrt(2.0)
PER_ROOT6: Final = 1 / math.sqrt(6.0)
ROOT2: Final = math.sqrt(2.0)

ENERGY_SCALE: Final = 255 * math.sqrt(math.pi)  # |n| of a splat with l11 = l22 = 1 px and a color of length 1
MIN_DIAGONAL: Final = 0.125  # smallest l11 and l22 in pixels that a state can hold
MIN_ENERGY: Final = 1.5  # splats with less energy than this many D have the units of one that has it

_LN2_UPPER, _LN2_LOWER = LN2_PARTS
_PER_LN2: Final = 1 / math.log(2)
_EXP: Final = tuple(1 / math.factorial(n) for n in range(13, -1, -1))
_LOG: Final = tuple(2 / (2 * n + 1) for n in range(11, -1, -1))


def squared_energies(z: F8) -> F8:
    """E^2 of each splat, (N,)."""
    return np.asarray((z[:, 5] * z[:, 5] + z[:, 6] * z[:, 6]) + z[:, 7] * z[:, 7])


@kernel(inline=True)
def exp_kernel(x: float) -> float:
    """`portable.exp` of a number between -700 and 700."""
    whole = np.rint(x * _PER_LN2)
    rest = (x - whole * _LN2_UPPER) - whole * _LN2_LOWER
    total = _EXP[0]
    for i in range(1, 14):
        total = total * rest + _EXP[i]
    return math.ldexp(total, int(whole))


@kernel(inline=True)
def log_kernel(x: float) -> float:
    """`portable.log` of a normal number above 0."""
    part, exponent = math.frexp(x)
    if part < math.sqrt(0.5):
        part, exponent = 2 * part, exponent - 1
    ratio = (part - 1) / (part + 1)
    square = ratio * ratio
    total = _LOG[0]
    for i in range(1, 12):
        total = total * square + _LOG[i]
    return exponent * _LN2_UPPER + (ratio * total + exponent * _LN2_LOWER)


@kernel(inline=True)
def squared_energy(z: F8) -> float:
    """E^2 of a splat (8,)."""
    return float((z[5] * z[5] + z[6] * z[6]) + z[7] * z[7])


@kernel()
def to_coordinates(parameters: F4) -> F8:
    """The coordinates (N, 8) of splats (N, 8) f4; l11 and l22 below MIN_DIAGONAL count as that."""
    z = np.empty(parameters.shape)
    for i in range(len(z)):
        l11 = max(np.float64(parameters[i, 2]), MIN_DIAGONAL)
        l22 = max(np.float64(parameters[i, 4]), MIN_DIAGONAL)
        a, b = log_kernel(l11), log_kernel(l22)
        scale = ENERGY_SCALE * math.sqrt(l11 * l22)
        red, green, blue = np.float64(parameters[i, 5]), np.float64(parameters[i, 6]), np.float64(parameters[i, 7])
        z[i, 0], z[i, 1] = parameters[i, 0], parameters[i, 1]
        z[i, 2], z[i, 3] = (a + b) * PER_ROOT2, (a - b) * PER_ROOT2
        z[i, 4] = np.float64(parameters[i, 3]) / l22
        z[i, 5] = ((red + green) + blue) * PER_ROOT3 * scale
        z[i, 6] = (red - blue) * PER_ROOT2 * scale
        z[i, 7] = ((red - 2 * green) + blue) * PER_ROOT6 * scale
    return z


@kernel(inline=True)
def put_parameters(z: F8, row: F4) -> None:
    """The parameters of a splat with the coordinates z (8,), into row (8,): `to_parameters`."""
    l22 = exp_kernel((z[2] - z[3]) * PER_ROOT2)
    row[0], row[1] = z[0], z[1]
    row[2], row[3], row[4] = exp_kernel((z[2] + z[3]) * PER_ROOT2), z[4] * l22, l22
    scale = exp_kernel(-(z[2] * PER_ROOT2)) / ENERGY_SCALE  # 1 / sqrt(l11 l22) = exp(-m / sqrt 2)
    grey, across, green = z[5] * PER_ROOT3, z[6] * PER_ROOT2, z[7] * PER_ROOT6
    row[5] = ((grey + across) + green) * scale  # the transpose of M is its inverse
    row[6] = (grey - 2 * green) * scale
    row[7] = ((grey - across) + green) * scale


@kernel()
def to_parameters(z: F8) -> F4:
    """The parameters (N, 8) f4 of splats with the coordinates z (N, 8): the inverse of `to_coordinates`."""
    parameters = np.empty(z.shape, np.float32)
    for i in range(len(z)):
        put_parameters(z[i], parameters[i])
    return parameters


@kernel(inline=True)
def put_gradient(row: F4, g: F4, out: F8) -> None:
    """The gradient by (u, v, m, r, s, n), into out (8,), from that by the parameters, g (8,), at `row` (8,).

    n holds while the size changes, so that a color goes as 1 / sqrt(l11 l22): that is the term `by_scale`. l21 / l11
    holds as well, so that l21 goes with l11 = exp(a) and not with l22 = exp(b).
    """
    l11, l21, l22 = np.float64(row[2]), np.float64(row[3]), np.float64(row[4])
    g0, g1, g2, g3, g4 = np.float64(g[0]), np.float64(g[1]), np.float64(g[2]), np.float64(g[3]), np.float64(g[4])
    g5, g6, g7 = np.float64(g[5]), np.float64(g[6]), np.float64(g[7])
    by_scale = 0.5 * ((g5 * np.float64(row[5]) + g6 * np.float64(row[6])) + g7 * np.float64(row[7]))
    by_a = (g2 * l11 + g3 * l21) - by_scale
    by_b = g4 * l22 - by_scale
    scale = 1 / (ENERGY_SCALE * math.sqrt(l11 * l22))
    out[0] = g0 * l11 + g1 * l21
    out[1] = g1 * l22
    out[2], out[3] = (by_a + by_b) * PER_ROOT2, (by_a - by_b) * PER_ROOT2
    out[4] = g3 * l22
    out[5] = ((g5 + g6) + g7) * PER_ROOT3 * scale
    out[6] = (g5 - g7) * PER_ROOT2 * scale
    out[7] = ((g5 - 2 * g6) + g7) * PER_ROOT6 * scale


@kernel()
def gradient_by_coordinates(parameters: F4, gradient: F4) -> F8:
    """The gradient (N, 8) by (u, v, m, r, s, n0, n1, n2) of any loss, from that by the parameters (N, 8) f4."""
    out = np.empty(parameters.shape)
    for i in range(len(out)):
        put_gradient(parameters[i], gradient[i], out[i])
    return out


@kernel()
def moved(z: F8, step: F8) -> F8:
    """The coordinates (N, 8) of splats after a step (N, 8) by (u, v, m, r, s, n0, n1, n2)."""
    out = np.empty(z.shape)
    for i in range(len(out)):
        l11, l22 = exp_kernel((z[i, 2] + z[i, 3]) * PER_ROOT2), exp_kernel((z[i, 2] - z[i, 3]) * PER_ROOT2)
        out[i, 0] = z[i, 0] + l11 * step[i, 0]
        out[i, 1] = z[i, 1] + (z[i, 4] * l22 * step[i, 0] + l22 * step[i, 1])
        for k in range(2, 8):
            if k != 4:
                out[i, k] = z[i, k] + step[i, k]
        out[i, 4] = z[i, 4] * exp_kernel(ROOT2 * step[i, 3]) + step[i, 4]  # l21 / l11 holds
    return out


def units(z: F8, D: float) -> F8:
    """By how much each of (u, v, m, r, s, n0, n1, n2) must change to be worth an error of D^2 (metric), (N, 8)."""
    out = np.full(z.shape, D)
    relative = D / np.maximum(np.sqrt(squared_energies(z)), MIN_ENERGY * D)
    out[:, :4] = (ROOT2 * relative)[:, None]
    out[:, 4] = 2 * relative
    return out


@kernel(inline=True)
def limited(m: float, r: float, low: float, high: float) -> tuple[float, float]:
    """The size and aspect nearest to these whose ln l11 and ln l22 are between two numbers."""
    a = min(max((m + r) * PER_ROOT2, low), high)
    b = min(max((m - r) * PER_ROOT2, low), high)
    return (a + b) * PER_ROOT2, (a - b) * PER_ROOT2
