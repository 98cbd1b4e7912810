"""Colour conversion between Y'CbCr planes and full-range R'G'B' frames (ITU-T H.273, section 8.3; R-11.1-1).

With E' in [0, 1]^3 the R'G'B' values, both directions are one affine map per pixel:

    planes = gain * (K E') + offset,    E' = K^-1 ((planes - offset) / gain).

K follows from (K_R, K_B) or is one of the two special matrices; gain and offset follow from range and bit depth. The
results are clipped to 0 .. 2^bit_depth - 1 and rounded half to even, as everywhere in this package (H.273 rounds ties
away from zero). The computation is binary64 in the order of spec.md's code, section 11.1.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple, get_args

import numpy as np

from gsvc_base.arrays import F8, I8, Frame
from gsvc_base.arrays import Plane as Plane
from gsvc_base.checks import door
from gsvc_base.constants import LUMA_WEIGHTS
from gsvc_base.errors import UsageError
from gsvc_ref._jit import kernel
from gsvc_ref.video.chroma import down_taps, phases, up_taps
from gsvc_ref.video.format import (
    MATRIX_NAMES,
    UNSPECIFIED,
    ChromaFormat,
    ColorDescription,
    VideoFormat,
    assumed_matrix,
    check_frame,
)

Planes = tuple[Plane, Plane, Plane]


def matrix_pair(matrix: int) -> tuple[F8, F8]:
    """K and its inverse, (3, 3) f8 each, from K_R and K_B, for R'G'B' and planes in [0, 1] and [-1/2, 1/2].

    The first column of the inverse is exactly 1 where the first plane is luma, so grey stays grey.
    """
    if matrix == 0:  # G, B, R
        return np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]), np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
    if matrix == 8:  # Y, Cg, Co
        forward = np.array([[0.25, 0.5, 0.25], [-0.25, 0.5, -0.25], [0.5, 0, -0.5]])
        return forward, np.array([[1.0, -1, 1], [1, 1, 0], [1, -1, -1]])
    if matrix not in LUMA_WEIGHTS:
        raise UsageError(f"colour matrix {matrix} cannot be converted; supported are {sorted(MATRIX_NAMES)} of H.273")
    kr, kb = LUMA_WEIGHTS[matrix]
    kg = 1 - kr - kb
    cb, cr = 2 * (1 - kb), 2 * (1 - kr)
    forward = np.array([[kr, kg, kb], [-kr / cb, -kg / cb, 0.5], [0.5, -kg / cr, -kb / cr]])  # (11-1)
    inverse = np.array([[1, 0, cr], [1, -cb * kb / kg, -cr * kr / kg], [1, cb, 0]])  # (11-2)
    return forward, inverse


@dataclass(frozen=True, eq=False)
class Conversion:
    """The affine map of a format."""

    to_planes: F8  # (3, 3): planes - offset = to_planes @ (R', G', B'), all in sample values
    to_rgb: F8  # (3, 3), its inverse
    offset: F8  # (3,): black of luma, zero of chroma


def conversion(video: VideoFormat) -> Conversion:
    """The map between the planes of a format and its R'G'B'; an unspecified matrix is taken as `assumed_matrix`."""
    if video.chroma_format == "rgb":
        raise UsageError("an 'rgb' format has no planes; ask for chroma_format '420', '422' or '444'")
    matrix = assumed_matrix(video.height) if video.color.matrix == 2 else video.color.matrix
    forward, inverse = matrix_pair(matrix)
    unit = 1 << (video.bit_depth - 8)
    luma_gain, luma_offset = (video.peak, 0) if video.color.full_range else (219 * unit, 16 * unit)
    chroma_gain, chroma_offset = video.peak if video.color.full_range else 224 * unit, 128 * unit  # (11-3)
    if matrix in (0, 8):  # H.273 scales R'G'B' before it forms these, so all planes share one gain
        chroma_gain = luma_gain
    if matrix == 0:
        chroma_offset = luma_offset
    gain = np.array([luma_gain, chroma_gain, chroma_gain], np.float64)
    offset = np.array([luma_offset, chroma_offset, chroma_offset], np.float64)
    return Conversion(forward * (gain / video.peak)[:, None], inverse * (video.peak / gain), offset)


