"""Ten thousand frames of a few splats that move all the time: one I-frame, then predictions of predictions.

The encoder is the closed loop at its barest: the difference between where a splat should be and where the decoder has
it, quantised by the functions of gsvc_ref. Every other frame is an R-frame; P-frames have positions, Cholesky factors
and colours in turn. The open loop codes the differences of the source instead.
"""

import sys
from dataclasses import dataclass
from functools import cache
from io import BytesIO
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.paper import (
    Codebooks,
    FrameCodes,
    LsqParameters,
    Quantizer,
    SplatBlock,
    State,
    lsq_quantize,
    reconstruct,
    rvq,
    to_half,
)
from gsvc_ref.paper.lsq_parameters import with_exact_zero
from gsvc_ref.stream import StreamReader, StreamWriter

F4 = NDArray[np.float32]

FRAMES: Final = 10_000
SPLATS: Final = 4
WIDTH: Final = 64
HEIGHT: Final = 48
BITS: Final = 6
POSITIONS, CHOLESKY, COLORS = 0, 1, 2
"""The attributes that the P-frames have in turn."""
SCALE: Final = np.full(3, 0.01, np.float32)  # pixels; no power of two, so that products are rounded
HEADER: Final = SequenceHeader(
    level=1, parameter_checksum_flag=True, width=WIDTH, height=HEIGHT, cholesky_bits=BITS, color_stages=2,
    color_codewords=27,
)  # fmt: skip
INTRA: Final = Quantizer(np.full(3, 0.1, np.float32), np.array([0.5, -3, 0.5], np.float32))
_ZERO: Final = with_exact_zero(LsqParameters(SCALE, -32 * SCALE), BITS)
INTER: Final = Quantizer(_ZERO.scale, _ZERO.offset)


def _grid(step: float) -> NDArray[np.float16]:
    """Codewords -step, 0, step in each channel, (27, 3) f2, the zero first."""
    axes = np.meshgrid(*[[0, -step, step]] * 3, indexing="ij")
    return np.stack(axes, axis=-1).reshape(-1, 3).astype(np.float16)


BOOKS: Final[Codebooks] = (_grid(0.01), _grid(0.003))


@cache
def source() -> F4:
    """Where splats should be, (FRAMES, SPLATS, 8) f4: each parameter swings slowly, with a period of its own."""
    t = np.arange(FRAMES)[:, None, None]
    number = np.arange(8 * SPLATS).reshape(SPLATS, 8)
    swing = np.sin(2 * np.pi * t / (211 + 13 * number) + number)
    middle = np.array([32, 24, 3, 0, 3, 0.4, 0.4, 0.4])
    reach = np.array([20, 15, 1.5, 1, 1.5, 0.2, 0.2, 0.2])
    return np.asarray(middle + reach * swing, np.float32)


def first_frame() -> FrameCodes:
    """The I-frame, which need not be good."""
    places = to_half(source()[0, :, :2] / np.array([WIDTH / 2, HEIGHT / 2]) - 1)
    shapes = lsq_quantize(source()[0, :, 2:5], INTRA.scale, INTRA.offset, BITS)
    books = ((np.arange(24).reshape(8, 3) / 24).astype(np.float16),)
    colors = rvq.rvq_assign(source()[0, :, 5:], *rvq.flat(books))
    return FrameCodes.intra_frame(SplatBlock(places, shapes, colors, INTRA, books))


def is_repeated(number: int) -> bool:
    """Whether a frame is an R-frame."""
    return number % 2 == 0


def attribute(number: int) -> int:
    """The attributes of a P-frame."""
    return number // 2 % 3


