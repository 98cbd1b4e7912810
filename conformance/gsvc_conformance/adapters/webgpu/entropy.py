"""Entropy coding: the host's side of rans.wgsl."""

from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np

from gsvc_conformance.adapters.webgpu.gpu import Array, download, groups, run, storage, uniform, upload, wgsl

ROUNDS_AT_ONCE: Final = 1 << 15
"""A dispatch takes so many symbols of each lane: Mesa's software rasteriser leaves every loop after 65,535 rounds."""


def decode_symbols(
    count: int, frequencies: Sequence[int], precision: int, states: Sequence[int], words: Sequence[int]
) -> tuple[Array, list[int], int]:
    """The symbols u2 (count,), the final states, and how many words were needed, (7-1).

    Parameters
    ----------
    count
        How many symbols.
    frequencies
        f(s) of the symbols from 0 on; they add up to 2^precision.
    precision
        R, 12 to 16.
    states
        Of the lanes that are used.
    words
        All words of the plane; fewer than are needed give any symbols.
    """
    lanes, slots = len(states), 2**precision
    buffers = {
        1: _cumulative(frequencies),
        2: storage(4 * slots),
        3: upload(np.array(states, np.uint32)),
        4: upload(np.array(words, np.uint16)),
        5: storage(4 * count),
        6: storage(4),
    }
    spread = [("spread", (groups(slots, 256),), (0, 1, 2))]
    for buffers[0] in _rounds(count, precision, lanes, len(words), len(frequencies)):
        run(wgsl("ballots.wgsl") + wgsl("rans.wgsl"), [*spread, ("decode", (1,), (0, 1, 2, 3, 4, 5, 6))], buffers)
        spread = []
    symbols = download(buffers[5], np.uint32, count).astype(np.uint16)
    final_states = [int(state) for state in download(buffers[3], np.uint32, lanes)]
    return symbols, final_states, int(download(buffers[6], np.uint32, 1)[0])


def encode_symbols(symbols: Array, frequencies: Array, precision: int, lane_count: int) -> tuple[Array, Array]:
    """The states u4 (lanes,) and words u2 (n,) with which a decoder finds symbols u2 (count,) again, (7-2).

    Parameters
    ----------
    symbols, frequencies, precision
        As above; every symbol has a frequency.
    lane_count
        Of the stream; fewer symbols use fewer lanes.
    """
    count = len(symbols)
    lanes = min(lane_count, count)
    buffers = {
        1: _cumulative(frequencies),
        3: storage(4 * lanes),
        5: upload(symbols.astype(np.uint32)),
        6: storage(4),
        7: storage(4 * count),
    }
    for buffers[0] in _rounds(count, precision, lanes, 0, len(frequencies)):
        run(wgsl("ballots.wgsl") + wgsl("rans.wgsl"), [("encode", (1,), (0, 1, 3, 5, 6, 7))], buffers)
    given = int(download(buffers[6], np.uint32, 1)[0])
    words = download(buffers[7], np.uint32, given)[::-1].astype(np.uint16)
    return download(buffers[3], np.uint32, lanes), words


def _rounds(count: int, precision: int, lanes: int, words: int, alphabet: int) -> Iterator[Any]:
    """The uniforms of all dispatches for a plane."""
    rounds = -(-count // max(lanes, 1))
    for first in range(0, rounds, ROUNDS_AT_ONCE):
        now = min(rounds - first, ROUNDS_AT_ONCE)
        yield uniform(np.array([count, precision, lanes, words, alphabet, first, now], np.uint32))


def _cumulative(frequencies: Sequence[int] | Array) -> Any:
    return upload(np.cumsum([0, *frequencies], dtype=np.uint32))
