"""The sum over splats and its gradients on tiles, in binary32: forward and backward inner loops beside each other.

The definition is `definition.py`, and the names are those of spec.md: the splat's centre x and y, u1 and u2, m =
u1^2 + u2^2, the weight g, e = dL/dC, q = g (e . c') of (10-6), and the moments S of (13-12). All loops over
`TILE_WIDTH` have constant bounds and constant offsets into one flat buffer, which is what makes LLVM turn them into
vector code; a test looks at the result. Per tile the splats come in index order, so that each sum has one fixed order
whoever owns the tile. The forward pass keeps its weights for the backward pass, which need not find them again. The
loops exist twice: with contraction, and `_strict` with every operation rounded as it is written (spec.md section 9.3).
"""

from typing import Any, Final

import numpy as np

from gsvc_base.arrays import F4, F8
from gsvc_base.constants import HALF, SUPPORT_SQUARED
from gsvc_ref._jit import kernel, without_contraction
from gsvc_ref.rendering.fast.batches import INDEX, KEPT_AT, NOWHERE, Batch, Buffers
from gsvc_ref.rendering.fast.exponential import exp_minus_half, exp_minus_half_strict
from gsvc_ref.rendering.fast.projection import BLUE, GREEN, R1, R2, RED, F, L, X, Y, row_range
from gsvc_ref.rendering.fast.tiles import CHANNELS, GROUP_ROWS, LANES, ROW, SPARE_ROWS, TILE_WIDTH, ZERO

MOMENTS: Final = 8
M_U1, M_U2, M_U1U1, M_U1U2, M_U2U2, M_RED, M_GREEN, M_BLUE = range(MOMENTS)
"""The moments S of an intersection: the sums of q u1, q u2, q u1 u1, q u1 u2 and q u2 u2 (13-12), and the three sums of
g e (10-9)."""

LANE_SUMS: Final = 6 * TILE_WIDTH
Q, QU2, QU2U2, GE_RED, GE_GREEN, GE_BLUE = range(0, LANE_SUMS, TILE_WIDTH)
"""The places where the lanes of each sum of the backward loop begin: the sums of q, q u2, q u2 u2 and the three of
g e. Within a tile u1 is constant per lane, so that the moments with u1 follow from these."""

HALF_TILE: Final = TILE_WIDTH // 2
QU1, QU1U1, QU1U2 = Q, Q + HALF_TILE, QU2 + HALF_TILE
"""The places where `fold_lanes` puts the sums with u1, once lanes k and k + HALF_TILE have been added: HALF_TILE lanes
each."""


@kernel(inline=True)
def at(row: int, lane: int) -> Any:
    """Index of a lane of a row of weights; `at(row * CHANNELS, lane)` is that of the row's first channel in a tile.

    It is unsigned, so that Numba does not look whether it counts from the end, for which LLVM would find anew for every
    GROUP_ROWS rows whether arrays overlap.
    """
    return np.uint64(row * TILE_WIDTH + lane)


@kernel(contract=True, inline=True)
def weigh_splat(weights: F4, column: np.float32, first: int, end: int, splat: Any) -> None:
    """Find the weights g of one splat (PROJECTED,) in the rows `first` to `end` - 1 of a tile, zero where m > 2 ln 255.

    `column` is the centre of the tile's first column. Weights up to SPARE_ROWS rows further are overwritten, too. What
    does not depend on the row is read before the loop: LLVM, which cannot know that the weights are no splat, would
    otherwise find u1 and the shear anew for every GROUP_ROWS rows.
    """
    x, y, r1, l, f, r2 = splat[X], splat[Y], splat[R1], splat[L], splat[F], splat[R2]
    for i in range(0, end - first, GROUP_ROWS):
        row = np.float32(first + i) + HALF
        for k in range(TILE_WIDTH):
            u1 = ((column + LANES[k]) - x) * r1
            shear = (l * u1) * f
            for j in range(GROUP_ROWS):
                u2 = ((row + np.float32(j)) - y) * r2 - shear
                m = u1 * u1 + u2 * u2  # (9-4)
                weights[at(i + j, k)] = exp_minus_half(m) if m <= SUPPORT_SQUARED else ZERO


