"""Cases of whole streams: the container, the header, frames and blocks, what decoders keep from block to block."""

from dataclasses import replace
from typing import Any, Final

import numpy as np

from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases import container as container  # their cases belong to this group, too
from gsvc_conformance.cases import long_streams as long_streams
from gsvc_conformance.cases import pace as pace
from gsvc_conformance.cases import plane_encoding as plane_encoding
from gsvc_conformance.cases import planes as planes
from gsvc_conformance.cases import prediction as prediction
from gsvc_conformance.cases.building import (
    BOOKS,
    COARSE,
    FINE,
    FINE_BOOKS,
    frames_of,
    inter_block,
    intra_block,
    on,
    overview_bytes,
    predicted,
    quantizer_of,
    result,
    same_bits,
    stream_of,
)
from gsvc_ref.bitstream import LEVELS, SequenceHeader
from gsvc_ref.paper import FrameCodes
from gsvc_ref.testing import RICH_HEADER, rich_frames, write_stream

STREAM: Final = ("read_stream", "reconstruct_stream")
FRAMES: Final = ("decode_stream", "decode_stream_deterministic")


@on("core", *STREAM, *FRAMES)
def overview() -> Inputs:
    """The stream that spec.md takes apart byte by byte: a splat appears, moves, and rests."""
    expected = yield {"stream": overview_bytes()}
    if "parameters" in expected:
        first, moved, rests = frames_of(expected)
        assert first[0].tolist() == [6, 4.5, 2, 0, 2, 0.75, 0.5, 0.25]
        assert (moved[0] - first[0]).tolist() == [1, -0.75, 0, 0, 0, 0, 0, 0]
        assert same_bits(moved, rests)
    elif "frames" in expected:
        assert np.array_equal(result(expected, "frames")[1], result(expected, "frames")[2])
    else:
        assert result(expected, "frame_types").tobytes() == b"IPR"


@on("core", *STREAM, "decode_stream_deterministic", flags=["survivors", "kept"], rules=["R-6.4-3"])
def rich_stream() -> Inputs:
    """Frames I P R I P with every plane mode, own and kept quantisers and codebooks, two lanes, an index, checksums."""
    expected = yield {"stream": write_stream(RICH_HEADER, rich_frames())}
    if "counts" in expected:
        assert result(expected, "counts").tolist() == [60, 42, 42, 60, 60]


@case("core", "read_stream", flags=["signed-zero"])
def signs_and_order_of_codes() -> Inputs:
    """Every code of a block is another one, -0 among the positions: nothing is swapped, nothing is normalised."""
    block = replace(intra_block(7), quantizer=quantizer_of([1, 2, 4], [-1, -0.0, 3]))
    positions = np.array([[0x8000, 0], [1, 2], [0x7BFF, 0xFBFF], [0x3C00, 0xBC00], [0x8001, 3], [4, 5], [6, 7]])
    positions = positions.astype(np.uint16)
    expected = yield {"stream": stream_of([FrameCodes.intra_frame(replace(block, positions=positions))])}
    assert np.array_equal(result(expected, "positions"), positions)
    assert np.signbit(result(expected, "quantizers")[0, 1, 1])
    assert result(expected, "codebook_sizes").tolist() == [5, 8]


EXTREMES: Final[dict[str, dict[str, Any]]] = {
    "least": {"width": 1, "height": 1, "frame_rate_numerator": 1, "chroma_format": 0, "color_primaries": 0,
              "transfer_characteristics": 0, "matrix_coefficients": 0, "video_full_range_flag": 0,
              "chroma_sample_loc_type": 0, "cholesky_bits": 4, "color_stages": 2, "lane_count": 1},
    "most": {"level": 5, "width": 65535, "height": 1024, "frame_rate_numerator": 2**32 - 1,
             "frame_rate_denominator": 2**32 - 1, "sample_aspect_numerator": 65535,
             "sample_aspect_denominator": 65535, "bit_depth": 16, "chroma_format": 3, "color_primaries": 255,
             "transfer_characteristics": 255, "matrix_coefficients": 255, "video_full_range_flag": 1,
             "chroma_sample_loc_type": 5, "cholesky_bits": 12, "color_stages": 8, "color_codewords": 1024,
             "entropy_precision": 16, "lane_count": 64},
    "high": {"width": 2, "height": 65535, "sample_aspect_numerator": 1, "sample_aspect_denominator": 1},
}  # fmt: skip


@on("core", *STREAM, flags=["overflow"], rules=["R-5-1"], each=EXTREMES,
    said={"least": "the least values", "most": "the largest values", "high": "the highest frame"})  # fmt: skip
