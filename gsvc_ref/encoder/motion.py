"""The motion of splats from one frame to the next: a dense optical flow of reduced frames, read at their centres.

A P-frame may begin with it; ours, not the paper's. Decoders know nothing of it.

The flow is found by iterated Lucas-Kanade (Lucas and Kanade 1981), from coarse pictures to fine ones. The motion (u, v)
of every pixel is found anew a few times, taken as constant within a window. With the second picture I read at
(x + u, y + v), its gradient (Ix, Iy), and e = first - I + Ix u + Iy v, the new motion (p, q) solves

    [sum Ix Ix + R   sum Ix Iy    ] [p]  =  [sum Ix e + R u]        sums over the window's part inside the picture
    [sum Ix Iy       sum Iy Iy + R] [q]     [sum Iy e + R v]

R keeps the motion as it was where there is nothing to see but noise. All of it is sums, products and quotients in a
fixed order.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4, F8
from gsvc_ref._jit import kernel
from gsvc_ref.training.reduction import reduced

LONGEST_SIDE: Final = 128
"""Flow is estimated on frames reduced to at most this number of pixels on the longer side."""

WINDOW_RADIUS: Final = 7
"""Half the side of the window over which flow is taken as constant, in pixels."""

CORRECTIONS: Final = 3
"""Number of corrections at each size; on three clips more of them changed the prediction by less than 0.1 dB."""

SMALLEST_SIDE: Final = 16
"""Pictures are not halved to a shorter side than this."""

REGULARISATION: Final = 1e-5
"""R for each pixel of the window, in squared samples per pixel: gradients of about 1/255 count half."""


def estimated_motion(
    before: F4,  # (H, W, 3) f4
    after: F4,  # (H, W, 3) f4
    positions: F4,  # (N, 2) f4, centres of splats of the first picture in pixels
) -> F4:
    """The distance by which splats of the frame before should move, (N, 2) f4 in pixels."""
    old, new = (reduced(picture, LONGEST_SIDE).mean(axis=2, dtype=np.float64) for picture in (before, after))
    if min(old.shape) < SMALLEST_SIDE or np.array_equal(old, new):
        return np.zeros_like(positions)
    step = -(-max(before.shape[:2]) // LONGEST_SIDE)
    motion = np.empty((len(positions), 2), np.float32)
    read_flow(optical_flow(old, new), positions.astype(np.float64) / step - 0.5, float(step), motion)
    return motion


def optical_flow(first: F8, second: F8) -> F8:
    """The distance by which each pixel of the first picture (h, w) f8 moves right and down, (2, h, w) f8 in pixels."""
    if min(first.shape) >= 2 * SMALLEST_SIDE:
        coarse = optical_flow(halved(first), halved(second))
        flow = np.empty((2, *first.shape))
        double(coarse, flow)
    else:
        flow = np.zeros((2, *first.shape))
    sums = np.zeros((5, first.shape[0] + 1, first.shape[1] + 1))
    moved = np.empty(first.shape)
    for _ in range(CORRECTIONS):
        read_moved(second, flow, moved)
        sum_products(first, moved, flow, sums)
        solve(sums, flow)
    return flow


def halved(picture: F8) -> F8:
    """Means of 2 x 2 pixels; an odd last row or column is left out."""
    height, width = (side // 2 * 2 for side in picture.shape)
    a, b = picture[0:height:2, :width], picture[1:height:2, :width]
    return np.asarray((a[:, 0::2] + a[:, 1::2] + b[:, 0::2] + b[:, 1::2]) / 4)


@kernel(inline=True)
def read(picture: F8, x: float, y: float) -> float:
    """The picture between pixels (bilinear), whose centres are at integers; beyond its edge the nearest pixel."""
    height, width = picture.shape
    x, y = min(max(x, 0.0), width - 1.0), min(max(y, 0.0), height - 1.0)
    column, row = min(int(x), max(width - 2, 0)), min(int(y), max(height - 2, 0))
    right, below = min(column + 1, width - 1), min(row + 1, height - 1)
    s, t = x - column, y - row
    above = picture[row, column] * (1 - s) + picture[row, right] * s
    return float(above * (1 - t) + (picture[below, column] * (1 - s) + picture[below, right] * s) * t)


@kernel()
def double(coarse: F8, flow: F8) -> None:
    """The flow (2, h // 2, w // 2) at twice the size, in its pixels, into flow (2, h, w)."""
    for k in range(2):
        for y in range(flow.shape[1]):
            for x in range(flow.shape[2]):
                flow[k, y, x] = 2 * read(coarse[k], (x - 0.5) / 2, (y - 0.5) / 2)


@kernel()
def read_moved(picture: F8, flow: F8, moved: F8) -> None:
    """The picture read where the flow leads, (h, w) f8."""
    for y in range(moved.shape[0]):
        for x in range(moved.shape[1]):
            moved[y, x] = read(picture, x + flow[0, y, x], y + flow[1, y, x])


@kernel()
def sum_products(first: F8, moved: F8, flow: F8, sums: F8) -> None:
    """sums[k, y, x]: of Ix Ix, Ix Iy, Iy Iy, Ix e, Iy e over the rows before y and columns before x."""
    height, width = first.shape
    row = np.empty(5)
    for y in range(height):
        above, below = max(y - 1, 0), min(y + 1, height - 1)
        row[:] = 0
        for x in range(width):
            left, right = max(x - 1, 0), min(x + 1, width - 1)
            dx = (moved[y, right] - moved[y, left]) / max(right - left, 1)
            dy = (moved[below, x] - moved[above, x]) / max(below - above, 1)
            e = first[y, x] - moved[y, x] + dx * flow[0, y, x] + dy * flow[1, y, x]
            row[0] += dx * dx
            row[1] += dx * dy
            row[2] += dy * dy
            row[3] += dx * e
            row[4] += dy * e
            for k in range(5):
                sums[k, y + 1, x + 1] = sums[k, y, x + 1] + row[k]


@kernel()
def solve(sums: F8, flow: F8) -> None:
    """Replace the flow (2, h, w) by the solution of the 2 x 2 system of each pixel, from the sums of its window."""
    height, width = flow.shape[1:]
    part = np.empty(5)
    farthest = np.float64(max(height, width))
    for y in range(height):
        top, bottom = max(y - WINDOW_RADIUS, 0), min(y + WINDOW_RADIUS + 1, height)
        for x in range(width):
            left, right = max(x - WINDOW_RADIUS, 0), min(x + WINDOW_RADIUS + 1, width)
            for k in range(5):  # a window sum is four reads of the summed table, whatever its size
                inside = sums[k, bottom, right] - sums[k, top, right] - sums[k, bottom, left] + sums[k, top, left]
                part[k] = inside
            noise = REGULARISATION * ((bottom - top) * (right - left))
            xx, xy, yy = part[0] + noise, part[1], part[2] + noise
            xe, ye = part[3] + noise * flow[0, y, x], part[4] + noise * flow[1, y, x]
            determinant = xx * yy - xy * xy  # R on the diagonal keeps it away from 0
            flow[0, y, x] = min(max((yy * xe - xy * ye) / determinant, -farthest), farthest)
            flow[1, y, x] = min(max((xx * ye - xy * xe) / determinant, -farthest), farthest)


@kernel()
def read_flow(flow: F8, places: F8, step: float, motion: NDArray[np.float32]) -> None:
    """The flow at places (N, 2) f8 in pixels of the flow (x, y), times `step`, into motion (N, 2) f4."""
    for n in range(places.shape[0]):
        for k in range(2):
            motion[n, k] = step * read(flow[k], places[n, 0], places[n, 1])
