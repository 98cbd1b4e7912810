"""Colour conversion without an error, from (11-1) to (11-4): rational numbers need no digits."""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from math import floor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.hard_cases.measuring import Objects, Truth

Samples = NDArray[np.unsignedinteger[Any]]

LUMA = {1: ("0.2126", "0.0722"), 6: ("0.299", "0.114"), 9: ("0.2627", "0.0593")}
PHASES = {0: (0, 1), 1: (1, 1), 2: (0, 0), 3: (1, 0), 4: (0, 2), 5: (1, 2)}
"""Twice phi of columns and of rows."""


def _to_planes(matrix: int, red: Any, green: Any, blue: Any) -> tuple[Any, Any, Any]:
    """(11-1), or Y, Cg, Co."""
    if matrix == 8:
        return (red + 2 * green + blue) / 4, (2 * green - red - blue) / 4, (red - blue) / 2
    kr, kb = (Fraction(k) for k in LUMA[matrix])
    y = kr * red + (1 - kr - kb) * green + kb * blue
    return y, (blue - y) / (2 * (1 - kb)), (red - y) / (2 * (1 - kr))


def _to_colors(matrix: int, y: Any, cb: Any, cr: Any) -> tuple[Any, Any, Any]:
    """(11-2): the green is what (11-1) leaves over."""
    if matrix == 8:
        return y - cb + cr, y + cb, y - cb - cr
    kr, kb = (Fraction(k) for k in LUMA[matrix])
    red, blue = y + 2 * (1 - kr) * cr, y + 2 * (1 - kb) * cb
    return red, (y - kr * red - kb * blue) / (1 - kr - kb), blue


def _scales(matrix: int, full_range: int, bit_depth: int) -> list[tuple[int, int]]:
    """(11-3): gain and offset of the three planes."""
    unit, peak = 2 ** (bit_depth - 8), 2**bit_depth - 1
    luma = (peak, 0) if full_range else (219 * unit, 16 * unit)
    chroma = (peak if full_range else 224 * unit, 128 * unit)
    if matrix == 8:
        chroma = (luma[0], chroma[1])
    return [luma, chroma, chroma]


def _rational(values: Samples) -> Objects:
    return np.array([Fraction(int(v)) for v in values.flat], object).reshape(values.shape)


def _rounded(values: Objects, bit_depth: int) -> Objects:
    """Clamped to 0..peak and rounded to nearest, ties to even."""
    clamped = [min(max(value, Fraction(0)), Fraction(2**bit_depth - 1)) for value in values.flat]
    return np.array([_nearest(value) for value in clamped], object).reshape(values.shape)


def _nearest(value: Fraction) -> int:
    low = floor(value)
    part = value - low
    return low + (part > Fraction(1, 2) or (part == Fraction(1, 2) and low % 2 == 1))


def planes_to_frame(
    y: Samples,
    cb: Samples,
    cr: Samples,
    chroma_format: int,
    matrix_coefficients: int,
    video_full_range_flag: int,
    chroma_sample_loc_type: int,
    bit_depth: int,
) -> Mapping[str, Truth]:
    """4:4:4 planes to a frame."""
    assert chroma_format == 3  # no hard case interpolates
    scales = _scales(matrix_coefficients, video_full_range_flag, bit_depth)
    values = [(_rational(plane) - offset) / gain for plane, (gain, offset) in zip((y, cb, cr), scales, strict=True)]
    colors = _to_colors(matrix_coefficients, *values)
    peak = 2**bit_depth - 1
    return {"frame": Truth(np.stack([_rounded(color * peak, bit_depth) for color in colors], axis=-1))}


def frame_to_planes(
    frame: Samples,
    chroma_format: int,
    matrix_coefficients: int,
    video_full_range_flag: int,
    chroma_sample_loc_type: int,
    bit_depth: int,
) -> Mapping[str, Truth]:
    """A frame to planes of any chroma format."""
    peak = 2**bit_depth - 1
    wide = [_rational(frame[..., k]) / peak for k in range(3)]
    columns, rows = PHASES[chroma_sample_loc_type]
    means = wide
    if chroma_format == 1:
        means = [_filtered(color, rows) for color in means]
    if chroma_format in (1, 2):
        means = [_filtered(color.T, columns).T for color in means]
    luma, chroma = _to_planes(matrix_coefficients, *wide)[:1], _to_planes(matrix_coefficients, *means)[1:]
    scales = _scales(matrix_coefficients, video_full_range_flag, bit_depth)
    return {
        name: Truth(_rounded(plane * gain + offset, bit_depth))
        for name, plane, (gain, offset) in zip(("y", "cb", "cr"), (*luma, *chroma), scales, strict=True)
    }


def _filtered(rows: Objects, twice_phi: int) -> Objects:
    """(11-4), down, along the first axis."""
    taps: Sequence[tuple[int, int]] = {0: ((-1, 1), (0, 2), (1, 1)), 1: ((0, 2), (1, 2)), 2: ((0, 1), (1, 2), (2, 1))}[
        twice_phi
    ]
    last = len(rows) - 1
    return np.stack([
        sum(weight * rows[min(max(2 * k + step, 0), last)] for step, weight in taps) / 4
        for k in range((len(rows) + 1) // 2)
    ])  # fmt: skip
