"""Cases of streams that are as large as their level allows, or longer than a counter of 8, 14 or 16 bits."""

from dataclasses import replace
from typing import Final

import numpy as np

from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases import CAPACITY
from gsvc_conformance.cases.building import (
    FINE_BOOKS,
    Array,
    frames_of,
    inter_block,
    intra_block,
    on,
    predicted,
    quantizer_of,
    result,
    stream_of,
)
from gsvc_conformance.cases.container import equal_splats
from gsvc_conformance.cases.faults import value_of
from gsvc_ref.bitstream import LEVELS
from gsvc_ref.paper import FrameCodes, SplatBlock

STREAM: Final = ("read_stream", "reconstruct_stream")
FRAMES: Final = ("decode_stream", "decode_stream_deterministic")
BEYOND_16_BITS: Final = 2**16 + 77


@on("core", *STREAM, *FRAMES, flags=["limit", "many"], rules=["R-5-2"])
def as_many_splats_as_allowed() -> Inputs:
    """An I-frame of 2^14 degenerate splats, then one goes and a visible one comes: the most that level 1 allows."""
    most = LEVELS[1].splats
    frames = [FrameCodes.intra_frame(equal_splats(most, 0)),
              predicted([0] + [1] * (most - 1), SplatBlock(), equal_splats(1, color=1))]  # fmt: skip
    expected = yield {"stream": stream_of(frames, width=5, height=3)}
    if "frames" in expected:
        assert result(expected, "frames").max(axis=(1, 2, 3)).tolist() == [0, 255]
    else:
        assert result(expected, "counts").tolist() == [most, most]


@on("core", *STREAM, *FRAMES, flags=["limit", "many", CAPACITY], rules=["R-5-2"])
def as_many_splats_as_level_2_allows() -> Inputs:
    """An I-frame of 2^16 splats, all degenerate but the last: their number takes 17 bits, their last index 16."""
    most = LEVELS[2].splats
    block = equal_splats(most, 0, color=1)
    assert block.cholesky is not None
    block.cholesky[-1] = 1, 0, 1
    expected = yield {"stream": stream_of([FrameCodes.intra_frame(block)], width=5, height=3, level=2)}
    if "frames" in expected:
        assert result(expected, "frames").max() == 255


@on("core", *FRAMES, flags=["limit", "large-frame"], rules=["R-5-1"])
def as_many_pixels_as_allowed() -> Inputs:
    """A frame of 512 by 256 pixels, the most that level 1 allows, with a splat at its right lower corner."""
    corner = np.full((1, 2), np.float16(1 - 2.0**-9).view(np.uint16))
    block = SplatBlock(corner, np.zeros((1, 3), np.uint16), np.zeros((1, 1), np.uint16),
                       quantizer_of([1, 1, 1], [0.5, 0, 0.5]), (np.ones((1, 3), np.float16),))  # fmt: skip
    expected = yield {"stream": stream_of([FrameCodes.intra_frame(block)], width=512, height=256)}
    picture = result(expected, "frames")[0]
    assert picture.shape[0] * picture.shape[1] == LEVELS[1].pixels
    assert picture[-1, -1].min() > 200
    assert not picture[:250].any()


@on("core", *STREAM, flags=["limit", "overflow"], rules=["R-5-4"])
def as_much_work_as_allowed() -> Inputs:
    """512 splats that cover 256 by 256 pixels: 2^25 pairs, the most that level 1 allows."""
    expected = yield {"stream": stream_of([FrameCodes.intra_frame(equal_splats(512, 1e30))], width=256, height=256)}
    assert int(result(expected, "counts")[0]) << 16 == LEVELS[1].work


@case("core", "reconstruct_stream", flags=["limit", "degenerate"], rules=["R-5-4", "R-9.1-2"])
def degenerate_splats_are_no_work() -> Inputs:
    """512 splats make the most work that level 1 allows; of one more l11 is 0, so it has no box."""
    codes = np.ones((513, 3), np.uint16)
    codes[512, 0] = 0
    zeros = np.zeros((513, 2), np.uint16)
    zeros[512] = np.float16(2.0**-9).view(np.uint16)
    quantizer = quantizer_of([1e30, 1, 1e30], [0, -1, 0])
    block = SplatBlock(zeros, codes, np.zeros((513, 1), np.uint16), quantizer, (np.zeros((1, 3), np.float16),))
    expected = yield {"stream": stream_of([FrameCodes.intra_frame(block)], width=256, height=256)}
    assert (result(expected, "error"), len(result(expected, "counts"))) == ("", 1)


