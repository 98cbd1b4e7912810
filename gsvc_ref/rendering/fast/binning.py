"""Binning: which splats touch which tile, sorted by tile.

A stream may come from anyone, and one splat may touch every tile. So the intersections of all tiles are listed at once
only while they are few. Otherwise they are listed for one window of neighbouring tiles after the other, which changes
no bit, as tiles have nothing in common.
"""

from collections.abc import Callable, Iterator
from typing import Any, Final, NamedTuple

import numpy as np

from gsvc_base.arrays import F4, F8, I4, I8
from gsvc_base.splats import PARAMETERS_PER_SPLAT, Splats
from gsvc_ref._jit import kernel
from gsvc_ref.rendering.fast.projection import PROJECTED, ROW_COUNT, ProjectedSplats, project_task
from gsvc_ref.rendering.fast.threads import run_tasks
from gsvc_ref.rendering.fast.tiles import aligned, tile_count

LISTED: Final = 1 << 20
"""Maximum number of intersections, 8 bytes each, that are listed at once, unless there are more splats than that."""

SPLATS_KEPT: Final = 1 << 16
"""Memory of more splats than this is given back to the system between two frames."""

SPLATS_PER_THREAD: Final = 4096
"""Minimum number of splats that another thread is woken for."""

ROWS_FOR_INTERSECTION: Final = 4.0
ROWS_FOR_ROW: Final = 1.5
"""The work of gathering an intersection, and of clearing and writing a row of a tile: in rows that a splat is added
to."""


class Bins(NamedTuple):
    """The intersections of splats and tiles, and what the inner loops need of the splats.

    An *intersection* is a pair of a splat and a tile that it touches.
    """

    projected: F4  # as in `ProjectedSplats`
    tile_ranges: I4  # as in `ProjectedSplats`
    splat_offsets: I8  # (N + 1,): the number of intersections of the splats before
    tile_offsets: I8  # (tiles + 1,): the number of intersections of the tiles before
    window: I8  # (2,): the first tile whose intersections are listed, and the one after the last
    intersections: I4
    """(intersections of the window or more, 2), tile after tile and in index order; each is the splat and the
    intersection's index in the order by splat, where a splat's intersections are side by side."""
    cursors: I8  # (tiles,) scratch: where the next intersection of a tile goes
    work: F8  # (tiles + 1,): about the work of the tiles before, in rows that a splat is added to


@kernel()
def count_intersections(height: int, bins: Bins) -> None:
    """Fill `splat_offsets`, `tile_offsets` and `work`."""
    splat_offsets, tile_offsets, work = bins.splat_offsets, bins.tile_offsets, bins.work
    tile_offsets[:] = 0
    splat_offsets[0] = 0
    work[0] = 0
    work[1:] = ROWS_FOR_ROW * height  # what a tile costs without a splat
    for n in range(bins.tile_ranges.shape[0]):
        first, end = bins.tile_ranges[n]
        splat_offsets[n + 1] = splat_offsets[n] + end - first
        for t in range(first, end):
            tile_offsets[t + 1] += 1
            work[t + 1] += bins.projected[n, ROW_COUNT] + ROWS_FOR_INTERSECTION
    # From counts to the sums before each tile.
    for t in range(tile_offsets.size - 1):
        tile_offsets[t + 1] += tile_offsets[t]
        work[t + 1] += work[t]


@kernel()
def list_intersections(bins: Bins) -> None:
    """Fill `intersections` for the tiles of the window: a counting sort by tile."""
    cursors = bins.cursors
    for t in range(cursors.size):
        cursors[t] = bins.tile_offsets[t] - bins.tile_offsets[bins.window[0]]
    # Splats in index order, so that every tile lists, and sums, them in that order.
    for n in range(bins.tile_ranges.shape[0]):
        first = bins.tile_ranges[n, 0]
        for t in range(max(first, bins.window[0]), min(bins.tile_ranges[n, 1], bins.window[1])):
            bins.intersections[cursors[t], 0] = n
            bins.intersections[cursors[t], 1] = bins.splat_offsets[n] + t - first
            cursors[t] += 1


@kernel(inline=True)
def intersections_of(t: int, bins: Bins) -> int:
    """The number of intersections of tile t."""
    count: int = bins.tile_offsets[t + 1] - bins.tile_offsets[t]
    return count


