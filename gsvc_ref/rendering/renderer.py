"""Pictures and gradients of a set of splats: the functions that the rest of the package calls."""

from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_ref.errors import UsageError
from gsvc_ref.rendering import definition
from gsvc_ref.rendering.pictures import frame_type
from gsvc_ref.rendering.tasks import (
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
from gsvc_ref.rendering.workspace import Workspace
from gsvc_ref.splats import PARAMETERS_PER_SPLAT, Splats

Precision = Literal["fast", "exact"]

LARGEST_SIDE = 65536
"""Pixels along a side that the renderer accepts; centres of pixels are then exact in binary32."""


class Renderer:
    """Renders set after set of splats at one size, ``fast``, and keeps its buffers between the calls.

    One renderer serves one thread at a time.

    Parameters
    ----------
    width, height
        Size of the frame in pixels.
    threads
        Threads to use, None for one per CPU. The results have the same bits for any number.

    Raises
    ------
    UsageError
        The size or the number of threads is outside its limits.
    """

    def __init__(self, width: int, height: int, *, threads: int | None = None) -> None:
        _check_size(width, height)
        self._shape = (height, width, 3)
        self._work = Workspace(width, height, threads)

    def picture(self, splats: Splats, *, clamp: bool = True) -> NDArray[np.float32]:
        """What `render` returns, or `render_sum` without the clamp: (H, W, 3) f4."""
        self._work.load(splats.to_array())
        picture = np.empty(self._shape, np.float32)  # (H, W, 3) f4
        self._work.over_strips(picture_task, picture_tasks, picture.reshape(self._shape[0], -1), clamp)
        return picture

    def frame(self, splats: Splats, bit_depth: int) -> NDArray[Any]:
        """What `render_frame` returns: (H, W, 3) u1 for 8 bits, else u2."""
        frame = np.empty(self._shape, frame_type(bit_depth))  # (H, W, 3) u1 or u2
        self._work.load(splats.to_array())
        peak = np.float32(2**bit_depth - 1)
        self._work.over_strips(frame_task, frame_tasks, frame.reshape(self._shape[0], -1), peak)
        return frame


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
        ``fast`` is binary32 within the error bound of `render_exact_with_bound`; ``exact`` is the definition evaluated
        in binary64, then rounded.
    threads
        Threads for ``fast``, None for one per CPU. The picture has the same bits for any number.

    Returns
    -------
    (H, W, 3) f4, R'G'B' with 1.0 = full scale; black without splats.

    Raises
    ------
    UsageError
        The size or an option is outside its limits.
    """
    if _is_exact(precision):
        _check_size(width, height)
        return np.clip(definition.exact_sum(splats, width, height), 0, 1).astype(np.float32)
    return Renderer(width, height, threads=threads).picture(splats)


def render_sum(
    splats: Splats, width: int, height: int, *, precision: Precision = "fast", threads: int | None = None
) -> NDArray[np.float32] | NDArray[np.float64]:
    """The same as `render` before the clamp: (H, W, 3), f4 for ``fast`` and f8 for ``exact``."""
    if _is_exact(precision):
        _check_size(width, height)
        return definition.exact_sum(splats, width, height)
    return Renderer(width, height, threads=threads).picture(splats, clamp=False)


def render_frame(
    splats: Splats, width: int, height: int, bit_depth: int, *, threads: int | None = None
) -> NDArray[Any]:
    """The same bits as ``to_frame(render(...), bit_depth)`` in one pass: (H, W, 3) u1 for 8 bits, else u2."""
    return Renderer(width, height, threads=threads).frame(splats, bit_depth)


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
    (N, 8) in the columns of `Splats.to_array`, f4 for ``fast`` and f8 for ``exact``; zero where a splat covers nothing.

    Raises
    ------
    UsageError
        The residual has another shape or a value that is not finite, or an option is outside its limits.
    """
    if _is_exact(precision):
        return definition.exact_gradients(splats, residual)
    e = np.ascontiguousarray(residual, np.float32)  # (H, W, 3) f4
    definition.check_residual_shape(e.shape)
    height, width = e.shape[:2]
    work = _load(splats, width, height, threads)
    gradients = np.empty((len(splats), PARAMETERS_PER_SPLAT), np.float32)  # (N, 8) f4
    work.over_strips(grad_picture_task, grad_picture_tasks, work.slots, e.reshape(height, -1))
    work.over_splats(splat_task, splat_tasks, work.slots, work.parameters, 1.0, gradients)
    # A residual that is not finite shows in the gradients; looking at every pixel each time would cost more.
    if not np.isfinite(gradients).all():
        definition.check_residual(e)
    return gradients


def covered_pixels(
    splats: Splats, width: int, height: int, *, precision: Precision = "fast", threads: int | None = None
) -> NDArray[np.int64]:
    """How many pixels of the frame each splat covers, as (N,) i8; ``fast`` decides in binary32."""
    if _is_exact(precision):
        _check_size(width, height)
        return definition.exact_covered_pixels(splats, width, height)
    work = _load(splats, width, height, threads)
    counts = np.zeros(len(splats), np.int64)  # (N,) i8
    work.over_splats(count_task, count_tasks, width, height, counts)
    return counts


def _is_exact(precision: str) -> bool:
    if precision not in ("fast", "exact"):
        raise UsageError(f"the precision is {precision!r}; it must be 'fast' or 'exact'")
    return precision == "exact"


def _check_size(width: int, height: int) -> None:
    if not (1 <= width <= LARGEST_SIDE and 1 <= height <= LARGEST_SIDE):
        raise UsageError(f"the frame is {width}x{height} pixels; each side must be 1 to {LARGEST_SIDE}")


def _load(splats: Splats, width: int, height: int, threads: int | None) -> Workspace:
    _check_size(width, height)
    work = Workspace(width, height, threads)
    work.load(splats.to_array())
    return work