@case("core", "decode_stream_deterministic", flags=["limit", "many", CAPACITY], rules=["R-5-4"])
def as_much_work_as_may_be_drawn() -> Inputs:
    """512 splats that cover 256 by 256 pixels with a weight of nearly 1: 2^25 pairs, the most that level 1 allows."""
    block = equal_splats(512, 1e30, color=2.0**-9)
    expected = yield {"stream": stream_of([FrameCodes.intra_frame(block)], width=256, height=256)}
    assert result(expected, "frames").min() == 255


@on("core", *STREAM, rules=["R-6.4-1"])
def frames_beyond_8_bits() -> Inputs:
    """Three hundred frames: a counter of frames takes more than 8 bits, and what the first one keeps is kept."""
    rest = [FrameCodes.repeated_frame()] * 298
    new = intra_block(2, first=3, quantizer=None, books=None)
    expected = yield {"stream": stream_of([FrameCodes.intra_frame(intra_block(1)), *rest, predicted([1], new=new)])}
    assert result(expected, "counts").tolist() == [1] * 299 + [3]


@on("core", *FRAMES)
def pictures_beyond_8_bits() -> Inputs:
    """Two hundred and seventy frames of 3 by 2 pixels, black up to the last one."""
    rest = [FrameCodes.repeated_frame()] * 268
    frames = [FrameCodes.intra_frame(None), *rest, predicted([], new=equal_splats(1, color=1))]
    expected = yield {"stream": stream_of(frames, width=3, height=2)}
    assert result(expected, "frames").any(axis=(1, 2, 3)).tolist() == [False] * 269 + [True]


@on("core", "reconstruct_stream", flags=[CAPACITY], rules=["R-6.4-1"])
def frames_beyond_14_bits() -> Inputs:
    """16,400 frames, an I-frame among the last ones: frame numbers, and a step of the index, take three bytes."""
    first, other = (FrameCodes.intra_frame(intra_block(1, first=n)) for n in (0, 5))
    rest = FrameCodes.repeated_frame()
    expected = yield {"stream": stream_of([first, *[rest] * 16_389, other, *[rest] * 8, predicted([1])], index=True)}
    parts = frames_of(expected)
    assert len(parts) == 16_400
    assert not np.array_equal(parts[16_389], parts[16_390])
    assert not np.array_equal(parts[-2], parts[-1])


@on("core", "reconstruct_stream", flags=[CAPACITY], rules=["R-6.4-1"])
def frames_beyond_16_bits() -> Inputs:
    """65,600 frames, all but the last two without splats: frame numbers take more than 16 bits."""
    rest = FrameCodes.repeated_frame()
    frames = [FrameCodes.intra_frame(None), *[rest] * 65_597, FrameCodes.intra_frame(intra_block(1)), predicted([1])]
    expected = yield {"stream": stream_of(frames, index=True)}
    assert np.flatnonzero(result(expected, "counts")).tolist() == [65_598, 65_599]


@on("core", *STREAM, flags=["survivors", CAPACITY], rules=["R-5-2"])
def splats_beyond_16_bits() -> Inputs:
    """65,613 splats of one shape but the last 90, of which every second one stays: indices take more than 16 bits."""
    count = BEYOND_16_BITS
    frames = [FrameCodes.intra_frame(_last_ones_differ(count)), predicted((np.arange(count) % 2) * _is_late(count))]
    expected = yield {"stream": stream_of(frames, level=3)}
    if "parameters" in expected:
        first, second = frames_of(expected)
        stay = first[(np.arange(count) % 2 == 1) & _is_late(count)]
        assert len(np.unique(stay[:, 2])) > 20
        assert (abs(second[:, 2] - stay[:, 2]) < 0.25).all()


