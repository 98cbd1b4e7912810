"""Between pictures (H, W, 3) and strips: copying, rounding, and the residual of the loss.

Pictures come as their rows, (H, 3 W) with the channels of a pixel side by side. The loop over the columns of a full
strip has a constant bound, without which it would not become vector code; the last strip may be narrower.
"""

from typing import Any, Final

import numpy as np

from gsvc_ref._jit import kernel
from gsvc_ref.rendering.strips import CHANNELS, F4, F8, ROW, STRIP_WIDTH

ZERO: Final = np.float32(0)
ONE: Final = np.float32(1)


@kernel(inline=True)
def _interleave(lanes: Any, pixels: Any, width: int) -> None:
    """One row of a strip to pixels, converting to the type of the picture."""
    for k in range(width):
        pixels[3 * k] = lanes[k]
        pixels[3 * k + 1] = lanes[STRIP_WIDTH + k]
        pixels[3 * k + 2] = lanes[2 * STRIP_WIDTH + k]


@kernel(inline=True)
def _deinterleave(pixels: Any, lanes: Any, width: int) -> None:
    """Pixels to one row of a strip."""
    for k in range(width):
        lanes[k] = pixels[3 * k]
        lanes[STRIP_WIDTH + k] = pixels[3 * k + 1]
        lanes[2 * STRIP_WIDTH + k] = pixels[3 * k + 2]


@kernel()
def write_picture(strip: F4, s: int, picture: F4, clamp: bool) -> None:
    """Write strip s into the picture (H, 3 W) f4; `clamp` limits the values, and the strip's own, to [0, 1]."""
    first = CHANNELS * STRIP_WIDTH * s
    end = min(first + ROW, picture.shape[1])
    for y in range(picture.shape[0]):
        row = strip[y * ROW : (y + 1) * ROW]
        if clamp:
            for k in range(ROW):
                row[k] = min(max(row[k], ZERO), ONE)
        if end - first == ROW:
            _interleave(row, picture[y, first:end], STRIP_WIDTH)
        else:
            _interleave(row, picture[y, first:end], (end - first) // CHANNELS)


@kernel()
def write_frame(strip: F4, s: int, frame: Any, peak: np.float32) -> None:
    """Write strip s into the frame (H, 3 W) u1 or u2: clamp, times peak, round half to even; it spoils the strip."""
    first = CHANNELS * STRIP_WIDTH * s
    end = min(first + ROW, frame.shape[1])
    for y in range(frame.shape[0]):
        row = strip[y * ROW : (y + 1) * ROW]
        for k in range(ROW):
            row[k] = np.rint(min(max(row[k], ZERO), ONE) * peak)
        if end - first == ROW:
            _interleave(row, frame[y, first:end], STRIP_WIDTH)
        else:
            _interleave(row, frame[y, first:end], (end - first) // CHANNELS)


@kernel()
def read_strip(picture: F4, s: int, strip: F4) -> None:
    """Copy strip s out of a picture (H, 3 W) f4; lanes and rows of the strip outside the picture become zero."""
    first = CHANNELS * STRIP_WIDTH * s
    end = min(first + ROW, picture.shape[1])
    height = picture.shape[0]
    strip[height * ROW :] = ZERO
    for y in range(height):
        row = strip[y * ROW : (y + 1) * ROW]
        if end - first == ROW:
            _deinterleave(picture[y, first:end], row, STRIP_WIDTH)
        else:
            row[:] = ZERO
            _deinterleave(picture[y, first:end], row, (end - first) // CHANNELS)


@kernel()
def subtract_target(strip: F4, target: F4, height: int, lanes: int, squares: F8) -> float:
    """Turn the sum C of a strip into e = clamp(C, 0, 1) - target, zero outside the frame; return the sum of e^2.

    `target` is (H * ROW,) f4 with zeros outside the frame, `lanes` the columns inside it, and `squares` is
    (STRIP_WIDTH,) f8 scratch: the squares of a pixel are added in binary32, everything else in binary64, per lane down
    the rows and then over the lanes.
    """
    squares[:] = 0
    strip[height * ROW :] = ZERO
    if lanes < STRIP_WIDTH:
        for row in range(height * CHANNELS):
            strip[row * STRIP_WIDTH + lanes : (row + 1) * STRIP_WIDTH] = ZERO
    for y in range(height):
        e = strip[y * ROW : (y + 1) * ROW]
        t = target[y * ROW : (y + 1) * ROW]
        for k in range(STRIP_WIDTH):
            red = min(max(e[k], ZERO), ONE) - t[k]
            green = min(max(e[STRIP_WIDTH + k], ZERO), ONE) - t[STRIP_WIDTH + k]
            blue = min(max(e[2 * STRIP_WIDTH + k], ZERO), ONE) - t[2 * STRIP_WIDTH + k]
            e[k] = red
            e[STRIP_WIDTH + k] = green
            e[2 * STRIP_WIDTH + k] = blue
            squares[k] += np.float64(red * red + green * green + blue * blue)
    total = 0.0
    for k in range(STRIP_WIDTH):
        total += squares[k]
    return total
