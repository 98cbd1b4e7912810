"""Whole streams as arrays: what section 12.4 of spec.md asks of them."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gsvc_base.checks import door
from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.main.codes import MainCodes
from gsvc_ref.main.frames import symbols_of
from gsvc_ref.main.kept_state import MainState
from gsvc_ref.paper import FrameCodes, SplatBlock
from gsvc_ref.stream.decoded import DecodedFrame
from gsvc_ref.stream.decoder import decode, rendered
from gsvc_ref.stream.reader import StreamReader

Array = NDArray[Any]


class StreamCodes(NamedTuple):
    """The codes of a stream: T frames, K blocks, and the rows of those blocks that have them."""

    header: Array
    """(22,) i8, the elements of the sequence header in the order of section 6.3."""
    frame_types: Array
    """(T,) u1, I, P or R in ASCII."""
    counts: Array
    """(T,) i8, the number of splats."""
    survivors: Array
    """(S,) u1, the symbols of all survivor maps."""
    blocks: Array
    """(K, 8) i8: `frame_number`, 0 intra or 1 inter, count, and whether positions, Cholesky factors, a quantiser,
    colours and codebooks are present."""
    positions: Array
    """(P, 2) u2, patterns of binary16."""
    cholesky: Array
    """(C, 3) u2."""
    quantizers: Array
    """(Q, 3, 2) f4, scale and offset of each channel."""
    codebook_sizes: Array
    """(M,) i8."""
    codewords: Array
    """(W, 3) u2, patterns of binary16."""
    color_indices: Array
    """(I,) u2, stage by stage, and within a stage splat by splat."""


class StreamSplats(NamedTuple):
    """The splats of the complete frames of a stream, or of those that were asked for."""

    counts: Array
    """(T,) i8, the number of splats of each frame."""
    parameters: Array
    """(N, 8) f4, frame by frame, in the columns of `Splats.to_array`."""
    error: str
    """Kind, rule and offset in bits of the first fault; empty if there is none."""


# twin of spec.read_stream
def read_stream(stream: bytes) -> StreamCodes:
    """The codes of a stream of profile `paper`, frame by frame and block by block in the order of its bytes.

    Parameters
    ----------
    stream
        A `.gsvc` file.

    Returns
    -------
    StreamCodes
        Flat arrays: a decoder that reads them needs no syntax.

    Raises
    ------
    GsvcError
        The stream breaks a rule of spec.md.
    UsageError
        The stream is of another profile.
    """
    reader = StreamReader(stream)
    frames = list(reader)
    rows: list[tuple[int, ...]] = []
    blocks: list[SplatBlock] = []
    survivors: list[Array | None] = []
    for frame in frames:
        codes = frame.codes
        if not isinstance(codes, FrameCodes):
            raise UsageError("the stream is of profile `main`; read_main_stream lists its codes")
        survivors.append(codes.survivors)
        # A P-frame's inter block stands before its intra block.
        for kind, count, block in ((1, codes.survivor_count, codes.inter), (0, codes.intra_count, codes.intra)):
            if block is not None:
                parts = (block.positions, block.cholesky, block.quantizer, block.colors, block.codebooks)
                rows.append((frame.number, kind, count, *(part is not None for part in parts)))
                blocks.append(block)
    quantizers = [block.quantizer for block in blocks if block.quantizer is not None]
    books = [book for block in blocks for book in block.codebooks or ()]
    return StreamCodes(
        header=np.array(list(reader.header.elements.values()), np.int64),
        frame_types=np.frombuffer("".join(frame.type for frame in frames).encode(), np.uint8),
        counts=np.array([len(frame.splats) for frame in frames], np.int64),
        survivors=_joined(survivors, np.zeros(0, np.uint8)),
        blocks=np.array(rows, np.int64).reshape(-1, 8),
        positions=_joined([block.positions for block in blocks], np.zeros((0, 2), np.uint16)),
        cholesky=_joined([block.cholesky for block in blocks], np.zeros((0, 3), np.uint16)),
        quantizers=np.array([np.stack([q.scale, q.offset], axis=1) for q in quantizers], np.float32).reshape(-1, 3, 2),
        codebook_sizes=np.array([len(book) for book in books], np.int64),
        codewords=_joined([book.view(np.uint16) for book in books], np.zeros((0, 3), np.uint16)),
        color_indices=_joined(
            [None if block.colors is None else block.colors.T.ravel() for block in blocks], np.zeros(0, np.uint16)
        ),
    )


class MainStreamCodes(NamedTuple):
    """The codes of a stream of profile `main`: T frames, of which B are not repeated."""

    header: Array
    """(n,) i8, the elements of the sequence header in the order of sections 6.3 and 15.2."""
    frame_types: Array
    """(T,) u1, I, P or R in ASCII."""
    counts: Array
    """(T,) i8, the number of splats."""
    bodies: Array
    """(B, 6) i8: `frame_number`, the `quantizer` that holds, `lane_exponent`, `motion_cell`, whether there are
    densities, and the number of new splats."""
    fields: Array
    """(V, 2) i8, the vectors of the motion fields row by row, in quarter pixels."""
    modes: Array
    """(M,) i8, those of the splats of the frame before."""
    differences: Array
    """(M, 8) i8, q of these splats."""
    symbols: Array
    """(S, 4) u2, c(s), f(s), pass and lane of each symbol."""
    states: Array
    """(N, 8) i8, the states of the splats of all frames."""


# twin of spec.read_main_stream
def read_main_stream(stream: bytes) -> MainStreamCodes:
    """The codes that a stream of profile `main` consists of, frame by frame (spec.md section 15.12).

    Parameters
    ----------
    stream
        A `.gsvc` file.

    Returns
    -------
    MainStreamCodes
        Flat arrays.

    Raises
    ------
    GsvcError
        The stream breaks a rule of spec.md.
    UsageError
        The stream is of another profile.
    """
    reader = StreamReader(stream)
    types, counts, states, symbols = [], [], [], []
    before = MainState.initial(reader.header.width, reader.header.height)
    bodies: list[tuple[int, MainCodes]] = []
    for frame in reader:
        if not isinstance(frame.codes, MainCodes) or not isinstance(frame.state, MainState):
            raise UsageError("the stream is of profile `paper`; read_stream lists its codes")
        types.append(frame.type)
        counts.append(len(frame.splats))
        states.append(frame.state.values)
        if frame.type != "R":
            bodies.append((frame.number, frame.codes))
            symbols.append(symbols_of(before, frame.codes))
        before = frame.state
    rows = [
        (number, c.quantizer, c.lane_exponent, c.motion_cell, int(c.densities is not None), len(c.new))
        for number, c in bodies
    ]
    return MainStreamCodes(
        header=np.array(list(reader.header.elements.values()), np.int64),
        frame_types=np.frombuffer("".join(types).encode(), np.uint8),
        counts=np.array(counts, np.int64),
        bodies=np.array(rows, np.int64).reshape(-1, 6),
        fields=_joined([codes.vectors.reshape(-1, 2) for _, codes in bodies], np.zeros((0, 2), np.int64)),
        modes=_joined([codes.modes for _, codes in bodies], np.zeros(0, np.int64)),
        differences=_joined([codes.differences for _, codes in bodies], np.zeros((0, 8), np.int64)),
        symbols=_joined(symbols, np.zeros((0, 4), np.uint16)),
        states=_joined(states, np.zeros((0, 8), np.int64)),
    )


def _joined(parts: list[Any], empty: Array) -> Array:
    """The arrays that are there, one after the other, in the type and shape of `empty`."""
    return np.concatenate([empty, *(part.astype(empty.dtype) for part in parts if part is not None)])


# twin of spec.reconstruct_stream
def reconstruct_stream(stream: bytes) -> StreamSplats:
    """The splats of all complete frames of a stream, and its first fault, which is not raised.

    Parameters
    ----------
    stream
        Any bytes.

    Returns
    -------
    StreamSplats
        `counts`, `parameters` and `error`.
    """
    return _splats_of(_frames_between(stream, 0, None))


# twin of spec.reconstruct_layers
@door
def reconstruct_layers(stream: bytes, layer: int) -> StreamSplats:
    """The splats of all complete frames of a stream up to a layer, and its first fault (section 15.13).

    Parameters
    ----------
    stream
        Any bytes.
    layer
        0 to 3; 0 is the base, and what `reconstruct_stream` gives.

    Returns
    -------
    StreamSplats
        `counts`, `parameters` and `error`. A frame whose layer has the fault is there, with the layers before it.

    Raises
    ------
    UsageError
        There is no such layer.
    """
    return _splats_of(_frames_between(stream, 0, None, layer))


# twin of spec.seek
@door
def seek(stream: bytes, first: int, last: int) -> StreamSplats:
    """The splats of frames `first` to `last`, decoded from the last I-frame at or before them (spec.md section 12.6).

    Parameters
    ----------
    stream
        Any bytes.
    first, last
        Numbers of frames, 0 <= first <= last.

    Returns
    -------
    StreamSplats
        `counts`, `parameters` and `error`, which is the first fault.
    """
    return _splats_of(_frames_between(stream, first, last + 1))


def _frames_between(stream: bytes, start: int, stop: int | None, layer: int = 0) -> Iterator[DecodedFrame]:
    yield from StreamReader(stream, layer=layer).frames(start, stop)


def _splats_of(frames: Iterator[DecodedFrame]) -> StreamSplats:
    """The splats of frames up to the fault that ends them, if one does."""
    splats: list[Array] = []
    error = ""
    try:
        splats.extend(frame.splats.to_array() for frame in frames)
    except GsvcError as fault:
        error = f"{fault.kind} {fault.rule} {fault.bit}"
    counts = np.array([len(part) for part in splats], np.int64)
    return StreamSplats(counts, np.concatenate([np.zeros((0, 8), np.float32), *splats]), error)


# twin of spec.decode_stream
def decode_stream(stream: bytes) -> Array:
    """The frames of a stream, all at once; `decode` gives them one by one.

    Parameters
    ----------
    stream
        A `.gsvc` file.

    Returns
    -------
    NDArray
        (T, H, W, 3) u1 for 8 bits, else u2 (R-9.1-1).

    Raises
    ------
    GsvcError
        The stream breaks a rule of spec.md.
    """
    return np.stack(list(decode(stream, layer=0)))


# twin of spec.decode_layers
@door
def decode_layers(stream: bytes, layer: int) -> Array:
    """The frames of a stream with layers, all at once, in the quality of a layer (section 15.13).

    Parameters
    ----------
    stream
        A `.gsvc` file.
    layer
        0 to 3; 0 is the base, and what `decode_stream` gives. A stream with fewer layers shows all that it has.

    Returns
    -------
    NDArray
        (T, H, W, 3) u1 for 8 bits, else u2 (R-9.1-1).

    Raises
    ------
    GsvcError
        The stream breaks a rule of spec.md in this quality.
    UsageError
        There is no such layer.
    """
    reader = StreamReader(stream, layer=layer)
    return np.stack(list(rendered(reader.frames(), reader.header, 1.0, "fast", None)))


# twin of spec.decode_stream_deterministic
def decode_stream_deterministic(stream: bytes) -> Array:
    """The frames of a stream as `decode_stream` has them, rendered deterministically (R-9.3-1).

    Parameters
    ----------
    stream
        A `.gsvc` file.

    Returns
    -------
    NDArray
        (T, H, W, 3) u1 for 8 bits, else u2, with the same bits on every machine.

    Raises
    ------
    GsvcError
        The stream breaks a rule of spec.md.
    """
    return np.stack(list(decode(stream, precision="deterministic", layer=0)))
