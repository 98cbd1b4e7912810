"""The sum over splats and its gradients on strips, in binary32: forward and backward inner loops beside each other.

The definition is `definition.py`, and the names are those of spec.md: the splat's centre x and y, u1 and u2, m =
u1^2 + u2^2, the weight g, e = dL/dC, q = g (e . c') of (10-6), and the sums S of (13-12). All loops over `STRIP_WIDTH`
have constant bounds and constant offsets into one flat buffer, which is what makes LLVM turn them into vector code; a
test looks at the result. Per strip the splats come in index order, so that each sum has one fixed order whoever owns
the strip. The loops exist twice: with contraction, and `_strict` with every operation rounded as it is written
(spec.md section 9.3).
"""

from typing import Any, Final

import numpy as np

from gsvc_ref._jit import kernel, without_contraction
from gsvc_ref.constants import HALF, SUPPORT_SQUARED
from gsvc_ref.rendering.fast.exponential import exp_minus_half, exp_minus_half_strict
from gsvc_ref.rendering.fast.lists import BLUE, GREEN, R1, R2, RED, F, L, Selection, X, Y, row_range
from gsvc_ref.rendering.fast.strips import F4, F8, LANES, ROW, ROWS, SLOT, STRIP_WIDTH

ZERO: Final = np.float32(0)

MOMENTS: Final = 6
"""Sums of the backward loop in each lane."""

Q, QU2, QU2U2, GE_RED, GE_GREEN, GE_BLUE = range(0, MOMENTS * STRIP_WIDTH, STRIP_WIDTH)
"""Where the lanes of each begin: the sums of q, q u2, q u2 u2 and the three of g e. Within a strip u1 is constant per
lane, so that the moments with u1 follow from these."""

EIGHT: Final = STRIP_WIDTH // 2
QU1, QU1U1, QU1U2 = Q, Q + EIGHT, QU2 + EIGHT
"""Where `fold_moments` puts the moments with u1, once lanes k and k + 8 have been added: eight lanes each."""

U1, U2, U1U1, U1U2, U2U2, E_RED, E_GREEN, E_BLUE = range(SLOT)
"""Columns of a slot: the sums of q u1, q u2, q u1 u1, q u1 u2 and q u2 u2, and the three of g e."""


@kernel(contract=True, inline=True)
def add_rows(strip: F4, column: np.float32, row: np.float32, record: Any) -> None:
    """Add one splat to ROWS rows of a strip: C <- C + g c' (9-6) where m <= 2 ln 255.

    Parameters
    ----------
    strip
        (ROWS * ROW,) f4, these rows.
    column, row
        The centre of their first pixel.
    record
        (RECORD,) f4, see `lists.Lists`.
    """
    x, y, r1, l, f, r2 = record[X], record[Y], record[R1], record[L], record[F], record[R2]
    red, green, blue = record[RED], record[GREEN], record[BLUE]
    for k in range(STRIP_WIDTH):
        u1 = ((column + LANES[k]) - x) * r1
        shear = (l * u1) * f
        for j in range(ROWS):
            u2 = ((row + np.float32(j)) - y) * r2 - shear
            m = u1 * u1 + u2 * u2  # (9-4)
            g = exp_minus_half(m) if m <= SUPPORT_SQUARED else ZERO
            strip[j * ROW + k] += g * red  # (9-6)
            strip[j * ROW + STRIP_WIDTH + k] += g * green
            strip[j * ROW + 2 * STRIP_WIDTH + k] += g * blue


add_rows_strict = without_contraction(add_rows, exp_minus_half=exp_minus_half_strict)


