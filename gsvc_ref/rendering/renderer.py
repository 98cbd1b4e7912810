"""Pictures and gradients of a set of splats: the functions that the rest of the package calls."""

from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_ref.errors import UsageError
from gsvc_ref.rendering import definition
from gsvc_ref.rendering.fast.strips import BLACK, I8, strip_count
from gsvc_ref.rendering.fast.tasks import (
    count_task,
    count_tasks,
    frame_task,
    frame_tasks,
    grad_picture_task,
    grad_picture_tasks,
    picture_task,
    picture_tasks,
    splat_task,
    splat_tasks,
)
from gsvc_ref.rendering.fast.tiles import Prepared, Tiles, leave_out_fresh, mark_changed
from gsvc_ref.rendering.fast.workspace import Workspace
from gsvc_ref.rendering.pictures import frame_type, to_frame
from gsvc_ref.rendering.precision import Precision, check_precision
from gsvc_ref.splats import PARAMETERS_PER_SPLAT, Splats

LARGEST_SIDE: Final = 65536
"""Pixels along a side that the renderer accepts; centres of pixels are then exact in binary32."""

TILE_ROWS: Final = 64
"""Rows of a tile where only a part of a picture is rendered."""

LARGEST_SHARE: Final = 0.7
"""Share of stale tiles above which a whole picture is rendered: tiles cost more for each pixel than whole strips do."""


class Renderer:
    """Renders set after set of splats at one size, and keeps its buffers between the calls.

    One renderer serves one thread at a time.

    Parameters
    ----------
    width, height
        Size of the frame in pixels.
    precision
        As for `render`.
    threads
        Threads to use, None for one per CPU. The results have the same bits for any number.
    tile_rows
        Rows of a tile, None for whole strips. The results have the same bits for any number.

    Raises
    ------
    UsageError
        The size or an option is outside its limits.
    """

    def __init__(
        self,
        width: int,
        height: int,
        *,
        precision: Precision = "fast",
        threads: int | None = None,
        tile_rows: int | None = None,
    ) -> None:
        _check_size(width, height)
        check_precision(precision)
        if tile_rows is not None and tile_rows < 1:
            raise UsageError(f"tile_rows is {tile_rows}; it must be at least 1, or None for whole strips")
        self.precision: Precision = precision
        self._shape = (height, width, 3)
        self._work = Workspace(width, height, threads, strict=precision == "deterministic")
        self._all = Tiles.all_of(strip_count(width), height, min(tile_rows or height, height))

    def picture(self, splats: Splats, *, clamp: bool = True) -> NDArray[np.float32]:
        """What `render` returns, or `render_sum` without the clamp (but f4 for ``exact`` as well): (H, W, 3) f4."""
        height, width, _ = self._shape
        if self.precision == "exact":
            C = definition.exact_sum(splats, width, height)
            return (np.clip(C, 0, 1) if clamp else C).astype(np.float32)
        self._work.load_splats(splats)
        picture = np.empty(self._shape, np.float32)  # (H, W, 3) f4
        self._work.over_strips(picture_task, picture_tasks, self._all, BLACK, picture.reshape(height, -1), clamp)
        return picture

    def frame(self, splats: Splats, bit_depth: int) -> NDArray[Any]:
        """What `render_frame` returns: (H, W, 3) u1 for 8 bits, else u2."""
        if self.precision == "exact":
            return to_frame(self.picture(splats), bit_depth)
        frame = np.empty(self._shape, frame_type(bit_depth))  # (H, W, 3) u1 or u2
        self._work.load_splats(splats)
        self._draw(self._all, frame, bit_depth)
        return frame

    def gradients(self, splats: Splats, residual: ArrayLike) -> NDArray[np.float32]:
        """What `render_gradients` returns (but f4 for ``exact`` as well): (N, 8) f4."""
        height = self._shape[0]
        e = np.ascontiguousarray(residual, np.float32)  # (H, W, 3) f4
        if e.shape != self._shape:
            raise UsageError(f"the residual has shape {e.shape}; it must be {self._shape}")
        if self.precision == "exact":
            return definition.exact_gradients(splats, e).astype(np.float32)
        work = self._work
        work.load_splats(splats)
        gradients = np.empty((len(splats), PARAMETERS_PER_SPLAT), np.float32)  # (N, 8) f4
        work.over_strips(grad_picture_task, grad_picture_tasks, work.slots, e.reshape(height, -1))
        work.over_splats(splat_task, splat_tasks, work.slots, work.parameters, 1.0, gradients)
        # A residual that is not finite shows in the gradients; looking at every pixel each time would cost more.
        if not np.isfinite(gradients).all():
            definition.check_residual(e)
        return gradients

    def _draw(self, tiles: Tiles, frame: NDArray[Any], bit_depth: int) -> None:
        """Render tiles of what is loaded into a frame."""
        peak = np.float32(2**bit_depth - 1)
        self._work.over_strips(frame_task, frame_tasks, tiles, frame.reshape(self._shape[0], -1), peak)


