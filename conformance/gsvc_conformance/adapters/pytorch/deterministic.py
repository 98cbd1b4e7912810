"""Deterministic rendering (section 9.3): the same bytes on every device.

Eager PyTorch runs one kernel per operation, and none of its kernels for +, -, · and / fuses or approximates, neither on
a CPU nor with CUDA. So writing (9-3) to (9-7) operation by operation is enough. What would break it: torch.compile and
TorchScript (they fuse), torch.addcmul and the like (one kernel for two operations), torch.set_flush_denormal(True), and
quotients of a tensor and a Python number other than 1, which become products with a reciprocal. Kernels that add by
float atomics (`rendering.render`) are another matter; there is none here.
"""

from typing import Final

import numpy as np
import torch
from torch import Tensor

from gsvc_conformance.adapters.pytorch.device import Array, Arrays, array, tensor
from gsvc_conformance.adapters.pytorch.tiles import TILE, Grid, TileLists, groups

K: Final = float.fromhex("0x1.62a41p+3")
K1: Final = float.fromhex("-0x1.ffffc8p-5")
K2: Final = float.fromhex("0x1.fff2fp-10")
K3: Final = float.fromhex("-0x1.547a8p-15")
K4: Final = float.fromhex("0x1.498f3ep-21")
K5: Final = float.fromhex("-0x1.908c68p-28")
"""Binary32 numbers, so that PyTorch rounds nothing when it calculates with them."""

MAX_TILES: Final = 2**14
"""Tiles at once: a dozen arrays of 256 numbers each are alive for every one."""


def render_deterministic(parameters: Tensor, width: int, height: int) -> Tensor:
    """The sum C of (9-6), (H, W, 3) f4: each tile takes the splats of its list in order, all tiles at the same time."""
    grid = Grid(width, height)
    pixels = torch.zeros(grid.tiles, TILE * TILE, 3, device=parameters.device)
    for group, lists in groups(parameters, grid):
        # Tiles with the longest lists first: those that still have a splat are then always the first ones.
        for tiles in torch.split(torch.argsort(lists.count, descending=True), MAX_TILES):
            _add_lists(pixels, parameters[group], lists, tiles, grid)
    return grid.picture(pixels)


def _add_lists(pixels: Tensor, splats: Tensor, lists: TileLists, tiles: Tensor, grid: Grid) -> None:
    """Add the splats of some tiles' lists, which are sorted by length, to the pixels of these tiles."""
    columns, rows = grid.centers(tiles)
    sums, first = pixels[tiles], lists.first[tiles]
    ends = torch.bincount(lists.count[tiles])  # how many lists have each length
    longer = (ends.sum() - torch.cumsum(ends, 0)).tolist()  # how many are longer than 0, 1, …
    for k, active in enumerate(longer[:-1]):
        splat = splats[lists.splats[first[:active] + k]]
        m = _squared_distance(splat, columns[:active], rows[:active])
        covered = m <= K  # false for NaN
        g = _weight(torch.where(covered, m, 0.0))
        current = sums[:active]
        sums[:active] = torch.where(covered[:, :, None], current + g[:, :, None] * splat[:, None, 5:], current)  # (9-6)
    pixels[tiles] = sums


def _squared_distance(splat: Tensor, columns: Tensor, rows: Tensor) -> Tensor:
    """The m of one splat (8 numbers) for the 256 pixels of each tile, (T, 256)."""
    x, y, l11, l21, l22 = splat[:, :5, None, None].unbind(1)  # (T, 1, 1) each
    r1 = 1 / l11
    r2 = 1 / l22
    small = l22 <= 1
    l = torch.where(small, l21, l21 / l22)
    f = torch.where(small, r2, 1.0)  # (9-3)
    u1 = (columns[:, None, :] - x) * r1
    u2 = (rows[:, :, None] - y) * r2 - (l * u1) * f
    return (u1 * u1 + u2 * u2).flatten(1)  # (9-4)


def _weight(m: Tensor) -> Tensor:
    """(9-5)."""
    t = m * m
    p = ((K5 * t + (K4 * m + K3)) * t + (K2 * m + K1)) * m + 1
    h = p * p
    q = h * h
    return q * q


def quantized_deterministic(picture: Tensor, bit_depth: int) -> Array:
    """(9-7): both comparisons fail for NaN, which becomes black."""
    v = torch.where(picture > 0, picture, 0.0)
    v = torch.where(picture >= 1, 1.0, v)
    return array(torch.round(v * (2**bit_depth - 1)), "u1" if bit_depth == 8 else "u2")


def render_sum_deterministic(parameters: Array, width: int, height: int) -> Arrays:
    """Operation: (9-6) over a frame."""
    return {"sum": array(render_deterministic(tensor(parameters), width, height), "f4")}


def to_frame_deterministic(sum: Array, bit_depth: int) -> Arrays:
    """Operation: (9-7)."""
    return {"frame": quantized_deterministic(tensor(sum), bit_depth)}


def scale_parameters(parameters: Array, width: int, height: int, new_width: int, new_height: int) -> Arrays:
    """Operation: the splats for another size (9-8); the ratios are rounded before they are multiplied with."""
    ratios = tensor(np.array([new_width, new_height], np.float32)) / tensor(np.array([width, height], np.float32))
    a, e = ratios.unbind()
    factors = torch.stack((a, e, a, e, e, *torch.ones_like(a).expand(3)))
    return {"parameters": array(tensor(parameters) * factors, "f4")}
