"""The operations of colour conversion."""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gsvc_conformance.expectations import Decision, Expectation
from gsvc_conformance.operation import paired
from gsvc_conformance.operations.color_map import ColorMap

F8 = NDArray[np.float64]
Samples = NDArray[np.unsignedinteger[Any]]
Expected = Mapping[str, Expectation]


def planes_to_frame_oracle(
    y: Samples,
    cb: Samples,
    cr: Samples,
    chroma_format: int,
    matrix_coefficients: int,
    video_full_range_flag: int,
    chroma_sample_loc_type: int,
    bit_depth: int,
) -> Expected:
    """The affine map in rational numbers; the other integer is legal where a tie is within the error of binary32."""
    color = ColorMap(
        y.shape, chroma_format, matrix_coefficients, video_full_range_flag, chroma_sample_loc_type, bit_depth
    )
    terms = [y.astype(np.float64), *(color.up(plane.astype(np.float64)) for plane in (cb, cr))]
    gains = [Fraction(color.peak, gain) for gain, _ in color.scales]
    matrix = [[c * gain for c, gain in zip(row, gains, strict=True)] for row in color.inverse]
    return {"frame": _stacked(color.samples(matrix, [offset for _, offset in color.scales], terms, (0, 0, 0)))}


def _stacked(channels: Sequence[Decision]) -> Decision:
    margins = [c.margin for c in channels if c.margin is not None]
    guards = [c.guard for c in channels if c.guard is not None]
    return Decision(
        np.stack([c.value for c in channels], axis=-1),
        np.stack([c.alternative for c in channels if c.alternative is not None], axis=-1),
        min(margins, default=None),
        max(guards, default=None),
    )


paired(
    "planes_to_frame",
    "colour",
    "Planes of a video file to a full-range frame.",
    inputs="y: u1|u2 (H, W); cb: u1|u2 (h, w); cr: u1|u2 (h, w); chroma_format: int; matrix_coefficients: int; "
    "video_full_range_flag: int; chroma_sample_loc_type: int; bit_depth: int",
    outputs="frame: u1|u2 (H, W, 3)",
    equations=("11-2", "11-3", "11-4"),
    rules=("R-11.1-1",),
    oracle=planes_to_frame_oracle,
)


def frame_to_planes_oracle(
    frame: Samples,
    chroma_format: int,
    matrix_coefficients: int,
    video_full_range_flag: int,
    chroma_sample_loc_type: int,
    bit_depth: int,
) -> Expected:
    """The affine map in rational numbers; the other integer is legal where a tie is within the error of binary32."""
    color = ColorMap(
        frame.shape[:2], chroma_format, matrix_coefficients, video_full_range_flag, chroma_sample_loc_type, bit_depth
    )
    wide = [frame[..., c].astype(np.float64) for c in range(3)]
    means = [color.down(channel) for channel in wide]
    result = {}
    for name, row, (gain, offset), terms in zip(
        ("y", "cb", "cr"), color.forward, color.scales, (wide, means, means), strict=True
    ):
        scaled = [[c * Fraction(gain, color.peak) for c in row]]
        result[name] = color.samples(scaled, (0, 0, 0), terms, (offset,))[0]
    return result


paired(
    "frame_to_planes",
    "colour",
    "A full-range frame to the planes of a video file.",
    inputs="frame: u1|u2 (H, W, 3); chroma_format: int; matrix_coefficients: int; video_full_range_flag: int; "
    "chroma_sample_loc_type: int; bit_depth: int",
    outputs="y: u1|u2 (H, W); cb: u1|u2 (h, w); cr: u1|u2 (h, w)",
    equations=("11-1", "11-3", "11-4"),
    rules=("R-11.1-1",),
    oracle=frame_to_planes_oracle,
)