def windows_of(tile_offsets: I8, most: int) -> list[tuple[int, int]]:
    """Windows (first tile, the one after the last) of one tile or at most `most` intersections."""
    windows = []
    first = end = 0
    while end < len(tile_offsets) - 1:
        end = max(first + 1, int(np.searchsorted(tile_offsets, tile_offsets[first] + most, side="right")) - 1)
        windows.append((first, end))
        first = end
    return windows


class Binning:
    """The splats of a frame, binned to its tiles: made once for a size, then filled with set after set of splats."""

    def __init__(self, width: int, height: int, threads: int) -> None:
        self.width, self.height, self.threads = width, height, threads
        count = tile_count(width)
        self.bins = Bins(
            projected=aligned((0, PROJECTED)),
            tile_ranges=np.zeros((0, 2), np.int32),
            splat_offsets=np.zeros(1, np.int64),
            tile_offsets=np.zeros(count + 1, np.int64),
            window=np.array([0, count]),
            intersections=np.zeros((0, 2), np.int32),
            cursors=np.zeros(count, np.int64),
            work=np.zeros(count + 1),
        )
        self._resize(0)
        self._bin()

    def __len__(self) -> int:
        """The number of splats."""
        return len(self.splats.parameters)

    @property
    def intersection_count(self) -> int:
        """The number of intersections of all tiles."""
        return int(self.bins.splat_offsets[-1])

    def load(self, parameters: F4) -> None:
        """Copy the parameters (N, 8) f4, in the columns of `Splats.to_array`, and bin these splats."""
        if len(parameters) != len(self):
            self._resize(len(parameters))
        np.copyto(self.splats.parameters, parameters)
        self._bin()

    def load_splats(self, splats: Splats) -> None:
        """`load` without a copy of all parameters in between."""
        if len(splats) != len(self):
            self._resize(len(splats))
        first = 0
        for part in (splats.positions, splats.cholesky, splats.colors):
            self.splats.parameters[:, first : first + part.shape[1]] = part
            first += part.shape[1]
        self._bin()

    def exchange(self, other: ProjectedSplats | None) -> ProjectedSplats:
        """Hand out the splats loaded last, and use the memory of `other` for the next ones if its size fits."""
        mine = self.splats
        if len(mine.parameters) > SPLATS_KEPT:
            self._resize(0)
            self.bins = self.bins._replace(intersections=np.zeros((0, 2), np.int32))
        elif other is None or len(other.parameters) != len(mine.parameters):
            self._resize(len(mine.parameters))
        else:
            self._use(other)
        return mine

    def windows(self) -> Iterator[Bins]:
        """The bins with the intersections, and the work, of one window after the other."""
        if len(self._windows) == 1:
            yield self.bins
            return
        for first, end in self._windows:
            self.bins.window[:] = first, end
            list_intersections(self.bins)
            work = self.bins.work
            yield self.bins._replace(work=np.clip(work, work[first], work[end]) - work[first])

    def over_splats(self, task: Callable[..., None], *arguments: Any) -> None:
        """Run a loop over all splats, as one task or, where it is worth it, as several."""
        count, tasks = len(self), max(1, min(self.threads, len(self) // SPLATS_PER_THREAD))

        def part(number: int) -> None:
            task(count * number // tasks, count * (number + 1) // tasks, *arguments)

        run_tasks(part, tasks)

    def _resize(self, count: int) -> None:
        """Make room for exactly this number of splats: most calls come with the number of the call before."""
        parameters = np.zeros((count, PARAMETERS_PER_SPLAT), np.float32)
        self._use(ProjectedSplats(parameters, aligned((count, PROJECTED)), np.zeros((count, 2), np.int32)))
        self.bins = self.bins._replace(splat_offsets=np.zeros(count + 1, np.int64))

    def _use(self, splats: ProjectedSplats) -> None:
        self.splats = splats
        self.bins = self.bins._replace(projected=splats.projected, tile_ranges=splats.tile_ranges)

    def _bin(self) -> None:
        self.over_splats(project_task, self.splats, self.width, self.height)
        count_intersections(self.height, self.bins)
        # No tile has more intersections than there are splats, so that every tile fits, and a pass over the splats for
        # each of at most 2 total / most + 1 windows takes no longer than the intersections themselves do.
        most = max(LISTED, len(self))
        self._windows = windows_of(self.bins.tile_offsets, most)
        total = min(self.intersection_count, most)
        if total > len(self.bins.intersections):
            room = np.zeros((min(total + total // 4, most), 2), np.int32)
            self.bins = self.bins._replace(intersections=room)
        if len(self._windows) == 1:
            self.bins.window[:] = self._windows[0]
            list_intersections(self.bins)
