"""The precision ``deterministic`` in its plainest form: every binary32 operation and its place in the order.

NumPy rounds each operation on its own, to nearest with ties to even, keeps subnormal numbers and fuses nothing: this is
spec.md section 9.3 (R-9.3-1). The kernels of `fast.sums` whose names end in ``_strict`` are what runs, with the same
bits.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4
from gsvc_base.constants import HALF, ONE, SMALLEST_NORMAL, SUPPORT_SQUARED
from gsvc_base.splats import PARAMETERS_PER_SPLAT, Splats
from gsvc_ref.rendering.fast.exponential import K1, K2, K3, K4, K5
from gsvc_ref.rendering.fast.sums import M_BLUE, M_GREEN, M_RED, M_U1, M_U1U1, M_U1U2, M_U2, M_U2U2, MOMENTS
from gsvc_ref.rendering.fast.tiles import TILE_WIDTH


def whitened(splat: F4, width: int, height: int) -> tuple[F4, F4, F4]:
    """u1 and u2 and m = u1^2 + u2^2 of one splat (8,) f4 over the frame, each (H, W) f4: spec.md (9-3) and (9-4)."""
    x, y, l11, l21, l22 = splat[:5]
    r1, r2 = ONE / l11, ONE / l22
    l, f = (l21, r2) if l22 <= 1 else (l21 / l22, ONE)  # so that no product overflows where a pixel is covered
    u1 = (np.arange(width, dtype=np.float32) + HALF - x) * r1  # (W,) f4
    shear = (l * u1) * f  # (W,) f4
    row = (np.arange(height, dtype=np.float32) + HALF - y) * r2  # (H,) f4
    u2 = row[:, None] - shear
    u1 = np.broadcast_to(u1, u2.shape)
    return u1, u2, u1 * u1 + u2 * u2


def weight(m: F4) -> F4:
    """The weight g ~ exp(-m/2) where m <= 2 ln 255, else 0: spec.md (9-5)."""
    covered = m <= SUPPORT_SQUARED
    m = np.where(covered, m, np.float32(0))  # a large m would overflow in the polynomial
    t = m * m
    p = ((K5 * t + (K4 * m + K3)) * t + (K2 * m + K1)) * m + ONE  # p ~ exp(-m/16), in the order of (9-5)
    h = p * p
    q = h * h  # exp(-m/4)
    return np.where(covered, q * q, np.float32(0))


def _drawn(splats: Splats) -> Iterator[tuple[int, F4]]:
    """The index and parameters (8,) f4 of every splat that is finite and not degenerate, in index order."""
    for n, splat in enumerate(splats.to_array()):
        if splat[2] >= SMALLEST_NORMAL and splat[4] >= SMALLEST_NORMAL and np.isfinite(splat[:5]).all():
            yield n, splat


def sum_plain(splats: Splats, width: int, height: int) -> F4:
    """The sum C of spec.md (9-6), (H, W, 3) f4, not clamped."""
    C = np.zeros((height, width, 3), np.float32)  # (H, W, 3) f4
    with np.errstate(over="ignore", invalid="ignore"):  # far from a splat, where it covers nothing
        for _, splat in _drawn(splats):
            g = weight(whitened(splat, width, height)[2])
            C = np.where(g[..., None] > 0, C + g[..., None] * splat[5:], C)
    return C


def gradients_plain(splats: Splats, residual: F4) -> F4:
    """The gradient of sum(residual * C), (N, 8) f4, coverage held fixed, for a residual dL/dC (H, W, 3) f4.

    With e = dL/dC and q = g ((e_red red + e_green green) + e_blue blue), a splat has the sums of q, q u2 and (q u2) u2
    and of g e. Column i of the frame is lane i mod 16 of tile i div 16 (`TILE_WIDTH`). In each tile

    - a lane adds its rows one after the other, from the top, in binary32;
    - lanes k and k + 8 are added, with their u1: q u1 + q' u1', (q u1) u1 + (q' u1') u1', (q u2) u1 + (q' u2') u1';
    - then the eight in the same way, half to half: ((0 + 4) + (2 + 6)) + ((1 + 5) + (3 + 7)).

    The moments of the tiles are added from the left in binary64, and the gradient is made of them in binary64 and
    rounded once (`sums.grad_splat`).
    """
    height, width = residual.shape[:2]
    tiles = -(-width // TILE_WIDTH)
    padded = np.zeros((height, tiles * TILE_WIDTH, 3), np.float32)  # zero beside the frame
    padded[:, :width] = residual
    gradients = np.zeros((len(splats), PARAMETERS_PER_SPLAT), np.float32)  # (N, 8) f4
    with np.errstate(over="ignore", invalid="ignore"):
        for n, splat in _drawn(splats):
            S = np.zeros(MOMENTS)  # (8,) f8, with the columns of `sums`
            u1, u2, m = whitened(splat, tiles * TILE_WIDTH, height)
            g = weight(m)
            for t in range(tiles):
                at = slice(t * TILE_WIDTH, (t + 1) * TILE_WIDTH)
                S += _tile_sums(u1[0, at], u2[:, at], g[:, at], padded[:, at], splat[5:])  # from the left, in binary64
            gradients[n] = _from_moments(S, splat.astype(np.float64))
    return gradients


def _tile_sums(u1: F4, u2: F4, g: F4, e: F4, color: F4) -> NDArray[np.float64]:
    """The eight moments of one tile: `u1` (16,), `u2` and `g` (H, 16), `e` (H, 16, 3)."""
    # Where nothing is covered, q and u2 may be infinite, and 0 * infinity would be NaN.
    u2 = np.where(g > 0, u2, np.float32(0))
    q = np.where(g > 0, g * (e[..., 0] * color[0] + e[..., 1] * color[1] + e[..., 2] * color[2]), np.float32(0))
    qu2 = q * u2
    lanes = np.stack([q, qu2, qu2 * u2, *(g * e[..., k] for k in range(3))])  # (6, H, 16) f4
    totals = np.zeros((6, TILE_WIDTH), np.float32)
    for row in range(lanes.shape[1]):
        totals = totals + lanes[:, row]  # each lane from the top
    q, qu2 = totals[0], totals[1]
    u1 = np.where((q != 0) | (qu2 != 0), u1, np.float32(0))
    return np.array([_tree(lanes) for lanes in (q * u1, qu2, q * u1 * u1, qu2 * u1, *totals[2:])], np.float64)


def _tree(lanes: F4) -> np.float32:
    """The sum of a power of two of numbers: the right half is added to the left until one is left."""
    while len(lanes) > 1:
        half = len(lanes) // 2
        lanes = lanes[:half] + lanes[half:]
    return np.float32(lanes[0])


def _from_moments(S: NDArray[np.float64], splat: NDArray[np.float64]) -> F4:
    """One splat's gradient (8,) f4 by (13-12), see `sums.grad_splat`."""
    l11, l21, l22 = splat[2:5]
    r1, r2 = 1 / l11, 1 / l22
    slope = l21 * r1 * r2  # v1 = u1 / l11 - slope u2
    of_mu = [S[M_U1] * r1 - S[M_U2] * slope, S[M_U2] * r2]
    of_l = [S[M_U1U1] * r1 - S[M_U1U2] * slope, S[M_U1U2] * r2, S[M_U2U2] * r2]
    return np.array([*of_mu, *of_l, S[M_RED], S[M_GREEN], S[M_BLUE]], np.float32)