class SequenceRenderer(Renderer):
    """Renders the frames of a sequence, of each only the tiles in which something changed if that is cheaper.

    The frames are those of `Renderer.frame`, to the bit: a tile that is touched by the same splats in the same order
    has the same sums.

    Parameters
    ----------
    width, height, precision, threads
        As for `Renderer`.

    Attributes
    ----------
    share
        The share of the frame's tiles that the last call rendered, 0 to 1.
    """

    def __init__(self, width: int, height: int, *, precision: Precision = "fast", threads: int | None = None) -> None:
        super().__init__(width, height, precision=precision, threads=threads)
        self.share = 0.0
        self._before: Prepared | None = None
        self._frame: NDArray[Any] = np.zeros(self._shape, np.uint8)  # (H, W, 3) u1 or u2, the last one
        self._bit_depth = 8  # of the last one

    def next_frame(self, splats: Splats, bit_depth: int, origins: ArrayLike | None = None) -> NDArray[Any]:
        """The frame of the next set of splats.

        Parameters
        ----------
        splats
            Positions and Cholesky factors in pixels of this frame.
        bit_depth
            8 to 16.
        origins
            (N,) integers: for each splat the index of the one before that it continues, or -1
            (`FrameCodes.origins`); None renders everything.

        Returns
        -------
        (H, W, 3) u1 for 8 bits, else u2; the next call may change it.
        """
        other = bit_depth != self._bit_depth
        if self.precision == "exact" or other or self._before is None or origins is None:
            self._frame, self.share, self._bit_depth = self.frame(splats, bit_depth), 1.0, bit_depth
            if self.precision == "exact":
                return self._frame
        else:
            self._work.load_splats(splats)
            tiles = self._stale(self._before, np.asarray(origins, np.int64))
            if tiles.stale.any():
                leave_out_fresh(self._work.lists.work, tiles)
                self._draw(tiles, self._frame, bit_depth)
            self.share = float(tiles.stale.mean())
        self._before = self._work.exchange(self._before)
        return self._frame

    def _stale(self, before: Prepared, origins: I8) -> Tiles:
        """The tiles to render of what is loaded."""
        height, width, _ = self._shape
        if origins.shape != (len(self._work.parameters),):
            raise UsageError(f"origins has shape {origins.shape}; it must have one number for each splat")
        rows = min(TILE_ROWS, height)
        tiles = Tiles(rows, np.zeros((strip_count(width), -(-height // rows)), np.bool_))
        after = Prepared(self._work.parameters, self._work.lists.records, self._work.lists.strips)
        if not mark_changed(before, after, origins, tiles) or tiles.stale.mean() > LARGEST_SHARE:
            return self._all
        return tiles


def render(
    splats: Splats, width: int, height: int, *, precision: Precision = "fast", threads: int | None = None
) -> NDArray[np.float32]:
    """The picture of a set of splats: the sum of c' exp(-sigma) where they cover, clamped to [0, 1] (spec.md 9.1).

    Parameters
    ----------
    splats
        Positions and Cholesky factors in pixels of this frame.
    width, height
        Size of the frame in pixels.
    precision
        ``fast`` is binary32 within the error bound of `render_exact_with_bound`; ``deterministic`` too, with the same
        bits on every machine (spec.md section 9.3); ``exact`` is the definition evaluated in binary64, then rounded.
    threads
        Threads, None for one per CPU. The picture has the same bits for any number; ``exact`` uses one.

    Returns
    -------
    (H, W, 3) f4, R'G'B' with 1.0 = full scale; black without splats.

    Raises
    ------
    UsageError
        The size or an option is outside its limits.
    """
    return Renderer(width, height, precision=precision, threads=threads).picture(splats)


def render_sum(
    splats: Splats, width: int, height: int, *, precision: Precision = "fast", threads: int | None = None
) -> NDArray[np.float32] | NDArray[np.float64]:
    """The same as `render` before the clamp: (H, W, 3), f8 for ``exact`` and f4 for the others."""
    renderer = Renderer(width, height, precision=precision, threads=threads)
    if precision == "exact":
        return definition.exact_sum(splats, width, height)
    return renderer.picture(splats, clamp=False)


def render_frame(
    splats: Splats,
    width: int,
    height: int,
    bit_depth: int,
    *,
    precision: Precision = "fast",
    threads: int | None = None,
) -> NDArray[Any]:
    """The same bits as ``to_frame(render(...), bit_depth)`` in one pass: (H, W, 3) u1 for 8 bits, else u2."""
    return Renderer(width, height, precision=precision, threads=threads).frame(splats, bit_depth)


def render_gradients(
    splats: Splats, residual: ArrayLike, *, precision: Precision = "fast", threads: int | None = None
) -> NDArray[np.float32] | NDArray[np.float64]:
    """The gradient of sum(residual * C) for every parameter, coverage held fixed (`definition.Footprint.gradient`).

    Parameters
    ----------
    residual
        (H, W, 3), dL/dC; it also gives the size of the frame.
    precision, threads
        As for `render`.

    Returns
    -------
    (N, 8) in the columns of `Splats.to_array`, f8 for ``exact`` and f4 for the others; zero where a splat covers
    nothing. The order in which ``deterministic`` adds is that of `deterministic.gradients_plain`.

    Raises
    ------
    UsageError
        The residual has another shape or a value that is not finite, or an option is outside its limits.
    """
    check_precision(precision)
    if precision == "exact":
        return definition.exact_gradients(splats, residual)
    e = np.ascontiguousarray(residual, np.float32)  # (H, W, 3) f4
    definition.check_residual_shape(e.shape)
    return Renderer(e.shape[1], e.shape[0], precision=precision, threads=threads).gradients(splats, e)


def covered_pixels(
    splats: Splats, width: int, height: int, *, precision: Precision = "fast", threads: int | None = None
) -> NDArray[np.int64]:
    """How many pixels of the frame each splat covers, as (N,) i8; all but ``exact`` decide by (9-4), in binary32."""
    check_precision(precision)
    _check_size(width, height)
    if precision == "exact":
        return definition.exact_covered_pixels(splats, width, height)
    work = Workspace(width, height, threads)
    work.load_splats(splats)
    counts = np.zeros(len(splats), np.int64)  # (N,) i8
    work.over_splats(count_task, count_tasks, width, height, counts)
    return counts


def _check_size(width: int, height: int) -> None:
    if not (1 <= width <= LARGEST_SIDE and 1 <= height <= LARGEST_SIDE):
        raise UsageError(f"the frame is {width}x{height} pixels; each side must be 1 to {LARGEST_SIDE}")
