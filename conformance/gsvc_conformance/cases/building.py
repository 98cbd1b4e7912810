"""Tools of the cases of streams: painted splat blocks, short ways to streams, and views of what is expected."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_conformance.case import Inputs, Tier, case
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.bitstream.chunks import PREFIX_SIZE
from gsvc_ref.paper import Codebooks, FrameCodes, Quantizer, SplatBlock
from gsvc_ref.testing import OVERVIEW_HEADER, join_chunks, overview_frames, split_chunks, write_stream

Array = NDArray[Any]
Chunks = list[tuple[bytes, bytes]]

HEADER: Final = SequenceHeader(
    level=1, width=21, height=15, cholesky_bits=6, color_stages=3, color_codewords=8, entropy_precision=12
)
"""The header of most streams: a size that is no multiple of anything."""


def quantizer_of(scale: ArrayLike, offset: ArrayLike) -> Quantizer:
    """Scales and offsets of l11, l21, l22."""
    return Quantizer(np.asarray(scale, np.float32), np.asarray(offset, np.float32))


COARSE: Final = quantizer_of([0.25, 0.5, 0.25], [0.5, -4, 0.5])
FINE: Final = quantizer_of([2.0**-7, 2.0**-6, 2.0**-7], [-(2.0**-4), -0.125, -(2.0**-4)])
BOOKS: Final[Codebooks] = tuple((np.arange(3 * n).reshape(n, 3) / 16 - 0.25).astype(np.float16) for n in (5, 8))
FINE_BOOKS: Final[Codebooks] = ((np.arange(12).reshape(4, 3) / 256 - 2.0**-6).astype(np.float16),)


def on(tier: Tier, *operations: str, **about: Any) -> Callable[[Callable[..., Inputs]], Callable[..., Inputs]]:
    """Register one function as a case of several operations that take a stream."""

    def register(function: Callable[..., Inputs]) -> Callable[..., Inputs]:
        for operation in operations:
            case(tier, operation, **about)(function)
        return function

    return register


def halves(values: ArrayLike) -> NDArray[np.uint16]:
    """The binary16 patterns of values."""
    return np.asarray(values, np.float16).view(np.uint16)


def intra_block(
    count: int,
    *,
    first: int = 0,
    quantizer: Quantizer | None = COARSE,
    books: Codebooks | None = BOOKS,
    kept: Codebooks = BOOKS,
) -> SplatBlock:
    """`count` splats all over the frame, painted by their number from `first`; `kept` is what `books` None uses."""
    n = np.arange(first, first + count)
    places = np.column_stack([37 * n % 64, 23 * n % 64]) / 32 - 1 + 1 / 64
    cholesky = np.column_stack([5 * n % 9 + 3, 7 * n % 5 + 6, 3 * n % 7 + 3]).astype(np.uint16)
    colors = np.column_stack([(k + 2) * n % len(book) for k, book in enumerate(books or kept)]).astype(np.uint16)
    return SplatBlock(halves(places), cholesky, colors, quantizer, books)


def inter_block(
    count: int,
    *,
    quantizer: Quantizer | None = FINE,
    books: Codebooks | None = FINE_BOOKS,
    kept: Codebooks = FINE_BOOKS,
    without: str = "",
) -> SplatBlock:
    """Differences of `count` splats, all small and none alike; `without` names attributes that are not present."""
    n = np.arange(count)
    steps = np.column_stack([11 * n % 16 - 7.5, 5 * n % 16 - 7.5]) * 2.0**-9
    cholesky = np.column_stack([3 * n % 15, 5 * n % 16, 7 * n % 13]).astype(np.uint16)
    colors = np.column_stack([(k + 3) * n % len(book) for k, book in enumerate(books or kept)]).astype(np.uint16)
    return SplatBlock(
        None if "positions" in without else halves(steps),
        None if "cholesky" in without else cholesky,
        None if "colors" in without else colors,
        None if "cholesky" in without else quantizer,
        None if "colors" in without else books,
    )


def predicted(survivors: Iterable[int], inter: SplatBlock | None = None, new: SplatBlock | None = None) -> FrameCodes:
    """A P-frame; without `inter`, the survivors move as `inter_block` has it."""
    stay = np.array(list(survivors), np.bool_)
    count = int(np.count_nonzero(stay))
    return FrameCodes.predicted_frame(stay, (inter or inter_block(count)) if count else None, new)


def stream_of(frames: list[FrameCodes], *, index: bool = False, **header: Any) -> bytes:
    """A stream of frames with the header of the cases, some elements of which may be others."""
    return write_stream(replace(HEADER, **header), frames, index=index)


def overview_bytes() -> bytes:
    """The stream that spec.md takes apart byte by byte."""
    return write_stream(OVERVIEW_HEADER, overview_frames(), index=False)


def operated(edit: Callable[[Chunks], Chunks], data: bytes | None = None) -> bytes:
    """A stream, else the overview (chunks H I P R E), after an operation on its chunks; checksums are made right."""
    data = overview_bytes() if data is None else data
    return join_chunks(edit(split_chunks(data)), prefix=data[:PREFIX_SIZE])


def result(expected: Mapping[str, Any], output: str) -> Any:
    """The value that an output must have."""
    return expected[output].value


def frames_of(expected: Mapping[str, Any]) -> list[Array]:
    """The parameters (N, 8) of each frame that reconstruct_stream must find, after a look at its outcome."""
    assert result(expected, "error") == ""
    counts = result(expected, "counts")
    return np.split(result(expected, "parameters"), np.cumsum(counts)[:-1])


def same_bits(a: Array, b: Array) -> bool:
    """Whether two arrays f4 have the same bits."""
    return a.tobytes() == b.tobytes()