def difference(wanted: F4, number: int) -> FrameCodes:
    """An R-frame, or a P-frame of differences (SPLATS, 8) f4; the first ones bring quantiser and codebooks."""
    if is_repeated(number):
        return FrameCodes.repeated_frame()
    positions = cholesky = colors = None
    if attribute(number) == POSITIONS:
        positions = to_half(wanted[:, :2] / np.array([WIDTH / 2, HEIGHT / 2], np.float32))
    elif attribute(number) == CHOLESKY:
        cholesky = lsq_quantize(wanted[:, 2:5], INTER.scale, INTER.offset, BITS)
    else:
        colors = rvq.rvq_assign(wanted[:, 5:], *rvq.flat(BOOKS))
    own_quantizer, own_books = number == 2 * CHOLESKY + 1, number == 2 * COLORS + 1
    block = SplatBlock(positions, cholesky, colors, INTER if own_quantizer else None, BOOKS if own_books else None)
    return FrameCodes.predicted_frame(np.ones(SPLATS, np.bool_), block)


@dataclass(frozen=True)
class Sequence:
    """A stream, and the parameters that its encoder had after each frame, (frames, SPLATS, 8) f4."""

    data: bytes
    codes: list[FrameCodes]
    parameters: F4


@cache
def closed_loop(frames: int = FRAMES) -> Sequence:
    """Differences to the writer's own state, which is that of a decoder."""
    file, codes = BytesIO(), [first_frame()]
    writer = StreamWriter(file, HEADER)
    parameters = np.empty((frames, SPLATS, 8), np.float32)
    for number in range(frames):
        if number > 0:
            codes.append(difference(source()[number] - parameters[number - 1], number))
        writer.write_frame(codes[-1])
        parameters[number] = writer.state.splats.to_array()
    writer.finish()
    return Sequence(file.getvalue(), codes, parameters)


@cache
def decoded() -> tuple[F4, int]:
    """The reader's splats after each frame of the closed loop, (FRAMES, SPLATS, 8) f4.

    Also how many more blocks of memory are in use after the last frame than after frame 100.
    """
    found = np.empty((FRAMES, SPLATS, 8), np.float32)
    blocks = []
    for frame in StreamReader(closed_loop().data):
        found[frame.number] = frame.splats.to_array()
        if frame.number in (100, FRAMES - 1):
            blocks.append(sys.getallocatedblocks())
    return found, blocks[1] - blocks[0]


@cache
def open_loop() -> F4:
    """A decoder's splats by differences of the source, (FRAMES, SPLATS, 8) f4."""
    state = reconstruct(first_frame(), State.initial(WIDTH, HEIGHT))
    found, last = [state.splats.to_array()], source()[0].copy()
    for number in range(1, FRAMES):
        codes = difference(source()[number] - last, number)
        state = reconstruct(codes, state)
        if codes.type == "P":
            columns = (slice(0, 2), slice(2, 5), slice(5, 8))[attribute(number)]
            last[:, columns] = source()[number, :, columns]
        found.append(state.splats.to_array())
    return np.stack(found)


def accumulated(dtype: Any, *, fused: bool) -> NDArray[np.floating]:
    """The splats of a decoder that adds up in another type, or with fused products, (FRAMES, SPLATS, 8)."""
    half_size = np.array([WIDTH / 2, HEIGHT / 2])  # f8, in which products are exact
    books = [book.astype(dtype) for book in BOOKS]
    state = closed_loop().parameters[0].astype(dtype)
    found = [state]
    for codes in closed_loop().codes[1:]:
        state, block = state.copy(), codes.inter or SplatBlock(None, None, None, None, None)
        if block.positions is not None:
            product = block.positions.view(np.float16) * half_size
            state[:, :2] = state[:, :2] + (product if fused else product.astype(dtype))
        if block.cholesky is not None:
            product = block.cholesky * INTER.scale.astype(np.float64)
            state[:, 2:5] += ((product if fused else product.astype(dtype)) + INTER.offset).astype(dtype)
        if block.colors is not None:
            state[:, 5:] += books[0][block.colors[:, 0]] + books[1][block.colors[:, 1]]
        found.append(state)
    return np.stack(found)
