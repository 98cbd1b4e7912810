"""Rendering: the host's side of ../web/render.wgsl.js and deterministic.wgsl, which list their passes and bindings."""

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from gsvc_conformance.adapters.webgpu.gpu import Array, Pass, download, groups, run, storage, uniform, upload, wgsl

TILE: Final = 16
SPLATS_OF_SLICE: Final = 2**15
"""Their masks need 32 MiB for a frame of 65,535 columns and rows, and a dispatch has at most 65,535 workgroups."""

PIXELS_OF_BAND: Final = 2**23
"""Their sums need 96 MiB, which is below the 128 MiB that every device binds."""


class Band(NamedTuple):
    """Rows of a frame, with their sums on the device."""

    view: Any
    """Uniform buffer: struct View."""
    sums: Any
    """Storage buffer: f4 (rows, columns, 3)."""
    samples: int


@cache
def bounded_shader() -> str:
    """The WGSL between the two backticks of the file that the browser loads."""
    text = Path(__file__).parents[1].joinpath("web", "render.wgsl.js").read_text(encoding="utf-8")
    return text.split("`")[1]


@cache
def exact_shader() -> str:
    """Bounded rendering for its tiles, binary32 in integers, and deterministic rendering."""
    return bounded_shader() + wgsl("binary32.wgsl") + wgsl("deterministic.wgsl")


def bands(width: int, height: int) -> Iterator[tuple[int, int]]:
    """First row and rows of each band of a frame, from the top."""
    most_rows = max(1, PIXELS_OF_BAND // width)
    for first_row in range(0, height, most_rows):
        yield first_row, min(most_rows, height - first_row)


def rendered(parameters: Array, width: int, height: int, bit_depth: int = 8, exact: bool = False) -> Iterator[Band]:
    """The sums of a frame of splats f4 (N, 8), band by band: (9-2), or (9-6) if they have to be exact."""
    for first_row, rows in bands(width, height):
        sums = storage(12 * width * rows)
        for first in range(0, len(parameters), SPLATS_OF_SLICE):
            part = parameters[first : first + SPLATS_OF_SLICE]
            view = _view(width, rows, bit_depth, first_row, len(part))
            add_slice(part, width, rows, view, sums, exact)
        yield Band(_view(width, rows, bit_depth), sums, 3 * width * rows)


def uploaded(sums: Array, bit_depth: int) -> Iterator[Band]:
    """The bands of sums f4 (H, W, 3) that are given."""
    height, width, _ = sums.shape
    for first_row, rows in bands(width, height):
        part = sums[first_row : first_row + rows]
        yield Band(_view(width, rows, bit_depth), upload(part), part.size)


def read_sums(parts: Iterator[Band]) -> Array:
    """All sums: f4 (samples,)."""
    return np.concatenate([download(band.sums, np.float32, band.samples) for band in parts])


def read_frame(parts: Iterator[Band], bit_depth: int, exact: bool = False) -> Array:
    """The frame of sums, by R-9.1-1 or (9-7): u1 or u2 (samples,)."""
    sample_type = np.dtype(np.uint8 if bit_depth == 8 else np.uint16)
    shader, entry_point = (exact_shader(), "quantize_exactly") if exact else (bounded_shader(), "quantize")
    samples = []
    for band in parts:
        words = groups(band.samples * sample_type.itemsize, 4)
        frame = storage(4 * words)
        run(shader, [(entry_point, (groups(words, 256),), (0, 5, 6))], {0: band.view, 5: band.sums, 6: frame})
        samples.append(download(frame, sample_type, band.samples))
    return np.concatenate(samples)


def _view(width: int, rows: int, bit_depth: int, first_row: int = 0, splat_count: int = 0) -> Any:
    origin_and_extent = np.array([0, first_row, width, rows], np.uint32)
    scale_and_shift = np.array([1, 1, 0, 0], np.float32)
    return uniform(origin_and_extent, scale_and_shift, np.uint32(splat_count), np.float32(2**bit_depth - 1))


def add_slice(parameters: Array, width: int, rows: int, view: Any, sums: Any, exact: bool) -> None:
    """Add splats f4 (n, 8) to the sums of a band, whose view has their number."""
    splats, words = len(parameters), groups(len(parameters), 32)
    across, down = groups(width, TILE), groups(rows, TILE)
    masks = groups(words, 64), across + down
    passes: list[Pass] = [("prepare", (groups(splats, 64),), (0, 1, 2, 3)), ("mark", masks, (0, 3, 4))]
    buffers = {
        0: view,
        1: upload(parameters),
        2: storage(32 * splats),
        3: storage(16 * splats),
        4: storage(4 * words * (across + down)),
        5: sums,
    }
    if exact:
        buffers[8] = storage(36 * splats)
        passes.append(("prepare_exactly", (groups(splats, 64),), (0, 1, 8)))
        passes.append(("sum_exactly", (across, down), (0, 4, 5, 8)))
        run(exact_shader(), passes, buffers)
    else:
        run(bounded_shader(), [*passes, ("sum", (across, down), (0, 2, 4, 5))], buffers)
