"""Pictures and gradients of a set of splats: the functions that the rest of the package calls."""

from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_base.arrays import frame_type
from gsvc_base.checks import door
from gsvc_base.errors import UsageError
from gsvc_base.rendering import definition
from gsvc_base.splats import Splats
from gsvc_ref.rendering.fast.jobs import FRAME, GRADIENTS, PICTURE, Job
from gsvc_ref.rendering.fast.rasterizer import Rasterizer
from gsvc_ref.rendering.fast.regions import Regions
from gsvc_ref.rendering.fast.tiles import tile_count
from gsvc_ref.rendering.pictures import to_frame
from gsvc_ref.rendering.precision import Precision, check_precision

MAX_SIDE: Final = 65536
"""Pixels along a side that the renderer accepts; centres of pixels are then exact in binary32."""


class Renderer:
    """Renders set after set of splats at one size, and keeps its buffers between the calls.

    The results have the same bits for any number of threads and rows. One renderer serves one thread at a time.
    """

    def __init__(
        self,
        width: int,
        height: int,
        *,
        precision: Precision = "fast",
        threads: int | None = None,
        region_rows: int | None = None,  # rows that are rendered at a time; None: all
    ) -> None:
        _check_size(width, height)
        check_precision(precision)
        if region_rows is not None and region_rows < 1:
            raise UsageError(f"region_rows is {region_rows}; it must be at least 1, or None for all rows")
        self.precision: Precision = precision
        self._shape = (height, width, 3)
        self._rasterizer = Rasterizer(width, height, threads)
        self._job = Job(width, height, strict=precision == "deterministic")
        self._all = Regions.all_of(tile_count(width), height, min(region_rows or height, height))

    def picture(self, splats: Splats, *, clamp: bool = True) -> NDArray[np.float32]:
        """The picture that `render` returns, or `render_sum` without the clamp: (H, W, 3) f4, for ``exact``, too."""
        height, width, _ = self._shape
        if self.precision == "exact":
            C = definition.exact_sum(splats, width, height)
            return (np.clip(C, 0, 1) if clamp else C).astype(np.float32)
        self._rasterizer.binning.load_splats(splats)
        picture = np.empty(self._shape, np.float32)  # (H, W, 3) f4
        job = self._job._replace(kind=PICTURE, picture=picture.reshape(height, -1), clamp=clamp)
        self._rasterizer.run(job, self._all)
        return picture

    def frame(self, splats: Splats, bit_depth: int) -> NDArray[Any]:
        """The frame that `render_frame` returns: (H, W, 3) u1 for 8 bits, else u2."""
        if self.precision == "exact":
            return to_frame(self.picture(splats), bit_depth)
        frame = np.empty(self._shape, frame_type(bit_depth))  # (H, W, 3) u1 or u2
        self._rasterizer.binning.load_splats(splats)
        self._draw(self._all, frame, bit_depth)
        return frame

    def gradients(self, splats: Splats, residual: ArrayLike) -> NDArray[np.float32]:
        """The gradients that `render_gradients` returns: (N, 8) f4, for ``exact``, too."""
        height = self._shape[0]
        e = np.require(residual, np.float32, ["C", "W"])  # (H, W, 3) f4; writeable, since a job may write pictures
        if e.shape != self._shape:
            raise UsageError(f"the residual has shape {e.shape}; it must be {self._shape}")
        if self.precision == "exact":
            return definition.exact_gradients(splats, e).astype(np.float32)
        self._rasterizer.binning.load_splats(splats)
        moments = self._rasterizer.moments
        job = self._job._replace(kind=GRADIENTS, picture=e.reshape(height, -1), moments=moments)
        self._rasterizer.run(job, self._all)
        gradients = self._rasterizer.gradients(1.0)
        # A residual that is not finite shows in the gradients; looking at every pixel each time would cost more.
        if not np.isfinite(gradients).all():
            definition.check_residual(e)
        return gradients

    def _draw(self, regions: Regions, frame: NDArray[Any], bit_depth: int) -> None:
        """Render the dirty regions of what is loaded into a frame."""
        peak = np.float32(2**bit_depth - 1)
        job = self._job._replace(kind=FRAME, frame=frame.reshape(self._shape[0], -1), peak=peak)
        self._rasterizer.run(job, regions)


