"""The sum over splats and its gradients on tiles, in binary32: forward and backward inner loops beside each other.

The definition is `definition.py`, and the names are those of spec.md: the splat's centre x and y, u1 and u2, m =
u1^2 + u2^2, the weight g, e = dL/dC, q = g (e . c') of (10-6), and the moments S of (13-12). All loops over
`TILE_WIDTH` have constant bounds and constant offsets into one flat buffer, which is what makes LLVM turn them into
vector code; a test looks at the result. Per tile the splats come in index order, so that each sum has one fixed order
whoever owns the tile. The loops exist twice: with contraction, and `_strict` with every operation rounded as it is
written (spec.md section 9.3).
"""

from typing import Any, Final

import numpy as np

from gsvc_ref._jit import kernel, without_contraction
from gsvc_ref.constants import HALF, SUPPORT_SQUARED
from gsvc_ref.rendering.fast.batches import Batch
from gsvc_ref.rendering.fast.exponential import exp_minus_half, exp_minus_half_strict
from gsvc_ref.rendering.fast.projection import BLUE, GREEN, R1, R2, RED, F, L, X, Y, row_range
from gsvc_ref.rendering.fast.tiles import F4, F8, LANES, ROW, ROWS, TILE_WIDTH

ZERO: Final = np.float32(0)

MOMENTS: Final = 8
U1, U2, U1U1, U1U2, U2U2, E_RED, E_GREEN, E_BLUE = range(MOMENTS)
"""The moments S of an intersection: the sums of q u1, q u2, q u1 u1, q u1 u2 and q u2 u2 (13-12), and the three sums of
g e (10-9)."""

LANE_SUMS: Final = 6 * TILE_WIDTH
Q, QU2, QU2U2, GE_RED, GE_GREEN, GE_BLUE = range(0, LANE_SUMS, TILE_WIDTH)
"""The places where the lanes of each sum of the backward loop begin: the sums of q, q u2, q u2 u2 and the three of
g e. Within a tile u1 is constant per lane, so that the moments with u1 follow from these."""

EIGHT: Final = TILE_WIDTH // 2
QU1, QU1U1, QU1U2 = Q, Q + EIGHT, QU2 + EIGHT
"""The places where `fold_lanes` puts the sums with u1, once lanes k and k + 8 have been added: eight lanes each."""


@kernel(contract=True, inline=True)
def add_splat(tile: F4, column: np.float32, first: int, end: int, splat: Any) -> None:
    """Add one splat to the rows `first` to `end` - 1 of a tile, ROWS at a time: C <- C + g c' (9-6) if m <= 2 ln 255.

    What does not depend on the row is read in front of the loop: LLVM, which cannot know that a tile holds no splat,
    would otherwise find u1 and the shear anew for every ROWS rows.

    Parameters
    ----------
    tile
        (rows * ROW,) f4; up to SPARE_ROWS rows below `end` are added to as well.
    column
        The centre of the tile's first column.
    splat
        (PROJECTED,) f4, see `projection.X`.
    """
    x, y, r1, l, f, r2 = splat[X], splat[Y], splat[R1], splat[L], splat[F], splat[R2]
    red, green, blue = splat[RED], splat[GREEN], splat[BLUE]
    for top in range(first, end, ROWS):
        rows, row = tile[top * ROW : (top + ROWS) * ROW], np.float32(top) + HALF
        for k in range(TILE_WIDTH):
            u1 = ((column + LANES[k]) - x) * r1
            shear = (l * u1) * f
            for j in range(ROWS):
                u2 = ((row + np.float32(j)) - y) * r2 - shear
                m = u1 * u1 + u2 * u2  # (9-4)
                g = exp_minus_half(m) if m <= SUPPORT_SQUARED else ZERO
                rows[j * ROW + k] += g * red  # (9-6)
                rows[j * ROW + TILE_WIDTH + k] += g * green
                rows[j * ROW + 2 * TILE_WIDTH + k] += g * blue


add_splat_strict = without_contraction(add_splat, exp_minus_half=exp_minus_half_strict)