weigh_splat_strict = without_contraction(weigh_splat, exp_minus_half=exp_minus_half_strict)


@kernel(inline=True)
def weigh(weights: F4, column: np.float32, first: int, end: int, splat: Any, strict: bool) -> None:
    """`weigh_splat` with or without contraction."""
    if strict:
        weigh_splat_strict(weights, column, first, end, splat)
    else:
        weigh_splat(weights, column, first, end, splat)


@kernel(inline=True)
def add_weighed(tile: F4, weights: F4, first: int, end: int, splat: Any) -> None:
    """Add one splat, whose weights are known, to the rows `first` to `end` - 1 of a tile: C <- C + g c' (9-6).

    Up to SPARE_ROWS rows below `end` are added to, too.
    """
    red, green, blue = splat[RED], splat[GREEN], splat[BLUE]
    rows = tile[first * ROW :]
    for i in range(0, end - first, GROUP_ROWS):
        # Lanes outside, rows inside: LLVM makes a vector of the lanes, and the rows hide latency.
        for k in range(TILE_WIDTH):
            for j in range(GROUP_ROWS):
                g, place = weights[at(i + j, k)], (i + j) * CHANNELS
                rows[at(place, k)] += g * red
                rows[at(place + 1, k)] += g * green
                rows[at(place + 2, k)] += g * blue


@kernel(contract=True, inline=True)
def add_splat(tile: F4, weights: F4, column: np.float32, first: int, end: int, splat: Any, keep: bool) -> None:
    """`weigh_splat` and `add_weighed` in one loop; `keep` is a constant that says whether weights are written.

    With fused multiply-adds one loop takes less time than two. Without, it would need more registers than there are.
    """
    x, y, r1, l, f, r2 = splat[X], splat[Y], splat[R1], splat[L], splat[F], splat[R2]
    red, green, blue = splat[RED], splat[GREEN], splat[BLUE]
    rows = tile[first * ROW :]
    for i in range(0, end - first, GROUP_ROWS):
        row = np.float32(first + i) + HALF
        for k in range(TILE_WIDTH):
            u1 = ((column + LANES[k]) - x) * r1
            shear = (l * u1) * f
            for j in range(GROUP_ROWS):
                u2 = ((row + np.float32(j)) - y) * r2 - shear
                m = u1 * u1 + u2 * u2  # (9-4)
                g = exp_minus_half(m) if m <= SUPPORT_SQUARED else ZERO
                if keep:
                    weights[at(i + j, k)] = g
                place = (i + j) * CHANNELS
                rows[at(place, k)] += g * red  # (9-6)
                rows[at(place + 1, k)] += g * green
                rows[at(place + 2, k)] += g * blue


@kernel(contract=True, inline=True)
def grad_add_splat(lane_sums: F4, tile: F4, weights: F4, column: np.float32, first: int, end: int, splat: Any) -> None:
    """The transpose of `add_splat`: add, per lane, what rows of dL/dC contribute to one splat's lane sums (see `Q`)."""
    x, y, r1, l, f, r2 = splat[X], splat[Y], splat[R1], splat[L], splat[F], splat[R2]
    red, green, blue = splat[RED], splat[GREEN], splat[BLUE]
    rows = tile[first * ROW :]
    for i in range(0, end - first, GROUP_ROWS):
        row = np.float32(first + i) + HALF
        for k in range(TILE_WIDTH):
            u1 = ((column + LANES[k]) - x) * r1
            shear = (l * u1) * f
            of_q, of_qu2, of_qu2u2 = lane_sums[Q + k], lane_sums[QU2 + k], lane_sums[QU2U2 + k]
            of_red, of_green, of_blue = lane_sums[GE_RED + k], lane_sums[GE_GREEN + k], lane_sums[GE_BLUE + k]
            for j in range(GROUP_ROWS):
                g = weights[at(i + j, k)]
                u2 = ((row + np.float32(j)) - y) * r2 - shear
                place = (i + j) * CHANNELS
                e_red, e_green, e_blue = rows[at(place, k)], rows[at(place + 1, k)], rows[at(place + 2, k)]
                q = g * (e_red * red + e_green * green + e_blue * blue)  # (10-6)
                # Where nothing is covered both may be infinite, and 0 * infinity is no sum.
                q = q if g > ZERO else ZERO
                u2 = u2 if g > ZERO else ZERO
                qu2 = q * u2
                of_q += q
                of_qu2 += qu2
                of_qu2u2 += qu2 * u2
                of_red += g * e_red  # (10-9)
                of_green += g * e_green
                of_blue += g * e_blue
            lane_sums[Q + k], lane_sums[QU2 + k], lane_sums[QU2U2 + k] = of_q, of_qu2, of_qu2u2
            lane_sums[GE_RED + k], lane_sums[GE_GREEN + k], lane_sums[GE_BLUE + k] = of_red, of_green, of_blue