@kernel(contract=True, inline=True)
def grad_add_rows(moments: F4, strip: F4, column: np.float32, row: np.float32, record: Any) -> None:
    """The transpose of `add_rows`: add, per lane, what ROWS rows of dL/dC contribute to one splat's moments.

    Parameters
    ----------
    moments
        (MOMENTS * STRIP_WIDTH,) f4, see `Q`.
    strip
        (ROWS * ROW,) f4, e = dL/dC of these rows.
    column, row, record
        As for `add_rows`.
    """
    x, y, r1, l, f, r2 = record[X], record[Y], record[R1], record[L], record[F], record[R2]
    red, green, blue = record[RED], record[GREEN], record[BLUE]
    for k in range(STRIP_WIDTH):
        u1 = ((column + LANES[k]) - x) * r1
        shear = (l * u1) * f
        of_q, of_qu2, of_qu2u2 = moments[Q + k], moments[QU2 + k], moments[QU2U2 + k]
        of_red, of_green, of_blue = moments[GE_RED + k], moments[GE_GREEN + k], moments[GE_BLUE + k]
        for j in range(ROWS):
            u2 = ((row + np.float32(j)) - y) * r2 - shear
            m = u1 * u1 + u2 * u2  # (9-4)
            g = exp_minus_half(m) if m <= SUPPORT_SQUARED else ZERO
            u2 = u2 if m <= SUPPORT_SQUARED else ZERO  # it may be infinite there, and 0 * infinity is no sum
            e_red = strip[j * ROW + k]
            e_green = strip[j * ROW + STRIP_WIDTH + k]
            e_blue = strip[j * ROW + 2 * STRIP_WIDTH + k]
            q = g * (e_red * red + e_green * green + e_blue * blue)  # (10-6)
            q = q if m <= SUPPORT_SQUARED else ZERO  # for the same reason
            qu2 = q * u2
            of_q += q
            of_qu2 += qu2
            of_qu2u2 += qu2 * u2
            of_red += g * e_red  # (10-9)
            of_green += g * e_green
            of_blue += g * e_blue
        moments[Q + k], moments[QU2 + k], moments[QU2U2 + k] = of_q, of_qu2, of_qu2u2
        moments[GE_RED + k], moments[GE_GREEN + k], moments[GE_BLUE + k] = of_red, of_green, of_blue


grad_add_rows_strict = without_contraction(grad_add_rows, exp_minus_half=exp_minus_half_strict)


@kernel(inline=True)
def tree(a: F4) -> Any:
    """The sum of eight numbers as a fixed tree."""
    return ((a[0] + a[4]) + (a[2] + a[6])) + ((a[1] + a[5]) + (a[3] + a[7]))


@kernel(contract=True, inline=True)
def fold_moments(moments: F4, column: np.float32, record: Any, S: F4) -> None:
    """Sum the lanes of one entry's moments in a fixed tree into its slot S (SLOT,) f4; `column` as for `add_rows`.

    `moments` is overwritten. The loop handles all sums at once, since LLVM unrolls short bodies into scalar code.
    """
    x, r1 = record[X], record[R1]
    for k in range(EIGHT):
        u1_left = ((column + LANES[k]) - x) * r1
        u1_right = ((column + LANES[EIGHT + k]) - x) * r1
        q_left, q_right = moments[Q + k], moments[Q + EIGHT + k]
        qu2_left, qu2_right = moments[QU2 + k], moments[QU2 + EIGHT + k]
        # Where nothing is covered u1 may be infinite, and 0 * infinity is no sum.
        u1_left = u1_left if q_left != ZERO or qu2_left != ZERO else ZERO
        u1_right = u1_right if q_right != ZERO or qu2_right != ZERO else ZERO
        moments[QU1 + k] = q_left * u1_left + q_right * u1_right
        moments[QU1U1 + k] = q_left * u1_left * u1_left + q_right * u1_right * u1_right
        moments[QU2 + k] = qu2_left + qu2_right
        moments[QU1U2 + k] = qu2_left * u1_left + qu2_right * u1_right
        moments[QU2U2 + k] += moments[QU2U2 + EIGHT + k]
        moments[GE_RED + k] += moments[GE_RED + EIGHT + k]
        moments[GE_GREEN + k] += moments[GE_GREEN + EIGHT + k]
        moments[GE_BLUE + k] += moments[GE_BLUE + EIGHT + k]
    S[U1] = tree(moments[QU1 : QU1 + EIGHT])
    S[U2] = tree(moments[QU2 : QU2 + EIGHT])
    S[U1U1] = tree(moments[QU1U1 : QU1U1 + EIGHT])
    S[U1U2] = tree(moments[QU1U2 : QU1U2 + EIGHT])
    S[U2U2] = tree(moments[QU2U2 : QU2U2 + EIGHT])
    S[E_RED] = tree(moments[GE_RED : GE_RED + EIGHT])  # (10-9)
    S[E_GREEN] = tree(moments[GE_GREEN : GE_GREEN + EIGHT])
    S[E_BLUE] = tree(moments[GE_BLUE : GE_BLUE + EIGHT])


fold_moments_strict = without_contraction(fold_moments)


