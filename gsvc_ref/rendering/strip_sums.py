"""The sum over splats and its gradients on strips, in binary32: forward and backward inner loops beside each other.

The definition is `definition.py`; here u1 and u2 are called u and v. All loops over `STRIP_WIDTH` have constant bounds
and constant offsets into one flat buffer, which is what makes LLVM turn them into vector code; a test looks at the
result. Per strip the splats come in index order, so that each sum has one fixed order whoever owns the strip. The
loops exist twice: with contraction, and `_strict` with every operation rounded as it is written (spec.md section 9.3).
"""

from typing import Any, Final

import numpy as np

from gsvc_ref._jit import kernel, without_contraction
from gsvc_ref.constants import HALF, SUPPORT_SQUARED
from gsvc_ref.rendering.exponential import exp_minus_half, exp_minus_half_strict
from gsvc_ref.rendering.lists import Selection, row_range
from gsvc_ref.rendering.strips import F4, F8, LANES, ROW, ROWS, SLOT, STRIP_WIDTH

ZERO: Final = np.float32(0)

MOMENTS: Final = 6
"""Lane-wise sums of the backward loop: q, q v, q v^2 and the three of g e."""


@kernel(contract=True, inline=True)
def add_rows(strip: F4, x: np.float32, y: np.float32, record: Any) -> None:
    """Add one splat to ROWS rows of a strip: C += c' exp(-(u^2 + v^2) / 2) where u^2 + v^2 <= 2 ln 255.

    Parameters
    ----------
    strip
        (ROWS * ROW,) f4, these rows.
    x, y
        The centre of their first pixel.
    record
        (RECORD,) f4, see `lists.Lists`.
    """
    mu_x, mu_y, inverse_l11, l, f, inverse_l22 = record[0], record[1], record[2], record[3], record[4], record[5]
    red, green, blue = record[6], record[7], record[8]
    for k in range(STRIP_WIDTH):
        u = ((x + LANES[k]) - mu_x) * inverse_l11
        shear = (l * u) * f
        for row in range(ROWS):
            v = ((y + np.float32(row)) - mu_y) * inverse_l22 - shear
            s = u * u + v * v
            g = exp_minus_half(s) if s <= SUPPORT_SQUARED else ZERO
            strip[row * ROW + k] += g * red
            strip[row * ROW + STRIP_WIDTH + k] += g * green
            strip[row * ROW + 2 * STRIP_WIDTH + k] += g * blue


add_rows_strict = without_contraction(add_rows, exp_minus_half=exp_minus_half_strict)


@kernel(contract=True, inline=True)
def grad_add_rows(moments: F4, strip: F4, x: np.float32, y: np.float32, record: Any) -> None:
    """The transpose of `add_rows`: add, per lane, what ROWS rows of dL/dC contribute to one splat's moments.

    Parameters
    ----------
    moments
        (MOMENTS * STRIP_WIDTH,) f4: per lane the sums of q, q v, q v^2, g e_red, g e_green and g e_blue, where
        e = dL/dC and q = g (e . c'). Within a strip u is constant per lane: the moments with u follow from these.
    strip
        (ROWS * ROW,) f4, dL/dC of these rows.
    """
    mu_x, mu_y, inverse_l11, l, f, inverse_l22 = record[0], record[1], record[2], record[3], record[4], record[5]
    red, green, blue = record[6], record[7], record[8]
    for k in range(STRIP_WIDTH):
        u = ((x + LANES[k]) - mu_x) * inverse_l11
        shear = (l * u) * f
        m_q, m_qv, m_qvv = moments[k], moments[STRIP_WIDTH + k], moments[2 * STRIP_WIDTH + k]
        m_red, m_green = moments[3 * STRIP_WIDTH + k], moments[4 * STRIP_WIDTH + k]
        m_blue = moments[5 * STRIP_WIDTH + k]
        for row in range(ROWS):
            v = ((y + np.float32(row)) - mu_y) * inverse_l22 - shear
            s = u * u + v * v
            g = exp_minus_half(s) if s <= SUPPORT_SQUARED else ZERO
            v = v if s <= SUPPORT_SQUARED else ZERO  # it may be infinite there, and 0 * infinity is no sum
            e_red = strip[row * ROW + k]
            e_green = strip[row * ROW + STRIP_WIDTH + k]
            e_blue = strip[row * ROW + 2 * STRIP_WIDTH + k]
            q = g * (e_red * red + e_green * green + e_blue * blue)
            q = q if s <= SUPPORT_SQUARED else ZERO  # for the same reason
            qv = q * v
            m_q += q
            m_qv += qv
            m_qvv += qv * v
            m_red += g * e_red
            m_green += g * e_green
            m_blue += g * e_blue
        moments[k] = m_q
        moments[STRIP_WIDTH + k] = m_qv
        moments[2 * STRIP_WIDTH + k] = m_qvv
        moments[3 * STRIP_WIDTH + k] = m_red
        moments[4 * STRIP_WIDTH + k] = m_green
        moments[5 * STRIP_WIDTH + k] = m_blue


