"""Colour conversion between frames and the planes of video files (section 11.1), in binary64."""

from typing import Final

import torch
from torch import Tensor

from gsvc_conformance.adapters.pytorch.device import DEVICE, Array, Arrays, array, tensor

LUMA_WEIGHTS: Final = {
    1: (0.2126, 0.0722),
    4: (0.30, 0.11),
    5: (0.299, 0.114),
    6: (0.299, 0.114),
    7: (0.212, 0.087),
    9: (0.2627, 0.0593),
}
"""K_R and K_B by `matrix_coefficients`."""

COLUMN_PHASES: Final = (0, 1, 0, 1, 0, 1)
ROW_PHASES: Final = (1, 1, 0, 0, 2, 2)
"""2 φ by `chroma_sample_loc_type`."""


def planes_to_frame(
    y: Array,
    cb: Array,
    cr: Array,
    chroma_format: int,
    matrix_coefficients: int,
    video_full_range_flag: int,
    chroma_sample_loc_type: int,
    bit_depth: int,
) -> Arrays:
    """Operation: planes to a frame."""
    height, width = y.shape
    matrix = _matrix_of(matrix_coefficients, height)
    gain, offset = _scale(matrix, video_full_range_flag, bit_depth)
    row_phase, column_phase = _phases(chroma_format, chroma_sample_loc_type)
    chroma = torch.stack((tensor(cb), tensor(cr))).double()
    chroma = _upsampled(_upsampled(chroma, 1, height, row_phase), 2, width, column_phase)
    planes = torch.cat((tensor(y).double()[None], chroma)) - offset[:, None, None]
    peak = torch.full_like(gain, 2**bit_depth - 1)
    to_rgb = _inverse(matrix) * (peak / gain)  # a number / tensor would be a product with the reciprocal
    return {"frame": _samples(_combined(to_rgb, planes).permute(1, 2, 0), bit_depth)}


def frame_to_planes(
    frame: Array,
    chroma_format: int,
    matrix_coefficients: int,
    video_full_range_flag: int,
    chroma_sample_loc_type: int,
    bit_depth: int,
) -> Arrays:
    """Operation: a frame to planes."""
    matrix = _matrix_of(matrix_coefficients, frame.shape[0])
    gain, offset = _scale(matrix, video_full_range_flag, bit_depth)
    row_phase, column_phase = _phases(chroma_format, chroma_sample_loc_type)
    full = tensor(frame).double().permute(2, 0, 1)
    means = _downsampled(_downsampled(full, 1, row_phase), 2, column_phase)
    peak = torch.full_like(gain, 2**bit_depth - 1)
    to_planes = _forward(matrix) * (gain / peak)[:, None]
    luma = _combined(to_planes[:1], full) + offset[0]
    chroma = _combined(to_planes[1:], means) + offset[1:, None, None]
    names = ("y", "cb", "cr")
    return {name: _samples(plane, bit_depth) for name, plane in zip(names, (*luma, *chroma), strict=True)}


def _combined(matrix: Tensor, planes: Tensor) -> Tensor:
    """Rows of a matrix times three planes, (rows, H, W); a product of matrices might round in another order."""
    (a, b, c), (first, second, third) = matrix.T[:, :, None, None].unbind(), planes.unbind()
    return (a * first + b * second) + c * third


def _samples(values: Tensor, bit_depth: int) -> Array:
    rounded = torch.round(values.clamp(0, 2**bit_depth - 1))
    return array(rounded, "u1" if bit_depth == 8 else "u2")


def _matrix_of(matrix_coefficients: int, height: int) -> int:
    unstated = 6 if height <= 576 else 1
    return unstated if matrix_coefficients == 2 else matrix_coefficients


def _forward(matrix: int) -> Tensor:
    """(11-1): planes from R', G', B'."""
    if matrix == 0:
        rows = [[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]
    elif matrix == 8:
        rows = [[0.25, 0.5, 0.25], [-0.25, 0.5, -0.25], [0.5, 0, -0.5]]
    else:
        kr, kb = LUMA_WEIGHTS[matrix]
        kg, b, r = 1 - kr - kb, 2 * (1 - kb), 2 * (1 - kr)
        rows = [[kr, kg, kb], [-kr / b, -kg / b, 0.5], [0.5, -kg / r, -kb / r]]
    return torch.tensor(rows, dtype=torch.float64, device=DEVICE)


def _inverse(matrix: int) -> Tensor:
    """(11-2): R', G', B' from planes; not a numerical inverse, so that integers stay integers."""
    if matrix == 0:
        rows = [[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]
    elif matrix == 8:
        rows = [[1.0, -1, 1], [1, 1, 0], [1, -1, -1]]
    else:
        kr, kb = LUMA_WEIGHTS[matrix]
        kg, b, r = 1 - kr - kb, 2 * (1 - kb), 2 * (1 - kr)
        rows = [[1, 0, r], [1, -b * kb / kg, -r * kr / kg], [1, b, 0]]
    return torch.tensor(rows, dtype=torch.float64, device=DEVICE)


def _scale(matrix: int, video_full_range_flag: int, bit_depth: int) -> tuple[Tensor, Tensor]:
    """Gain and offset (11-3) of the three planes."""
    unit, peak = 2 ** (bit_depth - 8), 2**bit_depth - 1
    luma = (peak, 0) if video_full_range_flag else (219 * unit, 16 * unit)
    chroma = (peak if video_full_range_flag else 224 * unit, 128 * unit)
    if matrix == 8:
        chroma = (luma[0], chroma[1])
    if matrix == 0:
        chroma = luma
    gain, offset = torch.tensor([luma, chroma, chroma], dtype=torch.float64, device=DEVICE).unbind(1)
    return gain, offset


def _phases(chroma_format: int, chroma_sample_loc_type: int) -> tuple[int | None, int | None]:
    """2 φ of rows and columns; None on an axis with as many chroma samples as luma samples."""
    rows = ROW_PHASES[chroma_sample_loc_type] if chroma_format == 1 else None
    return rows, COLUMN_PHASES[chroma_sample_loc_type] if chroma_format in (1, 2) else None


def _upsampled(planes: Tensor, axis: int, size: int, phase: int | None) -> Tensor:
    """(11-4) to luma samples along an axis; exact, since weights are quarters."""
    if phase is None:
        return planes
    quarters = 2 * torch.arange(size, device=planes.device) - phase  # four times (i - φ)/2
    j, last = quarters // 4, planes.shape[axis] - 1  # rounds down, also below zero
    f = ((quarters - 4 * j) / 4).double().view(-1, *[1] * (2 - axis))
    before, after = (planes.index_select(axis, place.clamp(0, last)) for place in (j, j + 1))
    return (1 - f) * before + f * after


def _downsampled(planes: Tensor, axis: int, phase: int | None) -> Tensor:
    """(11-4) to chroma samples along an axis; exact."""
    if phase is None:
        return planes
    size = planes.shape[axis]
    middle = 2 * torch.arange((size + 1) // 2, device=planes.device) + (phase == 2)

    def at(place: Tensor) -> Tensor:
        return planes.index_select(axis, place.clamp(0, size - 1))

    if phase == 1:
        return (at(middle) + at(middle + 1)) / 2
    return (at(middle - 1) + 2 * at(middle) + at(middle + 1)) / 4