@kernel(inline=True)
def _sample(value: float, peak: float) -> float:
    rounded: float = np.rint(min(max(value, 0.0), peak))
    return rounded


@kernel()
def _to_rgb(
    y_plane: Plane,
    cb_plane: Plane,
    cr_plane: Plane,
    row_indices: I8,
    row_weights: I8,
    column_indices: I8,
    column_weights: I8,
    matrix: F8,
    offset: F8,
    peak: float,
    frame: Frame,
) -> None:
    height, width = y_plane.shape
    chroma_width = cb_plane.shape[1]
    cb_row = np.empty(chroma_width, np.int64)
    cr_row = np.empty(chroma_width, np.int64)
    # Chroma is filtered down the columns first, then along the row: exact integers, in sixteenths.
    for y in range(height):
        above, below = row_indices[y, 0], row_indices[y, 1]
        above_weight, below_weight = row_weights[y, 0], row_weights[y, 1]
        for x in range(chroma_width):
            cb_row[x] = above_weight * cb_plane[above, x] + below_weight * cb_plane[below, x]
            cr_row[x] = above_weight * cr_plane[above, x] + below_weight * cr_plane[below, x]
        for x in range(width):
            left, right = column_indices[x, 0], column_indices[x, 1]
            left_weight, right_weight = column_weights[x, 0], column_weights[x, 1]
            luma = y_plane[y, x] - offset[0]
            cb = (left_weight * cb_row[left] + right_weight * cb_row[right]) / 16 - offset[1]
            cr = (left_weight * cr_row[left] + right_weight * cr_row[right]) / 16 - offset[2]
            for i in range(3):
                frame[y, x, i] = _sample((matrix[i, 0] * luma + matrix[i, 1] * cb) + matrix[i, 2] * cr, peak)


@kernel()
def _to_planes(
    frame: Frame,
    row_indices: I8,
    row_weights: I8,
    column_indices: I8,
    column_weights: I8,
    matrix: F8,
    offset: F8,
    peak: float,
    y_plane: Plane,
    cb_plane: Plane,
    cr_plane: Plane,
) -> None:
    height, width = y_plane.shape
    for y in range(height):
        for x in range(width):
            r, g, b = frame[y, x, 0], frame[y, x, 1], frame[y, x, 2]
            y_plane[y, x] = _sample(((matrix[0, 0] * r + matrix[0, 1] * g) + matrix[0, 2] * b) + offset[0], peak)
    # R'G'B' is filtered, in exact sixteenths, before the matrix makes chroma of it.
    columns = np.empty((width, 3), np.int64)
    for k in range(cb_plane.shape[0]):
        for x in range(width):
            for i in range(3):
                columns[x, i] = 0
                for t in range(3):
                    columns[x, i] += row_weights[k, t] * frame[row_indices[k, t], x, i]
        for j in range(cb_plane.shape[1]):
            r_sum, g_sum, b_sum = 0, 0, 0
            for t in range(3):
                weight, x = column_weights[j, t], column_indices[j, t]
                r_sum += weight * columns[x, 0]
                g_sum += weight * columns[x, 1]
                b_sum += weight * columns[x, 2]
            red, green, blue = r_sum / 16, g_sum / 16, b_sum / 16
            cb = ((matrix[1, 0] * red + matrix[1, 1] * green) + matrix[1, 2] * blue) + offset[1]
            cr = ((matrix[2, 0] * red + matrix[2, 1] * green) + matrix[2, 2] * blue) + offset[2]
            cb_plane[k, j] = _sample(cb, peak)
            cr_plane[k, j] = _sample(cr, peak)