@kernel(contract=True, inline=True)
def grad_add_splat(lane_sums: F4, tile: F4, column: np.float32, first: int, end: int, splat: Any) -> None:
    """The transpose of `add_splat`: add, per lane, what rows of dL/dC contribute to one splat's lane sums.

    Parameters
    ----------
    lane_sums
        (LANE_SUMS,) f4, see `Q`.
    tile
        (rows * ROW,) f4, e = dL/dC.
    column, first, end, splat
        As for `add_splat`.
    """
    x, y, r1, l, f, r2 = splat[X], splat[Y], splat[R1], splat[L], splat[F], splat[R2]
    red, green, blue = splat[RED], splat[GREEN], splat[BLUE]
    for top in range(first, end, ROWS):
        rows, row = tile[top * ROW : (top + ROWS) * ROW], np.float32(top) + HALF
        for k in range(TILE_WIDTH):
            u1 = ((column + LANES[k]) - x) * r1
            shear = (l * u1) * f
            of_q, of_qu2, of_qu2u2 = lane_sums[Q + k], lane_sums[QU2 + k], lane_sums[QU2U2 + k]
            of_red, of_green, of_blue = lane_sums[GE_RED + k], lane_sums[GE_GREEN + k], lane_sums[GE_BLUE + k]
            for j in range(ROWS):
                u2 = ((row + np.float32(j)) - y) * r2 - shear
                m = u1 * u1 + u2 * u2  # (9-4)
                g = exp_minus_half(m) if m <= SUPPORT_SQUARED else ZERO
                u2 = u2 if m <= SUPPORT_SQUARED else ZERO  # it may be infinite there, and 0 * infinity is no sum
                e_red = rows[j * ROW + k]
                e_green = rows[j * ROW + TILE_WIDTH + k]
                e_blue = rows[j * ROW + 2 * TILE_WIDTH + k]
                q = g * (e_red * red + e_green * green + e_blue * blue)  # (10-6)
                q = q if m <= SUPPORT_SQUARED else ZERO  # for the same reason
                qu2 = q * u2
                of_q += q
                of_qu2 += qu2
                of_qu2u2 += qu2 * u2
                of_red += g * e_red  # (10-9)
                of_green += g * e_green
                of_blue += g * e_blue
            lane_sums[Q + k], lane_sums[QU2 + k], lane_sums[QU2U2 + k] = of_q, of_qu2, of_qu2u2
            lane_sums[GE_RED + k], lane_sums[GE_GREEN + k], lane_sums[GE_BLUE + k] = of_red, of_green, of_blue


grad_add_splat_strict = without_contraction(grad_add_splat, exp_minus_half=exp_minus_half_strict)


@kernel(inline=True)
def tree(a: F4) -> Any:
    """The sum of eight numbers as a fixed tree."""
    return ((a[0] + a[4]) + (a[2] + a[6])) + ((a[1] + a[5]) + (a[3] + a[7]))


@kernel(contract=True, inline=True)
def fold_lanes(lane_sums: F4, column: np.float32, splat: Any, S: F4) -> None:
    """Fold the lane sums of one intersection in a fixed tree to its moments S (MOMENTS,) f4.

    `column` is that of `add_splat`, and `lane_sums` is overwritten. The loop handles all sums at once, since LLVM would
    unroll short bodies into scalar code.
    """
    x, r1 = splat[X], splat[R1]
    for k in range(EIGHT):
        u1_left = ((column + LANES[k]) - x) * r1
        u1_right = ((column + LANES[EIGHT + k]) - x) * r1
        q_left, q_right = lane_sums[Q + k], lane_sums[Q + EIGHT + k]
        qu2_left, qu2_right = lane_sums[QU2 + k], lane_sums[QU2 + EIGHT + k]
        # Where nothing is covered u1 may be infinite, and 0 * infinity is no sum.
        u1_left = u1_left if q_left != ZERO or qu2_left != ZERO else ZERO
        u1_right = u1_right if q_right != ZERO or qu2_right != ZERO else ZERO
        lane_sums[QU1 + k] = q_left * u1_left + q_right * u1_right
        lane_sums[QU1U1 + k] = q_left * u1_left * u1_left + q_right * u1_right * u1_right
        lane_sums[QU2 + k] = qu2_left + qu2_right
        lane_sums[QU1U2 + k] = qu2_left * u1_left + qu2_right * u1_right
        lane_sums[QU2U2 + k] += lane_sums[QU2U2 + EIGHT + k]
        lane_sums[GE_RED + k] += lane_sums[GE_RED + EIGHT + k]
        lane_sums[GE_GREEN + k] += lane_sums[GE_GREEN + EIGHT + k]
        lane_sums[GE_BLUE + k] += lane_sums[GE_BLUE + EIGHT + k]
    S[U1] = tree(lane_sums[QU1 : QU1 + EIGHT])
    S[U2] = tree(lane_sums[QU2 : QU2 + EIGHT])
    S[U1U1] = tree(lane_sums[QU1U1 : QU1U1 + EIGHT])
    S[U1U2] = tree(lane_sums[QU1U2 : QU1U2 + EIGHT])
    S[U2U2] = tree(lane_sums[QU2U2 : QU2U2 + EIGHT])
    S[E_RED] = tree(lane_sums[GE_RED : GE_RED + EIGHT])  # (10-9)
    S[E_GREEN] = tree(lane_sums[GE_GREEN : GE_GREEN + EIGHT])
    S[E_BLUE] = tree(lane_sums[GE_BLUE : GE_BLUE + EIGHT])


