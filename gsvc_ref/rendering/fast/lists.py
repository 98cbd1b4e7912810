"""Which splats touch which strip: the entries of every strip, and the rows that each may cover.

Nothing here decides coverage. Columns and rows are found in binary64 with a margin that outweighs the roundings of a
binary32 decision, so that every pixel that any binary32 arithmetic of `bounds` calls covered is among them: with
|u1| and |u2| off by at most gamma_5 |u1| and gamma_6 a + gamma_11 b (see there), such a pixel lies in the ellipse of
radius ELLIPSE, moved up or down by 17 eps SUPPORT_RADIUS (|l21| + l22) at most.
"""

import math
from typing import Any, Final, NamedTuple

import numpy as np

from gsvc_ref._jit import kernel
from gsvc_ref.constants import SMALLEST_NORMAL, SUPPORT_RADIUS
from gsvc_ref.rendering.fast.strips import F4, F8, I4, I8, RECORD, STRIP_WIDTH

ELLIPSE: Final = SUPPORT_RADIUS * (1 + 2.0**-18)
"""The radius of the ellipse that is listed, in standard deviations: the support with room for roundings."""

ROW_MARGIN: Final = SUPPORT_RADIUS * 2.0**-18
"""Room for roundings of a row, in units of |l21| + l22: above 17 eps SUPPORT_RADIUS. Both together have the room that
`REACH` has, so that no row is listed outside of the boxes of (5-1), whose pixels are the work that a level limits."""

SELECTED: Final = 1 << 12
"""Most entries of a selection, 76 bytes each."""

ROWS_FOR_ENTRY: Final = 4.0
ROWS_FOR_ROW: Final = 1.5
"""What selecting an entry, and clearing and writing a row of a strip, takes: in rows that a splat is added to."""

X, Y, R1, L, F, R2, RED, GREEN, BLUE, L11, L21, L22, FIRST_ROW, ROW_COUNT = range(14)
"""Columns of a record: the splat's centre, r1, l, f and r2 of (9-3), its colour, its factors, and its box's rows."""


class Lists(NamedTuple):
    """Which splats touch which strip, and what the inner loops need of them.

    An *entry* is a pair of a splat and a strip that it touches.

    Attributes
    ----------
    records
        Per splat (RECORD,) f4, one cache line, with the columns `X` to `ROW_COUNT`. The inner loops compute
        (l21 u1) / l22 as (l u1) f (9-3), which is (l21 u1) (1/l22) for l22 <= 1 and (u1 (l21/l22)) 1 above, so that
        nothing overflows where a pixel is covered.
    strips
        Per splat (2,) i4: the first strip and the one after the last; equal if no pixel centre can be covered.
    base
        (N + 1,) i8: the number of entries of the splats before.
    offsets
        (strips + 1,) i8: the number of entries of the strips before.
    window
        (2,) i8: the first strip whose entries are listed, and the one after the last.
    entries
        (entries of the window or more, 2) i4, strip after strip and in index order; each is the splat and the entry's
        index in the order by splat, where a splat's entries are side by side.
    positions
        (strips,) i8 scratch: where the next entry of a strip goes.
    work
        (strips + 1,) f8: about the work of the strips before, in rows that a splat is added to.
    """

    records: F4
    strips: I4
    base: I8
    offsets: I8
    window: I8
    entries: I4
    positions: I8
    work: F8


@kernel()
def prepare(first: int, end: int, parameters: F4, width: int, height: int, lists: Lists) -> None:
    """Fill `records` and `strips` of the splats first to end - 1.

    `parameters` is (N, 8) f4. A splat whose position or factor is infinite covers nothing.
    """
    for n in range(first, end):
        finite = True
        for column in range(5):
            finite &= np.isfinite(parameters[n, column])
        x, y = np.float64(parameters[n, 0]), np.float64(parameters[n, 1])
        l11, l21, l22 = np.float64(parameters[n, 2]), np.float64(parameters[n, 3]), np.float64(parameters[n, 4])
        strips = lists.strips[n]
        strips[0] = 0
        strips[1] = 0
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
        strips[0] = int(left) // STRIP_WIDTH
        strips[1] = int(right) // STRIP_WIDTH + 1
        record = lists.records[n]
        record[X] = parameters[n, 0]
        record[Y] = parameters[n, 1]
        record[R1] = np.float32(1 / l11)
        record[L] = parameters[n, 3] if l22 <= 1 else np.float32(l21 / l22)  # (9-3)
        record[F] = np.float32(1 / l22) if l22 <= 1 else np.float32(1)
        record[R2] = np.float32(1 / l22)
        record[RED] = parameters[n, 5]
        record[GREEN] = parameters[n, 6]
        record[BLUE] = parameters[n, 7]
        record[L11] = parameters[n, 2]
        record[L21] = parameters[n, 3]
        record[L22] = parameters[n, 4]
        record[FIRST_ROW] = np.float32(top)
        record[ROW_COUNT] = np.float32(bottom - top + 1)