grad_add_rows_strict = without_contraction(grad_add_rows, exp_minus_half=exp_minus_half_strict)


@kernel(inline=True)
def fold8(m: F4) -> Any:
    """The sum of eight numbers as a fixed tree."""
    return ((m[0] + m[4]) + (m[2] + m[6])) + ((m[1] + m[5]) + (m[3] + m[7]))


@kernel(contract=True, inline=True)
def fold_moments(moments: F4, x: np.float32, record: Any, slot: F4) -> None:
    """Sum the lanes of one entry's moments in a fixed tree: slot (SLOT,) f4 = sums of q (u, v, u^2, u v, v^2), g e.

    `moments` is overwritten. The loop handles all sums at once, since LLVM unrolls short bodies into scalar code.
    """
    mu_x, inverse_l11 = record[0], record[2]
    for k in range(8):
        u0 = ((x + LANES[k]) - mu_x) * inverse_l11
        u8 = ((x + LANES[k + 8]) - mu_x) * inverse_l11
        q0, q8 = moments[k], moments[8 + k]
        r0, r8 = moments[16 + k], moments[24 + k]
        # Where nothing is covered u may be infinite, and 0 * infinity is no sum.
        u0 = u0 if q0 != ZERO or r0 != ZERO else ZERO
        u8 = u8 if q8 != ZERO or r8 != ZERO else ZERO
        moments[k] = q0 * u0 + q8 * u8
        moments[8 + k] = q0 * u0 * u0 + q8 * u8 * u8
        moments[16 + k] = r0 + r8
        moments[24 + k] = r0 * u0 + r8 * u8
        moments[32 + k] += moments[40 + k]
        moments[48 + k] += moments[56 + k]
        moments[64 + k] += moments[72 + k]
        moments[80 + k] += moments[88 + k]
    slot[0] = fold8(moments[0:8])
    slot[1] = fold8(moments[16:24])
    slot[2] = fold8(moments[8:16])
    slot[3] = fold8(moments[24:32])
    slot[4] = fold8(moments[32:40])
    slot[5] = fold8(moments[48:56])
    slot[6] = fold8(moments[64:72])
    slot[7] = fold8(moments[80:88])


fold_moments_strict = without_contraction(fold_moments)


@kernel()
def add_tile(strip: F4, s: int, top: int, end: int, selection: Selection, count: int, strict: bool) -> None:
    """Add the selected entries in order to the rows top to end - 1 of strip s.

    `strip` is ((height + SPARE_ROWS) * ROW,) f4; up to SPARE_ROWS rows below `end` are spoiled.
    """
    x = np.float32(s * STRIP_WIDTH) + HALF
    for i in range(count):
        record = selection.records[i]
        for y in range(max(selection.rows[i, 0], top), min(selection.rows[i, 1], end), ROWS):
            rows = strip[y * ROW : (y + ROWS) * ROW]
            if strict:
                add_rows_strict(rows, x, np.float32(y) + HALF, record)
            else:
                add_rows(rows, x, np.float32(y) + HALF, record)