fold_lanes_strict = without_contraction(fold_lanes)


@kernel()
def add_batch(tile: F4, t: int, top: int, end: int, batch: Batch, count: int, strict: bool) -> None:
    """Add the first `count` splats of a batch in order to the rows top to end - 1 of tile t.

    `tile` is ((height + SPARE_ROWS) * ROW,) f4; up to SPARE_ROWS rows below `end` are spoiled.
    """
    column = np.float32(t * TILE_WIDTH) + HALF
    for i in range(count):
        splat, first, last = batch.splats[i], max(batch.rows[i, 0], top), min(batch.rows[i, 1], end)
        if strict:
            add_splat_strict(tile, column, first, last, splat)
        else:
            add_splat(tile, column, first, last, splat)


@kernel()
def grad_add_batch(tile: F4, t: int, batch: Batch, count: int, moments: F4, lane_sums: F4, strict: bool) -> None:
    """The transpose of `add_batch` for all rows: from e = dL/dC of tile t to the moments (intersections, MOMENTS) f4.

    `tile` is zero in the spare rows, and `lane_sums` is (LANE_SUMS,) f4 scratch. Per lane a sum goes down the rows, one
    after the other: rows that hold no covered pixel add zero, so that the bits do not depend on how rows are grouped.
    """
    column = np.float32(t * TILE_WIDTH) + HALF
    for i in range(count):
        splat = batch.splats[i]
        S = moments[batch.rows[i, 2]]
        lane_sums[:] = ZERO
        if strict:
            grad_add_splat_strict(lane_sums, tile, column, batch.rows[i, 0], batch.rows[i, 1], splat)
            fold_lanes_strict(lane_sums, column, splat, S)
        else:
            grad_add_splat(lane_sums, tile, column, batch.rows[i, 0], batch.rows[i, 1], splat)
            fold_lanes(lane_sums, column, splat, S)


@kernel()
def grad_splat(moments: F4, parameters: F4, scale: float, S: F8, gradient: F4) -> None:
    """One splat's gradient (8,) f4 from the moments (tiles, MOMENTS) f4 of its intersections: (13-12).

    It is (10-7) and (10-8), since v = L^-T u has v2 = u2 / l22 and v1 = u1 / l11 - slope u2, slope = l21 / (l11 l22).
    In binary64, rounded once. `S` is (MOMENTS,) f8 scratch.
    """
    S[:] = 0
    for i in range(moments.shape[0]):
        for k in range(MOMENTS):
            S[k] += moments[i, k]
    if moments.shape[0] == 0:
        gradient[:] = ZERO
        return
    r1 = 1 / np.float64(parameters[2])
    l21 = np.float64(parameters[3])
    r2 = 1 / np.float64(parameters[4])
    slope = l21 * r1 * r2
    gradient[0] = scale * (S[U1] * r1 - S[U2] * slope)  # (10-7) dL/dx = sum q v1
    gradient[1] = scale * (S[U2] * r2)  # (10-7) dL/dy = sum q v2
    gradient[2] = scale * (S[U1U1] * r1 - S[U1U2] * slope)  # (10-8) dL/dl11 = sum q v1 u1
    gradient[3] = scale * (S[U1U2] * r2)  # (10-8) dL/dl21 = sum q v2 u1
    gradient[4] = scale * (S[U2U2] * r2)  # (10-8) dL/dl22 = sum q v2 u2
    gradient[5] = scale * S[E_RED]  # (10-9) dL/dc' = sum g e
    gradient[6] = scale * S[E_GREEN]
    gradient[7] = scale * S[E_BLUE]


@kernel()
def covered_in_tile(t: int, width: int, height: int, splat: Any) -> int:
    """The number of pixels of tile t that one splat covers, by the decision of `add_splat_strict`."""
    x, y, r1, l, f, r2 = splat[X], splat[Y], splat[R1], splat[L], splat[F], splat[R2]
    column = np.float32(t * TILE_WIDTH) + HALF
    first, end = row_range(splat, t, height)
    pixels = 0
    for j in range(first, end):
        for k in range(min(TILE_WIDTH, width - t * TILE_WIDTH)):
            u1 = ((column + LANES[k]) - x) * r1
            u2 = ((np.float32(j) + HALF) - y) * r2 - (l * u1) * f
            pixels += u1 * u1 + u2 * u2 <= SUPPORT_SQUARED  # (9-4)
    return pixels
