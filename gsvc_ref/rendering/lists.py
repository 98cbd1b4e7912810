"""Which splats touch which strip: the drawing order, the entries of every strip, and the rows that each may cover."""

import math
from typing import Any, NamedTuple

import numpy as np

from gsvc_ref._jit import kernel
from gsvc_ref.rendering.definition import SMALLEST_FACTOR
from gsvc_ref.rendering.strips import BUCKET, F4, I4, I8, RADIUS, RECORD, STRIP_WIDTH


@kernel()
def order_by_row(parameters: F4, height: int, order: I4, counts: I8) -> int:
    """Fill `order` with the splats by bucket of mu_y, index order within a bucket; return a non-finite one, or -1.

    Neighbours in this order touch the same rows, which then stay in the first-level cache. The key depends on mu_y and
    the height alone, so that the order, and with it every bit of the result, is the same for any number of threads.
    `counts` is (buckets + 1,) i8 scratch.
    """
    counts[:] = 0
    n_splats = parameters.shape[0]
    last = np.float32(height - 1)
    for n in range(n_splats):
        for column in range(8):
            if not np.isfinite(parameters[n, column]):
                return n
        y = min(max(parameters[n, 1], np.float32(0)), last)
        counts[int(y) // BUCKET + 1] += 1
    for b in range(1, counts.size):
        counts[b] += counts[b - 1]
    for n in range(n_splats):
        y = min(max(parameters[n, 1], np.float32(0)), last)
        bucket = int(y) // BUCKET
        order[counts[bucket]] = n
        counts[bucket] += 1
    return -1


class Lists(NamedTuple):
    """Which splats touch which strip, and what the inner loops need of them.

    A splat's *place* is its position in the drawing order; an *entry* is a pair of a splat and a strip that it touches.

    Attributes
    ----------
    order
        (N,) i4, place -> index of the splat.
    records
        Per place (RECORD,) f4, one cache line: mu_x, mu_y, 1/l11, l, f, 1/l22, the colour, l11, l21, l22. The inner
        loops compute (l21 u1) / l22 as (l u1) f, which is (l21 u1) (1/l22) for l22 <= 1 and (u1 (l21/l22)) 1 above, so
        that nothing overflows where a pixel is covered.
    strips
        Per place (2,) i4: the first strip and the one after the last; equal if no pixel centre can be covered.
    base
        (N + 1,) i8: the number of entries of the places before.
    entries, offsets
        (entries, 2) i4 and i8: strip s has the entries offsets[s] to offsets[s + 1] - 1, with ascending places; each is
        the place and the entry's index in the order by place, where a splat's entries are side by side.
    positions
        (strips,) i8: the number of entries of each strip, then where its next entry goes.
    """

    order: I4
    records: F4
    strips: I4
    base: I8
    entries: I4
    offsets: I8
    positions: I8


@kernel()
def prepare(parameters: F4, width: int, height: int, lists: Lists) -> None:
    """Fill the lists except for entries and offsets from the parameters (N, 8) f4; `lists.order` is given."""
    order, records = lists.order, lists.records
    strips, base, positions = lists.strips, lists.base, lists.positions
    positions[:] = 0
    base[0] = 0
    for place in range(order.size):
        n = order[place]
        mu_x = np.float64(parameters[n, 0])
        mu_y = np.float64(parameters[n, 1])
        l11 = np.float64(parameters[n, 2])
        l21 = np.float64(parameters[n, 3])
        l22 = np.float64(parameters[n, 4])
        strips[place, 0] = 0
        strips[place, 1] = 0
        base[place + 1] = base[place]
        if l11 < SMALLEST_FACTOR or l22 < SMALLEST_FACTOR:
            continue
        half_width = RADIUS * l11
        half_height = RADIUS * math.sqrt(l21 * l21 + l22 * l22)
        # Clamped as floats: a centre may be further away than any integer type reaches.
        left = max(np.ceil(mu_x - half_width - 0.5), 0.0)
        right = min(np.floor(mu_x + half_width - 0.5), width - 1.0)
        top = max(np.ceil(mu_y - half_height - 0.5), 0.0)
        bottom = min(np.floor(mu_y + half_height - 0.5), height - 1.0)
        if left > right or top > bottom:
            continue
        first = int(left) // STRIP_WIDTH
        end = int(right) // STRIP_WIDTH + 1
        strips[place, 0] = first
        strips[place, 1] = end
        base[place + 1] = base[place] + end - first
        for s in range(first, end):
            positions[s] += 1
        records[place, 0] = parameters[n, 0]
        records[place, 1] = parameters[n, 1]
        records[place, 2] = np.float32(1 / l11)
        records[place, 3] = parameters[n, 3] if l22 <= 1 else np.float32(l21 / l22)
        records[place, 4] = np.float32(1 / l22) if l22 <= 1 else np.float32(1)
        records[place, 5] = np.float32(1 / l22)
        records[place, 6] = parameters[n, 5]
        records[place, 7] = parameters[n, 6]
        records[place, 8] = parameters[n, 7]
        records[place, 9] = parameters[n, 2]
        records[place, 10] = parameters[n, 3]
        records[place, 11] = parameters[n, 4]


@kernel()
def list_entries(lists: Lists) -> None:
    """Counting sort of the entries by strip."""
    offsets, positions = lists.offsets, lists.positions
    offsets[0] = 0
    for s in range(positions.size):
        offsets[s + 1] = offsets[s] + positions[s]
        positions[s] = offsets[s]
    for place in range(lists.strips.shape[0]):
        first, end = lists.strips[place]
        for s in range(first, end):
            lists.entries[positions[s], 0] = place
            lists.entries[positions[s], 1] = lists.base[place] + s - first
            positions[s] += 1


@kernel(inline=True)
def row_range(record: Any, strip: int, height: int) -> tuple[int, int]:
    """The rows (first, one after the last) where one splat may cover a pixel centre of a strip; equal if there is none.

    The ellipse |u| = RADIUS has y = mu_y + l21 u1 + l22 u2 with u2 = ± sqrt(RADIUS^2 - u1^2). Its lower edge is concave
    in u1 with the extreme at t = RADIUS l21 / sqrt(l21^2 + l22^2), the upper edge mirrors it, so that over the columns
    of a strip the extremes are at t and -t clamped to their range of u1. Computed in binary64, whose error is far below
    that of the binary32 decision of each pixel.
    """
    mu_x, mu_y = np.float64(record[0]), np.float64(record[1])
    l11, l21, l22 = np.float64(record[9]), np.float64(record[10]), np.float64(record[11])
    t = RADIUS * l21 / math.sqrt(l21 * l21 + l22 * l22)
    left = max((strip * STRIP_WIDTH + 0.5 - mu_x) / l11, -RADIUS)
    right = min((strip * STRIP_WIDTH + STRIP_WIDTH - 0.5 - mu_x) / l11, RADIUS)
    low = min(max(t, left), right)
    high = min(max(-t, left), right)
    bottom = mu_y + l21 * low + l22 * math.sqrt(max(RADIUS * RADIUS - low * low, 0.0))
    top = mu_y + l21 * high - l22 * math.sqrt(max(RADIUS * RADIUS - high * high, 0.0))
    first = max(np.ceil(top - 0.5), 0.0)
    last = min(np.floor(bottom - 0.5), height - 1.0)
    if left > right or first > last:
        return 0, 0
    return int(first), int(last) + 1


class Selection(NamedTuple):
    """The entries of one strip, side by side in memory: gathered in a loop of their own, the cache misses overlap.

    Attributes
    ----------
    rows
        Per entry (3,) i4: first row, the one after the last, and the entry's index in the order by place.
    records
        Per entry (RECORD,) f4, copied from `Lists`.
    """

    rows: I4
    records: F4


@kernel()
def select_strip(s: int, height: int, lists: Lists, selection: Selection) -> int:
    """Fill the selection with the entries of strip s and return their number."""
    first = lists.offsets[s]
    count: int = lists.offsets[s + 1] - first
    for i in range(count):
        place = lists.entries[first + i, 0]
        record = lists.records[place]
        rows = row_range(record, s, height)
        selection.rows[i, 0] = rows[0]
        selection.rows[i, 1] = rows[1]
        selection.rows[i, 2] = lists.entries[first + i, 1]
        for k in range(RECORD):
            selection.records[i, k] = record[k]
    return count
