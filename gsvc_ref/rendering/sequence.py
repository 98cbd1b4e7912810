"""Frames of a sequence, of which only what changed is rendered."""

from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_base.arrays import I8
from gsvc_base.errors import UsageError
from gsvc_base.splats import Splats
from gsvc_ref.rendering.fast.projection import ProjectedSplats
from gsvc_ref.rendering.fast.regions import Regions, leave_out_clean, mark_changed
from gsvc_ref.rendering.fast.tiles import tile_count
from gsvc_ref.rendering.precision import Precision
from gsvc_ref.rendering.renderer import Renderer

REGION_ROWS: Final = 64
"""Rows of a region where only a part of a picture is rendered."""

MAX_SHARE: Final = 0.7
"""Share of dirty regions above which a whole picture is rendered: regions cost more for each pixel than tiles do."""


class SequenceRenderer(Renderer):
    """Renders the frames of a sequence; of each only the regions in which something changed, if that is cheaper.

    The frames are those of `Renderer.frame`, to the bit: a region that is touched by the same splats in the same order
    has the same sums.
    """

    def __init__(self, width: int, height: int, *, precision: Precision = "fast", threads: int | None = None) -> None:
        super().__init__(width, height, precision=precision, threads=threads)
        self.share = 0.0  # of the regions that the last call rendered
        self._before: ProjectedSplats | None = None
        self._frame: NDArray[Any] = np.zeros(self._shape, np.uint8)  # (H, W, 3) u1 or u2, the last one
        self._bit_depth = 8  # of the last one

    def next_frame(self, splats: Splats, bit_depth: int, origins: ArrayLike | None = None) -> NDArray[Any]:
        """The frame of the next set of splats, (H, W, 3) u1 for 8 bits, else u2; the next call may change it.

        `origins` (N,) are integers: for each splat the index of the one before that it continues, or -1
        (`FrameCodes.origins`); None renders everything.
        """
        other = bit_depth != self._bit_depth
        if self.precision == "exact" or other or self._before is None or origins is None:
            self._frame, self.share, self._bit_depth = self.frame(splats, bit_depth), 1.0, bit_depth
            if self.precision == "exact":
                return self._frame
        else:
            self._rasterizer.binning.load_splats(splats)
            regions = self._dirty(self._before, np.asarray(origins, np.int64))
            if regions.dirty.any():
                leave_out_clean(self._rasterizer.binning.bins.work, regions)
                self._draw(regions, self._frame, bit_depth)
            self.share = float(regions.dirty.mean())
        self._before = self._rasterizer.binning.exchange(self._before)
        return self._frame

    def _dirty(self, before: ProjectedSplats, origins: I8) -> Regions:
        """The regions to render of what is loaded."""
        height, width, _ = self._shape
        after = self._rasterizer.binning.splats
        if origins.shape != (len(after.parameters),):
            raise UsageError(f"origins has shape {origins.shape}; it must have one number for each splat")
        regions = Regions.none_of(tile_count(width), height, min(REGION_ROWS, height))
        if not mark_changed(before, after, origins, regions) or regions.dirty.mean() > MAX_SHARE:
            return self._all
        return regions
