"""Which splats a tile of the frame has to look at, made with sorting and counting alone, as on any GPU."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor

TILE: Final = 16
"""Pixels on a side of a tile."""

MAX_PAIRS: Final = 2**22
"""(splat, tile) pairs that are listed at once: one splat may touch every tile (spec.md, section 14)."""

SUPPORT_RADIUS: Final = 3.3290429691304455
REACH: Final = SUPPORT_RADIUS * (1 + 2.0**-17)
SMALLEST_NORMAL: Final = 2.0**-126


@dataclass(frozen=True)
class Grid:
    """The tiles of a frame, counted row by row.

    Attributes
    ----------
    width, height
        Of the frame in pixels.
    """

    width: int
    height: int

    @property
    def across(self) -> int:
        """Tiles in a row."""
        return -(-self.width // TILE)

    @property
    def down(self) -> int:
        """Rows of tiles."""
        return -(-self.height // TILE)

    @property
    def tiles(self) -> int:
        """All tiles."""
        return self.across * self.down

    def centers(self, tile: Tensor) -> tuple[Tensor, Tensor]:
        """The centres i + 1/2 of the columns and j + 1/2 of the rows of tiles, (T, 16) f4 each; exact."""
        step = torch.arange(TILE, device=tile.device) + 0.5
        column, row = tile % self.across, tile // self.across
        return (TILE * column)[:, None] + step, (TILE * row)[:, None] + step

    def picture(self, pixels: Tensor) -> Tensor:
        """The pixels of all tiles (tiles, 256, 3) as one picture (H, W, 3)."""
        squares = pixels.view(self.down, self.across, TILE, TILE, 3).transpose(1, 2)
        return squares.reshape(TILE * self.down, TILE * self.across, 3)[: self.height, : self.width]


@dataclass(frozen=True)
class TileLists:
    """The splats of every tile in ascending order: tile t has ``splats[first[t] : first[t] + count[t]]``.

    Attributes
    ----------
    splats
        (pairs,) i8.
    first, count
        (tiles,) i8.
    """

    splats: Tensor
    first: Tensor
    count: Tensor


def boxes(parameters: Tensor, width: int, height: int) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """First column, end column, first row and end row of each splat's box (5-1) in the frame, (N,) i8 each.

    In binary64, and clamped before they become integers: a centre may be at 10^38.
    """
    x, y, l11, l21, l22 = parameters[:, :5].double().unbind(1)
    e_x = REACH * l11
    e_y = REACH * (l21.abs() + l22)
    finite = parameters[:, :5].isfinite().all(1)  # after (9-8)
    drawn = (l11 >= SMALLEST_NORMAL) & (l22 >= SMALLEST_NORMAL) & finite
    sides = [
        (x - e_x).floor().clamp(0, width),
        (x + e_x).ceil().clamp(0, width),
        (y - e_y).floor().clamp(0, height),
        (y + e_y).ceil().clamp(0, height),
    ]
    left, right, top, bottom = (torch.where(drawn, side, 0.0).long() for side in sides)
    return left, right, top, bottom


def groups(parameters: Tensor, grid: Grid) -> Iterator[tuple[slice, TileLists]]:
    """Consecutive splats in groups of about `MAX_PAIRS` pairs, with the lists of all tiles for each group.

    Splats are numbered from the first one of their group.
    """
    left, right, top, bottom = boxes(parameters, grid.width, grid.height)
    empty = (left >= right) | (top >= bottom)
    left, right = left // TILE, (right - 1) // TILE + 1
    top, bottom = top // TILE, (bottom - 1) // TILE + 1
    wide, tall = torch.where(empty, 0, right - left), torch.where(empty, 0, bottom - top)
    touched = wide * tall
    group_of = torch.cumsum(touched, 0) // MAX_PAIRS
    begin = 0
    for size in torch.unique_consecutive(group_of, return_counts=True)[1].tolist():
        group = slice(begin, begin + size)
        yield group, _lists(grid, left[group], top[group], wide[group], touched[group])
        begin += size


def _lists(grid: Grid, left: Tensor, top: Tensor, wide: Tensor, touched: Tensor) -> TileLists:
    """Count, scan, scatter and sort: one pair for each tile that the box of a splat touches."""
    splat = torch.repeat_interleave(torch.arange(len(touched), device=touched.device), touched)
    before = torch.cumsum(touched, 0) - touched
    place = torch.arange(len(splat), device=touched.device) - before[splat]  # 0, 1, … in the splat's own tiles
    row = top[splat] + place // wide[splat]
    column = left[splat] + place % wide[splat]
    tile, order = torch.sort(
        row * grid.across + column, stable=True
    )  # stable: splats of a tile stay in ascending order
    count = torch.bincount(tile, minlength=grid.tiles)
    return TileLists(splat[order], torch.cumsum(count, 0) - count, count)