def header_of(value: dict[str, Any]) -> Inputs:
    """Elements of the header at the ends of their ranges: {key}."""
    expected = yield {"stream": stream_of([FrameCodes.intra_frame(intra_block(3))], **value)}
    if "header" in expected:
        assert value["height"] in result(expected, "header").tolist()


@on("core", *STREAM, flags=["limit"], rules=["R-5-1", "R-5-5"], each={str(level): level for level in LEVELS})
def level(value: int) -> Inputs:
    """Level {key}, and as many pixels as it allows."""
    width = 1 << (8 + value)
    header = SequenceHeader(level=value, width=width, height=LEVELS[value].pixels // width)
    expected = yield {"stream": write_stream(header, [FrameCodes.intra_frame(None)])}
    if "header" in expected:
        assert result(expected, "header")[1] == value


@on("core", *FRAMES, flags=["bit-depth"], each={str(depth): depth for depth in range(8, 17)})
def bit_depth(value: int) -> Inputs:
    """Frames of {key} bits."""
    expected = yield {"stream": stream_of([FrameCodes.intra_frame(intra_block(5))], bit_depth=value)}
    frames = result(expected, "frames")
    assert frames.dtype == (np.uint8 if value == 8 else np.uint16)
    assert frames.max() == 2**value - 1


@on("core", *STREAM, flags=["empty"], rules=["R-6.5-2"])
def empty_frames() -> Inputs:
    """No splat in the first frame, then new ones, then none survives, then none comes, then an empty I-frame."""
    new = intra_block(3)
    frames = [FrameCodes.intra_frame(None), predicted([], new=new), predicted([0, 0, 0]), predicted([]),
              FrameCodes.repeated_frame(), FrameCodes.intra_frame(None)]  # fmt: skip
    expected = yield {"stream": stream_of(frames)}
    assert result(expected, "counts").tolist() == [0, 3, 0, 0, 0, 0]


@on("core", *FRAMES, flags=["empty"])
def black_frames() -> Inputs:
    """Frames without splats are black, before the first splat and after the last."""
    frames = [FrameCodes.intra_frame(None), predicted([], new=intra_block(3)), predicted([0, 0, 0])]
    expected = yield {"stream": stream_of(frames)}
    assert result(expected, "frames").any(axis=(1, 2, 3)).tolist() == [False, True, False]


@on("core", *STREAM, flags=["kept"], rules=["R-6.5-3", "R-6.5-4", "R-6.5-8"])
def kept_apart() -> Inputs:
    """What intra blocks have is kept for intra blocks, what inter blocks have for inter blocks.

    New splats of P-frames use the quantiser and codebooks of the I-frame, or those of new splats since.
    """
    other = quantizer_of(COARSE.scale * 2, COARSE.offset)
    frames = [
        FrameCodes.intra_frame(intra_block(4)),
        predicted([1, 0, 1, 1], new=intra_block(2, first=4, quantizer=None, books=None)),
        predicted([1, 1, 1, 1, 0], inter_block(4, quantizer=None, books=None),
                  intra_block(2, first=6, quantizer=other, books=None)),
        predicted([1, 0, 1, 1, 1, 1], inter_block(5, quantizer=None, books=None),
                  intra_block(2, first=8, quantizer=None, books=None)),
    ]  # fmt: skip
    expected = yield {"stream": stream_of(frames)}
    if "parameters" in expected:
        _, second, third, fourth = frames_of(expected)
        block = intra_block(2, first=8)
        assert block.cholesky is not None
        steps = block.cholesky.astype(np.float32) * other.scale + other.offset
        assert np.array_equal(fourth[-2:, 2:5], steps)
        assert (abs(third[:4, 2:5] - second[:4, 2:5]) < 0.25).all()


@on("core", *STREAM, flags=["kept"], rules=["R-6.5-4", "R-6.5-8", "R-6.5-9"])
def kept_through_frames_without() -> Inputs:
    """Kept ones outlast frames that do not use them, R-frames among them."""
    still = inter_block(4, without="positions cholesky colors")
    frames = [
        FrameCodes.intra_frame(intra_block(4)),
        predicted([1] * 4, inter_block(4)),
        predicted([1] * 4, still),
        FrameCodes.repeated_frame(),
        predicted([1] * 4, inter_block(4, quantizer=None, books=None)),
    ]
    expected = yield {"stream": stream_of(frames)}
    if "parameters" in expected:
        _, _, third, _, last = frames_of(expected)
        assert (third[:, 2:] != last[:, 2:]).any(axis=0).all()


@on("core", *STREAM, flags=["kept"], rules=["R-6.5-4", "R-6.5-9"])
def an_i_frame_forgets() -> Inputs:
    """After an I-frame new splats use what that frame has, and differences come with their own."""
    second = intra_block(3, quantizer=quantizer_of(COARSE.scale / 2, COARSE.offset), books=FINE_BOOKS)
    frames = [
        FrameCodes.intra_frame(intra_block(4)),
        predicted([1] * 4),
        FrameCodes.intra_frame(second),
        predicted([1] * 3, inter_block(3, quantizer=quantizer_of(FINE.scale * 4, FINE.offset), books=BOOKS),
                  intra_block(2, quantizer=None, books=None, kept=FINE_BOOKS)),
    ]  # fmt: skip
    expected = yield {"stream": stream_of(frames)}
    if "parameters" in expected:
        *_, third, last = frames_of(expected)
        assert np.array_equal(last[3:, 2:], third[:2, 2:])


@on("core", *STREAM, flags=["kept"], rules=["R-6.5-8"])
def quantiser_and_codebooks_are_kept_apart() -> Inputs:
    """A block may have its own quantiser and use the kept codebooks, or the other way round."""
    frames = [
        FrameCodes.intra_frame(intra_block(3)),
        predicted([1] * 3, None, intra_block(2, books=None)),
        predicted([1] * 5, inter_block(5, books=None), intra_block(2, quantizer=None, books=FINE_BOOKS)),
        predicted([1] * 7, inter_block(7, quantizer=None), intra_block(2, quantizer=None, books=None, kept=FINE_BOOKS)),
    ]
    expected = yield {"stream": stream_of(frames)}
    assert result(expected, "counts").tolist() == [3, 5, 7, 9]


CODES: Final[dict[str, tuple[int, tuple[int, ...]]]] = {
    "cholesky_bits_1": (1, (2,)),
    "cholesky_bits_12": (12, (5, 3)),
    "one_codeword": (6, (1, 1)),
    "eight_stages": (6, (2, 3, 4, 5, 6, 7, 8, 1)),
    "1024_codewords": (6, (1024,)),
}


@on("uncommon", *STREAM, each=CODES, rules=["R-6.5-6"],
    said={"cholesky_bits_1": "Cholesky codes of one bit", "cholesky_bits_12": "Cholesky codes of 12 bits"})  # fmt: skip
def codes_of(value: tuple[int, tuple[int, ...]]) -> Inputs:
    """Alphabets at the ends of their ranges: {key}."""
    bits, sizes = value
    books = tuple((np.arange(3 * n).reshape(n, 3) / 4096).astype(np.float16) for n in sizes)
    block = intra_block(9, books=books)
    cholesky = (np.arange(27).reshape(9, 3) * 379 + 1) % (1 << bits)
    cholesky[0] = (1 << bits) - 1
    last = np.array([[size - 1 for size in sizes]], np.uint16)
    colors = np.concatenate([last, (block.colors if block.colors is not None else last)[1:]])
    block = replace(block, cholesky=cholesky.astype(np.uint16), colors=colors)
    header: dict[str, Any] = {"cholesky_bits": bits, "color_stages": len(sizes), "color_codewords": max(sizes)}
    expected = yield {"stream": stream_of([FrameCodes.intra_frame(block)], **header)}
    if "cholesky" in expected:
        assert np.array_equal(result(expected, "cholesky"), cholesky)


@on("stress", *STREAM, flags=["overflow", "subnormal"], rules=["R-6.5-5", "R-8-1"])
def numbers_at_the_limits() -> Inputs:
    """Scales of 2^-126 and 8e34, offsets of +-2e38, positions of +-65504, codewords of +-65504: all remain finite."""
    tiny = 2.0**-126
    block = intra_block(6, quantizer=quantizer_of([tiny, 8e34, 8e34], [0, -2e38, 2e38]),
                        books=(np.array([[65504, -65504, 2.0**-24]], np.float16),) * 3)  # fmt: skip
    positions = np.array(
        [[0x7BFF, 0xFBFF], [1, 0x8001], [0, 0x8000], [0x3FF, 0x400], [0xBC00, 0x3C00], [0xFBFF, 0x7BFF]]
    )
    positions = positions.astype(np.uint16)
    back = quantizer_of([tiny, 8e34, 8e34], [-0.0, 2e38, 1.3e38])
    move = replace(inter_block(6), positions=positions[::-1].copy(), quantizer=back)
    frames = [FrameCodes.intra_frame(replace(block, positions=positions)), predicted([1] * 6, move)]
    expected = yield {"stream": stream_of(frames)}
    if "parameters" in expected:
        assert np.isfinite(result(expected, "parameters")).all()
        assert abs(result(expected, "parameters")).max() > 3e38
