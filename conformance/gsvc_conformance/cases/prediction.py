"""Cases of P- and R-frames: who survives, what differences are added to, and errors that would grow."""

from typing import Final

import numpy as np

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs
from gsvc_conformance.cases.building import (
    BOOKS,
    FINE_BOOKS,
    Array,
    frames_of,
    inter_block,
    intra_block,
    on,
    predicted,
    quantizer_of,
    result,
    same_bits,
    stream_of,
)
from gsvc_ref.bitstream.frequencies import normalized_frequencies
from gsvc_ref.bitstream.rans import encode_plane
from gsvc_ref.paper import FrameCodes, SplatBlock

QUANTIZER_12: Final = quantizer_of([2.0**-9, 2.0**-8, 2.0**-9], [0.5, -8, 0.5])
STREAM: Final = ("read_stream", "reconstruct_stream")
SURVIVORS: Final = {
    "all": [1] * 9,
    "all_but_the_first": [0] + [1] * 8,
    "all_but_the_last": [1] * 8 + [0],
    "some_in_the_middle": [1, 1, 0, 1, 0, 0, 1, 1, 1],
    "only_the_middle": [0] * 4 + [1] + [0] * 4,
    "none": [0] * 9,
}


@on("core", "reconstruct_stream", flags=["survivors"], rules=["R-6.4-5"], each=SURVIVORS,
    said={"all": "all nine", "some_in_the_middle": "some", "only_the_middle": "none but the middle one"})  # fmt: skip
def survivors(value: list[int]) -> Inputs:
    """Of nine splats {key} stay, two come; then all rest: survivors keep their order, new splats follow."""
    stay = np.array(value, np.bool_)
    count = int(stay.sum())
    frames = [FrameCodes.intra_frame(intra_block(9)), predicted(value, None, intra_block(2, first=9)),
              FrameCodes.repeated_frame()]  # fmt: skip
    expected = yield {"stream": stream_of(frames)}
    first, second, third = frames_of(expected)
    assert len(second) == count + 2
    assert (abs(second[:count, :5] - first[stay][:, :5]) < 0.4).all()
    assert same_bits(second, third)


@on("core", "reconstruct_stream", flags=["survivors", "prediction"], rules=["R-6.4-5"])
def pruned_again_and_again() -> Inputs:
    """Splats go and come in every frame, so that hardly one keeps its index."""
    frames = [FrameCodes.intra_frame(intra_block(12))]
    count = 12
    for number in range(1, 7):
        stay = (np.arange(count) + number) % 4 != 0
        frames.append(predicted(stay.tolist(), None, intra_block(2, first=10 + 2 * number)))
        count = int(stay.sum()) + 2
    expected = yield {"stream": stream_of(frames)}
    assert result(expected, "counts")[-1] == count


WITHOUT: Final = ("positions", "cholesky", "colors", "positions cholesky", "cholesky colors", "positions colors",
                  "positions cholesky colors")  # fmt: skip


@on("core", "reconstruct_stream", flags=["kept"], rules=["R-6.5-3", "R-6.5-10"],
    each={w.replace(" ", "_"): w for w in WITHOUT},
    said={w.replace(" ", "_"): w.replace(" ", ", ").replace("cholesky", "Cholesky factors").replace("colors", "colours")
          for w in WITHOUT})  # fmt: skip
def without(value: str) -> Inputs:
    """P-frames without differences of {key}: what is not present keeps its bits."""
    frames = [FrameCodes.intra_frame(intra_block(5)), predicted([1, 1, 0, 1, 1], inter_block(4, without=value))]
    expected = yield {"stream": stream_of(frames)}
    first, second = frames_of(expected)
    before = first[[0, 1, 3, 4]]
    for name, columns in (("positions", slice(0, 2)), ("cholesky", slice(2, 5)), ("colors", slice(5, 8))):
        assert same_bits(before[:, columns], second[:, columns]) == (name in value)


@on("core", "reconstruct_stream", flags=["lanes"])
def lanes_64_and_words(rng: Draws) -> Inputs:
    """64 lanes that take words: Cholesky codes of 12 bits that are alike take less than as many bits."""
    block = intra_block(400)
    codes = np.clip(np.rint(rng.normal(2000, 4, (400, 3))), 0, 4095).astype(np.uint16)
    frequencies = normalized_frequencies(np.bincount(codes[:, 0], minlength=4096), 12)
    assert len(encode_plane(codes[:, 0], frequencies, 12, 64)[1]) > 32
    frames = [FrameCodes.intra_frame(SplatBlock(block.positions, codes, block.colors, QUANTIZER_12, BOOKS))]
    expected = yield {"stream": stream_of(frames, cholesky_bits=12, lane_count=64)}
    assert np.array_equal(np.rint((frames_of(expected)[0][:, 2] - 0.5) / 2.0**-9), codes[:, 0])


