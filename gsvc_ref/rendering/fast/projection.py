"""Projected splats: what the inner loops need of each, the tiles that it touches, and the rows that it may cover.

Nothing here decides coverage. Columns and rows are found in binary64 with a margin that outweighs the roundings of a
binary32 decision, so that every pixel that any binary32 arithmetic of `bounds` calls covered is among them: with
|u1| and |u2| off by at most gamma_5 |u1| and gamma_6 a + gamma_11 b (see there), such a pixel lies in the ellipse of
radius ELLIPSE, moved up or down by 17 eps SUPPORT_RADIUS (|l21| + l22) at most.
"""

import math
from typing import Any, Final, NamedTuple

import numpy as np

from gsvc_base.arrays import F4, I4
from gsvc_base.constants import SMALLEST_NORMAL, SUPPORT_RADIUS
from gsvc_ref._jit import kernel
from gsvc_ref.rendering.fast.tiles import TILE_WIDTH

ELLIPSE: Final = SUPPORT_RADIUS * (1 + 2.0**-18)
"""The radius of the ellipse that is listed, in standard deviations: the support with room for roundings."""

ROW_MARGIN: Final = SUPPORT_RADIUS * 2.0**-18
"""Room for roundings of a row, in units of |l21| + l22: above 17 eps SUPPORT_RADIUS. Both together have the room that
`REACH` has, so that no row is listed outside of the boxes of (5-1), whose pixels are the work that a level limits."""

PROJECTED: Final = 16
"""Floats of a projected splat: 64 bytes, a cache line."""

X, Y, R1, L, F, R2, RED, GREEN, BLUE, L11, L21, L22, FIRST_ROW, ROW_COUNT = range(14)
"""Columns of a projected splat: its centre, r1, l, f and r2 of (9-3), its colour, its factors, and its box's rows."""


class ProjectedSplats(NamedTuple):
    """A set of splats and its projection."""

    parameters: F4  # (N, 8), in the columns of `Splats.to_array`
    projected: F4
    """(N, PROJECTED) with the columns `X` to `ROW_COUNT`. The inner loops compute (l21 u1) / l22 as (l u1) f (9-3),
    which is (l21 u1) (1/l22) for l22 <= 1 and (u1 (l21/l22)) 1 above: nothing overflows where a pixel is covered."""
    tile_ranges: I4  # (N, 2): the first tile touched and the one after the last; equal if no centre can be covered


@kernel()
def project_task(first: int, end: int, splats: ProjectedSplats, width: int, height: int) -> None:
    """Fill `projected` and `tile_ranges` of the splats first to end - 1.

    A splat whose position or factor is infinite covers nothing.
    """
    for n in range(first, end):
        parameters = splats.parameters[n]
        finite = True
        for column in range(5):
            finite &= np.isfinite(parameters[column])
        x, y = np.float64(parameters[0]), np.float64(parameters[1])
        l11, l21, l22 = np.float64(parameters[2]), np.float64(parameters[3]), np.float64(parameters[4])
        tiles = splats.tile_ranges[n]
        tiles[0] = 0
        tiles[1] = 0
        if l11 < SMALLEST_NORMAL or l22 < SMALLEST_NORMAL or not finite:
            continue
        half_width = ELLIPSE * l11
        half_height = ELLIPSE * math.sqrt(l21 * l21 + l22 * l22) + ROW_MARGIN * (abs(l21) + l22)
        # Clamped as floats: a centre may be further away than any integer type reaches.
        left = max(np.ceil(x - half_width - 0.5), 0.0)
        right = min(np.floor(x + half_width - 0.5), width - 1.0)
        top = max(np.ceil(y - half_height - 0.5), 0.0)
        bottom = min(np.floor(y + half_height - 0.5), height - 1.0)
        if left > right or top > bottom:
            continue
        tiles[0] = int(left) // TILE_WIDTH
        tiles[1] = int(right) // TILE_WIDTH + 1
        projected = splats.projected[n]
        projected[X] = parameters[0]
        projected[Y] = parameters[1]
        projected[R1] = np.float32(1 / l11)
        projected[L] = parameters[3] if l22 <= 1 else np.float32(l21 / l22)  # (9-3)
        projected[F] = np.float32(1 / l22) if l22 <= 1 else np.float32(1)
        projected[R2] = np.float32(1 / l22)
        projected[RED] = parameters[5]
        projected[GREEN] = parameters[6]
        projected[BLUE] = parameters[7]
        projected[L11] = parameters[2]
        projected[L21] = parameters[3]
        projected[L22] = parameters[4]
        projected[FIRST_ROW] = np.float32(top)
        projected[ROW_COUNT] = np.float32(bottom - top + 1)


@kernel(inline=True)
def row_range(splat: Any, t: int, height: int) -> tuple[int, int]:
    """The rows (first, one after the last) where a projected splat may cover a pixel centre of tile t; equal if none.

    The ellipse |u| = ELLIPSE has the rows y + l21 u1 + l22 u2 with u2 = ± sqrt(ELLIPSE^2 - u1^2). Its lower edge is
    concave in u1 with the extreme at u1 = tip = ELLIPSE l21 / sqrt(l21^2 + l22^2), the upper edge mirrors it, so that
    over the columns of a tile the extremes are at tip and -tip clamped to their range of u1.
    """
    x, y = np.float64(splat[X]), np.float64(splat[Y])
    l11, l21, l22 = np.float64(splat[L11]), np.float64(splat[L21]), np.float64(splat[L22])
    tip = ELLIPSE * l21 / math.sqrt(l21 * l21 + l22 * l22)
    left = max((t * TILE_WIDTH + 0.5 - x) / l11, -ELLIPSE)
    right = min((t * TILE_WIDTH + TILE_WIDTH - 0.5 - x) / l11, ELLIPSE)
    low = min(max(tip, left), right)
    high = min(max(-tip, left), right)
    margin = ROW_MARGIN * (abs(l21) + l22)  # for a decision in binary32
    bottom = y + l21 * low + l22 * math.sqrt(max(ELLIPSE * ELLIPSE - low * low, 0.0)) + margin
    top = y + l21 * high - l22 * math.sqrt(max(ELLIPSE * ELLIPSE - high * high, 0.0)) - margin
    first = max(np.ceil(top - 0.5), 0.0)
    last = min(np.floor(bottom - 0.5), height - 1.0)
    if left > right or first > last:
        return 0, 0
    return int(first), int(last) + 1
