"""Streams: what their bytes say, the splats that they stand for, and their frames (spec.md sections 5 to 9 and 12)."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

import gsvc_ref
from conformance.expectations import Expectation, Interval, Refusal
from conformance.operation import Values, exactly, operation, operations, paired
from conformance.spec import namespace
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.bitstream.bit_reader import Reader
from gsvc_ref.bitstream.planes import plane
from gsvc_ref.errors import GsvcError
from gsvc_ref.reconstruction import FrameCodes, SplatBlock
from gsvc_ref.stream import StreamReader

Array = NDArray[Any]

HEADER_ELEMENTS: Final = tuple(name for name, *_ in namespace()["HEADER"])
"""The elements of the sequence header, in order."""

CONTAINER_RULES: Final = ("R-6.1-1", "R-6.1-2", "R-6.1-3", "R-6.1-4", "R-6.1-5", "R-6.2-1", "R-6.2-2", "R-6.2-3",
                          "R-6.2-4", "R-6.3-1", "R-6.3-2", "R-6.4-1", "R-6.4-2", "R-6.8-1", "R-6.8-2")  # fmt: skip
"""Rules that every stream exercises."""


@operation(
    "bitstream",
    inputs="stream: stream",
    outputs="header: i8 (22,); frame_types: u1 (T,); counts: i8 (T,); survivors: u1 (S,); blocks: i8 (K, 8); "
    "positions: u2 (P, 2); cholesky: u2 (C, 3); quantizers: f4 (Q, 3, 2); codebook_sizes: i8 (M,); "
    "codewords: u2 (W, 3); color_indices: u2 (I,)",
    rules=CONTAINER_RULES,
)
def read_stream(stream: bytes) -> Values:
    """What the bytes of a legal stream say: header, frame types, survivors, and the codes of all splat blocks."""
    reader = StreamReader(stream)
    frames = list(reader)
    header = {**vars(reader.header), "flags": int(reader.header.parameter_checksum_flag)}
    blocks = [
        (frame.number, kind, block)
        for frame in frames
        for kind, block in enumerate((frame.codes.intra, frame.codes.inter))
        if block is not None
    ]
    # A P-frame's inter block stands before its intra block.
    blocks.sort(key=lambda entry: (entry[0], -entry[1]))
    counts = {(f.number, kind): count for f in frames for kind, count in enumerate(_counts(f.codes))}
    quantizers = [b.quantizer for _, _, b in blocks if b.quantizer is not None]
    books = [book for _, _, b in blocks for book in b.codebooks or ()]
    return {
        "header": np.array([header[name] for name in HEADER_ELEMENTS], np.int64),
        "frame_types": np.frombuffer("".join(f.type for f in frames).encode(), np.uint8),
        "counts": np.array([len(f.splats) for f in frames], np.int64),
        "survivors": _joined([f.codes.survivors for f in frames], np.zeros(0, np.uint8)),
        "blocks": np.array(
            [(number, kind, counts[number, kind], *_present(block)) for number, kind, block in blocks], np.int64
        ).reshape(-1, 8),
        "positions": _joined([b.positions for _, _, b in blocks], np.zeros((0, 2), np.uint16)),
        "cholesky": _joined([b.cholesky for _, _, b in blocks], np.zeros((0, 3), np.uint16)),
        "quantizers": _joined(
            [np.stack([q.scale, q.offset], axis=1)[None] for q in quantizers], np.zeros((0, 3, 2), np.float32)
        ),
        "codebook_sizes": np.array([len(book) for book in books], np.int64),
        "codewords": _joined([book.view(np.uint16) for book in books], np.zeros((0, 3), np.uint16)),
        "color_indices": _joined(
            [b.colors.T.ravel() for _, _, b in blocks if b.colors is not None], np.zeros(0, np.uint16)
        ),
    }


def _counts(codes: FrameCodes) -> tuple[int, int]:
    """The splats of the intra and of the inter block."""
    return codes.intra_count, codes.survivor_count


def _present(block: SplatBlock) -> tuple[bool, ...]:
    parts = (block.positions, block.cholesky, block.quantizer, block.colors, block.codebooks)
    return tuple(part is not None for part in parts)


def _joined(parts: list[Any], empty: Array) -> Array:
    """The arrays that are there, one after the other, in the type and shape of `empty`."""
    return np.concatenate([empty, *(part.astype(empty.dtype) for part in parts if part is not None)])


@operation(
    "bitstream",
    inputs="data: u1 (n,); count: int; alphabet: int; entropy_precision: int; lane_count: int",
    outputs="symbols: u2 (count,)",
    equations=("7-1",),
    rules=("R-6.6-2",),
)
def decode_plane(data: Array, count: int, alphabet: int, entropy_precision: int, lane_count: int) -> Values:
    """The symbols of one plane, from the bytes of plane()."""
    header = SequenceHeader(level=1, width=1, height=1, entropy_precision=entropy_precision, lane_count=lane_count)
    return {"symbols": plane(Reader(data.tobytes()), header, "colors", "plane", count, alphabet)}


paired(
    "encode_plane",
    "bitstream",
    "The states and words with which a decoder finds the symbols again, by the encoder of section 7.",
    inputs="symbols: u2 (count,); frequencies: i8 (alphabet,); entropy_precision: int; lane_count: int",
    outputs="lane_states: u4 (lanes,); words: u2 (n,)",
    equations=("7-2",),
    rules=("R-6.6-5", "R-7-1"),
)


def _refused(**inputs: Any) -> dict[str, Expectation]:
    """The parameters exactly; the error in full."""
    expected = exactly(lambda stream: {k: v for k, v in reconstruct_stream(stream).items() if k != "error"})(**inputs)
    return {**expected, "error": Refusal(reconstruct_stream(**inputs)["error"], in_full=True)}


@operation(
    "bitstream",
    inputs="stream: stream",
    outputs="counts: i8 (T,); parameters: f4 (N, 8); error: text",
    equations=("8-1", "8-2", "8-3", "8-4"),
    rules=("R-6.1-1", "R-6.1-2"),
    oracle=_refused,
)
def reconstruct_stream(stream: bytes) -> Values:
    """The splats of all complete frames of a stream, and what is wrong with it."""
    splats: list[Array] = []
    error = ""
    try:
        splats.extend(frame.splats.to_array() for frame in StreamReader(stream))
    except GsvcError as fault:
        error = f"{fault.kind} {fault.rule} {fault.bit}"
    return {
        "counts": np.array([len(part) for part in splats], np.int64),
        "parameters": np.concatenate([np.zeros((0, 8), np.float32), *splats]),
        "error": error,
    }


def _intervals(stream: bytes) -> dict[str, Expectation]:
    """Each frame's interval, derived from the exact sum and its bound."""
    header = StreamReader(stream).header
    size = {"width": header.width, "height": header.height, "bit_depth": header.bit_depth}
    rendered = operations()["render_frame"].oracle
    frames = [rendered(parameters=frame.splats.to_array(), **size)["frame"] for frame in StreamReader(stream)]
    return {
        "frames": Interval(*(np.stack([getattr(f, part) for f in frames]) for part in ("value", "lowest", "highest")))
    }


@operation(
    "rendering",
    inputs="stream: stream",
    outputs="frames: u1|u2 (T, H, W, 3)",
    equations=("9-1", "9-2"),
    rules=("R-9.1-1",),
    oracle=_intervals,
)
def decode_stream(stream: bytes) -> Values:
    """The frames of a legal stream."""
    return {"frames": np.stack(list(gsvc_ref.decode(stream)))}


@operation(
    "deterministic",
    inputs="stream: stream",
    outputs="frames: u1|u2 (T, H, W, 3)",
    equations=("9-3", "9-4", "9-5", "9-6", "9-7"),
    rules=("R-9.3-1",),
)
def decode_stream_deterministic(stream: bytes) -> Values:
    """The frames of a legal stream, rendered deterministically."""
    return {"frames": np.stack(list(gsvc_ref.decode(stream, precision="deterministic")))}