@door
def render(
    splats: Splats | ArrayLike, width: int, height: int, *, precision: Precision = "fast", threads: int | None = None
) -> NDArray[np.float32]:
    """The picture of a set of splats: the sum of c' exp(-sigma) where they cover, clamped to [0, 1] (spec.md 9.1).

    Parameters
    ----------
    splats
        The splats, or their parameters (N, 8) f4; positions and Cholesky factors in pixels of this frame.
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
        The splats are none, or the size or an option is outside its limits.
    """
    return Renderer(width, height, precision=precision, threads=threads).picture(Splats.of(splats))


# twin of spec.render_sum
@door
def render_sum(
    parameters: Splats | ArrayLike,
    width: int,
    height: int,
    *,
    precision: Precision = "fast",
    threads: int | None = None,
) -> NDArray[np.float32] | NDArray[np.float64]:
    """The sum C of (9-2) or (9-6): `render` before the clamp.

    Parameters
    ----------
    parameters
        The splats, or their parameters (N, 8) f4; positions and Cholesky factors in pixels of this frame.
    width, height, precision, threads
        As for `render`.

    Returns
    -------
    (H, W, 3) with 1.0 = full scale, f8 for ``exact`` and f4 for the others.

    Raises
    ------
    UsageError
        As for `render`.
    """
    splats, renderer = Splats.of(parameters), Renderer(width, height, precision=precision, threads=threads)
    if precision == "exact":
        return definition.exact_sum(splats, width, height)
    return renderer.picture(splats, clamp=False)


# twin of spec.render_sum_deterministic
@door
def render_sum_deterministic(
    parameters: Splats | ArrayLike, width: int, height: int, *, threads: int | None = None
) -> NDArray[np.float32]:
    """What `render_sum` returns for precision ``deterministic`` (R-9.3-1).

    Parameters
    ----------
    parameters, width, height, threads
        As for `render_sum`.

    Returns
    -------
    (H, W, 3) f4 with 1.0 = full scale, with the same bits on every machine.

    Raises
    ------
    UsageError
        As for `render`.
    """
    return Renderer(width, height, precision="deterministic", threads=threads).picture(
        Splats.of(parameters), clamp=False
    )


# twin of spec.render_frame
@door
def render_frame(
    parameters: Splats | ArrayLike,
    width: int,
    height: int,
    bit_depth: int,
    *,
    precision: Precision = "fast",
    threads: int | None = None,
) -> NDArray[Any]:
    """The same bits as ``to_frame(render(...), bit_depth)`` in one pass (R-9.1-1).

    Parameters
    ----------
    parameters, width, height, precision, threads
        As for `render_sum`.
    bit_depth
        8 to 16.

    Returns
    -------
    (H, W, 3) u1 for 8 bits, else u2.

    Raises
    ------
    UsageError
        As for `render`, or the bit depth is outside its limits.
    """
    return Renderer(width, height, precision=precision, threads=threads).frame(Splats.of(parameters), bit_depth)


# twin of spec.render_gradients
@door
def render_gradients(
    parameters: Splats | ArrayLike, residual: ArrayLike, *, precision: Precision = "fast", threads: int | None = None
) -> NDArray[np.float32] | NDArray[np.float64]:
    """The gradient of sum(residual * C) for every parameter, coverage held fixed (`definition.Footprint.gradient`).

    Parameters
    ----------
    parameters
        The splats, or their parameters (N, 8) f4.
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
    splats = Splats.of(parameters)
    if precision == "exact":
        return definition.exact_gradients(splats, residual)
    e = np.ascontiguousarray(residual, np.float32)  # (H, W, 3) f4
    definition.check_residual_shape(e.shape)
    return Renderer(e.shape[1], e.shape[0], precision=precision, threads=threads).gradients(splats, e)


def covered_pixels(
    splats: Splats, width: int, height: int, *, precision: Precision = "fast", threads: int | None = None
) -> NDArray[np.int64]:
    """The number of pixels of the frame that each splat covers, (N,) i8; ``exact`` alone does not decide by (9-4)."""
    check_precision(precision)
    _check_size(width, height)
    if precision == "exact":
        return definition.exact_covered_pixels(splats, width, height)
    rasterizer = Rasterizer(width, height, threads)
    rasterizer.binning.load_splats(splats)
    return rasterizer.covered_pixels()


def _check_size(width: int, height: int) -> None:
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
        raise UsageError(f"the frame is {width}x{height} pixels; each side must be 1 to {MAX_SIDE}")