@kernel()
def grad_add_strip(strip: F4, s: int, selection: Selection, count: int, slots: F4, moments: F4, strict: bool) -> None:
    """Gather dL/dC of strip s, zero in the spare rows, into the slots (entries, SLOT) f4 of the strip's entries.

    `moments` is (MOMENTS * STRIP_WIDTH,) f4 scratch. Per lane a moment is summed down the rows, one after the other:
    rows that hold no covered pixel add zero, so that the bits do not depend on how rows are grouped.
    """
    x = np.float32(s * STRIP_WIDTH) + HALF
    for i in range(count):
        record = selection.records[i]
        slot = slots[selection.rows[i, 2]]
        moments[:] = ZERO
        for y in range(selection.rows[i, 0], selection.rows[i, 1], ROWS):
            rows = strip[y * ROW : (y + ROWS) * ROW]
            if strict:
                grad_add_rows_strict(moments, rows, x, np.float32(y) + HALF, record)
            else:
                grad_add_rows(moments, rows, x, np.float32(y) + HALF, record)
        if strict:
            fold_moments_strict(moments, x, record, slot)
        else:
            fold_moments(moments, x, record, slot)


@kernel()
def grad_splat(slots: F4, splat: F4, scale: float, sums: F8, gradient: F4) -> None:
    """One splat's gradient (8,) f4 from the slots (strips, SLOT) f4 of its entries.

    With v = L^-T u, so that v2 = u2 / l22 and v1 = (u1 - l21 v2) / l11 (see `definition.Footprint.gradient`):

        dL/dmu  = (sum q v1, sum q v2) = (S_u / l11 - k S_v, S_v / l22)          where k = l21 / (l11 l22)
        dL/dl11 = sum q v1 u1 = S_uu / l11 - k S_uv
        dL/dl21 = sum q v2 u1 = S_uv / l22
        dL/dl22 = sum q v2 u2 = S_vv / l22
        dL/dc'  = S_e

    in binary64, rounded once. `sums` is (SLOT,) f8 scratch.
    """
    sums[:] = 0
    for entry in range(slots.shape[0]):
        for moment in range(SLOT):
            sums[moment] += slots[entry, moment]
    if slots.shape[0] == 0:
        gradient[:] = ZERO
        return
    inverse_l11 = 1 / np.float64(splat[2])
    l21 = np.float64(splat[3])
    inverse_l22 = 1 / np.float64(splat[4])
    shear = l21 * inverse_l11 * inverse_l22
    gradient[0] = scale * (sums[0] * inverse_l11 - sums[1] * shear)
    gradient[1] = scale * (sums[1] * inverse_l22)
    gradient[2] = scale * (sums[2] * inverse_l11 - sums[3] * shear)
    gradient[3] = scale * (sums[3] * inverse_l22)
    gradient[4] = scale * (sums[4] * inverse_l22)
    gradient[5] = scale * sums[5]
    gradient[6] = scale * sums[6]
    gradient[7] = scale * sums[7]


@kernel()
def count_strip(s: int, width: int, height: int, record: Any) -> int:
    """How many pixels of strip s one splat covers, by the decision of `add_rows_strict`."""
    mu_x, mu_y, inverse_l11, l, f, inverse_l22 = record[0], record[1], record[2], record[3], record[4], record[5]
    x = np.float32(s * STRIP_WIDTH) + HALF
    first, end = row_range(record, s, height)
    pixels = 0
    for y in range(first, end):
        for k in range(min(STRIP_WIDTH, width - s * STRIP_WIDTH)):
            u = ((x + LANES[k]) - mu_x) * inverse_l11
            v = ((np.float32(y) + HALF) - mu_y) * inverse_l22 - (l * u) * f
            pixels += u * u + v * v <= SUPPORT_SQUARED
    return pixels