@kernel()
def add_tile(strip: F4, s: int, top: int, end: int, selection: Selection, count: int, strict: bool) -> None:
    """Add the selected entries in order to the rows top to end - 1 of strip s.

    `strip` is ((height + SPARE_ROWS) * ROW,) f4; up to SPARE_ROWS rows below `end` are spoiled.
    """
    column = np.float32(s * STRIP_WIDTH) + HALF
    for i in range(count):
        record = selection.records[i]
        for j in range(max(selection.rows[i, 0], top), min(selection.rows[i, 1], end), ROWS):
            rows = strip[j * ROW : (j + ROWS) * ROW]
            if strict:
                add_rows_strict(rows, column, np.float32(j) + HALF, record)
            else:
                add_rows(rows, column, np.float32(j) + HALF, record)


@kernel()
def grad_add_strip(strip: F4, s: int, selection: Selection, count: int, slots: F4, moments: F4, strict: bool) -> None:
    """Gather e = dL/dC of strip s, zero in the spare rows, into the slots (entries, SLOT) f4 of the strip's entries.

    `moments` is (MOMENTS * STRIP_WIDTH,) f4 scratch. Per lane a moment is summed down the rows, one after the other:
    rows that hold no covered pixel add zero, so that the bits do not depend on how rows are grouped.
    """
    column = np.float32(s * STRIP_WIDTH) + HALF
    for i in range(count):
        record = selection.records[i]
        S = slots[selection.rows[i, 2]]
        moments[:] = ZERO
        for j in range(selection.rows[i, 0], selection.rows[i, 1], ROWS):
            rows = strip[j * ROW : (j + ROWS) * ROW]
            if strict:
                grad_add_rows_strict(moments, rows, column, np.float32(j) + HALF, record)
            else:
                grad_add_rows(moments, rows, column, np.float32(j) + HALF, record)
        if strict:
            fold_moments_strict(moments, column, record, S)
        else:
            fold_moments(moments, column, record, S)


@kernel()
def grad_splat(slots: F4, splat: F4, scale: float, S: F8, gradient: F4) -> None:
    """One splat's gradient (8,) f4 from the slots (strips, SLOT) f4 of its entries: (13-12).

    It is (10-7) and (10-8), since v = L^-T u has v2 = u2 / l22 and v1 = u1 / l11 - slope u2, slope = l21 / (l11 l22).
    In binary64, rounded once. `S` is (SLOT,) f8 scratch.
    """
    S[:] = 0
    for entry in range(slots.shape[0]):
        for moment in range(SLOT):
            S[moment] += slots[entry, moment]
    if slots.shape[0] == 0:
        gradient[:] = ZERO
        return
    r1 = 1 / np.float64(splat[2])
    l21 = np.float64(splat[3])
    r2 = 1 / np.float64(splat[4])
    slope = l21 * r1 * r2
    gradient[0] = scale * (S[U1] * r1 - S[U2] * slope)  # dL/dx = sum q v1
    gradient[1] = scale * (S[U2] * r2)  # dL/dy = sum q v2
    gradient[2] = scale * (S[U1U1] * r1 - S[U1U2] * slope)  # dL/dl11 = sum q v1 u1
    gradient[3] = scale * (S[U1U2] * r2)  # dL/dl21 = sum q v2 u1
    gradient[4] = scale * (S[U2U2] * r2)  # dL/dl22 = sum q v2 u2
    gradient[5] = scale * S[E_RED]  # dL/dc' = sum g e
    gradient[6] = scale * S[E_GREEN]
    gradient[7] = scale * S[E_BLUE]


@kernel()
def count_strip(s: int, width: int, height: int, record: Any) -> int:
    """How many pixels of strip s one splat covers, by the decision of `add_rows_strict`."""
    x, y, r1, l, f, r2 = record[X], record[Y], record[R1], record[L], record[F], record[R2]
    column = np.float32(s * STRIP_WIDTH) + HALF
    first, end = row_range(record, s, height)
    pixels = 0
    for j in range(first, end):
        for k in range(min(STRIP_WIDTH, width - s * STRIP_WIDTH)):
            u1 = ((column + LANES[k]) - x) * r1
            u2 = ((np.float32(j) + HALF) - y) * r2 - (l * u1) * f
            pixels += u1 * u1 + u2 * u2 <= SUPPORT_SQUARED  # (9-4)
    return pixels
