"""Rendering and its gradients (spec.md 9 and 10.3): splats go to the device once, a picture comes back."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
import pyopencl as cl

from gsvc_conformance.adapters.opencl.device import (
    Array,
    Floats,
    Values,
    buffer,
    download,
    lanes,
    launch,
    queue,
    tile,
    upload,
)

MAX_ENTRIES: Final = 2**26
"""The lists of a band hold so many splats together, 256 MiB, unless it is a single row of regions (spec.md 14)."""

LARGER: Final = (4096, 1024, 256, 64)
"""Widths and heights in pixels of the regions that a frame is divided into, one after the other, before the tiles."""

BLOCK: Final = 8
"""Width and height in pixels of the blocks of gradients.cl."""

SPLAT_BYTES: Final = 48
"""Size of Splat in splats.cl."""

GRID: Final = np.dtype([
    ("width", "u4"), ("height", "u4"), ("side", "u4"), ("columns", "u4"), ("first_row", "u4"),
    ("parent_side", "u4"), ("parent_columns", "u4"), ("parent_first_row", "u4"),
])  # fmt: skip
"""Grid of lists.cl."""


@dataclass(frozen=True)
class Lists:
    """The splats that touch each region of a band: those of region k are ``splats[start[k] : start[k + 1]]``.

    Attributes
    ----------
    side
        Width and height of a region in pixels.
    columns, first_row, rows
        Regions side by side, and the rows of them that the band has; regions are counted row by row.
    """

    side: int
    columns: int
    first_row: int
    rows: int
    splats: cl.Buffer
    start: cl.Buffer


def prepared(parameters: Floats, exact: bool) -> cl.Buffer:
    """The splats as the kernels want them, (9-3)."""
    splats = buffer(SPLAT_BYTES * len(parameters))
    launch("prepare", len(parameters), upload(parameters, "f4"), len(parameters), splats, exact=exact)
    return splats


def everything(splat_count: int) -> Lists:
    """One region larger than any frame, with all splats."""
    whole = Lists(2**16, 1, 0, 1, buffer(4 * splat_count), buffer(8 * 2))
    launch("list_all", max(splat_count, 1), splat_count, whole.splats, whole.start)
    return whole


def divided(
    splats: cl.Buffer, parent: Lists, sides: tuple[int, ...], frame: tuple[int, int], exact: bool
) -> Iterator[Lists]:
    """The lists of regions of sides[0] pixels, of those of sides[1] in them, and so on to the last, which are yielded.

    In one band from top to bottom, or in several where the lists would be too long.
    """
    side, *smaller = sides
    columns = -(-frame[0] // side)
    first_row = parent.first_row * parent.side // side
    end_row = -(-min((parent.first_row + parent.rows) * parent.side, frame[1]) // side)
    while first_row < end_row:
        rows = end_row - first_row
        grid = np.array((*frame, side, columns, first_row, parent.side, parent.columns, parent.first_row), GRID)
        around = splats, parent.splats, parent.start, grid
        count, start = buffer(4 * columns * rows), buffer(8 * (columns * rows + 1))
        launch("count_touching", lanes() * columns * rows, *around, count, exact=exact)
        entries = scanned(count, columns * rows, start)
        while entries > MAX_ENTRIES and rows > 1:
            rows //= 2
            entries = scanned(count, columns * rows, start)
        chosen = buffer(4 * entries)
        launch("write_touching", lanes() * columns * rows, *around, start, chosen, exact=exact)
        lists = Lists(side, columns, first_row, rows, chosen, start)
        if smaller:
            yield from divided(splats, lists, tuple(smaller), frame, exact)
        else:
            yield lists
        first_row += rows


def scanned(count: cl.Buffer, n: int, start: cl.Buffer) -> int:
    """Where lists of these lengths begin, and the sum of all: the host has to wait for it, since it allocates."""
    launch("scan", lanes(), count, n, start)
    total = np.empty((), "u8")
    cl.enqueue_copy(queue(), total, start, src_offset=8 * n)
    return int(total)


def device_sum(parameters: Floats, width: int, height: int, exact: bool) -> cl.Buffer:
    """The sum (9-2), left on the device: (H, W, 3) f4."""
    frame, side = (width, height), tile()
    splats = prepared(parameters, exact)
    picture = buffer(12 * width * height)
    larger = [region for region in LARGER if region < max(frame)]
    for tiles in divided(splats, everything(len(parameters)), (*larger, side), frame, exact):
        pixels = (tiles.columns * side, tiles.rows * side)
        lists = tiles.splats, tiles.start, *frame, tiles.first_row
        launch("render_sum", pixels, splats, *lists, picture, group=(side, side), exact=exact)
    return picture


def device_frame(picture: cl.Buffer, width: int, height: int, bit_depth: int) -> Array:
    """The samples of a sum, (9-7): (H, W, 3) u1 or u2."""
    dtype = np.dtype("u1" if bit_depth == 8 else "u2")
    samples = 3 * width * height
    frame = buffer(samples * dtype.itemsize)
    launch("to_frame", samples, picture, np.uint64(samples), bit_depth, frame)
    return download(frame, (height, width, 3), dtype)


def render_sum(parameters: Floats, width: int, height: int) -> Values:
    """The sum of the splats over a frame, (H, W, 3) f4, in whatever way the compiler finds fast: R-13-3."""
    return {"sum": download(device_sum(parameters, width, height, exact=False), (height, width, 3), "f4")}


def render_sum_deterministic(parameters: Floats, width: int, height: int) -> Values:
    """The sum of the splats over a frame, (H, W, 3) f4, of the operations of 9.3: R-9.3-1."""
    return {"sum": download(device_sum(parameters, width, height, exact=True), (height, width, 3), "f4")}


def to_frame(sum: Floats, bit_depth: int) -> Values:
    """The samples of a sum, (H, W, 3) u1 or u2: R-9.1-1."""
    height, width = sum.shape[:2]
    return {"frame": device_frame(upload(sum, "f4"), width, height, bit_depth)}


def to_frame_deterministic(sum: Floats, bit_depth: int) -> Values:
    """The kernel of `to_frame`: one product, which (9-7) rounds, and no sum that could be fused with it."""
    return to_frame(sum, bit_depth)


def render_frame(parameters: Floats, width: int, height: int, bit_depth: int) -> Values:
    """The frame of a set of splats, (H, W, 3) u1 or u2; the sum stays on the device: R-13-4."""
    return {"frame": device_frame(device_sum(parameters, width, height, exact=False), width, height, bit_depth)}


def scale_parameters(parameters: Floats, width: int, height: int, new_width: int, new_height: int) -> Values:
    """The splats of a frame for one of another size, (N, 8) f4: R-9.4-1."""
    scaled = buffer(parameters.nbytes)
    sizes = map(float, (width, height, new_width, new_height))
    launch("scale_parameters", len(parameters), upload(parameters, "f4"), len(parameters), *sizes, scaled, exact=True)
    return {"parameters": download(scaled, parameters.shape, "f4")}


def scale_parameters_filtered(parameters: Floats, width: int, height: int, new_width: int, new_height: int) -> Values:
    """The splats of a frame for a smaller one, (N, 8) f4: R-9.4-3."""
    filtered = buffer(parameters.nbytes)
    sides = ((width, new_width), (height, new_height))
    ratios = [new / old for old, new in sides]
    deviations = [math.sqrt(max(0, old - new) * (old + new) / 12) / old for old, new in sides]
    count = len(parameters)
    launch("scale_parameters_filtered", count, upload(parameters, "f4"), count, *ratios, *deviations, filtered)
    return {"parameters": download(filtered, parameters.shape, "f4")}


def render_gradients(parameters: Floats, residual: Floats) -> Values:
    """dL/dparameters, (N, 8) f4, of dL/dC, (H, W, 3) f4: R-10.3-1."""
    height, width = residual.shape[:2]
    gradients = buffer(parameters.nbytes)
    launch(
        "render_gradients", (BLOCK * len(parameters), BLOCK), prepared(parameters, exact=False),
        upload(residual, "f4"), width, height, gradients, group=(BLOCK, BLOCK),
    )  # fmt: skip
    return {"gradients": download(gradients, parameters.shape, "f4")}