def to_rgb(planes: Sequence[Plane], video: VideoFormat) -> Frame:
    """Convert Y'CbCr planes to a full-range R'G'B' frame (H, W, 3) of the same bit depth, u1 for 8 bits, else u2.

    The planes (for matrix 0: G', B', R'; for matrix 8: Y, Cg, Co) have the shapes ``video.plane_shapes``. Samples above
    the peak are possible in forged files and do no harm.
    """
    convert = conversion(video)
    y, cb, cr = (np.ascontiguousarray(plane) for plane in planes)
    for plane, shape in zip((y, cb, cr), video.plane_shapes, strict=True):
        if plane.shape != shape or plane.dtype != video.dtype:
            raise UsageError(f"a plane is {plane.dtype} of shape {plane.shape}; it must be {video.dtype} of {shape}")
    vertical, horizontal = phases(video)
    rows, columns = up_taps(video.height, vertical), up_taps(video.width, horizontal)
    frame = np.empty((video.height, video.width, 3), video.dtype)
    _to_rgb(
        y,
        cb,
        cr,
        rows.indices,
        rows.weights,
        columns.indices,
        columns.weights,
        convert.to_rgb,
        convert.offset,
        float(video.peak),
        frame,
    )
    return frame


def to_planes(frame: Frame, video: VideoFormat) -> Planes:
    """Convert a full-range R'G'B' frame (H, W, 3) to Y'CbCr planes of the same bit depth, ``video.plane_shapes``."""
    convert = conversion(video)
    check_frame(frame, video)
    vertical, horizontal = phases(video)
    rows, columns = down_taps(video.height, vertical), down_taps(video.width, horizontal)
    y, cb, cr = (np.empty(shape, video.dtype) for shape in video.plane_shapes)
    _to_planes(
        np.ascontiguousarray(frame),
        rows.indices,
        rows.weights,
        columns.indices,
        columns.weights,
        convert.to_planes,
        convert.offset,
        float(video.peak),
        y,
        cb,
        cr,
    )
    return y, cb, cr


class FramePlanes(NamedTuple):
    """The planes of a frame."""

    y: Plane
    cb: Plane
    cr: Plane


# twin of spec.planes_to_frame
@door
def planes_to_frame(
    y: Plane,
    cb: Plane,
    cr: Plane,
    chroma_format: int,
    matrix_coefficients: int,
    video_full_range_flag: int,
    chroma_sample_loc_type: int,
    bit_depth: int,
) -> Frame:
    """`to_rgb` by the elements of a sequence header in place of a `VideoFormat`: (11-2) to (11-4), R-11.1-1.

    Parameters
    ----------
    y, cb, cr
        (H, W), (h, w) and (h, w), u1 for 8 bits, else u2.
    chroma_format, matrix_coefficients, video_full_range_flag, chroma_sample_loc_type, bit_depth
        As in section 6.3; `chroma_format` is 1 to 3.

    Returns
    -------
    (H, W, 3) u1 or u2.

    Raises
    ------
    UsageError
        Shapes or dtypes do not fit, or the matrix cannot be converted.
    """
    color = (matrix_coefficients, video_full_range_flag, chroma_sample_loc_type)
    return to_rgb((y, cb, cr), _described(y.shape, chroma_format, *color, bit_depth))


# twin of spec.frame_to_planes
@door
def frame_to_planes(
    frame: Frame,
    chroma_format: int,
    matrix_coefficients: int,
    video_full_range_flag: int,
    chroma_sample_loc_type: int,
    bit_depth: int,
) -> FramePlanes:
    """`to_planes` by the elements of a sequence header in place of a `VideoFormat`: (11-1), (11-3), (11-4), R-11.1-1.

    Parameters
    ----------
    frame
        (H, W, 3), u1 for 8 bits, else u2.
    chroma_format, matrix_coefficients, video_full_range_flag, chroma_sample_loc_type, bit_depth
        As for `planes_to_frame`.

    Returns
    -------
    FramePlanes
        `y` (H, W), `cb` and `cr` (h, w) of the frame's dtype.

    Raises
    ------
    UsageError
        The frame does not fit the bit depth, or the matrix cannot be converted.
    """
    color = (matrix_coefficients, video_full_range_flag, chroma_sample_loc_type)
    return FramePlanes(*to_planes(frame, _described(frame.shape[:2], chroma_format, *color, bit_depth)))


def _described(
    size: tuple[int, ...], chroma_format: int, matrix: int, full_range: int, location: int, bit_depth: int
) -> VideoFormat:
    height, width = size
    color = ColorDescription(UNSPECIFIED, UNSPECIFIED, matrix, bool(full_range), location)
    return VideoFormat(width, height, Fraction(25), bit_depth, get_args(ChromaFormat)[chroma_format], color)