grad_add_splat_strict = without_contraction(grad_add_splat)


@kernel(inline=True)
def tree(a: F4) -> Any:
    """The sum of HALF_TILE numbers, which it overwrites: the upper half is added to the lower until one is left."""
    half = HALF_TILE // 2
    while half > 0:
        for k in range(half):
            a[k] += a[half + k]
        half //= 2
    return a[0]


@kernel(contract=True, inline=True)
def fold_lanes(lane_sums: F4, column: np.float32, splat: Any, S: F4) -> None:
    """Fold the lane sums of one intersection in a fixed tree to its moments S (MOMENTS,) f4.

    `column` is that of `add_splat`, and `lane_sums` is overwritten. The loop handles all sums at once, since LLVM would
    unroll short bodies into scalar code.
    """
    x, r1 = splat[X], splat[R1]
    for k in range(HALF_TILE):
        u1_left = ((column + LANES[k]) - x) * r1
        u1_right = ((column + LANES[HALF_TILE + k]) - x) * r1
        # Both are read before QU1 and QU1U1, which share their places, are written.
        q_left, q_right = lane_sums[Q + k], lane_sums[Q + HALF_TILE + k]
        qu2_left, qu2_right = lane_sums[QU2 + k], lane_sums[QU2 + HALF_TILE + k]
        # Where nothing is covered u1 may be infinite, and 0 * infinity is no sum.
        u1_left = u1_left if q_left != ZERO or qu2_left != ZERO else ZERO
        u1_right = u1_right if q_right != ZERO or qu2_right != ZERO else ZERO
        lane_sums[QU1 + k] = q_left * u1_left + q_right * u1_right
        lane_sums[QU1U1 + k] = q_left * u1_left * u1_left + q_right * u1_right * u1_right
        lane_sums[QU2 + k] = qu2_left + qu2_right
        lane_sums[QU1U2 + k] = qu2_left * u1_left + qu2_right * u1_right
        lane_sums[QU2U2 + k] += lane_sums[QU2U2 + HALF_TILE + k]
        lane_sums[GE_RED + k] += lane_sums[GE_RED + HALF_TILE + k]
        lane_sums[GE_GREEN + k] += lane_sums[GE_GREEN + HALF_TILE + k]
        lane_sums[GE_BLUE + k] += lane_sums[GE_BLUE + HALF_TILE + k]
    S[M_U1] = tree(lane_sums[QU1 : QU1 + HALF_TILE])
    S[M_U2] = tree(lane_sums[QU2 : QU2 + HALF_TILE])
    S[M_U1U1] = tree(lane_sums[QU1U1 : QU1U1 + HALF_TILE])
    S[M_U1U2] = tree(lane_sums[QU1U2 : QU1U2 + HALF_TILE])
    S[M_U2U2] = tree(lane_sums[QU2U2 : QU2U2 + HALF_TILE])
    S[M_RED] = tree(lane_sums[GE_RED : GE_RED + HALF_TILE])  # (10-9)
    S[M_GREEN] = tree(lane_sums[GE_GREEN : GE_GREEN + HALF_TILE])
    S[M_BLUE] = tree(lane_sums[GE_BLUE : GE_BLUE + HALF_TILE])


