"""Profile `paper` (spec.md 5 to 8): symbols of planes, splats from their codes, and what is checked of a frame."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from gsvc_conformance.adapters.cuda.device import Array, Floats, Values, address, download, launch, storage, upload
from gsvc_conformance.adapters.main_operations import groups

THREADS: Final = 256
BLOCK: Final = np.dtype([
    ("positions_present", "u4"), ("cholesky_present", "u4"), ("colors_present", "u4"), ("stage_count", "u4"),
    ("half_width", "f4"), ("half_height", "f4"),
])  # fmt: skip
"""`Block` of reconstruct.cu."""
CODES: Final = np.dtype([
    (name, "u8") for name in ("positions", "cholesky", "color_indices", "codewords", "scale", "offset", "first")
])  # fmt: skip
"""`Codes` of reconstruct.cu: where they are on the device."""
CHECKSUM_WORDS: Final = 32
"""Those of a thread."""


def decode_lanes(
    count: int, frequencies: Sequence[int], precision: int, states: Sequence[int], words: Sequence[int]
) -> tuple[Array, list[int], int]:
    """The symbols u2 (count,) of a coded plane, the final states, and how many words they take: (7-1)."""
    there, symbols, taken = upload(states, "u4"), storage(2 * count), storage(4)
    launch(
        "decode_lanes", 1, 32, np.uint32(count), upload(frequencies, "u4"), np.uint32(len(frequencies)),
        np.uint32(precision), np.uint32(len(states)), there, upload(words, "u2"), np.uint32(len(words)),
        storage(4 * (len(frequencies) + 1)), symbols, taken, exact=True,
    )  # fmt: skip
    final: list[int] = download(there, (len(states),), "u4").tolist()
    return download(symbols, (count,), "u2"), final, int(download(taken, (), "u4"))


def encode_plane(symbols: Array, frequencies: Array, entropy_precision: int, lane_count: int) -> Values:
    """The states u4 (lanes,) and words u2 (n,) with which a decoder finds symbols u2 (count,) again: (7-2)."""
    count, lanes = len(symbols), min(lane_count, len(symbols))
    states, emitted, emitted_count = storage(4 * lanes), storage(2 * count), storage(4)
    launch(
        "encode_lanes", 1, 32, np.uint32(count), upload(symbols, "u2"), upload(frequencies, "u4"),
        np.uint32(len(frequencies)), np.uint32(entropy_precision), np.uint32(lanes),
        storage(4 * (len(frequencies) + 1)), states, emitted, emitted_count, exact=True,
    )  # fmt: skip
    words = download(emitted, (int(download(emitted_count, (), "u4")),), "u2")[::-1]
    return {"lane_states": download(states, (lanes,), "u4"), "words": words}


def from_half(bits: Array) -> Values:
    """The values of binary16 patterns, (N,) f4: (8-5)."""
    values = storage(4 * len(bits))
    launch("from_half", groups(len(bits)), THREADS, upload(bits, "u2"), np.uint32(len(bits)), values, exact=True)
    return {"values": download(values, bits.shape, "f4")}


def to_half(values: Floats) -> Values:
    """The binary16 patterns nearest to values, (N,) u2: (8-6)."""
    bits = storage(2 * len(values))
    launch("to_half", groups(len(values)), THREADS, upload(values, "f4"), np.uint32(len(values)), bits, exact=True)
    return {"bits": download(bits, values.shape, "u2")}


def reconstruct_intra(
    width: int, height: int, positions: Array, cholesky: Array, scale: Floats, offset: Floats, color_indices: Array,
    codebook_sizes: Array, codewords: Array,
) -> Values:  # fmt: skip
    """The splats that the codes of an intra block stand for, (N, 8) f4: R-8-1 is for the host to check."""
    count = len(positions)
    codes, _kept = uploaded(positions, cholesky, scale, offset, color_indices, codebook_sizes, codewords)
    block = np.array((1, 1, 1, len(codebook_sizes), width / 2, height / 2), BLOCK)
    parameters = storage(32 * count)
    launch("reconstruct_intra", groups(count), THREADS, codes, block[()], np.uint32(count), parameters, exact=True)
    return {"parameters": download(parameters, (count, 8), "f4")}


def reconstruct_inter(
    width: int, height: int, reference: Floats, survivors: Array, positions: Array, cholesky: Array, scale: Floats,
    offset: Floats, color_indices: Array, codebook_sizes: Array, codewords: Array,
) -> Values:  # fmt: skip
    """The survivors of a frame after the differences of an inter block, (n, 8) f4."""
    before, count = len(reference), int(np.count_nonzero(survivors))
    ranked = storage(4 * before)
    launch("rank_survivors", 1, THREADS, upload(survivors, "u2"), np.uint32(before), ranked, exact=True)
    codes, _kept = uploaded(positions, cholesky, scale, offset, color_indices, codebook_sizes, codewords)
    present = (len(attribute) > 0 for attribute in (positions, cholesky, color_indices))
    block = np.array((*present, len(codebook_sizes), width / 2, height / 2), BLOCK)
    parameters = storage(32 * count)
    launch(
        "reconstruct_inter", groups(count), THREADS, upload(reference, "f4"), ranked, codes, block[()],
        np.uint32(count), parameters, exact=True,
    )  # fmt: skip
    return {"parameters": download(parameters, (count, 8), "f4")}


def uploaded(
    positions: Array, cholesky: Array, scale: Floats, offset: Floats, color_indices: Array, codebook_sizes: Array,
    codewords: Array,
) -> tuple[Any, list[Any]]:  # fmt: skip
    """The codes of a block, as `CODES`, and their buffers, which have to live until the kernel has read them."""
    arrays: dict[str, tuple[Any, Any]] = {
        "positions": (positions, "u2"), "cholesky": (cholesky, "u2"), "color_indices": (color_indices, "u2"),
        "codewords": (codewords, "u2"), "scale": (scale, "f4"), "offset": (offset, "f4"),
        "first": (np.cumsum([0, *codebook_sizes]), "u4"),
    }  # fmt: skip
    buffers = [upload(array, dtype) for array, dtype in arrays.values()]
    return np.array(tuple(map(address, buffers)), CODES)[()], buffers


def rendering_work(parameters: Floats, width: int, height: int) -> Values:
    """The number of pixels in the boxes of splats, () i8: (5-1), in binary64."""
    work, count = storage(8), len(parameters)
    there = upload(parameters, "f4")
    launch("rendering_work", groups(count), THREADS, there, np.uint32(count), width, height, work, exact=True)
    return {"work": download(work, (), "i8")[()]}


def parameter_checksum(parameters: Floats) -> Values:
    """The CRC-32C of a frame's parameters, () i8: R-6.4-3."""
    there, count, checksum = upload(parameters, "f4"), upload([len(parameters)], "u4"), storage(4)
    threads = groups(8 * len(parameters), CHECKSUM_WORDS)
    launch("parameter_checksum", groups(threads), THREADS, there, count, checksum, exact=True)
    found = int(download(checksum, (), "u4")) ^ 0xFFFFFFFF if len(parameters) else 0
    return {"checksum": np.array(found, np.int64)[()]}