def steps(count: int) -> list[SplatBlock]:
    """Differences that change every attribute a little, in every frame otherwise."""
    scale = np.array([1.3e-3, 0.7e-3, 1.1e-3])
    return [
        inter_block(count, quantizer=quantizer_of(scale * (k + 1), -8 * scale), books=FINE_BOOKS) for k in range(count)
    ]


@on("core", "reconstruct_stream", flags=["prediction", "order"], rules=["R-3.3-1"])
def eight_predictions() -> Inputs:
    """Eight P-frames in a row, each from the reconstructed frame before: every sum is rounded.

    Adding up differences first, or predicting from anything else, ends in other bits.
    """
    frames = [FrameCodes.intra_frame(intra_block(8))] + [predicted([1] * 8, block) for block in steps(8)]
    expected = yield {"stream": stream_of(frames, width=37)}
    first, *_, last = frames_of(expected)
    assert (last != _added_up(first, steps(8))).any(axis=0)[2:5].all()


def _added_up(first: Array, blocks: list[SplatBlock]) -> Array:
    """The Cholesky factors that come out when differences are added up before they are added, (8, 8) f4."""
    total = np.zeros((len(first), 3), np.float32)
    for block in blocks:
        assert block.quantizer is not None
        assert block.cholesky is not None
        total += block.cholesky.astype(np.float32) * block.quantizer.scale + block.quantizer.offset
    wrong = first.copy()
    wrong[:, 2:5] += total
    return wrong


@on("core", *STREAM, flags=["prediction"], rules=["R-6.4-4"])
def predicted_from_a_repeated_frame() -> Inputs:
    """R-frames between P-frames, two in a row: prediction goes on from what rests."""
    rest = FrameCodes.repeated_frame()
    frames = [FrameCodes.intra_frame(intra_block(4)), rest, predicted([1, 0, 1, 1]), rest, rest, predicted([1, 1, 1])]
    expected = yield {"stream": stream_of(frames)}
    if "parameters" in expected:
        parts = frames_of(expected)
        assert same_bits(parts[0], parts[1])
        assert same_bits(parts[2], parts[4])
        assert (parts[5][:, :2] != parts[4][:, :2]).all()


@on("core", "reconstruct_stream", flags=["signed-zero"], rules=["R-6.4-3", "R-6.5-10"])
def checksums_with_signed_zeros() -> Inputs:
    """Parameters of -0 survive a P-frame without differences; the checksums tell them from +0."""
    block = intra_block(3, books=(np.array([[-0.0, 0.5, -0.0]], np.float16),))
    still = inter_block(3, without="positions cholesky colors")
    frames = [FrameCodes.intra_frame(block), predicted([1] * 3, still), FrameCodes.repeated_frame()]
    expected = yield {"stream": stream_of(frames, parameter_checksum_flag=True)}
    for frame in frames_of(expected):
        assert np.signbit(frame[:, 5:]).tolist() == [[True, False, True]] * 3


@on("core", "reconstruct_stream")
def hundreds_of_frames() -> Inputs:
    """A hundred and forty frames of one splat: frame numbers take a second byte from 128 on."""
    frames = [FrameCodes.intra_frame(intra_block(1))] + [FrameCodes.repeated_frame()] * 138
    expected = yield {"stream": stream_of([*frames, predicted([1])])}
    assert len(frames_of(expected)) == 140


@on("core", *STREAM)
def many_splats() -> Inputs:
    """A hundred and fifty splats: splat_count takes two bytes, planes are entropy coded."""
    frames = [FrameCodes.intra_frame(intra_block(150)), predicted([n % 5 != 0 for n in range(150)])]
    expected = yield {"stream": stream_of(frames, lane_count=3)}
    assert result(expected, "counts").tolist() == [150, 120]


@on("core", "decode_stream", "decode_stream_deterministic", flags=["survivors"])
def moving_frames() -> Inputs:
    """Frames I P R P: splats move, one goes, one comes."""
    frames = [FrameCodes.intra_frame(intra_block(5)), predicted([1, 1, 0, 1, 1], None, intra_block(1, first=9)),
              FrameCodes.repeated_frame(), predicted([1] * 5)]  # fmt: skip
    expected = yield {"stream": stream_of(frames)}
    pictures = result(expected, "frames")
    assert np.array_equal(pictures[1], pictures[2])
    assert (pictures[0] != pictures[1]).any()
    assert (pictures[2] != pictures[3]).any()