fold_lanes_strict = without_contraction(fold_lanes)


@kernel()
def add_batch(buffers: Buffers, t: int, top: int, end: int, batch: Batch, count: int, keep: bool, strict: bool) -> None:
    """Add the first `count` splats of a batch in order to the rows top to end - 1 of tile t.

    Up to SPARE_ROWS rows below `end` are spoiled. If `keep` is set, which is for all rows of a tile, weights are kept
    as long as there is room, and the batch says where.
    """
    column = np.float32(t * TILE_WIDTH) + HALF
    tile, used = buffers.tile, 0
    for i in range(count):
        splat, first, last = batch.splats[i], max(batch.rows[i, 0], top), min(batch.rows[i, 1], end)
        size = (last - first + SPARE_ROWS) * TILE_WIDTH
        weights = buffers.weights
        if keep and used + size <= buffers.kept.size:
            weights = buffers.kept[used:]
            batch.rows[i, KEPT_AT] = used
            used += size  # with the spare rows, which the backward loop reads, too
        if strict:
            weigh(weights, column, first, last, splat, strict)
            add_weighed(tile, weights, first, last, splat)
        elif keep:
            add_splat(tile, weights, column, first, last, splat, True)
        else:
            add_splat(tile, weights, column, first, last, splat, False)


@kernel()
def grad_add_batch(
    buffers: Buffers, t: int, batch: Batch, count: int, moments: F4, lane_sums: F4, strict: bool
) -> None:
    """The transpose of `add_batch` for all rows: from e = dL/dC of tile t to the moments (intersections, MOMENTS) f4.

    The tile is zero in the spare rows, and `lane_sums` is (LANE_SUMS,) f4 scratch. Per lane a sum goes down the rows,
    one after the other: rows that hold no covered pixel add zero, so that the bits do not depend on how rows are
    grouped. Weights that were not kept are found again.
    """
    column = np.float32(t * TILE_WIDTH) + HALF
    for i in range(count):
        splat, first, end, place = batch.splats[i], batch.rows[i, 0], batch.rows[i, 1], batch.rows[i, KEPT_AT]
        S = moments[batch.rows[i, INDEX]]
        weights = buffers.weights
        if place == NOWHERE:
            weigh(weights, column, first, end, splat, strict)
        else:
            weights = buffers.kept[place:]
        lane_sums[:] = ZERO
        if strict:
            grad_add_splat_strict(lane_sums, buffers.tile, weights, column, first, end, splat)
            fold_lanes_strict(lane_sums, column, splat, S)
        else:
            grad_add_splat(lane_sums, buffers.tile, weights, column, first, end, splat)
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
            S[k] += moments[i, k]  # tile after tile, from the left
    if moments.shape[0] == 0:
        gradient[:] = ZERO
        return
    r1 = 1 / np.float64(parameters[2])
    l21 = np.float64(parameters[3])
    r2 = 1 / np.float64(parameters[4])
    slope = l21 * r1 * r2
    gradient[0] = scale * (S[M_U1] * r1 - S[M_U2] * slope)  # (10-7) dL/dx = sum q v1
    gradient[1] = scale * (S[M_U2] * r2)  # (10-7) dL/dy = sum q v2
    gradient[2] = scale * (S[M_U1U1] * r1 - S[M_U1U2] * slope)  # (10-8) dL/dl11 = sum q v1 u1
    gradient[3] = scale * (S[M_U1U2] * r2)  # (10-8) dL/dl21 = sum q v2 u1
    gradient[4] = scale * (S[M_U2U2] * r2)  # (10-8) dL/dl22 = sum q v2 u2
    gradient[5] = scale * S[M_RED]  # (10-9) dL/dc' = sum g e
    gradient[6] = scale * S[M_GREEN]
    gradient[7] = scale * S[M_BLUE]


@kernel()
def covered_in_tile(t: int, width: int, height: int, splat: Any) -> int:
    """The number of pixels of tile t that one splat covers, by the decision of `weigh_splat_strict`."""
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
