"""Streams of a few bytes, to read by eye and to damage."""

import numpy as np

from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.paper import FrameCodes, Quantizer, SplatBlock

OVERVIEW_HEADER = SequenceHeader(
    level=1,
    width=16,
    height=12,
    chroma_format=1,
    matrix_coefficients=1,
    cholesky_bits=6,
    color_stages=1,
    color_codewords=1,
)
"""The header of the stream of `overview_frames`."""


def overview_frames() -> list[FrameCodes]:
    """An I-, a P- and an R-frame with one splat: it appears at (6, 4.5), moves by (1, -0.75) pixels, and rests."""
    intra = SplatBlock(
        positions=_half([[-0.25, -0.25]]),
        cholesky=np.array([[8, 16, 8]], np.uint16),
        colors=np.zeros((1, 1), np.uint16),
        quantizer=Quantizer(np.full(3, 0.25, np.float32), np.array([0, -4, 0], np.float32)),
        codebooks=(np.array([[0.75, 0.5, 0.25]], np.float16),),
    )
    moved = SplatBlock(positions=_half([[0.125, -0.125]]))
    return [
        FrameCodes.intra_frame(intra),
        FrameCodes.predicted_frame(np.ones(1, np.bool_), moved),
        FrameCodes.repeated_frame(),
    ]


RICH_HEADER = SequenceHeader(
    level=1,
    parameter_checksum_flag=True,
    width=40,
    height=30,
    cholesky_bits=5,
    color_stages=3,
    color_codewords=8,
    entropy_precision=12,
    lane_count=2,
)
"""The header of the stream of `rich_frames`."""


def rich_frames(count: int = 60) -> list[FrameCodes]:
    """Frames I P R I P with every plane mode, own and kept quantisers and codebooks, an alphabet that is no power of 2.

    `count` splats are in each I-frame; of the next P-frame, a third goes and two come.
    """
    n = np.arange(count)
    codes = np.where(n % 7 == 0, n % 5, 2)  # mostly one symbol: worth entropy coding
    quantizer = Quantizer(np.array([0.25, 0.5, 0.25], np.float32), np.array([0.5, -4, 0.5], np.float32))
    books = tuple((np.arange(3 * size).reshape(size, 3) / 16 - 0.5).astype(np.float16) for size in (5, 8))

    def block(size: int, spread: float, *, own: bool) -> SplatBlock:
        places = np.column_stack([37 * n[:size] % 64, 23 * n[:size] % 64]) / 32 - 1  # all over the frame, exact
        positions = _half(places * spread)
        cholesky = np.column_stack([codes[:size], codes[:size][::-1], np.full(size, 3)]).astype(np.uint16)
        colors = np.column_stack([codes[:size] % 5, n[:size] % 8]).astype(np.uint16)
        return SplatBlock(positions, cholesky, colors, quantizer if own else None, books if own else None)

    survivors = n % 3 != 0
    stay = int(survivors.sum())
    predicted = FrameCodes.predicted_frame(survivors, block(stay, 2.0**-8, own=True), block(2, 0.5, own=False))
    still = FrameCodes.predicted_frame(np.ones(count, np.bool_), SplatBlock())
    intra = FrameCodes.intra_frame(block(count, 1.0, own=True))
    return [intra, predicted, FrameCodes.repeated_frame(), intra, still]


def _half(values: object) -> np.ndarray[tuple[int, int], np.dtype[np.uint16]]:
    return np.asarray(values, np.float16).view(np.uint16)
