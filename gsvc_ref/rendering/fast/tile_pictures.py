"""Between pictures (H, W, 3) and tiles: copying, rounding, and the residual of the loss.

Pictures come as their rows, (H, 3 W) with the channels of a pixel side by side. The loop over the columns of a full
tile has a constant bound, without which it would not become vector code; the last tile may be narrower.
"""

from typing import Any

import numpy as np

from gsvc_base.arrays import F4, F8
from gsvc_base.constants import ONE
from gsvc_ref._jit import kernel
from gsvc_ref.rendering.fast.tiles import CHANNELS, ROW, TILE_WIDTH, ZERO, aligned, tile_count


@kernel(inline=True)
def clamped(value: np.float32) -> np.float32:
    """`value` within [0, 1]; what is not a number becomes 0."""
    value = value if value > ZERO else ZERO
    return value if value < ONE else ONE


@kernel(inline=True)
def rounded(value: np.float32, peak: np.float32) -> np.int32:
    """Clamp, times peak, round half to even (R-9.1-1)."""
    return np.int32(np.rint(clamped(value) * peak))  # (9-7)


@kernel(inline=True)
def _interleave(lanes: Any, pixels: Any, width: int) -> None:
    """One row of a tile to pixels."""
    for k in range(width):
        pixels[3 * k] = lanes[k]
        pixels[3 * k + 1] = lanes[TILE_WIDTH + k]
        pixels[3 * k + 2] = lanes[2 * TILE_WIDTH + k]


@kernel(inline=True)
def _interleave_clamped(lanes: Any, pixels: Any, width: int) -> None:
    """One row of a tile to pixels within [0, 1]."""
    for k in range(width):
        pixels[3 * k] = clamped(lanes[k])
        pixels[3 * k + 1] = clamped(lanes[TILE_WIDTH + k])
        pixels[3 * k + 2] = clamped(lanes[2 * TILE_WIDTH + k])


@kernel(inline=True)
def _interleave_rounded(lanes: Any, pixels: Any, width: int, peak: np.float32) -> None:
    """One row of a tile to integer pixels; with the rounding in a loop of its own it takes twice as long."""
    for k in range(width):
        pixels[3 * k] = rounded(lanes[k], peak)
        pixels[3 * k + 1] = rounded(lanes[TILE_WIDTH + k], peak)
        pixels[3 * k + 2] = rounded(lanes[2 * TILE_WIDTH + k], peak)


@kernel(inline=True)
def _deinterleave(pixels: Any, lanes: Any, width: int) -> None:
    """Pixels to one row of a tile."""
    for k in range(width):
        lanes[k] = pixels[3 * k]
        lanes[TILE_WIDTH + k] = pixels[3 * k + 1]
        lanes[2 * TILE_WIDTH + k] = pixels[3 * k + 2]


@kernel()
def write_picture(tile: F4, t: int, top: int, end: int, picture: F4, clamp: bool) -> None:
    """Write the rows top to end - 1 of tile t into the picture (H, 3 W) f4, limited to [0, 1] if `clamp` is set."""
    first = CHANNELS * TILE_WIDTH * t
    last = min(first + ROW, picture.shape[1])
    for y in range(top, end):
        row, pixels = tile[y * ROW : (y + 1) * ROW], picture[y, first:last]
        if clamp and last - first == ROW:  # a full tile: the loop has a constant bound
            _interleave_clamped(row, pixels, TILE_WIDTH)
        elif clamp:
            _interleave_clamped(row, pixels, (last - first) // CHANNELS)
        elif last - first == ROW:
            _interleave(row, pixels, TILE_WIDTH)
        else:
            _interleave(row, pixels, (last - first) // CHANNELS)


@kernel()
def write_frame(tile: F4, t: int, top: int, end: int, frame: Any, peak: np.float32) -> None:
    """Write the rows top to end - 1 of tile t into the frame (H, 3 W) u1 or u2, see `rounded`."""
    first = CHANNELS * TILE_WIDTH * t
    last = min(first + ROW, frame.shape[1])
    for y in range(top, end):
        row, pixels = tile[y * ROW : (y + 1) * ROW], frame[y, first:last]
        if last - first == ROW:
            _interleave_rounded(row, pixels, TILE_WIDTH, peak)
        else:
            _interleave_rounded(row, pixels, (last - first) // CHANNELS, peak)


@kernel()
def read_tile(picture: F4, t: int, tile: F4) -> None:
    """Copy tile t out of a picture (H, 3 W) f4; lanes and rows of the tile outside the picture become zero."""
    first = CHANNELS * TILE_WIDTH * t
    end = min(first + ROW, picture.shape[1])
    height = picture.shape[0]
    tile[height * ROW :] = ZERO
    for y in range(height):
        row = tile[y * ROW : (y + 1) * ROW]
        if end - first == ROW:
            _deinterleave(picture[y, first:end], row, TILE_WIDTH)
        else:
            row[:] = ZERO
            _deinterleave(picture[y, first:end], row, (end - first) // CHANNELS)


def to_tiles(picture: F4) -> F4:
    """A picture (H, W, 3) f4 in tile layout, (tiles, H * ROW) f4, zero outside the picture."""
    height, width, _ = picture.shape
    tiles = aligned((tile_count(width), height * ROW))
    for t, tile in enumerate(tiles):
        read_tile(picture.reshape(height, -1), t, tile)
    return tiles


@kernel()
def subtract_target(tile: F4, target: F4, height: int, lanes: int, squares: F8) -> float:
    """Turn the sum C of a tile into e = clamp(C, 0, 1) - target (10-2), zero outside the frame; return the sum of e^2.

    `target` is (H * ROW,) f4 with zeros outside the frame, `lanes` the columns inside it, and `squares` is
    (TILE_WIDTH,) f8 scratch: the squares of a pixel are added in binary32, everything else in binary64, per lane down
    the rows and then over the lanes.
    """
    squares[:] = 0
    tile[height * ROW :] = ZERO  # the spare rows, to which the forward pass has added
    if lanes < TILE_WIDTH:
        for row in range(height * CHANNELS):
            tile[row * TILE_WIDTH + lanes : (row + 1) * TILE_WIDTH] = ZERO  # lanes to the right of the frame
    for y in range(height):
        e = tile[y * ROW : (y + 1) * ROW]
        wanted = target[y * ROW : (y + 1) * ROW]
        for k in range(TILE_WIDTH):
            red = clamped(e[k]) - wanted[k]
            green = clamped(e[TILE_WIDTH + k]) - wanted[TILE_WIDTH + k]
            blue = clamped(e[2 * TILE_WIDTH + k]) - wanted[2 * TILE_WIDTH + k]
            e[k] = red
            e[TILE_WIDTH + k] = green
            e[2 * TILE_WIDTH + k] = blue
            squares[k] += np.float64(red * red + green * green + blue * blue)  # (10-1)
    total = 0.0
    for k in range(TILE_WIDTH):
        total += squares[k]
    return total