@on("core", *FRAMES, flags=["many", CAPACITY], rules=["R-5-2"])
def the_splat_beyond_16_bits() -> Inputs:
    """65,613 degenerate splats; then a visible one comes, whose index does not fit into 16 bits."""
    count = BEYOND_16_BITS
    frames = [FrameCodes.intra_frame(equal_splats(count, 0)),
              predicted([1] * count, SplatBlock(), equal_splats(1, color=1))]  # fmt: skip
    expected = yield {"stream": stream_of(frames, width=5, height=3, level=3)}
    assert result(expected, "frames").max(axis=(1, 2, 3)).tolist() == [0, 255]


@case("core", "read_stream", flags=["lanes", CAPACITY], each={"one_lane": 1, "64_lanes": 64},
    said={"one_lane": "one lane", "64_lanes": "64 lanes"})  # fmt: skip
def planes_of_thousands(value: int) -> Inputs:
    """Planes of 4,999 symbols and more than 1,024 words, by {key}; then every third splat goes."""
    count = 4999
    n = np.arange(count)
    factors = np.array([[2654435761], [2246822519], [3266489917], [668265263]])
    bumps = (n * factors % 2**32 >> 26).sum(axis=0)  # 0..252, mostly near the middle
    codes = np.column_stack([bumps, 2047 - n % 5, 4095 - bumps[::-1]]).astype(np.uint16)
    zeros = np.zeros((count, 2), np.uint16)
    quantizer = quantizer_of([2.0**-10] * 3, [0.25, -2, 0.25])
    intra = SplatBlock(zeros, codes, zeros[:, :1], quantizer, FINE_BOOKS)
    stay = n % 3 != 0
    frames = [FrameCodes.intra_frame(intra), predicted(stay, inter_block(int(stay.sum()), without="positions colors"))]
    stream = stream_of(frames, cholesky_bits=12, lane_count=value)
    assert value_of(stream, "cholesky_code[l22].word_count") > 1024
    expected = yield {"stream": stream}
    assert np.array_equal(result(expected, "cholesky")[:count], codes)


def _is_late(count: int) -> Array:
    """Which splats are among the last 90."""
    return np.arange(count) >= count - 90


def _last_ones_differ(count: int) -> SplatBlock:
    """Splats of a pixel, the last 90 of other shapes."""
    block = equal_splats(count, 1)
    n = np.arange(count)
    assert block.cholesky is not None
    block.cholesky[_is_late(count)] = np.column_stack([n % 61, n % 7, n % 3])[-90:]
    return SplatBlock(
        block.positions, block.cholesky, block.colors, quantizer_of([0.5, 0.5, 0.5], [1, 0, 1]), block.codebooks
    )


@on("core", *STREAM, flags=["survivors", CAPACITY], rules=["R-5-2"])
def codes_beyond_16_bits() -> Inputs:
    """65,613 splats none of whose codes is zero; of 65,600 that stay, and 13 that come, none is either."""
    count = BEYOND_16_BITS
    ones = np.ones((count, 3), np.uint16)
    books = (np.array([[0, 0, 0], [0.25, 0.5, 0.75]], np.float16),)
    block = SplatBlock(0x3000 * ones[:, :2], ones, ones[:, :1], quantizer_of([0.5] * 3, [1, 0, 1]), books)
    new = SplatBlock(0x3400 * ones[:13, :2], 2 * ones[:13], ones[:13, :1], None, None)
    stream = stream_of(
        [FrameCodes.intra_frame(block), predicted([1] * (count - 13) + [0] * 13, SplatBlock(), new)], level=3
    )
    expected = yield {"stream": stream}
    assert result(expected, "counts").tolist() == [count, count]


@on("core", *STREAM, flags=[CAPACITY])
def as_many_codewords_as_allowed() -> Inputs:
    """A block with eight codebooks of 1,024 codewords, of which two splats use the last ones."""
    n = np.arange(1024 * 3).reshape(1024, 3)
    books = tuple(((n * (k + 3) % 1009 + 1) / 1024).astype(np.float16) for k in range(8))
    block = replace(intra_block(2, books=None, kept=books), colors=np.full((2, 8), 1023, np.uint16), codebooks=books)
    expected = yield {"stream": stream_of([FrameCodes.intra_frame(block)], color_stages=8, color_codewords=1024)}
    assert result(expected, "counts").tolist() == [2]