@kernel()
def count_entries(height: int, lists: Lists) -> None:
    """Fill `base`, `offsets` and `work`."""
    base, offsets, work = lists.base, lists.offsets, lists.work
    offsets[:] = 0
    base[0] = 0
    work[0] = 0
    work[1:] = ROWS_FOR_ROW * height
    for n in range(lists.strips.shape[0]):
        first, end = lists.strips[n]
        base[n + 1] = base[n] + end - first
        for s in range(first, end):
            offsets[s + 1] += 1
            work[s + 1] += lists.records[n, ROW_COUNT] + ROWS_FOR_ENTRY
    for s in range(offsets.size - 1):
        offsets[s + 1] += offsets[s]
        work[s + 1] += work[s]


@kernel()
def fill_entries(lists: Lists) -> None:
    """Fill `entries` for the strips of the window: a counting sort by strip."""
    positions = lists.positions
    positions[:] = lists.offsets[:-1] - lists.offsets[lists.window[0]]
    for n in range(lists.strips.shape[0]):
        first = lists.strips[n, 0]
        for s in range(max(first, lists.window[0]), min(lists.strips[n, 1], lists.window[1])):
            lists.entries[positions[s], 0] = n
            lists.entries[positions[s], 1] = lists.base[n] + s - first
            positions[s] += 1


@kernel(inline=True)
def entries_of(s: int, lists: Lists) -> int:
    """The number of entries of strip s."""
    count: int = lists.offsets[s + 1] - lists.offsets[s]
    return count


@kernel(inline=True)
def row_range(record: Any, strip: int, height: int) -> tuple[int, int]:
    """The rows (first, one after the last) where one splat may cover a pixel centre of a strip; equal if there is none.

    The ellipse |u| = ELLIPSE has the rows y + l21 u1 + l22 u2 with u2 = ± sqrt(ELLIPSE^2 - u1^2). Its lower edge is
    concave in u1 with the extreme at u1 = tip = ELLIPSE l21 / sqrt(l21^2 + l22^2), the upper edge mirrors it, so that
    over the columns of a strip the extremes are at tip and -tip clamped to their range of u1.
    """
    x, y = np.float64(record[X]), np.float64(record[Y])
    l11, l21, l22 = np.float64(record[L11]), np.float64(record[L21]), np.float64(record[L22])
    tip = ELLIPSE * l21 / math.sqrt(l21 * l21 + l22 * l22)
    left = max((strip * STRIP_WIDTH + 0.5 - x) / l11, -ELLIPSE)
    right = min((strip * STRIP_WIDTH + STRIP_WIDTH - 0.5 - x) / l11, ELLIPSE)
    low = min(max(tip, left), right)
    high = min(max(-tip, left), right)
    margin = ROW_MARGIN * (abs(l21) + l22)
    bottom = y + l21 * low + l22 * math.sqrt(max(ELLIPSE * ELLIPSE - low * low, 0.0)) + margin
    top = y + l21 * high - l22 * math.sqrt(max(ELLIPSE * ELLIPSE - high * high, 0.0)) - margin
    first = max(np.ceil(top - 0.5), 0.0)
    last = min(np.floor(bottom - 0.5), height - 1.0)
    if left > right or first > last:
        return 0, 0
    return int(first), int(last) + 1


class Selection(NamedTuple):
    """Entries of one strip, side by side in memory: gathered in a loop of their own, the cache misses overlap.

    Attributes
    ----------
    rows
        Per entry (3,) i4: first row, the one after the last, and the entry's index in the order by splat.
    records
        Per entry (RECORD,) f4, copied from `Lists`.
    """

    rows: I4
    records: F4


@kernel()
def select_strip(s: int, skipped: int, height: int, lists: Lists, selection: Selection) -> int:
    """Fill the selection with entries of strip s, all but the first `skipped` if it has room; return their number."""
    first = lists.offsets[s] - lists.offsets[lists.window[0]] + skipped
    count: int = min(entries_of(s, lists) - skipped, selection.rows.shape[0])
    for i in range(count):
        n = lists.entries[first + i, 0]
        record = lists.records[n]
        rows = row_range(record, s, height)
        selection.rows[i, 0] = rows[0]
        selection.rows[i, 1] = rows[1]
        selection.rows[i, 2] = lists.entries[first + i, 1]
        for k in range(RECORD):
            selection.records[i, k] = record[k]
    return count
