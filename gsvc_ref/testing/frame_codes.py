"""Hypothesis strategies of what a stream says: headers, frames, and whole streams with what they stand for."""

from dataclasses import dataclass, replace

import numpy as np
from hypothesis import strategies as st

from gsvc_ref.bitstream import LEVELS, SequenceHeader, level_for
from gsvc_ref.reconstruction import (
    BlockKind,
    Codebooks,
    FrameCodes,
    FrameType,
    Kept,
    Quantizer,
    SplatBlock,
    State,
    reconstruct,
)
from gsvc_ref.splats import Splats
from gsvc_ref.testing.faults import Lie, write_stream
from gsvc_ref.testing.strategies import SYMBOL_KINDS, U2, paint_symbols, painters

MOST_SPLATS = 256
"""Every level allows so many splats of any size on frames of any size: its work is 256 times its pixels."""

FEW_SPLATS = 8
"""So few that no plane is worth entropy coding, and that a stream can be read by eye."""


@st.composite
def headers(draw: st.DrawFn, *, max_pixels: int = 1 << 17) -> SequenceHeader:
    """Legal sequence headers; all elements but the size take their whole range."""
    width = draw(st.one_of(st.integers(1, 64), st.integers(1, min(65535, max_pixels))))
    height = draw(st.integers(1, min(65535, max(1, max_pixels // width))))
    known_aspect = draw(st.booleans())
    aspect = st.integers(1, 65535) if known_aspect else st.just(0)
    rate = st.integers(1, 2**32 - 1)
    byte = st.integers(0, 255)
    return SequenceHeader(
        level=draw(st.integers(level_for(width, height), max(LEVELS))),
        parameter_checksum_flag=draw(st.booleans()),
        width=width,
        height=height,
        frame_rate_numerator=draw(st.one_of(st.sampled_from((25, 30000)), rate)),
        frame_rate_denominator=draw(st.one_of(st.sampled_from((1, 1001)), rate)),
        sample_aspect_numerator=draw(aspect),
        sample_aspect_denominator=draw(aspect),
        bit_depth=draw(st.integers(8, 16)),
        chroma_format=draw(st.integers(0, 3)),
        color_primaries=draw(byte),
        transfer_characteristics=draw(byte),
        matrix_coefficients=draw(byte),
        video_full_range_flag=draw(st.integers(0, 1)),
        chroma_sample_loc_type=draw(st.integers(0, 5)),
        cholesky_bits=draw(st.integers(1, 12)),
        color_stages=draw(st.integers(1, 8)),
        color_codewords=draw(st.one_of(st.integers(1, 16), st.integers(1, 1024))),
        entropy_precision=draw(st.integers(12, 16)),
        lane_count=draw(st.one_of(st.integers(1, 4), st.integers(1, 64))),
    )


@st.composite
def _columns(draw: st.DrawFn, count: int, alphabets: tuple[int, ...]) -> U2:
    """(count, len(alphabets)) u2, each column a plane of a kind of its own."""
    rng = draw(painters())
    kinds = [draw(st.sampled_from(SYMBOL_KINDS)) for _ in alphabets]
    columns = np.empty((count, len(alphabets)), np.uint16)
    for k, (kind, alphabet) in enumerate(zip(kinds, alphabets, strict=True)):
        columns[:, k] = paint_symbols(rng, kind, count, alphabet)
    return columns


@st.composite
def _positions(draw: st.DrawFn, count: int, kind: BlockKind) -> U2:
    """Binary16 patterns (count, 2) u2, finite: plausible ones, all alike, or any."""
    rng = draw(painters())
    style = draw(st.sampled_from(("plausible", "alike", "any")))
    if style == "any":
        signs = rng.choice(np.array([0, 0x8000], np.uint16), (count, 2))
        bits: U2 = rng.integers(0, 0x7C00, (count, 2), np.uint16) | signs
        return bits
    spread = 1.0 if kind == "intra" else 2.0**-6
    values = rng.uniform(-spread, spread, (count, 2)).astype(np.float16)
    if style == "alike":
        values[:] = values[0]
    return values.view(np.uint16)


@st.composite
def _quantizers(draw: st.DrawFn) -> Quantizer:
    """Scales and offsets that are plausible, tiny or huge, but cannot overflow within a few frames."""
    rng = draw(painters())
    exponent = draw(st.sampled_from((-126, -130 + 64, -6, 0, 60)))
    scale = np.ldexp(rng.uniform(1, 2, 3), exponent)
    return Quantizer(scale.astype(np.float32), (rng.normal(0, 8, 3) * scale).astype(np.float32))


@st.composite
def _codebooks(draw: st.DrawFn, header: SequenceHeader) -> Codebooks:
    rng = draw(painters())
    spread = draw(st.sampled_from((0.0, 0.3, 6e4)))
    sizes = [draw(st.integers(1, header.color_codewords)) for _ in range(draw(st.integers(1, header.color_stages)))]
    return tuple(rng.uniform(-spread, spread, (size, 3)).astype(np.float16) for size in sizes)


@st.composite
def _blocks(draw: st.DrawFn, header: SequenceHeader, count: int, kind: BlockKind, kept: Kept) -> SplatBlock:
    """A block that uses what is kept whenever it may and Hypothesis likes it to."""

    def present() -> bool:
        return kind == "intra" or draw(st.booleans())

    positions = draw(_positions(count, kind)) if present() else None
    cholesky = colors = quantizer = codebooks = None
    if present():
        cholesky = draw(_columns(count, (1 << header.cholesky_bits,) * 3))
        if kept.quantizer is None or draw(st.booleans()):
            quantizer = draw(_quantizers())
    if present():
        if kept.codebooks is None or draw(st.booleans()):
            codebooks = draw(_codebooks(header))
        books = codebooks or kept.codebooks or ()
        colors = draw(_columns(count, tuple(len(book) for book in books)))
    return SplatBlock(positions, cholesky, colors, quantizer, codebooks)


@st.composite
def frames(
    draw: st.DrawFn, header: SequenceHeader, state: State, *, types: str = "IPR", max_count: int = 120
) -> FrameCodes:
    """A frame that may follow `state`: one of `types`, with at most `max_count` new splats and `MOST_SPLATS` in all."""
    frame_type: FrameType = draw(st.sampled_from(sorted(types)))
    if frame_type == "R":
        return FrameCodes.repeated_frame()
    survivors = np.zeros(0, np.bool_)
    inter = None
    if frame_type == "P":
        share = draw(st.sampled_from((0.0, 0.5, 0.9, 1.0)))
        survivors = draw(painters()).random(len(state.splats)) < share
        if survivors.any():
            inter = draw(_blocks(header, int(np.count_nonzero(survivors)), "inter", state.inter))
    room = min(max_count, MOST_SPLATS - int(np.count_nonzero(survivors)))
    count = draw(st.one_of(st.integers(0, min(room, FEW_SPLATS)), st.integers(0, room)))
    kept = Kept() if frame_type == "I" else state.intra
    intra = draw(_blocks(header, count, "intra", kept)) if count else None
    return FrameCodes.intra_frame(intra) if frame_type == "I" else FrameCodes.predicted_frame(survivors, inter, intra)


@dataclass(frozen=True, eq=False)
class Stream:
    """A legal stream.

    Attributes
    ----------
    data
        Its bytes.
    header, frames
        What they say.
    splats
        What they stand for: the splats of each frame, bit for bit.
    """

    data: bytes
    header: SequenceHeader
    frames: list[FrameCodes]
    splats: list[Splats]


@st.composite
def streams(draw: st.DrawFn, *, max_frames: int = 5, max_count: int = 120, max_pixels: int = 1 << 17) -> Stream:
    """Legal streams with all that the syntax allows.

    Any mix of frame types, plane modes, kept quantisers and codebooks; any number of lanes; with and without index,
    parameter checksums, a frame count in the header, ancillary chunks, and header elements of a later minor version.
    """
    header = draw(headers(max_pixels=max_pixels))
    state = State.initial(header.width, header.height)
    codes: list[FrameCodes] = []
    splats: list[Splats] = []
    for number in range(draw(st.integers(1, max_frames))):
        codes.append(draw(frames(header, state, types="IPR" if number else "I", max_count=max_count)))
        state = reconstruct(codes[-1], state)
        splats.append(state.splats)
    ancillary = draw(
        st.dictionaries(
            st.integers(0, len(codes) - 1), st.tuples(st.sampled_from("abz"), st.binary(max_size=9)), max_size=2
        )
    )
    header = replace(header, frame_count=draw(st.sampled_from((0, len(codes)))))
    elements = [Lie("frame_count", header.frame_count)]
    if draw(st.integers(0, 7)) == 7:
        elements.append(Lie("version_minor", draw(st.integers(1, 255))))
        elements.append(Lie("lane_count", bytes([header.lane_count]) + draw(st.binary(max_size=5))))
    data = write_stream(header, codes, index=draw(st.booleans()), ancillary=ancillary, lies=elements)
    return Stream(data, header, codes, splats)
